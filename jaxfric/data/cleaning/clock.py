"""The clock of a record: which stamps to believe, and where the record is interrupted."""

import numpy as np

from .interleaved import check_one_log
from .pieces import GAP, begun, note, runs, some, spans, usual_step
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
    gap, restart = _interruptions(time, segment, keep, usual)
    note(notes, restart, rows, "where the clock restarts begin a new segment")
    segment = begun(segment, restart | gap)
    kept = {role: some(signal, keep) for role, signal in signals.items()}
    check_one_log(kept, some(segment, keep), source)
    steady = on_a_steady_clock(kept, runs(some(segment, keep)), notes)
    check_runs(steady, some(segment, keep), source)
    if not keep.all():
        time = time.copy()
        time[keep] = steady
    else:
        time = steady
    signals["time"] = time
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
    if np.count_nonzero(step < 0) > 0.5 * len(step):
        raise ValueError(
            f"{source}: time runs backwards at {np.count_nonzero(step < 0)} of {len(step)} steps. "
            "Turn the order of the rows round if the newest is first, or give another column: "
            "--columns time=NAME."
        )
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
    kept, usual = some(time, keep), some(usual, keep)
    step, inside = np.diff(kept), np.diff(some(segment, keep)) == 0
    gap, restart = np.zeros(len(time), bool), np.zeros(len(time), bool)
    restart[keep] = np.concatenate([[False], inside & (step < -GAP * usual[1:])])
    if restart.any():  # after it another rate may hold
        usual = usual_step(kept, runs((segment + np.cumsum(restart))[keep]))
    gap[keep] = np.concatenate([[False], inside & (step > GAP * usual[1:])])
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
    kept = some(time, keep)
    late = np.ones(len(kept), bool)
    for part in spans(some(segment, keep)):
        latest = np.maximum.accumulate(kept[part])
        late[part][1:] = kept[part][1:] > latest[:-1]
    result = np.ones(len(time), bool)
    result[keep] = late
    return result
