"""An error of the measured position that returns along the stroke, as of an encoder off centre."""

import math
from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...units import DAMPING, INERTIA, POSITION
from ..base import AbstractLaw, AbstractTerm
from ..effect import Derived, Effect, Extent, View
from ..position import any_period, cycles, wave, waves
from ..sample import UNKNOWN, Parameter, Sample
from ..text import TURN, literal


class EncoderError(AbstractLaw):
    """Position that is measured with an error: u = d(M_e v)/dt + B_e v, M_e = A sin(2πx/L + φ),
    and B_e a wave of the same period.

    `encoder_period` L, m. An axis at x is measured at x + e sin(2πx/L + ψ). Its velocity is the
    measured one times 1 − ε cos(2πx/L + ψ), ε = 2πe/L. What an inertia M and viscous friction B
    lack for that, to first order in ε, is a momentum of M_e = −εM cos(2πx/L + ψ), and as much of B.
    """

    encoder_period: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (*wave("encoder", INERTIA), *wave("encoder_viscous", DAMPING))
    nonlinear: ClassVar = (
        Parameter("encoder_period", POSITION, any_period, resolution=cycles(), repeats=True),
    )
    coordinates: ClassVar = frozenset({"position", "velocity", "acceleration"})

    def _waves(self, sample: Sample):
        angle = 2 * jnp.pi * sample.position / self.encoder_period
        return tuple(part * sample.velocity for part in waves(angle))

    def law(self, sample: Sample):
        none = jnp.zeros_like(sample.velocity)
        return (none, none, *self._waves(sample))

    def impulse(self, sample: Sample):
        none = jnp.zeros_like(sample.velocity)
        return (*self._waves(sample), none, none)

    def text(self, s, period):
        # The derivative carried out: u = M_e a + M_e′ v².
        sine, cosine = s.waves("x", period)
        rate = f"{literal(TURN)} / {period} * v * v"
        return (
            f"(a * {sine} + {rate} * {cosine})", f"(a * {cosine} - {rate} * {sine})",
            f"v * {sine}", f"v * {cosine}",
        )  # fmt: skip


# An encoder is off once in a revolution of what it sits on: of a motor that is many in a stroke.
_MOST = 16


def _periods(term: AbstractTerm, view: View) -> np.ndarray:
    """From eight strokes to a sixteenth of one, a quarter of a cycle apart."""
    stroke = float(view.limits.high - view.limits.low)
    every = np.concatenate([2.0 ** np.arange(-3, 0, 0.5), np.arange(1, _MOST, 0.25)])
    return (stroke / every)[:, None]


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
    "d(M_e v)/dt + B_e v, M_e = A sin(2πx/L + φ)",
    "position",
    "The measured position is off by {encoder_error} either way, periodic in position, period "
    "{encoder_period}: an encoder off centre, or an error of its scale or resolver",
    laws=(EncoderError,),
    coordinates=("position_by_acceleration", "position"),
    needs=frozenset({"position"}),
    confusable_with=("position_dependent_inertia", "cogging"),
    separate_by="Compare a second position sensor, or read the encoder against a dial gauge "
    "over one period.",
    grid=_periods,
    derived=_error,
    variant=_without_inertia,
    sizes=("amplitude", "encoder_error"),
    drawn=False,
)
