"""Rows that are lost while the clock counts on: steps that the motion around them cannot make."""

import numpy as np

from .pieces import adjacent, note, runs

MISSING_ROWS = "the position steps as if rows were missing"
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
    step = np.diff(signals["time"])
    speed = np.diff(position) / np.where(step > 0, step, np.inf)
    linked = adjacent(signals["time"], mask, segment)
    # Per sample and per second: where the clock alone is uneven, one of them is not out.
    found = _impossible(speed, linked)
    if found.any():
        found &= _impossible(np.diff(position), linked)
    begun = np.concatenate([[False], found])
    if begun.any():
        largest = np.max(np.abs(np.diff(position))[found])
        note(
            notes,
            begun,
            rows,
            f"where {MISSING_ROWS}, by up to {largest:.4g}, which the motion around it cannot do, "
            "begin a new segment",
        )
    return runs(segment + np.cumsum(begun))


def _impossible(speed: np.ndarray, linked: np.ndarray) -> np.ndarray:
    """Which steps the motion around them cannot make, shape as `speed`."""
    near = [_shifted(speed, k) for k in range(-SIDE, SIDE + 1) if k]
    low, high = near[0].copy(), near[0].copy()
    for other in near[1:]:
        np.minimum(low, other, out=low)
        np.maximum(high, other, out=high)
    whole = np.convolve(linked, np.ones(2 * SIDE + 1), "same") == 2 * SIDE + 1
    whole[:SIDE], whole[len(whole) - SIDE :] = False, False
    out = np.where(whole, np.maximum(speed - high, low - speed), 0.0)
    moving = whole & ((low != 0.0) | (high != 0.0) | (speed != 0.0))
    if not moving.any() or not np.any(out > OUT * (high - low)):
        return np.zeros(len(speed), bool)
    change = np.abs(speed - 0.5 * (_shifted(speed, -1) + _shifted(speed, 1)))
    floor = OUT * float(np.quantile(change[moving], USUAL))
    far = (out > OUT * (high - low)) & (out > floor)
    fastest = np.max(np.abs(speed[linked & ~far]), initial=0.0)
    even = (np.sign(low) == np.sign(high)) & (high - low < 0.5 * np.abs(high + low) / 2)
    return far & (even | (np.abs(speed) > 2 * fastest))


def _shifted(values: np.ndarray, by: int) -> np.ndarray:
    """`values[i + by]` at i; the ends, which wrap round, are not asked for."""
    return np.roll(values, -by)
