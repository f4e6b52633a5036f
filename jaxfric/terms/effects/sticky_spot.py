"""Extra friction at one place."""

import numpy as np

from ..base import AbstractTerm
from ..effect import Effect, View
from ..position import StickySpot


def spots(term: AbstractTerm, view: View) -> np.ndarray:
    """Places one width apart, for widths by factors of 1.6 from what the kernel resolves."""
    low, high = float(view.limits.low), float(view.limits.high)
    stroke = high - low
    narrowest = np.clip(0.5 * view.speed * view.reach, stroke / 100, stroke / 8)
    widths = np.geomspace(narrowest, stroke / 4, 6)
    return np.array([(at, w) for w in widths for at in np.arange(low + w / 2, high, w)])


STICKY_SPOT = Effect(
    "sticky_spot",
    "sign(v) A exp(−(x − x₀)²/(2w²))",
    "position",
    "Extra friction of {spot_force} around {spot_position}, half-width {spot_width}: a sticky spot",
    laws=(StickySpot,),
    coordinates=("position_by_direction",),
    needs=frozenset({"position"}),
    confusable_with=("position_dependent_friction", "disturbance_pulses"),
    separate_by="Cross the place slowly, both ways, several times.",
    positive=True,
    grid=spots,
)
