"""Results to files, whole or not at all: `write_table`, `write_text`, `write_bytes`."""

import csv
import os
import secrets
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import IO

import numpy as np

from .tables import optional
from .targets import replaced, stream

# Rows of a table that are spelled together.
ROWS = 1 << 16


def write_text(path: str | os.PathLike, text: str) -> None:
    """Write a text file (UTF-8) whole or not at all.

    **Raises:** `ValueError` if the folder is absent or cannot be written to.
    """
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: str | os.PathLike, content: bytes) -> None:
    """Write a file whole or not at all.

    **Raises:** `ValueError` if the folder is absent or cannot be written to.
    """
    _write_whole(Path(path), lambda file: file.write(content))


def write_table(path: str | os.PathLike, columns: Mapping[str, object]) -> None:
    """Write columns of one length as CSV, Parquet or `.npz`, by suffix, whole or not at all.

    **Arguments:** `columns`, name to array of shape `(N,)`; floats are written so that reading
    them gives the same number.

    **Raises:** `ValueError` if the suffix is unknown, the lengths differ, the folder cannot be
    written to, or a library is missing.
    """
    path = Path(path)
    arrays = {name: np.asarray(column) for name, column in columns.items()}
    if (
        len({array.shape for array in arrays.values()}) != 1
        or next(iter(arrays.values())).ndim != 1
    ):
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise ValueError(f"{path}: a table needs columns of one length; given: {shapes or 'none'}.")
    writers: dict[str, Callable[[IO[bytes]], object]] = {
        ".csv": lambda file: file.writelines(part.encode("utf-8") for part in _csv_parts(arrays)),
        ".npz": lambda file: np.savez_compressed(file, **arrays),
        ".parquet": lambda file: _write_parquet(file, arrays, path),
    }
    suffix = path.suffix.lower()
    writer = writers.get(suffix if suffix or replaced(path) is not None else ".csv")
    if writer is None:
        raise ValueError(f"{path}: tables are written as {', '.join(writers)}; use that suffix.")
    _write_whole(path, writer)


def csv_text(arrays: Mapping[str, np.ndarray]) -> str:
    """Columns of one length as CSV."""
    return "".join(_csv_parts(arrays))


def _csv_parts(arrays: Mapping[str, np.ndarray]) -> Iterator[str]:
    """The same, some thousand rows at once."""
    length = len(next(iter(arrays.values())))
    for start in range(0, max(length, 1), ROWS):
        text = StringIO()
        writer = csv.writer(text, lineterminator="\n")
        if start == 0:
            writer.writerow(arrays)
        columns = (array[start : start + ROWS].tolist() for array in arrays.values())
        writer.writerows(zip(*columns, strict=True))
        yield text.getvalue()


def _write_parquet(file: IO[bytes], arrays: Mapping[str, np.ndarray], path: Path) -> None:
    pa, parquet = optional("pyarrow", path), optional("pyarrow.parquet", path)
    parquet.write_table(pa.table({name: pa.array(array) for name, array in arrays.items()}), file)


def _write_whole(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write beside the target and move over it: a reader sees the old file or the new one.

    A stream has no old content: it is written to.
    """
    target = replaced(path)
    if target is None:
        try:
            with stream(path) as file:
                write(file)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise ValueError(f"{path}: cannot be written: {error.strerror}.") from error
        return
    name = target.parent / (f".{target.name}"[:100] + f".{secrets.token_hex(4)}")
    try:
        handle = name.open("xb")
    except OSError as error:
        raise ValueError(
            f"{path}: cannot be written: {error.strerror}. Is the folder there?"
        ) from error
    try:
        with handle as file:
            write(file)
        os.replace(name, target)
    except BaseException as error:
        with suppress(OSError):
            os.unlink(name)
        if isinstance(error, OSError):
            raise ValueError(f"{path}: cannot be written: {error.strerror}.") from error
        raise
