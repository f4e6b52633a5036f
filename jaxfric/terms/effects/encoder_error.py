"""An error of the measured position that returns along the stroke, as of an encoder off centre."""

import math
from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...units import FREQUENCY, INERTIA, POSITION
from ..base import AbstractLaw, AbstractTerm
from ..effect import Derived, Effect, Extent, View
from ..position import cycles, shortest, stroke, wave, waves
from ..sample import UNKNOWN, Parameter, Resolution, Sample
from ..text import TURN, literal


def _seen(scales):
    """From two samples at the top speed to the stroke: of less than a period nobody can tell what
    returns from what varies.
    """
    return shortest(scales), stroke(scales)


def _rates(scales):
    """From a tenth of what dies out in the record to what dies out from sample to sample."""
    return 0.1 / scales.duration, 1 / scales.interval


class EncoderError(AbstractLaw):
    """Position that is measured with an error: u = d(M_e v)/dt + r M_e v, M_e = A sin(2πx/L + φ).

    `encoder_period` L, m; `encoder_rate` r, 1/s, of viscous friction by inertia. An axis at x is
    measured at x + e sin(2πx/L + ψ). Its velocity is the measured one times 1 − ε cos(2πx/L + ψ),
    ε = 2πe/L. What an inertia M and viscous friction rM lack for that, to first order in ε, is the
    momentum of M_e = −εM cos(2πx/L + ψ), and r times as much of a force.
    """

    encoder_period: Float[Array, ""] | float = UNKNOWN
    encoder_rate: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = wave("encoder", INERTIA)
    nonlinear: ClassVar = (
        Parameter("encoder_period", POSITION, _seen, resolution=cycles(), repeats=True),
        Parameter("encoder_rate", FREQUENCY, _rates, resolution=Resolution(0, 0.5, None, 8)),
    )
    coordinates: ClassVar = frozenset({"position", "velocity", "acceleration"})

    def law(self, sample: Sample):
        return tuple(self.encoder_rate * part for part in self.impulse(sample))

    def impulse(self, sample: Sample):
        angle = 2 * jnp.pi * sample.position / self.encoder_period
        return tuple(part * sample.velocity for part in waves(angle))

    def text(self, s, period, rate):
        # The derivative carried out: u = M_e (a + r v) + M_e′ v².
        sine, cosine = s.waves("x", period)
        still, bent = f"(a + {rate} * v)", f"{literal(TURN)} / {period} * v * v"
        return (
            f"({still} * {sine} + {bent} * {cosine})",
            f"({still} * {cosine} - {bent} * {sine})",
        )


_MOST = 16
# Viscous friction by what the inertia takes, about the usual speed and acceleration.
_VISCOUS = 0.1, 0.5, 2.5


def _places(term: AbstractTerm, view: View) -> np.ndarray:
    """Periods from one stroke to a sixteenth of it, a quarter of a cycle apart, and of an axis that
    turns a revolution and half of one, for three rates.
    """
    periods = view.with_turns(float(view.limits.high - view.limits.low) / np.arange(1, _MOST, 0.25))
    low, high = (float(end) for end in _rates(view.limits))
    usual = view.acceleration / max(view.speed, 1e-300)
    rates = np.unique(np.clip(np.multiply(_VISCOUS, usual), low, high))
    return np.array([(period, rate) for rate in rates for period in periods])


def _error(values: Mapping[str, float], extent: Extent) -> dict[str, Derived]:
    """How far the position is off, where the axis's inertia is known."""
    if not extent.inertia > 0:
        return {}
    factor = values["encoder_period"] / (2 * math.pi * extent.inertia)
    return {"encoder_error": Derived("amplitude", factor, POSITION)}


def _without_inertia(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence where that is not known."""
    if extent.inertia > 0:
        return None
    return (
        "The measured position has an error, periodic in position, period {encoder_period}, by "
        "which the inertia seems to vary by {amplitude}: an encoder off centre, or an error of its "
        "scale or resolver"
    )


ENCODER_ERROR = Effect(
    "encoder_error",
    "d(M_e v)/dt + r M_e v, M_e = A sin(2πx/L + φ)",
    "position",
    "The measured position is off by {encoder_error} either way, periodic in position, period "
    "{encoder_period}: an encoder off centre, or an error of its scale or resolver",
    laws=(EncoderError,),
    coordinates=("position_by_acceleration", "position"),
    needs=frozenset({"position"}),
    confusable_with=("position_dependent_inertia", "cogging"),
    separate_by="Compare a second position sensor, or read the encoder against a dial gauge "
    "over one period.",
    grid=_places,
    derived=_error,
    variant=_without_inertia,
    sizes=("amplitude", "encoder_error"),
    drawn=False,
)
