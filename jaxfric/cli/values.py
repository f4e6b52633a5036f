"""Types of the command's option values: each reads a text, or says what is wrong with it."""

import math
import re
from argparse import ArgumentTypeError
from pathlib import Path

from ..data.targets import replaced

# Gains of each controller that `simulate` knows; `limit` bounds the force of any of them.
CONTROLLERS = {"pd": ("kp", "kd"), "pid": ("kp", "ki", "kd"), "cascade": ("kp", "kv")}
TABLES = (".csv", ".npz", ".parquet")
# A pair up to the next comma, which a value in quotation marks may hold.
_ITEM = r'(?:[^,="]*="[^"]*"\s*(?=,|$)|[^,])+'
PICTURES = ("png", "pdf", "svg")


def names(text: str) -> dict[str, str]:
    """`a=b,c=d` as a mapping; a value with a comma stands in quotation marks, `a="b, c"`."""
    pairs = {}
    for item in filter(None, (part.strip() for part in re.findall(_ITEM, text))):
        key, equals, value = item.partition("=")
        if not equals or not key.strip():
            raise ArgumentTypeError(
                f"{item!r} is not of the form NAME=VALUE; a value with a comma stands in quotation "
                'marks, NAME="VALUE"'
            )
        value = value.strip()
        quoted = len(value) > 1 and value[0] == value[-1] == '"'
        pairs[key.strip()] = value[1:-1] if quoted else value
    return pairs


def number(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ArgumentTypeError(f"{text!r} is not a number")
    return value


def factors(text: str) -> dict[str, float]:
    """`a=1.5,b=2` as a mapping to numbers."""
    return {name: number(value) for name, value in names(text).items()}


def bounds(text: str) -> dict[str, tuple[float, float]]:
    """`a=low:high,…` as a mapping to pairs of numbers."""
    return {
        name: _ordered(limits, f"{name}={limits} is not of the form NAME=LOW:HIGH")
        for name, limits in names(text).items()
    }


def span(text: str) -> tuple[float, float]:
    """`low:high` as a pair of numbers, the second the larger."""
    return _ordered(text, f"{text!r} is not of the form LOW:HIGH")


def _ordered(text: str, fault: str) -> tuple[float, float]:
    low, colon, high = text.partition(":")
    limits = (number(low), number(high)) if colon else (1.0, 0.0)
    if not limits[0] < limits[1]:
        raise ArgumentTypeError(fault)
    return limits


def controller(text: str) -> tuple[str, dict[str, float]]:
    """`kind:gain=value,…` as the kind and its gains, all of them given."""
    kind, _, rest = text.partition(":")
    if kind not in CONTROLLERS:
        raise ArgumentTypeError(f"there is no {kind!r}; there are {', '.join(CONTROLLERS)}")
    gains = factors(rest)
    wanted = CONTROLLERS[kind]
    if missing := [gain for gain in wanted if gain not in gains]:
        example = ",".join(f"{gain}=…" for gain in wanted)
        raise ArgumentTypeError(f"{kind} lacks {', '.join(missing)}: {kind}:{example}")
    if unknown := sorted(set(gains) - {*wanted, "limit"}):
        raise ArgumentTypeError(f"{kind} has no {', '.join(unknown)}; it has {', '.join(wanted)}")
    return kind, gains


def output(text: str) -> str:
    """A path to write to, its folder there: said before the work instead of after it."""
    if not text:
        raise ArgumentTypeError("the name of the file is empty")
    if text == "-":
        return text
    try:
        target = replaced(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error).rstrip(".")) from None
    if target is not None and not target.parent.is_dir():
        raise ArgumentTypeError(f"{text}: there is no folder {Path(text).parent}; make it first")
    return text


def table(text: str) -> str:
    """A path to write a table to, of a kind that can be written."""
    if output(text) == "-" or replaced(text) is None or Path(text).suffix.lower() in TABLES:
        return text
    kinds = ", ".join(TABLES)
    raise ArgumentTypeError(f"{text}: tables are written as {kinds}; use that suffix")


def picture(text: str) -> str:
    """A path to draw to, of a kind that can be drawn."""
    if Path(text).suffix.lstrip(".").lower() not in PICTURES:
        kinds = ", ".join(f".{kind}" for kind in PICTURES)
        raise ArgumentTypeError(f"{text}: pictures are written as {kinds}; use that suffix")
    return output(text)


def count(text: str) -> int:
    """A whole number from one."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise ArgumentTypeError(f"{text!r} is not a whole number from 1")
    return value


def seconds(text: str) -> float:
    """A time span over zero, s."""
    return _over_zero(text, "a number of seconds over zero")


def positive(text: str) -> float:
    """A number over zero."""
    return _over_zero(text, "a number over zero")


def _over_zero(text: str, wanted: str) -> float:
    value = number(text)
    if value <= 0:
        raise ArgumentTypeError(f"{text!r} is not {wanted}")
    return value


def rate(text: str) -> float:
    """Samples per second, over zero."""
    return _over_zero(text, "a number of samples per second over zero")


def process(text: str) -> tuple[int, int, str]:
    """`i/n@host:port` as the number of a process, how many there are, and the address of the
    first.
    """
    place, _, address = text.partition("@")
    index, _, total = place.partition("/")
    host, _, port = address.rpartition(":")
    numbers = all(part.isdecimal() for part in (index, total, port))
    if not (numbers and host and int(index) < int(total)):
        raise ArgumentTypeError(f"{text!r} is not of the form I/N@HOST:PORT with I from 0 to N-1")
    return int(index), int(total), address


def sizes(text: str) -> tuple[float, float]:
    """`low:high`, or one number for both; shares from over 0 to 1."""
    low, _, high = text.partition(":")
    limits = number(low), number(high or low)
    if not 0 < limits[0] <= limits[1] <= 1:
        raise ArgumentTypeError(f"{text!r} is not LOW:HIGH with 0 < LOW ≤ HIGH ≤ 1")
    return limits
