"""An eccentric mass on a turning axis."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...units import FORCE, POSITION
from ..base import AbstractLaw, AbstractTerm
from ..effect import REPEATED, Effect, Extent
from ..position import POSITION_ONLY, Gravity, stroke, wave, waves
from ..sample import UNKNOWN, Parameter, Resolution, Sample
from ..slow import slowly

# Of so many strokes a sine spans ±π/8 about its middle and differs from a parabola by
# (π/8)³/6 = 1 %: a longer period can no longer be told.
STROKES = 8


def _long_bounds(scales):
    """From the longest period that repeats within the stroke, [`REPEATED`][], to the longest one
    that can be told.
    """
    return stroke(scales) / REPEATED, STROKES * stroke(scales)


# Hardly more than a cycle: what is told apart are the curvatures of its pieces, not their phases.
_LONG = Resolution(-1, 16, stroke, 16)


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


def _once_a_turn(
    term: GravityUnbalance, base: AbstractTerm, turn: float | None
) -> tuple[AbstractTerm, ...]:
    """On a turning axis also the weight whose period is one revolution."""
    return (term,) if turn is None else (term, Gravity(turn))


def _told(values: Mapping[str, float], extent: Extent) -> str | None:
    if "unbalance_period" not in values:
        return (
            "A force that repeats once per revolution, amplitude {amplitude}: gravity on an "
            "eccentric mass, or the run-out of a gear"
        )
    return _slowly(values, extent)


_slowly = slowly(
    "unbalance_period",
    "A force varies slowly along the stroke",
    "; it does not repeat within the stroke, so that a spring or a cable would look the same",
)

GRAVITY_UNBALANCE = Effect(
    "gravity_unbalance",
    "A sin(2πx/L + φ)",
    "position",
    "A force that follows position with a period of {unbalance_period}, amplitude {amplitude}: "
    "gravity on an eccentric mass",
    laws=(GravityUnbalance,),
    coordinates=("position",),
    needs=frozenset({"position"}),
    confusable_with=("spring", "hardening_spring", "cogging"),
    separate_by="Use the whole stroke: an unbalance is periodic, a spring is not.",
    suited=_once_a_turn,
    variant=_told,
)
