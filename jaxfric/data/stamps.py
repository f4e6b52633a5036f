"""A time column in seconds: dates, and counts since 1970 in seconds down to nanoseconds."""

from contextlib import suppress

import numpy as np

# From 1980 to 2100 in seconds since 1970: a factor of 13, so that stamps of such dates in s, ms,
# µs and ns are told by their size alone.
_EPOCH = (315_532_800, 4_102_444_800)
_COUNTS = {"ms": 1_000, "µs": 1_000_000, "ns": 1_000_000_000}
_LARGEST_EXACT = 2**53  # whole numbers beyond this lose digits as float64
# Stamps that are whole numbers at least so far apart count something else than seconds.
SLOW = 0.5


def moments(column: np.ndarray) -> np.ndarray | None:
    """Dates with a time of day as seconds from the first one; `None` if they are none."""
    if column.dtype.kind == "O" and len(column) and "-" in str(column[0])[1:]:
        with suppress(ValueError):
            column = np.array([str(cell).strip().removesuffix("Z") for cell in column], "M8[ns]")
    if column.dtype.kind != "M":
        return None
    return (column - column[0]) / np.timedelta64(1, "s")


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
