"""A gain that drifts to where it settles, as a force constant does while the motor warms."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...units import DIMENSIONLESS, TIME
from ..actuator import PREDICTED
from ..base import AbstractLaw
from ..effect import Effect
from ..sample import UNKNOWN, Parameter, Sample, Scales
from ..table import reading
from ..text import signed
from .thermal_drift import constants


class GainDrift(AbstractLaw):
    """A gain that drifts to where it settles: u = f + κ f exp(−(t − t₀)/τ), f as the motion needs.

    `time_constant` τ, s; `start` t₀, s, is a given number that only scales κ. Magnets lose one to
    two thousandths of their flux with each kelvin (Miller, "Brushless permanent-magnet and
    reluctance motor drives", 1989): a motor that warms needs more current for the same torque.
    """

    time_constant: Float[Array, ""] | float = UNKNOWN
    start: float = eqx.field(static=True, default=0.0)
    affine: ClassVar = (Parameter("drift_gain", DIMENSIONLESS),)
    nonlinear: ClassVar = (Parameter("time_constant", TIME, constants),)
    coordinates: ClassVar = frozenset({"time", PREDICTED})

    def law(self, sample: Sample):
        away = jnp.exp(-(sample.time - self.start) / self.time_constant)
        return (away * reading(sample, PREDICTED),)

    def text(self, s, name):
        return (f"{s.call('exp', f'-(t - {signed(self.start)}) / {name}')} * f",)

    def extent(self, values):
        return {"time": (self.start, self.start + 3 * values["time_constant"])}


def _shapes(scales: Scales) -> tuple[GainDrift, ...]:
    """From the start of the recording on."""
    return (GainDrift(start=float(scales.start)),)


GAIN_DRIFT = Effect(
    "gain_drift",
    "κ f exp(−(t − t₀)/τ)",
    "time",
    "At the start the gain is {drift_gain:gain} than where it settles, with a time constant of "
    "{time_constant}: a force constant that falls as the motor warms, or an amplifier that drifts",
    laws=(GainDrift,),
    scaled=_shapes,
    coordinates=("time_by_direction", "time_by_velocity", "predicted_force", "time"),
    needs=frozenset({"predicted_force"}),
    confusable_with=("thermal_drift", "gain_step", "payload_change"),
    separate_by="Press on a force gauge with one command, at rest, cold and again warm: friction "
    "of the axis does not show there.",
    momentary=True,
    settles="time_constant",
    composite=True,
    drawn=False,
)
