"""Which recordings there are, which axis each is of, and in which order an axis made them."""

import datetime
import glob
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

# Keys of a partitioned dataset (`machine=7/axis=x/date=2024-03-01/log.parquet`) that say when
# instead of what.
TIMES = ("date", "day", "month", "year", "hour", "time", "timestamp", "week", "run", "session")
SUFFIXES = (".csv", ".parquet", ".mat", ".npz")
_KEY = re.compile(r"^([A-Za-z_]\w*)=(.+)$")
_DATE = re.compile(
    r"(?<!\d)((?:19|20)\d\d)([-_]?)(0[1-9]|1[0-2])\2(0[1-9]|[12]\d|3[01])(?!\d)"
    r"(?:[T _-]([01]\d|2[0-3])[-_:hH]?([0-5]\d)(?:[-_:mM]?([0-5]\d))?(?!\d))?"
)


class File(NamedTuple):
    """One file of a fleet: its path as found, its keys, its axis, and what tells that it changed.

    `keys` are those of its folders, `key=value`; `axis` is empty where it is not known.
    """

    path: str
    keys: dict[str, str]
    axis: str
    group: str
    size: int
    changed: int

    @property
    def date(self) -> float | None:
        """When it was recorded by its path (`2024-03-01`, `20240301-1530`), in days, or `None`."""
        for part in reversed(Path(self.path).parts):
            if found := _DATE.search(part):
                year, _, month, day, hour, minute, second = found.groups("0")
                numbers = (int(n) for n in (year, month, day, hour, minute, second))
                try:
                    moment = datetime.datetime(*numbers, tzinfo=datetime.UTC)
                except ValueError:  # the 31st of a shorter month: no date after all
                    continue
                return moment.timestamp() / 86400
        return None


def find(
    patterns: Sequence[str], axis: str | None = None, group: str | None = None
) -> tuple[File, ...]:
    """The files that patterns match (`logs/**/*.parquet`), in the order of their names.

    **Arguments:** `patterns`, globs, files, or folders (all recordings in them); `axis` and
    `group`, how to tell the axis and the group that it is compared with from a path: a key of
    its folders or a regular expression, whose groups are taken if it has any. By default an axis
    is all keys but those of time, and the whole fleet one group.

    **Raises:** `ValueError` if a pattern matches no file, or `axis` or `group` none of the files.
    """
    paths: dict[str, None] = {}
    for pattern in patterns:
        paths |= dict.fromkeys(_matching(pattern))
    ordered = sorted(paths, key=_natural)
    keys = [_keys(path) for path in ordered]
    axes = [_axis(k) for k in keys] if axis is None else _names(ordered, keys, axis, "--axis")
    groups = [""] * len(keys) if group is None else _names(ordered, keys, group, "--group")
    stamps = [os.stat(path) for path in ordered]
    sizes, changes = [s.st_size for s in stamps], [s.st_mtime_ns for s in stamps]
    return tuple(map(File, ordered, keys, axes, groups, sizes, changes))


def _matching(pattern: str) -> list[str]:
    if os.path.isfile(pattern):
        return [pattern]
    folder = os.path.isdir(pattern)
    found = glob.glob(os.path.join(pattern, "**", "*") if folder else pattern, recursive=True)
    found = [path for path in found if os.path.isfile(path)]
    if folder:
        found = [path for path in found if path.lower().endswith(SUFFIXES)]
    if not found:
        hint = "" if folder else "; quote a pattern, so that ** reaches jaxfric and not the shell"
        raise ValueError(f"{pattern}: no file matches{hint}.")
    return found


def _natural(text: str) -> tuple:
    """A sorting key by which run2 comes before run10."""
    pieces = re.split(r"(\d+)", text)
    return tuple((0, int(p), p) if p.isdecimal() else (1, 0, p) for p in pieces)


def _keys(path: str) -> dict[str, str]:
    found = (_KEY.match(part) for part in Path(path).parent.parts)
    return {m[1]: unquote(m[2]) for m in found if m}


def _axis(keys: dict[str, str]) -> str:
    """All keys but those of time; of a single one its value alone."""
    named = {key: value for key, value in keys.items() if key not in TIMES}
    if len(named) == 1:
        return next(iter(named.values()))
    return "/".join(f"{key}={value}" for key, value in named.items())


def _names(paths, keys, how: str, option: str) -> list[str]:
    """What a key or a regular expression takes from each path; empty where it takes nothing."""
    if any(how in k for k in keys):
        return [k.get(how, "") for k in keys]
    try:
        pattern = re.compile(how)
    except re.error as error:
        raise ValueError(f"{option} {how}: this is no regular expression: {error}.") from error
    found = [pattern.search(path) for path in paths]
    names = ["" if m is None else "/".join(filter(None, m.groups())) or m[0] for m in found]
    if not any(names):
        there = sorted({key for k in keys for key in k})
        raise ValueError(
            f"{option} {how}: neither a key of the folders ({', '.join(there) or 'they have none'})"
            f" nor a regular expression that is found in a path such as {paths[0]}."
        )
    return names
