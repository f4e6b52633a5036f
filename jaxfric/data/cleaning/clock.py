"""The clock of a record: which stamps to believe, and where the record is interrupted."""

import numpy as np

from .pieces import GAP, borders, note, runs, usual_step
from .steady import on_a_steady_clock

# Three samples are the fewest that have a central difference, that is, a velocity.
MIN_SEGMENT = 3


def order(signals, segment, rows, notes, source) -> tuple[np.ndarray, np.ndarray]:
    """Which samples to keep, and the segments after interruptions: `(keep, segment)`.

    Stamps that scatter about a steady clock are put on it in `signals["time"]`.

    **Raises:** `ValueError` if the clock does not run.
    """
    time = signals["time"]
    usual = usual_step(time, segment)
    keep = ~_stray(time, segment, usual)
    note(notes, ~keep, rows, "with a stray time stamp left out")
    index = np.flatnonzero(keep)
    gap, restart = _interruptions(time, segment, keep, usual)
    note(notes, restart, rows, "where the clock restarts begin a new segment")
    segment = runs(segment + np.cumsum(restart | gap))
    kept = {role: signal[index] for role, signal in signals.items()}
    time = time.copy()
    time[index] = on_a_steady_clock(kept, runs(segment[index]), notes)
    signals["time"] = time
    check_runs(time[index], segment[index], source)
    late = _not_late(time, segment, keep)
    note(notes, keep & ~late, rows, "with a repeated or backward time stamp left out")
    keep &= late
    note(notes, gap & keep, rows, f"after a gap of over {GAP:g} usual steps begin a new segment")
    short = np.bincount(segment[keep], minlength=segment[-1] + 1)[segment] < MIN_SEGMENT
    note(notes, keep & short, rows, f"in segments of under {MIN_SEGMENT} samples left out")
    return keep & ~short, segment


def check_runs(time: np.ndarray, segment: np.ndarray, source: str) -> None:
    """Raises `ValueError` unless most stamps are later than the one before."""
    step = np.diff(time)[np.diff(segment) == 0]
    if not np.count_nonzero(step > 0) > 0.5 * len(step):
        fault = "does not change" if not step.any() else "does not increase"
        raise ValueError(
            f"{source}: time {fault} at {np.count_nonzero(step <= 0)} of {len(step)} steps, so "
            "most samples have no time of their own. Give another column: --columns time=NAME, "
            "or log the time with more digits."
        )


def check_increases(time: np.ndarray, segment: np.ndarray, rows: np.ndarray, source: str) -> None:
    """Raises `ValueError` unless every stamp is later than the one before in its segment."""
    wrong = (np.diff(time) <= 0) & (np.diff(segment) == 0)
    if wrong.any():
        raise ValueError(
            f"{source}: row {rows[1:][np.argmax(wrong)]}: time does not increase, here and at "
            f"{np.count_nonzero(wrong) - 1} other steps. Correct the stamps, name a segment "
            "column where the clock restarts (--columns segment=NAME), or read without --no-repair."
        )


def _interruptions(time, segment, keep, usual) -> tuple[np.ndarray, np.ndarray]:
    """Where a gap and where a restart of the clock begins, among the samples to keep."""
    index = np.flatnonzero(keep)
    step, inside = np.diff(time[index]), np.diff(segment[index]) == 0
    gap, restart = np.zeros(len(time), bool), np.zeros(len(time), bool)
    restart[index[1:]] = inside & (step < -GAP * usual[index][1:])
    # After a restart another rate may hold.
    after = usual_step(time[index], runs((segment + np.cumsum(restart))[index]))
    gap[index[1:]] = inside & (step > GAP * after[1:])
    return gap, restart


def _stray(time: np.ndarray, segment: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """Lone stamps far outside their neighbours, which themselves follow each other."""
    before, here, after = time[:-2], time[1:-1], time[2:]
    limit = GAP * usual[1:-1]
    outside = np.maximum(before - here, here - after) > limit
    follow = (after > before) & (after - before <= limit) & (segment[2:] == segment[:-2])
    return np.concatenate([[False], outside & follow, [False]])


def _not_late(time: np.ndarray, segment: np.ndarray, keep: np.ndarray) -> np.ndarray:
    """Samples later than all before them in their segment."""
    result = np.ones(len(time), bool)
    for part in np.split(np.flatnonzero(keep), borders(segment[keep])):
        latest = np.maximum.accumulate(time[part])
        result[part[1:]] = time[part[1:]] > latest[:-1]
    return result
