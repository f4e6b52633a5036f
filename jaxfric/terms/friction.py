"""Slip friction: functions of velocity alone, the classical curves of Armstrong-Hélouvry, Dupont &
Canudas de Wit, "A survey of models, analysis tools and compensation methods for the control of
machines with friction", Automatica 30(7), 1994, section 2.
"""

from abc import abstractmethod
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..units import DAMPING, DIMENSIONLESS, FORCE, VELOCITY
from .base import AbstractLaw
from .sample import UNKNOWN, Parameter, Sample
from .text import Syntax


class Coulomb(AbstractLaw):
    """Friction of constant magnitude: F = Fc sign(v)."""

    in_joint: ClassVar = "friction"
    affine: ClassVar = (Parameter("coulomb", FORCE),)

    def law(self, sample: Sample):
        return (jnp.sign(sample.velocity),)

    def text(self, s):
        return (s.call("sign", "v"),)


class Viscous(AbstractLaw):
    """Friction proportional to speed: F = Fv v."""

    in_joint: ClassVar = "damping"
    affine: ClassVar = (Parameter("viscous", DAMPING),)

    def law(self, sample: Sample):
        return (sample.velocity,)

    def text(self, s):
        return ("v",)


def _stribeck_bounds(scales):
    """From the slowest speed that counts as slip to half the fastest one.

    A bump narrower than the slowest slip leaves no trace in the samples; one wider than half the
    speed range is no longer told from viscous friction and offset.
    """
    return scales.slowest, 0.5 * scales.fastest


_STRIBECK_FORCE = (Parameter("stribeck_force", FORCE),)
STRIBECK_VELOCITY = Parameter("stribeck_velocity", VELOCITY, _stribeck_bounds)


class AbstractBump(AbstractLaw):
    """A Stribeck bump F = F_b sign(v) s(|v|), its shape s smooth at speeds above zero.

    A concrete bump gives `shape`, and `contrast` for the search over β, whose grid is content with
    `ratio`. Smooth means: at the scale of |v| itself or of the Stribeck velocity, whichever is
    larger.
    """

    affine: ClassVar = _STRIBECK_FORCE

    @abstractmethod
    def shape(self, speed: Float[Array, "*n"]) -> Float[Array, "*n"]:
        """The shape s at positive speeds, m/s."""

    @abstractmethod
    def contrast(self, speed: Float[Array, "*n"], slowest: Float[Array, ""]) -> Float[Array, "*n"]:
        """s(v)/s(v₀) − 1, with v₀ = `slowest` > 0: with the constant it spans what s spans.

        Written so that it neither underflows where the bump is narrow nor loses its variation in
        the rounding of a constant where the bump is wide. `speed` is not below `slowest`, m/s.
        """

    def ratio(self, speed: Float[Array, "*n"], slowest: Float[Array, ""]) -> Float[Array, "*n"]:
        """s(v)/s(v₀), for where the rounding of a constant does no harm."""
        return 1 + self.contrast(speed, slowest)

    def law(self, sample: Sample):
        speed = jnp.abs(sample.velocity)
        moving = speed > 0
        shape = self.shape(jnp.where(moving, speed, jnp.ones_like(speed)))
        return (jnp.where(moving, jnp.sign(sample.velocity) * shape, jnp.zeros_like(shape)),)


class AbstractExponentialBump(AbstractBump):
    """A bump whose shape is an exponential; `fall` is its exponent less that at `slowest`."""

    @abstractmethod
    def fall(self, speed: Float[Array, "*n"], slowest: Float[Array, ""]) -> Float[Array, "*n"]:
        """log(s(v)/s(v₀)), not by the difference of two exponents."""

    def contrast(self, speed, slowest):
        return jnp.expm1(self.fall(speed, slowest))

    def ratio(self, speed, slowest):
        # A third cheaper than `expm1`.
        return jnp.exp(self.fall(speed, slowest))


def _bump(s: Syntax, shape: str) -> tuple[str]:
    """A bump as text."""
    return (f"{s.call('sign', 'v')} * {shape}",)


class Gaussian(AbstractExponentialBump):
    """Stribeck bump F = F_b sign(v) exp(−(v/v_s)²) (Kim, Kim & Ha 2004, eq. 20).

    `stribeck_velocity` v_s, m/s, is nonlinear; NaN means "to be identified".
    """

    stribeck_velocity: Float[Array, ""] | float = UNKNOWN
    nonlinear: ClassVar = (STRIBECK_VELOCITY,)

    def shape(self, speed):
        return jnp.exp(-((speed / self.stribeck_velocity) ** 2))

    def fall(self, speed, slowest):
        return (slowest - speed) * (slowest + speed) / self.stribeck_velocity**2

    def text(self, s, width):
        return _bump(s, s.call("exp", f"-(v / {width}) * (v / {width})"))


class Lorentzian(AbstractBump):
    """Stribeck bump F = F_b sign(v) / (1 + (v/v_s)²) (Hess & Soom 1990; Kim, Kim & Ha, eq. 29).

    `stribeck_velocity` v_s, m/s, is nonlinear; NaN means "to be identified".
    """

    stribeck_velocity: Float[Array, ""] | float = UNKNOWN
    nonlinear: ClassVar = (STRIBECK_VELOCITY,)

    def shape(self, speed):
        return 1 / (1 + (speed / self.stribeck_velocity) ** 2)

    def contrast(self, speed, slowest):
        return (slowest - speed) * (slowest + speed) / (self.stribeck_velocity**2 + speed**2)

    def text(self, s, width):
        return (f"{s.call('sign', 'v')} / (1.0 + (v / {width}) * (v / {width}))",)


class Exponential(AbstractExponentialBump):
    """Stribeck bump F = F_b sign(v) exp(−|v|/v_s) (Tustin 1947).

    `stribeck_velocity` v_s, m/s, is nonlinear; NaN means "to be identified".
    """

    stribeck_velocity: Float[Array, ""] | float = UNKNOWN
    nonlinear: ClassVar = (STRIBECK_VELOCITY,)

    def shape(self, speed):
        return jnp.exp(-speed / self.stribeck_velocity)

    def fall(self, speed, slowest):
        return (slowest - speed) / self.stribeck_velocity

    def text(self, s, width):
        return _bump(s, s.call("exp", f"-{s.call('abs', 'v')} / {width}"))


class Generalised(AbstractExponentialBump):
    """Stribeck bump F = F_b sign(v) exp(−|v/v_s|^δ) (Bo & Pavelescu 1982; δ from 1/2 to 2).

    `stribeck_velocity` v_s, m/s, and `stribeck_exponent` δ are nonlinear; NaN means "to be
    identified".
    """

    stribeck_velocity: Float[Array, ""] | float = UNKNOWN
    stribeck_exponent: Float[Array, ""] | float = UNKNOWN
    nonlinear: ClassVar = (
        STRIBECK_VELOCITY,
        Parameter("stribeck_exponent", DIMENSIONLESS, lambda scales: (0.5, 2.0), logarithmic=False),
    )

    def shape(self, speed):
        return jnp.exp(-self._power(speed / self.stribeck_velocity))

    def fall(self, speed, slowest):
        rise = jnp.expm1(self.stribeck_exponent * jnp.log1p((speed - slowest) / slowest))
        return -self._power(slowest / self.stribeck_velocity) * rise

    def _power(self, ratio):
        # jnp.power is an order of magnitude slower.
        return jnp.exp(self.stribeck_exponent * jnp.log(ratio))

    def text(self, s, width, exponent):
        ratio = f"{s.call('abs', 'v')} / {width}"
        return _bump(s, s.call("exp", f"-{s.raised(ratio, exponent)}"))


def _crossing_bounds(scales):
    """From a third of the slowest slip, which lacks half a percent of a jump, to half the fastest.

    A wider one is no longer told from viscous friction.
    """
    return scales.slowest / 3, 0.5 * scales.fastest


class SmoothCrossing(AbstractLaw):
    """What friction lacks that passes zero speed smoothly: F = −F_s (sign v − tanh(v/v_c)).

    Beside a friction of F_s at zero speed that jumps, it makes F_s tanh(v/v_c) of the jump
    (Andersson, Söderberg & Björklund 2007), as most simulators have it. At `crossing_velocity` v_c,
    m/s, three quarters of F_s have built up.
    """

    crossing_velocity: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("smoothed_force", FORCE),)
    nonlinear: ClassVar = (Parameter("crossing_velocity", VELOCITY, _crossing_bounds),)

    def law(self, sample: Sample):
        # Not as a difference of nearly equal numbers.
        fall = jnp.exp(-2 * jnp.abs(sample.velocity) / self.crossing_velocity)
        return (-jnp.sign(sample.velocity) * 2 * fall / (1 + fall),)

    def text(self, s, width):
        fall = s.call("exp", f"-2.0 * {s.call('abs', 'v')} / {width}")
        return (f"-2.0 * {s.call('sign', 'v')} * {fall} / (1.0 + {fall})",)
