"""Which recordings there are, which axis each is of, and in which order an axis made them."""

import datetime
import glob
import os
import re
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote

from .expressions import expression

# Keys of a partitioned dataset (`machine=7/axis=x/date=2024-03-01/log.parquet`) that say when
# instead of what.
TIMES = ("date", "day", "month", "year", "hour", "time", "timestamp", "week", "run", "session")
SUFFIXES = (".csv", ".parquet", ".mat", ".npz")
_STARS = re.compile(r"(?:^|(?<=[/\\]))\*\*(?:[/\\]|$)" if os.altsep else r"(?:^|(?<=/))\*\*(?:/|$)")
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
    paths: dict[str, str] = {}
    for pattern in patterns:
        for path in _matching(pattern):
            paths.setdefault(_place(path), path)
    ordered = sorted(paths.values(), key=_natural)
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
    found = _found(os.path.join(glob.escape(pattern), "**", "*") if folder else pattern)
    found = [path for path in found if os.path.isfile(path)]
    if folder:
        found = [path for path in found if path.lower().endswith(SUFFIXES)]
    if not found:
        hint = "" if folder else "; quote a pattern, so that ** reaches jaxfric and not the shell"
        raise ValueError(f"{pattern}: no file matches{hint}.")
    return found


def _place(path: str) -> str:
    """What is one for all names of a file through linked folders."""
    folder, name = os.path.split(path)
    return os.path.join(os.path.realpath(folder), name)


def _found(pattern: str) -> list[str]:
    """What a glob matches; its first `**` enters each folder once, wherever links lead."""
    parts = _STARS.split(pattern, maxsplit=1)
    if len(parts) == 1:
        return glob.glob(pattern)
    head, tail = parts
    starts = glob.glob(head) if head else [""]
    folders = (folder for start in starts for folder in _folders(start))
    return [path for f in folders for path in _found(os.path.join(glob.escape(f), tail or "*"))]


def _folders(start: str) -> Iterator[str]:
    """A folder and all in it, each once: first those that it holds, then those it has links to."""
    seen: set[str] = set()
    held, linked = deque([start]), deque[str]()
    while held or linked:
        folder = held.popleft() if held else linked.popleft()
        real = os.path.realpath(folder)
        if real in seen or not os.path.isdir(real):
            continue
        seen.add(real)
        yield folder
        try:
            entries = sorted(os.scandir(folder or os.curdir), key=lambda entry: entry.name)
        except OSError:  # not ours to look into
            continue
        for entry in entries:
            if not entry.name.startswith("."):
                path = os.path.join(folder, entry.name)
                (linked if entry.is_symlink() else held).append(path)


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
    pattern = expression(how, option)
    found = [pattern.search(path) for path in paths]
    names = ["" if m is None else "/".join(filter(None, m.groups())) or m[0] for m in found]
    if not any(names):
        there = sorted({key for k in keys for key in k})
        raise ValueError(
            f"{option} {how}: neither a key of the folders ({', '.join(there) or 'they have none'})"
            f" nor a regular expression that is found in a path such as {paths[0]}."
        )
    return names
