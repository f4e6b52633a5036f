"""Elastic stops at the ends of the stroke."""

import math
from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...units import POSITION, STIFFNESS
from ..base import AbstractLaw, AbstractTerm
from ..effect import GRID, Effect, Extent, View
from ..position import POSITION_ONLY, stroke
from ..sample import UNKNOWN, Parameter, Sample

# In parts of the stroke, how much of it a stop may act over. Of less, fewer samples than a fit
# needs would touch it; of more, all but a tenth of its force is a straight spring's.
_LEAST, _MOST = 0.02, 0.85


def _upper(scales):
    return scales.high - _MOST * stroke(scales), scales.high - _LEAST * stroke(scales)


def _lower(scales):
    return scales.low + _LEAST * stroke(scales), scales.low + _MOST * stroke(scales)


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
        f"From {{{side}stop_position}} to the end, over much of the stroke, a force grows by "
        f"{{{side}stop_stiffness}}: a spring, a cable or a bellows that begins to pull there, too "
        "soft for an end stop"
    )


def _places(term: AbstractTerm, view: View) -> np.ndarray:
    """Places as finely as they are near the end: what they differ by is of the way to it."""
    limits = view.limits
    way = (limits.high - limits.low) * np.geomspace(_LEAST, _MOST, GRID)
    return (limits.low + way if isinstance(term, LowerEndStop) else limits.high - way)[:, None]


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
    grid=_places,
    variant=soft,
)
