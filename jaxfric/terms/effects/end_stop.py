"""Elastic stops at the ends of the stroke."""

import math
from collections.abc import Mapping

from ..effect import Effect, Extent
from ..position import EndStop, LowerEndStop

# A stop is met at the end: what acts over more than this part of the stroke is something else.
ABRUPT = 0.25
# Over half of that, too, where at the end it is less than this part of the usual force.
FAINT = 0.25


def soft(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence for either end, and another one for what acts over too much of the stroke."""
    lower = "lower_stop_position" in values
    side = "lower_" if lower else ""
    place, stiffness = (values.get(f"{side}stop_{name}") for name in ("position", "stiffness"))
    if place is None or stiffness is None:
        return None
    reach = abs((extent.low if lower else extent.high) - place)
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
