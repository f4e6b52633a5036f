"""A force that acts late: a dead time, or a lag."""

import dataclasses
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ...data.recording import Recording
from ...data.shifting import shifted
from ...units import TIME
from ..actuator import PREDICTED
from ..base import AbstractLaw
from ..effect import Effect
from ..known import at_other_times
from ..sample import Parameter, Sample
from ..table import reading


class AbstractLate(AbstractLaw):
    """A force that acts late, to first order: f and a time times df/dt."""

    coordinates: ClassVar = frozenset({PREDICTED})

    def law(self, sample: Sample):
        return (jnp.zeros_like(sample.time),)

    def impulse(self, sample: Sample):
        return (reading(sample, PREDICTED),)


class TransportDelay(AbstractLate):
    """Force that acts τ late: u = f(t + τ) = f + τ df/dt + O(τ²): first order.

    The same column as [`ActuatorLag`][]; only the second order, ½ τ² d²f/dt², tells them apart.
    """

    affine: ClassVar = (Parameter("delay", TIME),)


class ActuatorLag(AbstractLate):
    """First-order lag of the force: u = f + T df/dt (exact)."""

    affine: ClassVar = (Parameter("lag", TIME),)


FASTER = "Excite faster: a delay turns the phase without bound, a lag by a quarter turn."


def earlier(motion: Recording, delay: float) -> Recording:
    """The force taken `delay`, s, later: what acted then."""
    time, force, segment = map(np.asarray, (motion.time, motion.force, motion.segment))
    moved = at_other_times(motion, force, lambda part: shifted(time, part, segment, -delay))
    return dataclasses.replace(motion, force=jnp.asarray(moved))


def lagged(motion: Recording, lag: float) -> Recording:
    """The force through 1/(1 + T s), exact for straight lines between the samples."""
    force = np.asarray(motion.force)
    through = at_other_times(motion, force, lambda part: _through(motion, np.asarray(part), lag))
    return dataclasses.replace(motion, force=jnp.asarray(through))


def _through(motion: Recording, force: np.ndarray, lag: float) -> np.ndarray:
    time = np.asarray(motion.time)
    step = np.diff(time, prepend=time[0])
    keep = np.exp(-np.clip(step, 0.0, None) / lag)
    new = np.diff(np.asarray(motion.segment), prepend=-1) != 0
    out, state, before = np.empty_like(force), 0.0, 0.0
    for i, (u, k, h, fresh) in enumerate(zip(force, keep, step, new, strict=True)):
        if fresh or h <= 0:
            state = u
        else:
            slope = (u - before) / h
            state = k * (state - before + slope * lag) + u - slope * lag
        out[i], before = state, u
    return out


TRANSPORT_DELAY = Effect(
    "transport_delay",
    "u = f(t + τ)",
    "actuator",
    "The force acts {delay} late: a dead time between command and motion",
    laws=(TransportDelay,),
    coordinates=("force_rate",),
    needs=frozenset({"predicted_force"}),
    confusable_with=("actuator_lag", "frictional_lag", "compliance"),
    separate_by=FASTER,
    positive=True,
    first_order=True,
    sharp=True,
    delays=True,
    leftover=True,
    undone=earlier,
    shift="delay",
)
ACTUATOR_LAG = Effect(
    "actuator_lag",
    "u = f + T df/dt",
    "actuator",
    "The force lags its command by a time constant of {lag}",
    laws=(ActuatorLag,),
    coordinates=("force_rate",),
    needs=frozenset({"predicted_force"}),
    confusable_with=("transport_delay", "frictional_lag", "compliance"),
    separate_by=FASTER,
    positive=True,
    sharp=True,
    delays=True,
    leftover=True,
    undone=lagged,
)
