"""A gain that differs with the sign of the force."""

from typing import ClassVar

import jax.numpy as jnp

from ...units import DIMENSIONLESS
from ..actuator import PREDICTED
from ..base import AbstractLaw
from ..effect import Effect
from ..sample import Parameter, Sample
from ..table import reading


class GainAsymmetry(AbstractLaw):
    """Different gain for positive force: u = f + κ max(f, 0)."""

    affine: ClassVar = (Parameter("gain_asymmetry", DIMENSIONLESS),)
    coordinates: ClassVar = frozenset({PREDICTED})

    def law(self, sample: Sample):
        return (jnp.maximum(reading(sample, PREDICTED), 0.0),)

    def text(self, s):
        return (s.call("max", "f", "0.0"),)


GAIN_ASYMMETRY = Effect(
    "gain_asymmetry",
    "κ max(f, 0)",
    "actuator",
    "For positive force the gain (the force that acts, by the force that is recorded) is "
    "{gain_asymmetry:gain} than for negative force",
    laws=(GainAsymmetry,),
    coordinates=("predicted_force",),
    needs=frozenset({"predicted_force"}),
    confusable_with=("load_dependent_friction", "actuator_saturation", "asymmetric_friction"),
    separate_by="Accelerate hard both ways: inertia is the same in both directions.",
)
