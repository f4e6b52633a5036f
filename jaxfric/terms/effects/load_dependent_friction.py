"""Friction that grows with the load."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ...units import (
    DIMENSIONLESS,
)
from ..actuator import PREDICTED
from ..base import AbstractLaw
from ..effect import Effect
from ..sample import Parameter, Sample
from ..table import reading

LOAD = "load"
"""The channel of a recorded load."""


class LoadDependentFriction(AbstractLaw):
    """Friction proportional to a load: F = μ abs(N) sign(v) (Amontons).

    `load` names the channel with the load N: a recorded one, or by default the force that the
    model without this term predicts.
    """

    load: str = eqx.field(static=True, default=PREDICTED)
    affine: ClassVar = (Parameter("load_friction", DIMENSIONLESS),)

    @property
    def coordinates(self):
        return frozenset({self.load, "velocity"})

    def law(self, sample: Sample):
        return (jnp.abs(reading(sample, self.load)) * jnp.sign(sample.velocity),)

    def text(self, s):
        if self.load != PREDICTED:
            return None
        return (f"{s.call('abs', 'f')} * {s.call('sign', 'v')}",)


LOAD_DEPENDENT_FRICTION = Effect(
    "load_dependent_friction",
    "μ abs(N) sign(v)",
    "friction",
    "Friction grows with the load by {load_friction} of it",
    laws=(LoadDependentFriction,),
    scaled=lambda scales: (LoadDependentFriction(), LoadDependentFriction(LOAD)),
    coordinates=("predicted_force_by_direction", "predicted_force"),
    confusable_with=("gain_asymmetry", "actuator_saturation"),
    separate_by="Record the load, or repeat with another payload.",
    positive=True,
)
