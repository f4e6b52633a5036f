"""Gain that falls at high force."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...units import DIMENSIONLESS, FORCE
from ..actuator import PREDICTED
from ..base import AbstractLaw
from ..effect import Effect, Extent
from ..sample import UNKNOWN, Parameter, Sample
from ..table import reading
from ..text import literal


def _knee_bounds(scales):
    """From half the root-mean-square force, below which most samples lie beyond the knee and the
    law is a gain plus a dead-band, to the peak: many times that of short moves between long dwells.
    """
    return 0.5 * scales.force, scales.peak


class ActuatorSaturation(AbstractLaw):
    """Gain that falls at high force (magnetic saturation): u = f + c max(abs(f) − U, 0) sign(f).

    `knee` U, N. A hard limit is not this law: there u − f depends on the controller alone, and
    the samples at the limit are to be masked.
    """

    knee: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("saturation", DIMENSIONLESS),)
    nonlinear: ClassVar = (Parameter("knee", FORCE, _knee_bounds),)
    coordinates: ClassVar = frozenset({PREDICTED})

    def law(self, sample: Sample):
        force = reading(sample, PREDICTED)
        return (jnp.sign(force) * jnp.maximum(jnp.abs(force) - self.knee, 0.0),)

    def text(self, s, knee):
        beyond = s.call("max", f"{s.call('abs', 'f')} - {knee}", "0.0")
        return (f"{s.call('sign', 'f')} * {beyond}",)


def _level_bounds(scales):
    """From the root-mean-square force, the peak of a square wave, to two and a half times the peak:
    there the law is a cubic to a tenth.
    """
    return scales.force, 2.5 * scales.peak


# So far, in parts of the level, and no further: beyond, a command five times as large is straight.
_NEAR = 0.98


class SoftSaturation(AbstractLaw):
    """Gain that falls gradually: u = f + c f (1/√(1 − (f/L)²) − 1).

    `saturation_level` L, N, is approached and not reached; with c = 1 the actuator gives
    f = u/√(1 + (u/L)²) (Rapp 1991, of the smoothness 1), as iron that saturates little by little.
    """

    saturation_level: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("saturation", DIMENSIONLESS),)
    nonlinear: ClassVar = (Parameter("saturation_level", FORCE, _level_bounds),)
    coordinates: ClassVar = frozenset({PREDICTED})

    def law(self, sample: Sample):
        force = reading(sample, PREDICTED)
        used = jnp.minimum((force / self.saturation_level) ** 2, _NEAR**2)
        return (force * (1 / jnp.sqrt(1 - used) - 1),)

    def text(self, s, level):
        used = s.call("min", f"f / {level} * f / {level}", literal(_NEAR**2))
        return (f"f * (1.0 / {s.raised(f'1.0 - {used}', '0.5')} - 1.0)",)


def _reached(saturation: float, most: float) -> float:
    """The largest f/L that the soft law gives where `most` is the largest u/L, from 0 to 1."""
    given = np.linspace(0.0, 1.0, 1001)[:-1]
    asked = given * (1 + saturation * (1 / np.sqrt(1 - given**2) - 1))
    return float(np.interp(most, asked, given))


def _gradual(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence of the soft law, whose level is not seen but extrapolated."""
    level = values.get("saturation_level")
    if level is None:
        return None
    text = (
        "The actuator gives less than commanded, the more the larger the force: gradual "
        "saturation. By this law it would never give more than {saturation_level}"
    )
    reached = _reached(values["saturation"], extent.peak / level)
    if not reached < _NEAR:  # as far as the law goes
        return text
    return f"{text}; here it gives {reached:.0%} of that at most, so that the level is not seen"


ACTUATOR_SATURATION = Effect(
    "actuator_saturation",
    "c max(abs(f) − U, 0) sign(f), or c f (1/√(1 − (f/L)²) − 1)",
    "actuator",
    "Above {knee} the actuator gives less than commanded: saturation, by {saturation} of the "
    "excess",
    laws=(ActuatorSaturation, SoftSaturation),
    coordinates=("predicted_force",),
    needs=frozenset({"predicted_force"}),
    confusable_with=("gain_asymmetry", "load_dependent_friction"),
    separate_by="Repeat at half the acceleration, below the knee.",
    positive=True,
    variant=_gradual,
)
