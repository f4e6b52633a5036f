"""Friction that varies along the stroke."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...units import FORCE, POSITION
from ..base import AbstractLaw
from ..effect import SIDE, Effect, Waves
from ..position import WITH_DIRECTION, any_period, cycles, wave, waves
from ..sample import UNKNOWN, Parameter, Sample
from ..slow import slowly


class PositionDependentFriction(AbstractLaw):
    """Coulomb level that varies along the stroke: F = A sin(2πx/L + φ) sign(v).

    `friction_period` L, m.
    """

    friction_period: Float[Array, ""] | float = UNKNOWN
    sided: ClassVar = True
    affine: ClassVar = wave("friction", FORCE)
    nonlinear: ClassVar = (
        Parameter("friction_period", POSITION, any_period, resolution=cycles(), repeats=True),
    )
    coordinates: ClassVar = WITH_DIRECTION

    def law(self, sample: Sample):
        angle = 2 * jnp.pi * sample.position / self.friction_period
        return tuple(jnp.sign(sample.velocity) * part for part in waves(angle))

    def text(self, s, period):
        return tuple(f"{s.call('sign', 'v')} * {wave}" for wave in s.waves("x", period))


POSITION_DEPENDENT_FRICTION = Effect(
    "position_dependent_friction",
    "sign(v) A sin(2πx/L + φ)",
    "position",
    "Friction varies along the stroke by {amplitude}, with a period of {friction_period}",
    laws=(PositionDependentFriction,),
    coordinates=("position_by_direction",),
    needs=frozenset({"position"}),
    confusable_with=("sticky_spot", "asymmetric_friction", "position_dependent_force_constant"),
    separate_by="Cross the stroke slowly, both ways.",
    waves=lambda term: Waves("position", True, SIDE),
    variant=slowly(
        "friction_period",
        "Friction varies slowly along the stroke",
        "; it does not repeat within the stroke, as with a guide or a belt that is tight in one "
        "place, or with a load that the place sets",
    ),
)
