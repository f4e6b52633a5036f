"""A gap between motor and load."""

import numpy as np

from ..base import AbstractTerm
from ..effect import Effect, View, even, inside, product
from ..transmission import Backlash, ElasticBacklash
from .compliance import coasting


def gaps(term: AbstractTerm, view: View) -> np.ndarray:
    """Gaps and windups from what is crossed in a twentieth of the kernel's reach to the widest."""
    if not isinstance(term, ElasticBacklash):
        return even(term, view)
    low, high = inside(term, view.limits, np.array([[0.0] * 3, [1.0] * 3]))
    least = 0.25 * view.acceleration * (view.reach / 20) ** 2
    least = np.clip(least, low[0], 0.1 * high[0])
    widths, windups = (np.geomspace(least, high[0], n) for n in (10, 7))
    return product([widths, windups, coasting(view)])


BACKLASH = Effect(
    "backlash",
    "−F_L sign(v) inside the gap 2δ, or F_L (T − sign v) − M_L a, T what the flanks push",
    "reversals",
    "After a reversal {backlash_force} of friction is absent while a gap of twice {half_gap} is "
    "crossed: backlash",
    laws=(Backlash, ElasticBacklash),
    coordinates=("distance_since_reversal",),
    needs=frozenset({"position"}),
    confusable_with=("presliding", "compliance", "transport_delay"),
    separate_by="Repeat the motion at half the speed: a delay scales with force rate, a gap does "
    "not.",
    positive=True,
    first_order=True,
    at_reversals=True,
    leftover=True,
    grid=gaps,
    sizes=("backlash_force",),
)
