"""How far a model runs away from the recorded motion when it is driven by the recorded force."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from .. import signals
from ..data.recording import Recording
from ..models import Model
from ..simulation.simulating import simulate
from ..terms.base import summands
from ..terms.presliding import AbstractMemory
from .motion import from_position

# A piece lasts this part of the typical time between reversals: long enough for a missing force to
# move the axis, short enough for the motion to stay near the recorded one.
PART = 0.2
SHORTEST = 20


def motion_error(model: Model, recording: Recording) -> float | None:
    """norm(v − v̂)/norm(v) of open-loop runs that start anew from the recorded motion in pieces.

    In closed loop the controller hides what a model lacks (position errors of EMPS differ in the
    sixth digit); driven by the recorded force over a fraction of a stroke, the axis shows it.

    **Arguments:** `model`; `recording`, signals of shape `(N,)`.

    **Returns:** the relative error of the velocity; `None` where a piece that starts anew does not
    tell the state of a term (presliding, a load on a coupling), or for faults of the actuator.
    """
    beyond = model.term.coordinates - {"position", "velocity", "acceleration", "time"}
    if beyond - set(recording.channels) or not _memoryless(model):
        return None
    prepared = signals.prepare(from_position(recording))
    velocity = np.asarray(prepared.velocity)
    slowest = float(signals.scales(prepared).slowest)
    moving = np.sign(velocity[np.abs(velocity) > slowest])
    turns = int(np.count_nonzero(np.diff(moving))) + 1
    piece = max(SHORTEST, int(PART * velocity.size / turns))
    labels = np.arange(velocity.size) // piece
    both = labels * (1 + (prepared.num_segments or 1)) + np.asarray(prepared.segment)
    segment = np.unique(both, return_inverse=True)[1]
    cut = dataclasses.replace(
        prepared, segment=jnp.asarray(segment), num_segments=int(segment.max()) + 1
    )
    run = np.asarray(simulate(model, cut).velocity)
    used = np.asarray(prepared.mask) & np.isfinite(run)
    left = np.linalg.norm((run - velocity)[used])
    return float(left) / max(float(np.linalg.norm(velocity[used])), 1e-300)


def _memoryless(model: Model) -> bool:
    return not any(isinstance(term, AbstractMemory) for term in summands(model.term))
