"""Text from outside (names of files, columns and units) made fit for a terminal or a message."""

import json
import os
import unicodedata
from collections.abc import Iterable, Sequence

# Control, format (which may turn the direction of writing), half of a pair, separators of lines.
_UNSEEN = ("Cc", "Cf", "Cs", "Zl", "Zp")
# What a message shows of a list and of an entry; the rest no one would read.
MOST, LONGEST = 40, 80


def printable(text: str, keep: str = "") -> str:
    """The text with each character that would steer a terminal spelled out, but for those to keep.

    A byte of a file's name that is no UTF-8 is spelled as that byte.
    """
    if text.isprintable():
        return text
    return "".join(c if c in keep or not _unseen(c) else _spelled(c) for c in text)


def encodable(text: str | bytes) -> str:
    """A path or another text with what UTF-8 cannot hold spelled out."""
    text = os.fsdecode(text)
    if text.isprintable():
        return text
    return "".join(_spelled(c) if unicodedata.category(c) == "Cs" else c for c in text)


def json_text(text: str) -> str:
    """A JSON text in which such characters are escaped; it says the same."""
    if text.isprintable():
        return text
    return "".join(c if c == "\n" or not _unseen(c) else json.dumps(c)[1:-1] for c in text)


def listed(names: Iterable[str], most: int = MOST) -> str:
    """Names, the first of many, each no longer than a message can bear; or `none`."""
    names = list(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return (", ".join(map(short, names[:most])) or "none") + more


def listed_and(names: Sequence[str]) -> str:
    """Names in a row: "a, b and c"."""
    return " and ".join([*([", ".join(names[:-1])] if len(names) > 1 else []), *names[-1:]])


def short(text: str) -> str:
    """The text, or the beginning of a long one."""
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"


def _unseen(character: str) -> bool:
    return unicodedata.category(character) in _UNSEEN


def _spelled(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:  # Python's sign for a byte that is no UTF-8
        return f"\\x{code - 0xDC00:02x}"
    return character.encode("unicode_escape").decode("ascii")
