"""Elastic stops at the ends of the stroke."""

import math
from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...units import POSITION, STIFFNESS
from ..base import AbstractLaw
from ..effect import Effect, Extent
from ..position import POSITION_ONLY, stroke
from ..sample import UNKNOWN, Parameter, Sample


def _upper(scales):
    """In the upper half of the stroke: what presses over more of it is a spring, and no stop.

    Not in the outermost 2 %, where fewer samples than a fit needs would touch it.
    """
    return scales.high - 0.5 * stroke(scales), scales.high - 0.02 * stroke(scales)


def _lower(scales):
    """In the lower half of the stroke, likewise."""
    return scales.low + 0.02 * stroke(scales), scales.low + 0.5 * stroke(scales)


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


def place(upper: bool) -> str:
    """The name of the parameter that says where the stop of an end is."""
    return (EndStop if upper else LowerEndStop).nonlinear[0].name


# A stop is met at the end: what acts over more than this part of the stroke is something else.
ABRUPT = 0.25
# Over half of that, too, where at the end it is less than this part of the usual force.
FAINT = 0.25


def soft(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence for either end, and another one for what acts over too much of the stroke."""
    lower = place(upper=False) in values
    side = "lower_" if lower else ""
    at, stiffness = (values.get(f"{side}stop_{name}") for name in ("position", "stiffness"))
    if at is None or stiffness is None:
        return None
    reach = abs((extent.low if lower else extent.high) - at)
    part = reach * abs(stiffness) / extent.force
    most = ABRUPT if part > FAINT or math.isnan(part) else 0.5 * ABRUPT
    if not reach > most * extent.stroke:
        return END_STOP.sentence.replace("{", f"{{{side}")
    return (
        f"Towards the end of the stroke a force rises slowly, from {{{side}stop_position}} on by "
        f"{{{side}stop_stiffness}}: a slow variation along the stroke, too soft for an end stop"
    )


END_STOP = Effect(
    "end_stop",
    "k max(x − x_s, 0)",
    "position",
    "From {stop_position} to the end of the stroke a force grows by {stop_stiffness}: an elastic "
    "end stop",
    laws=(EndStop, LowerEndStop),
    coordinates=("position",),
    needs=frozenset({"position"}),
    confusable_with=("hardening_spring", "spring"),
    separate_by="Turn the motion round shortly before the suspected stop.",
    positive=True,
    several=True,
    variant=soft,
)
