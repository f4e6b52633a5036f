"""What a path to write to stands for: a file that is replaced whole, or a stream."""

import os
import re
import stat
import sys
from pathlib import Path
from typing import BinaryIO

_STANDARD = {"/dev/stdout": 1, "/dev/stderr": 2}
_DESCRIPTOR = re.compile(r"/(?:dev|proc/self)/fd/(\d+)")


def replaced(path: str | os.PathLike) -> Path | None:
    """The file that writing replaces, behind all links; `None` for a stream.

    Streams are standard output by its names, pipes, and the null device: what is written goes
    through, and nothing is put in their place.

    **Raises:** `ValueError` for a folder, another device, or links that lead nowhere.
    """
    if _descriptor(path) is not None:
        return None
    real = Path(os.path.realpath(path))
    try:
        found = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        return real
    except OSError as error:  # a link to itself, a folder that may not be looked into
        raise ValueError(f"{path}: cannot be written: {error.strerror}.") from error
    if stat.S_ISREG(found.st_mode):
        return real
    if stat.S_ISDIR(found.st_mode):
        raise ValueError(f"{path}: is a folder; name a file.")
    if stat.S_ISFIFO(found.st_mode) or _null(found):
        return None
    raise ValueError(f"{path}: is a device; name a file, or - for standard output.")


def stream(path: str | os.PathLike) -> BinaryIO:
    """A stream opened for writing."""
    number = _descriptor(path)
    if number is None:
        return open(path, "wb")
    sys.stdout.flush()  # what was printed before comes first
    return os.fdopen(os.dup(number), "wb")


def standard(path: str | os.PathLike) -> bool:
    """Whether what is written goes to standard output."""
    return path == "-" or _descriptor(path) == 1


def same(first: str, second: str) -> bool:
    """Whether two paths lead to one file, by whatever names; two links, say."""
    if standard(first) or standard(second):
        return standard(first) and standard(second)
    if os.path.realpath(first) == os.path.realpath(second):
        return True
    return os.path.exists(first) and os.path.exists(second) and os.path.samefile(first, second)


def _descriptor(path: str | os.PathLike) -> int | None:
    """The number of an open file that a path is the name of."""
    text = os.fspath(path)
    found = _DESCRIPTOR.fullmatch(text)
    return int(found[1]) if found else _STANDARD.get(text)


def _null(found: os.stat_result) -> bool:
    return os.path.exists(os.devnull) and os.path.samestat(found, os.stat(os.devnull))
