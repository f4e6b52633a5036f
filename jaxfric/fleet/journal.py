"""Rows kept as they are made, so that an interrupted run goes on where it was.

Beside the output stands a folder `OUT.partial` with one file a process: a line that says what is
being done, then one line a row. Lines are only ever added. A process that dies in the middle of
one leaves a line without its end, which the next run cuts off; so no row is lost or there twice.
"""

import json
import os
import shutil
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

from ..data.provenance import versions
from .files import File

SCHEMA = "jaxfric.fleet/2"
Row = dict[str, Any]


def folder(out: str | os.PathLike) -> Path:
    """Where the rows of an output are kept until it is whole."""
    return Path(f"{os.fspath(out)}.partial")


def forget(out: str | os.PathLike, part: int = 0, parts: int = 1) -> None:
    """Remove the rows that an interrupted run has left for an output.

    **Arguments:** `part`, the number of this process among `parts`: each removes its own, the first
    also those of processes that there are no longer.

    **Raises:** `ValueError` if another run is writing to them.
    """
    for path in sorted(folder(out).glob("rows-*.jsonl")):
        number = path.stem.removeprefix("rows-")
        if not number.isdecimal():
            continue
        if int(number) == part or (part == 0 and int(number) >= parts):
            with path.open("ab") as file:
                _lock(file, path)
            path.unlink()


def _lock(file: BinaryIO, path: Path) -> None:
    """Hold a journal until it is closed; raises `ValueError` if another run does."""
    with suppress(ImportError):  # no such locks on Windows
        import fcntl

        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise ValueError(f"{path}: another run is writing to it.") from error


class Journal:
    """The rows made so far for an output; a context manager that holds them against others.

    **Arguments:** `out`, the output; `task`, all options that the rows depend on; `part`, the
    number of this process.

    **Raises:** `ValueError` if the folder cannot be written to, holds rows made with other
    options, or is being written to by another run.
    """

    def __init__(self, out: str | os.PathLike, task: Mapping[str, Any], part: int = 0):
        self.folder = folder(out)
        self._task = {"schema": SCHEMA, "jaxfric": versions()["jaxfric"], "task": _plain(task)}
        self._path = self.folder / f"rows-{part}.jsonl"

    def __enter__(self) -> "Journal":
        try:
            self.folder.mkdir(exist_ok=True)
            self._check()
            self._file = self._path.open("ab")
        except OSError as error:
            raise ValueError(
                f"{self.folder}: cannot be written: {error.strerror}. The rows are kept there "
                "until the output is whole; is its folder there, and yours?"
            ) from error
        try:
            _lock(self._file, self._path)
        except ValueError:
            self._file.close()
            raise
        self._mend()
        if not self._file.tell():
            self._append([self._task])
        return self

    def __exit__(self, *_):
        self._file.close()

    def add(self, rows: Iterable[tuple[File, Row]]) -> None:
        """Keep rows; when this returns they are on the disk."""
        self._append(
            {"file": f.path, "size": f.size, "changed": f.changed, "row": row} for f, row in rows
        )

    def rows(self, files: Iterable[File]) -> dict[str, Row]:
        """The rows, by path, of those files that are as they were; of all processes' journals."""
        wanted = {file.path: file for file in files}
        found = {}
        for path in sorted(self.folder.glob("rows-*.jsonl")):
            for line in _lines(path)[1:]:
                file = wanted.get(line["file"])
                if file and (file.size, file.changed) == (line.get("size"), line.get("changed")):
                    found[file.path] = line["row"]
        return found

    def remove(self) -> None:
        """The output is whole: the folder goes."""
        shutil.rmtree(self.folder, ignore_errors=True)

    def _check(self) -> None:
        for path in self.folder.glob("rows-*.jsonl"):
            head = next(iter(_lines(path)), self._task)
            if head != self._task:
                raise ValueError(
                    f"{self.folder}: holds rows made with {_difference(head, self._task)}. Give "
                    "those options to go on with them, or --restart to begin anew."
                )

    def _mend(self) -> None:
        """Cut off a line without its end."""
        content = self._path.read_bytes()
        whole = content.rfind(b"\n") + 1
        if whole < len(content):
            os.truncate(self._path, whole)
        self._file.seek(0, os.SEEK_END)

    def _append(self, lines: Iterable[Mapping[str, Any]]) -> None:
        text = "".join(json.dumps(line) + "\n" for line in lines)
        try:
            self._file.write(text.encode("ascii"))
            self._file.flush()
            os.fsync(self._file.fileno())
        except OSError as error:
            raise ValueError(f"{self._path}: cannot be written: {error.strerror}.") from error


def _lines(path: Path) -> list[dict[str, Any]]:
    """What a journal holds; raises `ValueError` for a line that no fleet has written."""
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1].split(b"\n")[:-1]
    return [_line(path, number, line) for number, line in enumerate(whole, 1)]


def _line(path: Path, number: int, text: bytes) -> dict[str, Any]:
    wanted = {"schema": str, "task": dict} if number == 1 else {"file": str, "row": dict}
    try:
        found = json.loads(text)
        right = all(isinstance(found[key], kind) for key, kind in wanted.items())
        right = right and (number == 1 or _is_row(found["row"]))
    except (ValueError, RecursionError, TypeError, KeyError):
        right = False
    if not right:
        raise ValueError(
            f"{path}: line {number} was not written by jaxfric fleet, or is damaged. Remove the "
            "line, or give --restart to begin anew."
        )
    return found


def _is_row(row: Row) -> bool:
    return isinstance(row.get("result"), str) and isinstance(row.get("parameters"), dict)


def _plain(value: Any) -> Any:
    return json.loads(json.dumps(value))


def _difference(theirs: Mapping[str, Any], ours: Mapping[str, Any]) -> str:
    if theirs["schema"] != SCHEMA or theirs.get("jaxfric") != ours["jaxfric"]:
        return f"another version of jaxfric ({theirs.get('jaxfric')})"
    pairs = ((name, theirs["task"].get(name), value) for name, value in ours["task"].items())
    return ", ".join(f"{name} {old}, not {new}" for name, old, new in pairs if old != new)
