"""Forces that depend on where the axis is.

Every bound is a length that the recording itself gives: the stroke (range of the position), or
the distance between two samples. `sin` and `cos` amplitudes are affine; amplitude and phase of a
wave follow from them: A = √(a_sin² + a_cos²), φ = atan2(a_cos, a_sin).
"""

import math
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ..units import FORCE, Dimension
from .base import AbstractLaw
from .sample import Parameter, Resolution, Sample
from .text import Syntax, literal

POSITION_ONLY = frozenset({"position"})
WITH_DIRECTION = frozenset({"position", "velocity"})


def shortest(scales):
    """Two samples at the top speed: a shorter period is aliased there."""
    return 2 * scales.fastest * scales.interval


def stroke(scales):
    """The range of the position."""
    return scales.high - scales.low


def any_period(scales):
    """From two samples at the top speed to eight strokes: as a pitch, or longer than the stroke."""
    return shortest(scales), 8 * stroke(scales)


def within(scales):
    """Somewhere in the stroke: outside, the place leaves no trace."""
    return scales.low, scales.high


# A wave of a period a little off falls out of step by the end of the stroke: the cost's minimum is
# one cycle more or less wide, and four points a cycle leave no more than an eighth of one.
_PER_CYCLE = 4


def cycles(harmonics: int = 1) -> Resolution:
    """The grid of a period that is seen over the stroke, with its harmonics."""
    return Resolution(-1, _PER_CYCLE * harmonics, stroke, 1024 * harmonics)


def wave(name: str, dimension: Dimension, harmonics: int = 1) -> tuple[Parameter, ...]:
    """Affine parameters of a wave: sine and cosine amplitude of each harmonic."""
    stems = [name if n == 1 else f"{name}_harmonic{n}" for n in range(1, harmonics + 1)]
    return tuple(Parameter(f"{s}_{part}", dimension) for s in stems for part in ("sin", "cos"))


def waves(argument, harmonics: int = 1):
    """sin(n θ) and cos(n θ) of an angle θ = `argument`, rad, for n = 1 … `harmonics`."""
    return tuple(f(n * argument) for n in range(1, harmonics + 1) for f in (jnp.sin, jnp.cos))


def hump(position, place, width):
    """exp(−(x − x₀)²/(2w²)) of a `place` x₀ and a half-width w, m."""
    return jnp.exp(-0.5 * ((position - place) / width) ** 2)


def hump_text(s: Syntax, place: str, width: str) -> str:
    """The same in a language's own words, of the position x."""
    away = f"((x - {place}) / {width})"
    return s.call("exp", f"-0.5 * {away} * {away}")


def hump_extent(place: float, width: float) -> dict[str, tuple[float, float]]:
    """Where a hump is more than 3e-4 of its height."""
    return {"position": (place - 4 * width, place + 4 * width)}


class Gravity(AbstractLaw):
    """Weight of an eccentric mass on the turning axis itself: u = G sin(2πx/L + φ), L one turn.

    `turn` L is a given number: 2π rad, 360°, or one revolution.
    """

    turn: float = eqx.field(static=True, default=2 * math.pi)
    affine: ClassVar = wave("gravity", FORCE)
    coordinates: ClassVar = POSITION_ONLY

    def law(self, sample: Sample):
        return waves(2 * jnp.pi * sample.position / self.turn)

    def extent(self, values):
        return {"position": (0.0, self.turn)}

    def text(self, s):
        return s.waves("x", literal(self.turn))
