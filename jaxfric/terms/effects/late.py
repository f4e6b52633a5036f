"""A force that acts late, or that is recorded late: a dead time, or a lag."""

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


class AbstractRecordedLate(AbstractLate):
    """A force that is recorded late, to first order: f and a time times −df/dt."""

    def impulse(self, sample: Sample):
        return (-reading(sample, PREDICTED),)


class ClockOffset(AbstractRecordedLate):
    """Recorded force that is τ old: u = f(t − τ) = f − τ df/dt + O(τ²): first order."""

    affine: ClassVar = (Parameter("clock_offset", TIME),)


class SensorFilter(AbstractRecordedLate):
    """Recorded force behind a first-order low pass: u + T du/dt = f, u = f − T df/dt + O(T²)."""

    affine: ClassVar = (Parameter("filter_time", TIME),)


UNFILTERED = "Excite faster: a filter takes off the fast parts of a force, another clock none."
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


def lagged_twice(motion: Recording, lag: float) -> Recording:
    """The force through 1/(1 + T s + T² s²/2): a current loop tuned to the magnitude optimum
    (Kessler 1955), which to second order is a delay of T.
    """
    force, pole = np.asarray(motion.force), lag * (0.5 + 0.5j)

    def through(part):
        once = _through(motion, np.asarray(part, complex), pole)
        return _through(motion, once, pole.conjugate()).real

    return dataclasses.replace(motion, force=jnp.asarray(at_other_times(motion, force, through)))


def recorded_earlier(motion: Recording, delay: float) -> Recording:
    """The force taken `delay`, s, earlier: what acted when it was recorded."""
    return earlier(motion, -delay)


def unfiltered(motion: Recording, lag: float) -> Recording:
    """The force u before a low pass, u + T du/dt, by central differences."""
    time, force, segment = map(np.asarray, (motion.time, motion.force, motion.segment))

    def before(part):
        found = np.array(part, float)
        for label in np.unique(segment):
            own = np.flatnonzero((segment == label) & (np.diff(time, append=np.inf) > 0))
            if own.size > 1:
                found[own] += lag * np.gradient(found[own], time[own])
        return found

    return dataclasses.replace(motion, force=jnp.asarray(at_other_times(motion, force, before)))


def _through(motion: Recording, force: np.ndarray, lag: complex) -> np.ndarray:
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
    also_undone=(lagged_twice,),
)

CLOCK = Effect(
    "clock",
    "u = f(t − τ)",
    "actuator",
    "The recorded force is {clock_offset} late: force and motion are logged with different delays, "
    "and the machine itself has none of it; log both by one clock, or shift the column",
    laws=(ClockOffset,),
    coordinates=("force_rate",),
    needs=frozenset({"predicted_force"}),
    confusable_with=("sensor_filter", "frictional_lag", "compliance"),
    separate_by=UNFILTERED,
    positive=True,
    first_order=True,
    sharp=True,
    delays=True,
    leftover=True,
    undone=recorded_earlier,
    shift="clock_offset",
    logged=True,
)
SENSOR_FILTER = Effect(
    "sensor_filter",
    "u + T du/dt = f",
    "actuator",
    "The recorded force is filtered, by a low pass with a time constant of {filter_time}: of the "
    "sensor or of the drive's display, and the machine itself has none of it; log it unfiltered",
    laws=(SensorFilter,),
    coordinates=("force_rate",),
    needs=frozenset({"predicted_force"}),
    confusable_with=("clock", "frictional_lag", "compliance"),
    separate_by=UNFILTERED,
    positive=True,
    first_order=True,
    sharp=True,
    delays=True,
    leftover=True,
    undone=unfiltered,
    logged=True,
)
