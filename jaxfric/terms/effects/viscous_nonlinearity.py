"""Friction that is curved in speed."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...units import DAMPING, DIMENSIONLESS, FORCE, VELOCITY, Dimension
from ..base import AbstractLaw
from ..effect import Effect, Extent
from ..sample import UNKNOWN, Parameter, Sample
from ..text import literal


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


_CURVED = "Friction is curved in speed, beyond a Coulomb and a viscous part"
# What a law adds, by the name of its size; and of what it is as, where that is positive.
_PARTS = {
    "quadratic_drag": ("{quadratic_drag} times the square of speed", "air or churning oil"),
    "thinning_viscous": (
        "{thinning_viscous}, half as much at {thinning_velocity}",
        "a lubricant that thins",
    ),
    "power_force": ("speed {exponent:power}", ""),
}


def _by_law(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence with what the law adds."""
    for name, (added, source) in _PARTS.items():
        if name in values:
            like = f", as of {source}" if source and values[name] > 0 else ""
            return f"{_CURVED}: by {added}{like}"
    return None


VISCOUS_NONLINEARITY = Effect(
    "viscous_nonlinearity",
    "c v abs(v), b v/(1 + abs(v)/v₀) or k sign(v) abs(v)ⁿ",
    "friction",
    _CURVED,
    laws=(QuadraticDrag, ShearThinning, PowerLaw),
    scaled=lambda scales: (
        QuadraticDrag(),
        ShearThinning(),
        PowerLaw(unit_speed=float(scales.fastest)),
    ),
    coordinates=("velocity",),
    confusable_with=("thermal_drift", "stribeck"),
    separate_by="Run to the top speed from cold and again warm.",
    variant=_by_law,
)
