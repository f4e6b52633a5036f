"""Rows that are lost while the clock counts on: steps that the motion around them cannot make."""

from typing import NamedTuple

import numpy as np

from .pieces import adjacent, begun, note

MISSING_ROWS = "the position steps as if rows were missing"
# So many steps are looked at together.
BLOCK = 1 << 18
# Samples on each side that say what the motion can do.
SIDE = 3
# How far outside of its neighbours' range a speed has to be, in widths of that range and in the
# changes of speed that all but 2 % of the samples stay below. White noise comes four widths out
# once in some millions of samples, and lost rows that are more frequent are no exceptions.
OUT = 4.0
USUAL = 0.98


def missing_rows(signals, mask, segment, rows, notes) -> np.ndarray:
    """Begin a segment after each step that the neighbouring motion cannot make.

    Such a step is far outside the speeds before and after it, and either the axis moves evenly
    before and after, or no other step of the record is half as fast: an axis that is sampled so
    coarsely that a whole move fits into a step makes several of them.

    **Returns:** the segments, shape `(N,)`.
    """
    position = signals.get("position")
    if position is None or len(position) < 4 * SIDE:
        return segment
    linked = adjacent(signals["time"], mask, segment)
    speed, step = np.diff(position), np.diff(signals["time"])
    step[step <= 0] = np.inf
    speed /= step
    del step
    # Per sample and per second: where the clock alone is uneven, one of them is not out.
    found = _impossible(speed, linked)
    if found.any():
        found &= _impossible(np.diff(position), linked)
    begins = np.concatenate([[False], found])
    if begins.any():
        largest = np.max(np.abs(np.diff(position))[found])
        note(
            notes,
            begins,
            rows,
            f"where {MISSING_ROWS}, by up to {largest:.4g}, which the motion around it cannot do, "
            "begin a new segment",
        )
    return begun(segment, begins)


def _impossible(speed: np.ndarray, linked: np.ndarray) -> np.ndarray:
    """Which steps the motion around them cannot make, shape as `speed`."""
    found = np.zeros(len(speed), bool)
    blocks = [_beside(speed, linked, start) for start in range(0, len(speed), BLOCK)]
    index, low, high, out, change = map(np.concatenate, zip(*blocks, strict=True))
    del blocks
    if not len(index):
        return found
    floor = OUT * float(np.quantile(change, USUAL, overwrite_input=True))
    far = out > floor
    fast = np.abs(speed[index])
    found[index[far]] = True
    ordinary = linked & ~found
    least, most = (end(speed, where=ordinary, initial=0.0) for end in (np.min, np.max))
    even = (np.sign(low) == np.sign(high)) & (high - low < 0.5 * np.abs(high + low) / 2)
    found[index] = far & (even | (fast > 2 * max(-least, most)))
    return found


class _Beside(NamedTuple):
    """The steps of a block far outside their neighbours: which, the neighbours' range, and by how
    much they are outside; and the usual changes of speed, where the axis moves.
    """

    at: np.ndarray
    low: np.ndarray
    high: np.ndarray
    out: np.ndarray
    change: np.ndarray


def _beside(speed: np.ndarray, linked: np.ndarray, start: int) -> _Beside:
    first = max(0, start - SIDE)
    own = slice(start - first, start - first + BLOCK)
    speed, linked = (values[first : start + BLOCK + SIDE] for values in (speed, linked))
    near = [_shifted(speed, k) for k in range(-SIDE, SIDE + 1) if k]
    low, high = np.min(near, axis=0), np.max(near, axis=0)
    whole = np.convolve(linked, np.ones(2 * SIDE + 1), "same") == 2 * SIDE + 1
    whole[:SIDE], whole[len(whole) - SIDE :] = False, False
    out = np.where(whole, np.maximum(speed - high, low - speed), 0.0)
    moving = whole & ((low != 0.0) | (high != 0.0) | (speed != 0.0))
    change = np.abs(speed - 0.5 * (_shifted(speed, -1) + _shifted(speed, 1)))
    at = np.flatnonzero((out > OUT * (high - low))[own]) + own.start
    return _Beside(at + first, low[at], high[at], out[at], change[own][moving[own]])


def _shifted(values: np.ndarray, by: int) -> np.ndarray:
    """`values[i + by]` at i; the ends, which wrap round, are not asked for."""
    return np.roll(values, -by)
