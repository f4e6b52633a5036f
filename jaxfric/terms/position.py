"""Forces that depend on where the axis is.

Every bound is a length that the recording itself gives: the stroke (range of the position), or
the distance between two samples. `sin` and `cos` amplitudes are affine; amplitude and phase of a
wave follow from them: A = √(a_sin² + a_cos²), φ = atan2(a_cos, a_sin).
"""

import math
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..units import FORCE, INERTIA, POSITION, STIFFNESS, Dimension
from .base import AbstractLaw
from .sample import Parameter, Resolution, Sample
from .text import TURN, literal, signed

UNKNOWN = float("nan")
POSITION_ONLY = frozenset({"position"})
WITH_DIRECTION = frozenset({"position", "velocity"})


def _shortest(scales):
    """Two samples at the top speed: a shorter period is aliased there."""
    return 2 * scales.fastest * scales.interval


def _stroke(scales):
    return scales.high - scales.low


# A pitch is one that is seen to repeat: a whole period and a quarter in the stroke. What does not
# is a turn of the whole axis.
_REPEATED = 0.8


def _pitch_bounds(scales):
    """From the shortest period that is sampled to the longest that repeats within the stroke."""
    return _shortest(scales), _REPEATED * _stroke(scales)


def _long_bounds(scales):
    """From the longest period that repeats within the stroke to eight strokes.

    There the sine spans ±π/8 about its middle and differs from a parabola by (π/8)³/6 = 1 %: a
    longer period can no longer be told.
    """
    return _stroke(scales), 8 * _stroke(scales)


def _any_period(scales):
    """All of the two ranges above: short as a pitch, or longer than the stroke."""
    return _shortest(scales), 8 * _stroke(scales)


def _inside(scales):
    """Somewhere in the stroke: outside, the place leaves no trace."""
    return scales.low, scales.high


def _spot_bounds(scales):
    """From two samples at the top speed to a quarter of the stroke, beyond which it is no spot."""
    return _shortest(scales), 0.25 * _stroke(scales)


# A wave of a period a little off falls out of step by the end of the stroke: the cost's minimum is
# one cycle more or less wide, and four points a cycle leave no more than an eighth of one.
_PER_CYCLE = 4


def _cycles(harmonics: int = 1) -> Resolution:
    """The grid of a period that is seen over the stroke, with its harmonics."""
    return Resolution(-1, _PER_CYCLE * harmonics, _stroke, 1024 * harmonics)


def wave(name: str, dimension: Dimension, harmonics: int = 1) -> tuple[Parameter, ...]:
    """Affine parameters of a wave: sine and cosine amplitude of each harmonic."""
    stems = [name if n == 1 else f"{name}_harmonic{n}" for n in range(1, harmonics + 1)]
    return tuple(Parameter(f"{s}_{part}", dimension) for s in stems for part in ("sin", "cos"))


def waves(argument, harmonics: int = 1):
    """sin(n θ) and cos(n θ) of an angle θ = `argument`, rad, for n = 1 … `harmonics`."""
    return tuple(f(n * argument) for n in range(1, harmonics + 1) for f in (jnp.sin, jnp.cos))


# Less than a cycle: what is told apart are the curvatures of its pieces, not their phases.
_LONG = Resolution(-1, 16, _stroke, 16)
# Two spots one width apart overlap by exp(−1/4) = 0.8; 1.5 points a width and two widths an octave
# leave no spot without a neighbour that overlaps it by 0.9.
_BY_WIDTH = Resolution(1, 1.5, None, 96, "spot_width")
_WIDTH = Resolution(0, 2, None, 12)


class GravityUnbalance(AbstractLaw):
    """Weight of an eccentric mass, hardly a turn a stroke: F = A sin(2πx/L + φ).

    `unbalance_period` L, m (2π rad on the turning axis itself). The force's constant part cannot
    be told from an [`Offset`][jaxfric.terms.Offset].
    """

    unbalance_period: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = wave("unbalance", FORCE)
    nonlinear: ClassVar = (
        Parameter("unbalance_period", POSITION, _long_bounds, resolution=_LONG, repeats=True),
    )
    coordinates: ClassVar = POSITION_ONLY

    def law(self, sample: Sample):
        return waves(2 * jnp.pi * sample.position / self.unbalance_period)

    def text(self, s, period):
        return s.waves("x", period)


class Gravity(AbstractLaw):
    """Weight of an eccentric mass on the turning axis itself: u = G sin(2πx/L + φ), L one turn.

    `turn` L is a given number: 2π rad, 360°, or one revolution.
    """

    turn: float = eqx.field(static=True, default=2 * math.pi)
    affine: ClassVar = wave("gravity", FORCE)
    coordinates: ClassVar = POSITION_ONLY

    def law(self, sample: Sample):
        return waves(2 * jnp.pi * sample.position / self.turn)


class Cogging(AbstractLaw):
    """Detent force of a motor or mesh: F = Σ_n A_n sin(2πn x/p + φ_n), n = 1 … `harmonics`.

    `pitch` p, m (Otten, de Vries, van Amerongen, Rankers & Gaal, "Linear motor motion control
    using a learning feedforward controller", IEEE/ASME Trans. Mechatronics 2(3), 1997).
    """

    pitch: Float[Array, ""] | float = UNKNOWN
    harmonics: int = eqx.field(static=True, default=1)
    coordinates: ClassVar = POSITION_ONLY

    @property
    def affine(self):
        return wave("cogging", FORCE, self.harmonics)

    @property
    def nonlinear(self):
        grid = _cycles(self.harmonics)
        return (Parameter("pitch", POSITION, _pitch_bounds, resolution=grid, repeats=True),)

    def law(self, sample: Sample):
        return waves(2 * jnp.pi * sample.position / self.pitch, self.harmonics)

    def text(self, s, pitch):
        return s.waves("x", pitch, self.harmonics)


class Spring(AbstractLaw):
    """Linear spring: F = k (x − x₀).

    `rest` x₀, m, is a given number: moving it adds a constant, which the offset or the two
    Coulomb levels take up. A place inside the stroke keeps that constant small.
    """

    rest: float = eqx.field(static=True, default=0.0)
    in_joint: ClassVar = "spring"
    affine: ClassVar = (Parameter("stiffness", STIFFNESS),)
    coordinates: ClassVar = POSITION_ONLY

    def law(self, sample: Sample):
        return (sample.position - self.rest,)

    def text(self, s):
        return (f"(x - {signed(self.rest)})",)


class HardeningSpring(AbstractLaw):
    """Cubic part of a spring: F = k₃ (x − x₀)³ (Duffing 1918).

    `spring_centre` x₀, m, lies in the stroke.
    """

    spring_centre: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("cubic_stiffness", Dimension(force=1, position=-3)),)
    nonlinear: ClassVar = (Parameter("spring_centre", POSITION, _inside, logarithmic=False),)
    coordinates: ClassVar = POSITION_ONLY

    def law(self, sample: Sample):
        return ((sample.position - self.spring_centre) ** 3,)

    def text(self, s, centre):
        away = f"(x - {centre})"
        return (f"{away} * {away} * {away}",)


def _upper(scales):
    """In the upper half of the stroke: what presses over more of it is a spring, and no stop.

    Not in the outermost 2 %, where fewer samples than a fit needs would touch it.
    """
    return scales.high - 0.5 * _stroke(scales), scales.high - 0.02 * _stroke(scales)


def _lower(scales):
    """In the lower half of the stroke, likewise."""
    return scales.low + 0.02 * _stroke(scales), scales.low + 0.5 * _stroke(scales)


class EndStop(AbstractLaw):
    """Elastic stop at the upper end of the stroke: F = k max(x − x_s, 0).

    `stop_position` x_s, m. [`LowerEndStop`][] is its mirror image.
    """

    stop_position: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("stop_stiffness", STIFFNESS),)
    nonlinear: ClassVar = (Parameter("stop_position", POSITION, _upper, logarithmic=False),)
    coordinates: ClassVar = POSITION_ONLY

    def law(self, sample: Sample):
        return (jnp.maximum(sample.position - self.stop_position, 0.0),)

    def text(self, s, place):
        return (s.call("max", f"x - {place}", "0.0"),)


class LowerEndStop(AbstractLaw):
    """Elastic stop at the lower end of the stroke: F = k min(x − x_s, 0).

    `lower_stop_position` x_s, m.
    """

    lower_stop_position: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("lower_stop_stiffness", STIFFNESS),)
    nonlinear: ClassVar = (Parameter("lower_stop_position", POSITION, _lower, logarithmic=False),)
    coordinates: ClassVar = POSITION_ONLY

    def law(self, sample: Sample):
        return (jnp.minimum(sample.position - self.lower_stop_position, 0.0),)

    def text(self, s, place):
        return (s.call("min", f"x - {place}", "0.0"),)


class PositionDependentFriction(AbstractLaw):
    """Coulomb level that varies along the stroke: F = A sin(2πx/L + φ) sign(v).

    `friction_period` L, m.
    """

    friction_period: Float[Array, ""] | float = UNKNOWN
    sided: ClassVar = True
    affine: ClassVar = wave("friction", FORCE)
    nonlinear: ClassVar = (
        Parameter("friction_period", POSITION, _any_period, resolution=_cycles(), repeats=True),
    )
    coordinates: ClassVar = WITH_DIRECTION

    def law(self, sample: Sample):
        angle = 2 * jnp.pi * sample.position / self.friction_period
        return tuple(jnp.sign(sample.velocity) * part for part in waves(angle))

    def text(self, s, period):
        return tuple(f"{s.call('sign', 'v')} * {wave}" for wave in s.waves("x", period))


class StickySpot(AbstractLaw):
    """Extra friction at one place: F = A sign(v) exp(−(x − x₀)²/(2w²)).

    `spot_position` x₀, m; `spot_width` w, m.
    """

    spot_position: Float[Array, ""] | float = UNKNOWN
    spot_width: Float[Array, ""] | float = UNKNOWN
    sided: ClassVar = True
    affine: ClassVar = (Parameter("spot_force", FORCE),)
    nonlinear: ClassVar = (
        Parameter("spot_position", POSITION, _inside, logarithmic=False, resolution=_BY_WIDTH),
        Parameter("spot_width", POSITION, _spot_bounds, resolution=_WIDTH),
    )
    coordinates: ClassVar = WITH_DIRECTION

    def law(self, sample: Sample):
        distance = (sample.position - self.spot_position) / self.spot_width
        return (jnp.sign(sample.velocity) * jnp.exp(-0.5 * distance**2),)

    def text(self, s, place, width):
        away = f"((x - {place}) / {width})"
        return (f"{s.call('sign', 'v')} * {s.call('exp', f'-0.5 * {away} * {away}')}",)

    def extent(self, values):
        at, reach = values["spot_position"], 4 * values["spot_width"]
        return {"position": (at - reach, at + reach)}


class PositionDependentInertia(AbstractLaw):
    """Inertia that varies along the stroke: u = d(M₁v)/dt − ½ M₁′v², M₁ = A sin(2πx/L + φ).

    Lagrange's equation for the kinetic energy ½ M₁(x) v². `inertia_period` L, m.
    """

    inertia_period: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = wave("inertia", INERTIA)
    nonlinear: ClassVar = (
        Parameter("inertia_period", POSITION, _any_period, resolution=_cycles(), repeats=True),
    )
    coordinates: ClassVar = frozenset({"position", "velocity", "acceleration"})

    def law(self, sample: Sample):
        rate = 2 * jnp.pi / self.inertia_period
        sine, cosine = waves(rate * sample.position)
        half = 0.5 * rate * sample.velocity**2
        return (-half * cosine, half * sine)

    def impulse(self, sample: Sample):
        angle = 2 * jnp.pi * sample.position / self.inertia_period
        return tuple(part * sample.velocity for part in waves(angle))

    def text(self, s, period):
        # The derivative carried out: u = M₁ a + ½ M₁′ v².
        sine, cosine = s.waves("x", period)
        half = f"{literal(0.5 * TURN)} / {period} * v * v"
        return (f"(a * {sine} + {half} * {cosine})", f"(a * {cosine} - {half} * {sine})")
