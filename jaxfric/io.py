"""Files to recordings, and results to files: `read`, `write_table`, `write_text`."""

import csv
import math
import os
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import IO

import jax
import numpy as np

from . import columns as names
from .cleaning import clean
from .delimited import Table, numbers
from .recording import Recording
from .tables import load, optional

_SIGNALS = ("time", "force", "position", "velocity")
_LARGEST_EXACT = 2**53  # whole numbers beyond this lose digits as float64


def read(
    path: str | os.PathLike,
    *,
    columns: Mapping[str, str | None] | None = None,
    scale: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
    format: str | None = None,
) -> Recording:
    """Read one log: CSV, Parquet, MATLAB `.mat` or NumPy `.npz`.

    What was put in order on the way (interruptions, invalid samples, a wrapped position) is told
    by [`read_with_notes`][].

    **Arguments:**

    - `columns`: role to column name, where names do not speak for themselves; roles beyond the
      usual ones (`time`, `position`, `velocity`, `force`, `reference`, `load`, `temperature`,
      `segment`) become channels; an empty name leaves a role out.
    - `scale`: role to factor, for instance `{"position": 0.001}` for millimetres to metres.
    - `units`: names of the force and the position unit after scaling, `{"force": "N·m"}`.
    - `format`: `csv`, `parquet`, `mat` or `npz`, where the suffix does not say.

    **Returns:** a `Recording` with signals of shape `(N,)`, in jax's default float type.

    **Raises:** `ValueError` naming file, place, fault and remedy.
    """
    return read_with_notes(path, columns=columns, scale=scale, units=units, format=format)[0]


def read_with_notes(
    path: str | os.PathLike,
    *,
    columns: Mapping[str, str | None] | None = None,
    scale: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
    format: str | None = None,
    set_point: bool = False,
) -> tuple[Recording, list[str]]:
    """[`read`][] together with one plain sentence for each thing that was put in order.

    With `set_point` the file may hold what an axis should do instead of what it did: time and a
    reference, a position or a force are enough, and a force that is absent is zero.

    Row numbers in the notes count lines in a CSV file and samples, from 1, in the other formats.
    """
    path, source = Path(path), str(path)
    scale, units = dict(scale or {}), dict(units or {})
    table = load(path, format)
    chosen = names.assign(table.columns, columns, source, set_point)
    _check_arguments(chosen, scale, units, source)
    names.check_per_second(chosen, scale, source)
    signals = {
        role: _signal(table, role, name, path) for role, name in chosen.items() if role != "segment"
    }
    segment = table.columns[chosen["segment"]] if "segment" in chosen else None
    _check_lengths(signals, segment, chosen, source)
    rows = np.arange(len(signals["time"])) + table.first_row
    tidy = clean(signals, segment, rows, source)
    scaled = {role: signal * scale.get(role, 1.0) for role, signal in tidy.signals.items()}
    if set_point:
        scaled.setdefault("force", np.zeros_like(scaled["time"]))
        if not {"position", "velocity"} & set(scaled):
            scaled["position"] = scaled.get("reference", np.zeros_like(scaled["time"]))
    notes = table.notes + tidy.notes
    scaled["time"] = _exact_time(scaled["time"], tidy.segment, notes, source)
    recording = Recording(
        **{role: scaled[role] for role in _SIGNALS if role in scaled},
        mask=tidy.mask,
        segment=tidy.segment,
        channels={role: scaled[role] for role in scaled if role not in _SIGNALS},
        units=tuple(names.units(chosen, scale, units).items()),
        source=source,
    )
    return recording, notes


def _check_arguments(chosen, scale, units, source) -> None:
    for role, factor in scale.items():
        if role not in chosen or role == "segment":
            raise ValueError(
                f"{source}: scale names {role!r}, which is not read. Read are {', '.join(chosen)}."
            )
        if not math.isfinite(factor) or factor == 0 or (role == "time" and factor < 0):
            raise ValueError(f"{source}: the scale of {role} is {factor}; give a usual number.")
    if unknown := set(units) - {"force", "position"}:
        raise ValueError(
            f"{source}: units names {', '.join(sorted(unknown))}; only the force and the position "
            "have a unit to name, the others follow from them and the second."
        )


def _signal(table: Table, role: str, name: str, path: Path) -> np.ndarray:
    column = table.columns[name]
    if role == "time":
        if (moments := _moments(column)) is not None:
            return moments
        if column.dtype.kind in "iu" and len(column) and np.abs(column).max() > _LARGEST_EXACT:
            return (column - column[0]).astype(np.float64)
    return numbers(column, name, path, table.first_row)


def _moments(column: np.ndarray) -> np.ndarray | None:
    """Dates with a time of day as seconds from the first one; `None` if they are none."""
    if column.dtype.kind == "O" and len(column) and "-" in str(column[0])[1:]:
        with suppress(ValueError):
            column = np.array([str(cell).strip().removesuffix("Z") for cell in column], "M8[ns]")
    if column.dtype.kind != "M":
        return None
    return (column - column[0]) / np.timedelta64(1, "s")


def _check_lengths(signals, segment, chosen, source) -> None:
    lengths = {role: len(signal) for role, signal in signals.items()}
    if segment is not None:
        lengths["segment"] = len(segment)
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{chosen[role]} ({role}) {n}" for role, n in lengths.items())
        raise ValueError(
            f"{source}: the columns differ in length: {listed}. Name columns of one log with "
            "--columns."
        )


def _exact_time(time, segment, notes, source) -> np.ndarray:
    """Time that jax's default float type can hold, from zero where the origin costs digits."""
    kind = np.dtype(jax.dtypes.canonicalize_dtype(np.float64))
    inside = np.diff(segment) == 0
    usual = np.median(np.diff(time)[inside])
    # A stamp that is rounded by 1 % of a step puts as much error on a derived velocity.
    if np.spacing(np.abs(time).max().astype(kind)) > 0.01 * usual and time.min() != 0:
        notes.append(f"Time is counted from its first value, {time.min():.10g} s.")
        time = time - time.min()
    if not np.all(np.diff(time.astype(kind))[inside] > 0):
        raise ValueError(
            f"{source}: {kind.name} is too coarse for this clock. Switch on 64 bits before "
            'reading: jax.config.update("jax_enable_x64", True).'
        )
    return time


# ---- writing ----


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
        ".csv": lambda file: file.write(_csv_text(arrays).encode("utf-8")),
        ".npz": lambda file: np.savez_compressed(file, **arrays),
        ".parquet": lambda file: _write_parquet(file, arrays, path),
    }
    writer = writers.get(path.suffix.lower())
    if writer is None:
        raise ValueError(f"{path}: tables are written as {', '.join(writers)}; use that suffix.")
    _write_whole(path, writer)


def _csv_text(arrays: Mapping[str, np.ndarray]) -> str:
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(arrays)
    writer.writerows(zip(*(array.tolist() for array in arrays.values()), strict=True))
    return text.getvalue()


def _write_parquet(file: IO[bytes], arrays: Mapping[str, np.ndarray], path: Path) -> None:
    pa, parquet = optional("pyarrow", path), optional("pyarrow.parquet", path)
    parquet.write_table(pa.table({name: pa.array(array) for name, array in arrays.items()}), file)


def _write_whole(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write beside the target and move over it: a reader sees the old file or the new one."""
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise ValueError(
            f"{path}: cannot be written: {error.strerror}. Is the folder there?"
        ) from error
    try:
        with os.fdopen(handle, "wb") as file:
            write(file)
        os.chmod(name, 0o666 & ~_umask())  # a temporary file is private, a result is not
        os.replace(name, path)
    except BaseException as error:
        with suppress(OSError):
            os.unlink(name)
        if isinstance(error, OSError):
            raise ValueError(f"{path}: cannot be written: {error.strerror}.") from error
        raise


def _umask() -> int:
    current = os.umask(0)
    os.umask(current)
    return current
