"""When a recorded force acts: by how much later than its time stamp, and the force there."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import signals
from ..checks import Design, lateness
from ..data.recording import Recording, row_of
from ..data.shifting import shifted

# Estimates to first order; the second is off by the square of what the first has left.
ROUNDS = 3
# A force that is off by less of a sample is at its stamp: a hold is off by half of one.
CLOSE = 0.02


def later(design: Design, recording: Recording) -> np.ndarray:
    """By how much later than it was taken the force of a fit's rows acts, s, `()`; `(B,)` of a
    batch. Zero where that is not told from zero, or is more than one and a half samples.

    **Arguments:** `design` of the rows, by the weak form, and the `recording` they are of.
    """
    host = jax.tree.map(np.asarray, (design, recording))
    if recording.time.ndim == 1:
        return np.asarray(_later(*host))
    return np.array([_later(*row_of(host, i)) for i in range(len(recording.time))])


def _later(design: Design, recording: Recording) -> float:
    known, interval = lateness(design), signals.host_interval(recording)
    if known is None or not known.sure(interval) or abs(known.time) <= CLOSE * interval:
        return 0.0
    return -known.time


def at_stamps(recording: Recording, delay: np.ndarray) -> Recording:
    """The recording, or batch, with the force that acts at each sample, straight between them.

    **Arguments:** `delay`, s, by how much later than its stamp a force acts, `()`; `(B,)` of a
    batch. At the ends of a segment the force is held.
    """
    parts = recording.time, recording.force, recording.segment, recording.mask
    rows = zip(*(np.atleast_2d(np.asarray(x)) for x in parts), np.ravel(delay), strict=True)
    moved = np.stack([_moved(*row) for row in rows])
    there = jnp.asarray(moved.reshape(recording.force.shape), recording.force.dtype)
    return eqx.tree_at(lambda r: r.force, recording, there)


def _moved(time, force, segment, mask, by: float) -> np.ndarray:
    """Of valid samples alone; padding stays as it is."""
    found = np.array(force)
    if by:
        found[mask] = shifted(time[mask], force[mask], segment[mask], -by)
    return found
