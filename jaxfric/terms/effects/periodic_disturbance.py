"""A tone in time."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...units import FORCE, FREQUENCY
from ..base import AbstractLaw
from ..effect import RECURS, Effect, Waves
from ..position import wave, waves
from ..sample import UNKNOWN, Parameter, Resolution, Sample
from ..text import TURN, literal


def _frequency_bounds(scales):
    """From the slowest that repeats in the record to half of Nyquist's frequency.

    Fewer periods are a drift; above, a force held over a sample is no longer the tone that acts.
    """
    return RECURS / scales.duration, 0.25 / scales.interval


def _record(scales):
    return scales.duration


# As for a pitch: out of step by a cycle over the record, the tone is another one.
_TONES = Resolution(1, 4, _record, 4096)


class PeriodicDisturbance(AbstractLaw):
    """A tone in time: F = A sin(2πf t + φ). `frequency` f, Hz."""

    frequency: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = wave("tone", FORCE)
    nonlinear: ClassVar = (
        Parameter("frequency", FREQUENCY, _frequency_bounds, resolution=_TONES, repeats=True),
    )
    coordinates: ClassVar = frozenset({"time"})

    def law(self, sample: Sample):
        return waves(2 * jnp.pi * self.frequency * sample.time)

    def text(self, s, frequency):
        angle = f"{literal(TURN)} * {frequency} * t"
        return (s.call("sin", angle), s.call("cos", angle))


PERIODIC_DISTURBANCE = Effect(
    "periodic_disturbance",
    "A sin(2πf t + φ)",
    "time",
    "A force periodic in time, {frequency}, amplitude {amplitude}",
    laws=(PeriodicDisturbance,),
    coordinates=("time_lines", "time"),
    confusable_with=("cogging", "load_drift"),
    separate_by="Change the speed: a line in position keeps its pitch, a tone its frequency.",
    momentary=True,
    waves=lambda term: Waves("time", False),
)
