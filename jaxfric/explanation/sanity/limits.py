"""A hard limit of force: the recorded command asks for more than arrives, u_real = clip(u, ±U)."""

import dataclasses

import numpy as np

from ...data.recording import Recording
from ...identification.uncertainty import Estimate
from ...simulation.prediction import in_motion
from ...terms import KNOWN_FORCE
from ..significance import FEWEST

# Of the mismatch in the samples that ask for more: what a clip leaves of it, and of all of it; and
# the part of the excess that arrives. A soft knee leaves more, and gives more.
LEAVES, LEAVES_IN_ALL = 0.25, 0.5
# A machine that is at its limit most of the time does not do what it is told.
MOST = 0.5
LEVELS = 200


def hard_limit(recording: Recording) -> Estimate | None:
    """The force U beyond which no more arrives, N, of a recording with its simulator's force
    beside it; `None` where the command and what the motion needed do not part so.
    """
    command = np.asarray(recording.force, float)
    known = np.asarray(recording.channels[KNOWN_FORCE], float)
    moving = in_motion(recording) & np.isfinite(command)
    size, needed = np.abs(command[moving]), np.sign(command[moving]) * known[moving]
    mismatch = (size - needed) ** 2
    levels = np.quantile(size, np.linspace(1 - MOST, 1, LEVELS + 1))[:-1]
    left = np.array([np.sum((np.minimum(size, level) - needed) ** 2) for level in levels])
    level = float(levels[int(np.argmin(left))])
    beyond = size > level
    if np.count_nonzero(beyond) < FEWEST or not left.min() < LEAVES_IN_ALL * mismatch.sum():
        return None
    level = float(np.mean(needed[beyond]))  # what arrived there
    beyond = size > level
    inside = np.sum((level - needed[beyond]) ** 2)
    if not inside < LEAVES * np.sum(mismatch[beyond]):
        return None
    excess = size[beyond] - np.mean(size[beyond])
    part = float(excess @ needed[beyond]) / max(float(excess @ excess), 1e-300)
    if abs(part) > LEAVES:
        return None
    visits = np.flatnonzero(np.diff(beyond.astype(int), prepend=0) == 1)
    spread = float(np.std(needed[beyond]))
    unit = recording.unit_names["force"]
    error = spread / np.sqrt(max(len(visits), 1))
    return Estimate(np.float64(level), np.float64(error), unit)


def arrived(recording: Recording, limit: Estimate | None) -> Recording:
    """The recording with the force that arrived."""
    if limit is None:
        return recording
    top = float(limit.value)
    force = np.clip(np.asarray(recording.force), -top, top)
    return dataclasses.replace(recording, force=force)


def beyond(recording: Recording, limit: Estimate) -> int:
    """How many samples ask for more."""
    force = np.abs(np.asarray(recording.force, float))
    return int(np.count_nonzero((force > float(limit.value)) & np.asarray(recording.mask)))
