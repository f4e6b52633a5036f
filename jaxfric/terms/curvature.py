"""Friction beyond Coulomb and viscous: curved, asymmetric, or dependent on a load."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..units import DAMPING, DIMENSIONLESS, FORCE, VELOCITY, Dimension
from .base import AbstractLaw
from .sample import Parameter, Sample
from .table import reading
from .text import literal

UNKNOWN = float("nan")


class FrictionAsymmetry(AbstractLaw):
    """Half the difference of the two directions' friction: F = ΔFc abs(sign v) + ΔFv abs(v).

    For a baseline that ties the directions. In slip the Coulomb part is exactly a constant
    force; only sticking tells the two apart.
    """

    affine: ClassVar = (
        Parameter("coulomb_asymmetry", FORCE),
        Parameter("viscous_asymmetry", DAMPING),
    )

    def law(self, sample: Sample):
        return (jnp.abs(jnp.sign(sample.velocity)), jnp.abs(sample.velocity))

    def text(self, s):
        return (s.call("abs", s.call("sign", "v")), s.call("abs", "v"))


class QuadraticDrag(AbstractLaw):
    """Turbulent drag (air, churning oil): F = c v abs(v)."""

    affine: ClassVar = (Parameter("quadratic_drag", Dimension(force=1, position=-2, time=2)),)

    def law(self, sample: Sample):
        return (sample.velocity * jnp.abs(sample.velocity),)

    def text(self, s):
        return (f"v * {s.call('abs', 'v')}",)


class PowerLaw(AbstractLaw):
    """Friction by a power of speed: F = k sign(v) abs(v/v₁)^n.

    `exponent` n is nonlinear; `unit_speed` v₁, m/s, is a given number, so that k is a force: that
    at v₁. (Elastohydrodynamic traction: Stribeck 1902 and later empirical fits; n = 1 is viscous.)
    """

    exponent: Float[Array, ""] | float = UNKNOWN
    unit_speed: float = eqx.field(static=True, default=1.0)
    affine: ClassVar = (Parameter("power_force", FORCE),)
    # Below 1/4 the curve is Coulomb friction but for the first tenths of speed (1/4 of a power of
    # ten is under a factor of two); above 4 nothing is seen but at the top.
    nonlinear: ClassVar = (Parameter("exponent", DIMENSIONLESS, lambda scales: (0.25, 4.0)),)

    def law(self, sample: Sample):
        speed = jnp.abs(sample.velocity) / self.unit_speed
        moving = speed > 0
        power = jnp.exp(self.exponent * jnp.log(jnp.where(moving, speed, jnp.ones_like(speed))))
        return (jnp.where(moving, jnp.sign(sample.velocity) * power, jnp.zeros_like(power)),)

    def text(self, s, exponent):
        ratio = f"{s.call('abs', 'v')} / {literal(self.unit_speed)}"
        return (f"{s.call('sign', 'v')} * {s.raised(ratio, exponent)}",)


def _thinning_bounds(scales):
    """A tenth of to ten times the top speed.

    Below, the curve has saturated over most of the range (Coulomb); above, it bends from a
    straight line by 1/40 of its height at most (viscous).
    """
    return 0.1 * scales.fastest, 10 * scales.fastest


class ShearThinning(AbstractLaw):
    """Lubricant that thins with shear: F = b v / (1 + abs(v)/v₀).

    `thinning_velocity` v₀, m/s (the Cross model with exponent one, Cross 1965).
    """

    thinning_velocity: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("thinning_viscous", DAMPING),)
    nonlinear: ClassVar = (Parameter("thinning_velocity", VELOCITY, _thinning_bounds),)

    def law(self, sample: Sample):
        return (sample.velocity / (1 + jnp.abs(sample.velocity) / self.thinning_velocity),)

    def text(self, s, scale):
        return (f"v / (1.0 + {s.call('abs', 'v')} / {scale})",)


class LoadDependentFriction(AbstractLaw):
    """Friction proportional to a load: F = μ abs(N) sign(v) (Amontons).

    `load` names the channel with the load N: a recorded one, or by default the force that the
    model without this term predicts.
    """

    load: str = eqx.field(static=True, default="predicted_force")
    affine: ClassVar = (Parameter("load_friction", DIMENSIONLESS),)

    @property
    def coordinates(self):
        return frozenset({self.load, "velocity"})

    def law(self, sample: Sample):
        return (jnp.abs(reading(sample, self.load)) * jnp.sign(sample.velocity),)


class CrossAxis(AbstractLaw):
    """Coupling from another axis: u = d(C v₂)/dt + h v₂.

    Needs that axis' velocity as the channel `neighbour_velocity`; its acceleration is never
    formed, the weak form differentiates the kernel instead.
    """

    affine: ClassVar = (
        Parameter("coupling_inertia", Dimension(force=1, position=-1, time=2)),
        Parameter("coupling_viscous", DAMPING),
    )
    coordinates: ClassVar = frozenset({"neighbour_velocity"})

    def law(self, sample: Sample):
        other = reading(sample, "neighbour_velocity")
        return (jnp.zeros_like(other), other)

    def impulse(self, sample: Sample):
        other = reading(sample, "neighbour_velocity")
        return (other, jnp.zeros_like(other))
