"""Regular expressions of the user, without those whose search may never end."""

import re
from re import _constants as kinds, _parser as parser  # type: ignore[attr-defined]
from typing import Any

# A text of a hundred letters can be cut in n pieces in some 100ⁿ/n! ways.
_MOST_REPEATS = 6
_REPEATS = (kinds.MAX_REPEAT, kinds.MIN_REPEAT)


def expression(text: str, option: str) -> re.Pattern[str]:
    """A regular expression, compiled.

    **Raises:** `ValueError` where it is none, or where the time of a search may grow without
    bound: what repeats must itself match in one way only.
    """
    try:
        tree, compiled = parser.parse(text), re.compile(text)
    except (re.error, OverflowError, RecursionError) as error:
        raise ValueError(f"{option} {text}: this is no regular expression: {error}.") from error
    if _nested(tree):
        raise ValueError(
            f"{option} {text}: what repeats contains a repeat or alternatives, for which a search "
            "may take for ever. Make the inner one possessive (a++), put it in an atomic group "
            "(?>...), or write it without."
        )
    if (count := _repeats(tree)) > _MOST_REPEATS:
        raise ValueError(
            f"{option} {text}: {count} repeats one after another may take for ever; use "
            f"{_MOST_REPEATS} at most."
        )
    return compiled


def _parts(argument: Any) -> list[Any]:
    """The patterns inside a node's argument."""
    if isinstance(argument, parser.SubPattern):
        return [argument]
    if isinstance(argument, tuple | list):
        return [part for item in argument for part in _parts(item)]
    return []


def _varies(tree: Any) -> bool:
    """Whether a pattern can match one text in several ways; what is atomic cannot."""
    for operation, argument in tree:
        if operation in (kinds.ATOMIC_GROUP, kinds.POSSESSIVE_REPEAT):
            continue
        if operation is kinds.BRANCH or (operation in _REPEATS and argument[0] != argument[1]):
            return True
        if any(map(_varies, _parts(argument))):
            return True
    return False


def _nested(tree: Any) -> bool:
    """Whether some repeat contains what varies: "(a+)+" goes 2ⁿ ways through n letters."""
    for operation, argument in tree:
        repeats = operation in (*_REPEATS, kinds.POSSESSIVE_REPEAT) and argument[1] > 1
        if repeats and any(map(_varies, _parts(argument))):
            return True
        if any(map(_nested, _parts(argument))):
            return True
    return False


def _repeats(tree: Any) -> int:
    """How many repeats a pattern has in all."""
    count = 0
    for operation, argument in tree:
        count += operation in _REPEATS and argument[0] != argument[1]
        count += sum(map(_repeats, _parts(argument)))
    return count
