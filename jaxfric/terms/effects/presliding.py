"""Friction that builds up over a distance."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...units import FORCE, POSITION
from ..effect import Effect
from ..friction import STRIBECK_VELOCITY
from ..presliding import AbstractBristle
from ..sample import UNKNOWN, Parameter


def _distance_bounds(scales):
    """From one sample's way at the slowest slip to a tenth of the stroke.

    A shorter transient is over before the first sample in slip. One longer than a tenth of the
    stroke leaves no steady slip to compare with: it is a function of position.
    """
    return scales.slowest * scales.interval, 0.1 * (scales.high - scales.low)


_DISTANCE = Parameter("presliding_distance", POSITION, _distance_bounds)


class Dahl(AbstractBristle):
    """Presliding that Coulomb friction lacks: F = F_p (z − sign v), dz = (dx/x_d)(1 − z sign(dx)).

    `presliding_distance` x_d, m; F_p, equal to the Coulomb level for Dahl's model, is affine, and
    the presliding stiffness is σ₀ = F_p/x_d (Dahl 1968; exponent one).
    """

    presliding_distance: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("presliding_force", FORCE),)
    nonlinear: ClassVar = (_DISTANCE,)

    def lagging(self, velocity, deflection) -> Float[Array, "N 1"]:
        return (deflection - jnp.sign(velocity))[:, None]


class LuGre(AbstractBristle):
    """Presliding with a Stribeck curve: F = (F_p + F_b exp(−(v/v_s)²)) (z − sign v), z as in Dahl.

    The LuGre model (Canudas de Wit, Olsson, Åström & Lischinsky 1995) for a bristle whose
    stiffness scales with the friction level, so that `presliding_distance` x_d is constant, and
    without micro-damping σ₁, which acts in presliding only. `stribeck_velocity` v_s, m/s.
    """

    presliding_distance: Float[Array, ""] | float = UNKNOWN
    stribeck_velocity: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (
        Parameter("presliding_force", FORCE),
        Parameter("presliding_stribeck_force", FORCE),
    )
    nonlinear: ClassVar = (_DISTANCE, STRIBECK_VELOCITY)

    def lagging(self, velocity, deflection) -> Float[Array, "N 2"]:
        lagging = deflection - jnp.sign(velocity)
        bump = jnp.exp(-((velocity / self.stribeck_velocity) ** 2))
        return jnp.stack([lagging, bump * lagging], axis=1)

    def weights(self, s, distance, width):
        return ("", s.call("exp", f"-(v / {width}) * (v / {width})"))


PRESLIDING = Effect(
    "presliding",
    "F_p (z − sign v), dz = (dx/x_d)(1 − z sign(dx))",
    "reversals",
    "After a reversal friction builds up over {presliding_distance} instead of at once, "
    "{presliding_force} of it: presliding",
    laws=(Dahl, LuGre),
    scaled=lambda scales: (Dahl(),),
    coordinates=("distance_since_reversal",),
    confusable_with=("backlash", "compliance", "frictional_lag", "stribeck"),
    separate_by="Reverse slowly within the presliding distance: the axis is elastic there.",
    positive=True,
    first_order=True,
    at_reversals=True,
    sizes=("presliding_force",),
    vanishes=("presliding_distance",),
)
