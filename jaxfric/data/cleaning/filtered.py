"""A seam that went through a low-pass filter: several samples that fly back through the turn."""

from typing import NamedTuple

import numpy as np

from .pieces import adjacent, plural, runs

FILTERED_SEAM = "the position flies back"
# Faster than this many times the upper quartile of the speed: a motion at any steady speed, a sine
# (1.5 times) and a triangle stay below it.
FAST = 4.0
# A longer flight is a motion: no filter of a control loop has a lag of so many samples.
LONGEST = 32
# Each run is looked at by itself; of more than this the first ones tell.
MOST_RUNS = 2000


class _Run(NamedTuple):
    """Consecutive steps from `start` to before `stop` that move the position by `total`."""

    start: int
    stop: int
    total: float


def filtered_seams(signals, mask, segment, rows, notes) -> np.ndarray:
    """Tell of filtered seams; where certain, mask them and begin segments. Returns the segments.

    The position goes through most of its range within a few samples against the motion before
    and after, while the force, and the velocity if there is one, know nothing of it: no axis
    turns round and flies back without a force. It is certain if the velocity says otherwise, or
    if it happens several times over the same range.
    """
    position = signals.get("position")
    if position is None:
        return segment
    linked = adjacent(signals["time"], mask, segment)
    step = np.where(linked, np.diff(position), 0.0)
    found = _runs(step, np.ptp(position[mask]))
    if not found or not _silent(signals["force"], found):
        return segment
    seen = _velocity_agrees(signals.get("velocity"), found)
    if seen is True:
        return segment
    totals = np.abs([run.total for run in found])
    same = len(found) > 1 and np.ptp(totals) < 0.1 * np.ptp(position[mask])
    affected = _affected(found, len(position))
    certain = (seen is False or same) and np.count_nonzero(affected & mask) < 0.5 * mask.sum()
    first = rows[found[0].start + 1]
    text = (
        f"Warning: {FILTERED_SEAM} through most of its range within a few samples, "
        f"{plural(len(found), 'time')} (first at row {first}), against the motion before and "
        "after: a wrapped angle that was low-pass filtered. Log it unfiltered or unwrapped. "
    )
    if not certain:
        notes.append(text + "Kept as it is.")
        return segment
    count = int(np.count_nonzero(affected & mask))
    mask &= ~affected
    notes.append(text + f"{plural(count)} masked there, and segments begun after.")
    return runs(segment + np.cumsum(_ends(affected)))


def _runs(step: np.ndarray, span: float) -> list[_Run]:
    """Several fast steps one way, over half the range, against the motion before and after."""
    usual = float(np.quantile(np.abs(step), 0.75))
    sign = np.where(np.abs(step) > FAST * usual, np.sign(step), 0.0)
    if usual == 0.0 or not sign.any():
        return []
    edges = np.concatenate([[0], np.flatnonzero(np.diff(sign)) + 1, [len(step)]])
    found = []
    total = np.concatenate([[0.0], np.cumsum(step)])
    for i in np.flatnonzero(sign[edges[:-1]] != 0.0)[:MOST_RUNS]:
        start, stop = int(edges[i]), int(edges[i + 1])
        run = _Run(start, stop, float(total[stop] - total[start]))
        few = 1 < stop - start <= LONGEST
        if few and abs(run.total) > 0.5 * span and _against(total, run, usual):
            found.append(run)
    return found


def _against(total: np.ndarray, run: _Run, usual: float) -> bool:
    """Whether the motion before and after, out of the filter's reach, is the other way."""
    length = run.stop - run.start
    a, b = run.start - 3 * length, run.start - length
    c, d = run.stop + 2 * length, run.stop + 4 * length
    if a < 0 or d >= len(total):
        return False
    speeds = np.array([total[b] - total[a], total[d] - total[c]]) / (2 * length)
    return bool(np.all(-np.sign(run.total) * speeds > usual / FAST))


def _silent(force: np.ndarray, found: list[_Run]) -> bool:
    """Whether the force is there as it is anywhere: its change beside the same change elsewhere."""
    ranks = []
    total = np.concatenate([[0.0], np.cumsum(force - force[0])])
    for run in found[:64]:
        width = run.stop - run.start + 2
        mean = (total[width:] - total[:-width]) / width
        change = np.abs(mean[width:-width] - 0.5 * (mean[: -2 * width] + mean[2 * width :]))
        at = run.start - 1 - width
        if 0 <= at < len(change):
            ranks.append(float(np.mean(change < change[at])))
    # A real turn and flight is the largest change there is; another place is as often below the
    # median as above.
    return bool(ranks) and float(np.median(ranks)) < 0.9


def _velocity_agrees(velocity: np.ndarray | None, found: list[_Run]) -> bool | None:
    """Whether the velocity flies back as well; `None` where there is none, or it is undecided."""
    if velocity is None:
        return None
    same = [np.mean(velocity[r.start : r.stop + 1]) * r.total > 0 for r in found]
    return True if all(same) else False if not any(same) else None


def _affected(found: list[_Run], total: int) -> np.ndarray:
    """The run, twice as much before it (filters without lag) and thrice as much of its tail.

    A first-order filter flies through 99 % of the turn at the speed of motion or more, and has
    settled to 1e-8 of it after as much again three times.
    """
    affected = np.zeros(total, bool)
    for run in found:
        length = run.stop - run.start
        affected[max(run.start - 2 * length, 0) : run.stop + 1 + 3 * length] = True
    return affected


def _ends(affected: np.ndarray) -> np.ndarray:
    """The first sample after each stretch."""
    return np.concatenate([[False], affected[:-1] & ~affected[1:]])
