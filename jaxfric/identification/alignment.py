"""When a recorded force acts: by how much later than its time stamp, and the force there."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..checks import STAMPED, SURE, Design, lateness
from ..data.recording import Recording

# Estimates to first order; the second is off by the square of what the first has left.
ROUNDS = 3
# An interval of samples so much smaller than the error of the time is not told from none.
CLOSE = 0.02


def later(design: Design, recording: Recording) -> np.ndarray:
    """By how much later than it was taken the force of a fit's rows acts, s, `()`; `(B,)` of a
    batch. Zero where that is not told from zero, or is more than one and a half samples.
    """
    host = jax.tree.map(np.asarray, (design, recording.time, recording.mask))
    if np.ndim(host[1]) == 1:
        return np.asarray(_later(*host))
    rows = range(len(host[1]))
    return np.array([_later(*jax.tree.map(lambda x, i=i: x[i], host)) for i in rows])


def _later(design: Design, time: np.ndarray, mask: np.ndarray) -> float:
    known = lateness(design)
    if known is None:
        return 0.0
    interval = usual_interval(time, mask)
    sure = SURE * known.error < abs(known.time) <= STAMPED * interval
    return -known.time if sure and abs(known.time) > CLOSE * interval else 0.0


def usual_interval(time: np.ndarray, mask: np.ndarray) -> float:
    """The usual time between valid samples, s; zero where there are none."""
    steps = np.diff(time[mask])
    steps = steps[steps > 0]
    return float(np.median(steps)) if steps.size else 0.0


def at_stamps(recording: Recording, delay: np.ndarray) -> Recording:
    """The recording, or batch, with the force that acts at each sample, straight between them.

    `delay`, s, by how much later than its stamp a force acts, `()`, or `(B,)` of a batch. At the
    ends of a segment the force is held.
    """
    parts = recording.time, recording.force, recording.segment, recording.mask
    time, force, segment, mask = (np.atleast_2d(np.asarray(x)) for x in parts)
    rows = zip(time, force, segment, mask, np.ravel(delay), strict=True)
    moved = np.stack([_moved(*row) for row in rows])
    there = jnp.asarray(moved.reshape(recording.force.shape), recording.force.dtype)
    return eqx.tree_at(lambda r: r.force, recording, there)


def _moved(time, force, segment, mask, by: float) -> np.ndarray:
    found = np.array(force, float)
    if not by:
        return found
    for label in np.unique(segment[mask]):
        own = mask & (segment == label)
        if np.all(np.diff(time[own]) > 0):
            found[own] = np.interp(time[own] - by, time[own], force[own])
    return found
