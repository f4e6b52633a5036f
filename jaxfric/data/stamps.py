"""A time column in seconds: dates, and counts since 1970 in seconds down to nanoseconds."""

from pathlib import Path

import numpy as np

from .delimited import NO_NUMBER, no_number
from .iso import is_moment, moment
from .printable import short

# From 1980 to 2100 in seconds since 1970: a factor of 13, so that stamps of such dates in s, ms,
# µs and ns are told by their size alone.
_EPOCH = (315_532_800, 4_102_444_800)
_COUNTS = {"ms": 1_000, "µs": 1_000_000, "ns": 1_000_000_000}
_LARGEST_EXACT = 2**53  # whole numbers beyond this lose digits as float64
# Stamps that are whole numbers at least so far apart count something else than seconds.
SLOW = 0.5


def moments(column: np.ndarray, name: str, path: Path, first_row: int) -> np.ndarray | None:
    """Dates with a time of day as seconds from the first one, `(N,)`; `None` if they are none.

    Empty cells become NaN.

    **Raises:** `ValueError` naming the file, row, column and value of the first cell that is no
    date where others are.
    """
    if column.dtype.kind in "OU" and is_moment(_first(column)):
        column = _dates(column, name, path, first_row)
    if column.dtype.kind != "M":
        return None
    known = column[~np.isnat(column)]
    return (column - known[0]) / np.timedelta64(1, "s") if len(known) else None


def _first(column: np.ndarray) -> str:
    """The first cell with a value, as a text."""
    texts = ("" if cell is None else str(cell).strip() for cell in column)
    return next((text for text in texts if text.lower() not in NO_NUMBER), "")


def _dates(column: np.ndarray, name: str, path: Path, first_row: int) -> np.ndarray:
    """Cells as moments, by universal time where they say how far they are from it."""
    texts, ahead = [], np.zeros(len(column), "m8[m]")
    for i, cell in enumerate(column):
        text = "" if cell is None else str(cell).strip()
        found = moment(text)
        if found is None and text.lower() not in NO_NUMBER:
            raise ValueError(no_number(text, "date as the others", name, path, first_row + i))
        each, ahead[i] = found or ("NaT", 0)
        texts.append(each)
    try:
        return np.array(texts, "M8[ns]") - ahead
    except ValueError as error:  # a thirteenth month
        raise ValueError(f"{path}: column {short(name)!r}: {error}. Correct the cell.") from None


def since_1970(column: np.ndarray, notes: list[str]) -> np.ndarray:
    """Stamps in ms, µs or ns since 1970 as seconds from the first; others as they are.

    Whole numbers that float64 cannot hold are counted from the first one as well.
    """
    if column.dtype.kind not in "iuf" or not len(column):
        return column
    finite = column[np.isfinite(column)] if column.dtype.kind == "f" else column
    if not len(finite):
        return column
    low, high = float(finite.min()), float(finite.max())
    for unit, per_second in _COUNTS.items():
        if _EPOCH[0] * per_second <= low and high < _EPOCH[1] * per_second:
            day = np.datetime64(int(low // per_second), "s")
            notes.append(
                f"The time stamps, {low:.6g} and more, are {unit} since 1970 (from {day}); time "
                "is in s from the first one."
            )
            return (column - finite[0]).astype(np.float64) / per_second
    if column.dtype.kind in "iu" and max(abs(low), abs(high)) > _LARGEST_EXACT:
        return (column - column[0]).astype(np.float64)
    return column


def check_slow(time: np.ndarray, notes: list[str]) -> None:
    """Warn of whole numbers that are hardly seconds: they count rows or milliseconds."""
    time = time[np.isfinite(time)]
    steps = np.diff(time)
    if not len(steps) or np.any(time != np.rint(time)):
        return
    usual = float(np.median(steps))
    if usual >= SLOW:
        notes.append(
            f"Warning: the time stamps are whole numbers, {usual:g} s apart if they are seconds. "
            "If they count ms, --scale time=0.001; if they count rows, --scale time=INTERVAL."
        )
