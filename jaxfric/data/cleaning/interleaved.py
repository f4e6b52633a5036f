"""Logs of several axes in one file, row by row in turn."""

import numpy as np

from .pieces import borders

# Between neighbouring samples a motion changes by less than over several, and noise by as much:
# four times the power is as far from noise as the noise is from a motion's, over two samples. So is
# a fourth of the power of a motion that goes on alike from sample to sample.
APART = 4.0


def check_one_log(signals: dict[str, np.ndarray], segment: np.ndarray, source: str) -> None:
    """Raises `ValueError` where samples of one time stamp are of several axes in turn.

    Signals of shape `(N,)`. Stamps that are merely rounded repeat too, but there the position goes
    on from sample to sample, instead of to and fro. Of axes that move alike it stands within each
    stamp, and the force goes to and fro.
    """
    count = _at_a_time(signals["time"], segment)
    if count < 2:
        return
    motion = [role for role in ("position", "velocity") if role in signals]
    stands = all(_stands(signals[role], signals["time"]) for role in motion[:1])
    for role in [*motion, *["force"] * stands]:
        if role in signals and _to_and_fro(signals[role], count):
            raise ValueError(
                f"{source}: {count} samples in turn have the same time stamp, and the {role} jumps "
                f"to and fro between them: {count} logs in one file, row by row. Write each axis "
                "to a file of its own."
            )


def _at_a_time(time: np.ndarray, segment: np.ndarray) -> int:
    """How many samples have the same stamp, where all have as many, but for the ends."""
    if len(borders(segment)):
        return 1
    lengths = np.diff(np.flatnonzero(np.diff(time)))
    return int(lengths[0]) if len(lengths) and np.all(lengths == lengths[0]) else 1


def _stands(values: np.ndarray, time: np.ndarray) -> bool:
    """Whether values change from stamp to stamp, and hardly within one."""
    change, within = np.diff(values) ** 2, np.diff(time) == 0
    return bool(APART * np.nanmean(change[within]) < np.nanmean(change[~within]))


def _to_and_fro(values: np.ndarray, count: int) -> bool:
    """Whether neighbours are further apart than samples `count` rows apart."""
    near, far = values[1:] - values[:-1], values[count:] - values[:-count]
    return bool(np.nanmean(near**2) > APART * np.nanmean(far**2))
