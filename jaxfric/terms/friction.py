"""Slip friction: functions of velocity alone, the classical curves of Armstrong-Hélouvry, Dupont &
Canudas de Wit, "A survey of models, analysis tools and compensation methods for the control of
machines with friction", Automatica 30(7), 1994, section 2.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..units import DAMPING, DIMENSIONLESS, FORCE, VELOCITY
from .base import AbstractLaw, Parameter, Sample

UNKNOWN = float("nan")


class Coulomb(AbstractLaw):
    """Friction of constant magnitude: F = Fc sign(v)."""

    affine: ClassVar = (Parameter("coulomb", FORCE),)

    def law(self, sample: Sample):
        return (jnp.sign(sample.velocity),)


class Viscous(AbstractLaw):
    """Friction proportional to speed: F = Fv v."""

    affine: ClassVar = (Parameter("viscous", DAMPING),)

    def law(self, sample: Sample):
        return (sample.velocity,)


def _stribeck_bounds(scales):
    """From the slowest speed that counts as slip to half the fastest one.

    A bump narrower than the slowest slip leaves no trace in the samples; one wider than half the
    speed range is no longer told from viscous friction and offset.
    """
    return scales.slowest, 0.5 * scales.fastest


_STRIBECK_FORCE = (Parameter("stribeck_force", FORCE),)
_STRIBECK_VELOCITY = Parameter("stribeck_velocity", VELOCITY, _stribeck_bounds)


class Gaussian(AbstractLaw):
    """Stribeck bump F = F_b sign(v) exp(−(v/v_s)²) (Kim, Kim & Ha 2004, eq. 20).

    `stribeck_velocity` v_s, m/s, is nonlinear; NaN means "to be identified".
    """

    stribeck_velocity: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = _STRIBECK_FORCE
    nonlinear: ClassVar = (_STRIBECK_VELOCITY,)

    def law(self, sample: Sample):
        ratio = sample.velocity / self.stribeck_velocity
        return (jnp.sign(sample.velocity) * jnp.exp(-(ratio**2)),)


class Lorentzian(AbstractLaw):
    """Stribeck bump F = F_b sign(v) / (1 + (v/v_s)²) (Hess & Soom 1990; Kim, Kim & Ha, eq. 29).

    `stribeck_velocity` v_s, m/s, is nonlinear; NaN means "to be identified".
    """

    stribeck_velocity: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = _STRIBECK_FORCE
    nonlinear: ClassVar = (_STRIBECK_VELOCITY,)

    def law(self, sample: Sample):
        ratio = sample.velocity / self.stribeck_velocity
        return (jnp.sign(sample.velocity) / (1 + ratio**2),)


class Exponential(AbstractLaw):
    """Stribeck bump F = F_b sign(v) exp(−|v|/v_s) (Tustin 1947).

    `stribeck_velocity` v_s, m/s, is nonlinear; NaN means "to be identified".
    """

    stribeck_velocity: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = _STRIBECK_FORCE
    nonlinear: ClassVar = (_STRIBECK_VELOCITY,)

    def law(self, sample: Sample):
        ratio = jnp.abs(sample.velocity) / self.stribeck_velocity
        return (jnp.sign(sample.velocity) * jnp.exp(-ratio),)


class Generalised(AbstractLaw):
    """Stribeck bump F = F_b sign(v) exp(−|v/v_s|^δ) (Bo & Pavelescu 1982; δ from 1/2 to 2).

    `stribeck_velocity` v_s, m/s, and `stribeck_exponent` δ are nonlinear; NaN means "to be
    identified".
    """

    stribeck_velocity: Float[Array, ""] | float = UNKNOWN
    stribeck_exponent: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = _STRIBECK_FORCE
    nonlinear: ClassVar = (
        _STRIBECK_VELOCITY,
        Parameter("stribeck_exponent", DIMENSIONLESS, lambda scales: (0.5, 2.0), logarithmic=False),
    )

    def law(self, sample: Sample):
        speed = jnp.abs(sample.velocity)
        moving = speed > 0
        ratio = jnp.where(moving, speed, jnp.ones_like(speed)) / self.stribeck_velocity
        bump = jnp.exp(-jnp.exp(self.stribeck_exponent * jnp.log(ratio)))
        return (jnp.where(moving, jnp.sign(sample.velocity) * bump, jnp.zeros_like(bump)),)
