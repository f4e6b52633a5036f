"""Gain that falls at high force."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...units import (
    DIMENSIONLESS,
    FORCE,
)
from ..actuator import PREDICTED
from ..base import AbstractLaw
from ..effect import Effect
from ..sample import UNKNOWN, Parameter, Sample
from ..table import reading


def _knee_bounds(scales):
    """A half to three times the root-mean-square force.

    Below, most samples lie beyond the knee and the law is a gain plus a dead-band; three times
    the root mean square is the peak of all but the most impulsive duty.
    """
    return 0.5 * scales.force, 3 * scales.force


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


ACTUATOR_SATURATION = Effect(
    "actuator_saturation",
    "c max(abs(f) − U, 0) sign(f)",
    "actuator",
    "Above {knee} the actuator gives less than commanded: saturation, {saturation} of the excess",
    laws=(ActuatorSaturation,),
    coordinates=("predicted_force",),
    needs=frozenset({"predicted_force"}),
    confusable_with=("gain_asymmetry", "load_dependent_friction"),
    separate_by="Repeat at half the acceleration, below the knee.",
    positive=True,
)
