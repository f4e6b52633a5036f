"""Friction that grows with the load."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ...units import DIMENSIONLESS
from ..actuator import PREDICTED, REACTION
from ..base import AbstractLaw
from ..effect import Effect, with_parameter
from ..sample import Parameter, Sample
from ..table import reading

LOAD = "load"
"""The channel of a recorded load."""


class LoadDependentFriction(AbstractLaw):
    """Friction proportional to a load: F = μ abs(N) sign(v) (Amontons).

    `load` names the channel with the load N: a recorded one, or by default the force that the
    model without this term predicts, as of a gear that loses a share of all that goes through it.
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


class ReactionFriction(AbstractLaw):
    """Friction proportional to what guide or screw carry: F = μ abs(r) sign(v) (Amontons).

    r is the force that the model predicts without its friction: of inertia, weight and springs.
    The axis is as heavy by μ more where it accelerates, and lighter by μ where it brakes.
    """

    affine: ClassVar = (Parameter("reaction_friction", DIMENSIONLESS),)
    coordinates: ClassVar = frozenset({REACTION, "velocity"})

    def law(self, sample: Sample):
        return (jnp.abs(reading(sample, REACTION)) * jnp.sign(sample.velocity),)

    def text(self, s):
        return (f"{s.call('abs', 'r')} * {s.call('sign', 'v')}",)


LOAD_DEPENDENT_FRICTION = Effect(
    "load_dependent_friction",
    "μ abs(N) sign(v)",
    "friction",
    "Friction grows with the load by {load_friction} of it",
    laws=(LoadDependentFriction, ReactionFriction),
    scaled=lambda scales: (
        LoadDependentFriction(),
        ReactionFriction(),
        LoadDependentFriction(LOAD),
    ),
    coordinates=("predicted_force_by_direction", "predicted_force"),
    confusable_with=("gain_asymmetry", "actuator_saturation"),
    separate_by="Record the load, or repeat with another payload.",
    positive=True,
    variant=with_parameter(
        "reaction_friction",
        "Friction grows by {reaction_friction} of the force of inertia, weight and springs, which "
        "guide or screw carry",
    ),
)
