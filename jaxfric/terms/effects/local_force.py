"""A force at one place, alike in both directions."""

from typing import ClassVar

import numpy as np
from jaxtyping import Array, Float

from ...units import FORCE, POSITION
from ..base import AbstractLaw, AbstractTerm
from ..effect import Effect, View
from ..position import POSITION_ONLY, hump, hump_extent, hump_text, shortest, stroke
from ..sample import UNKNOWN, Parameter, Resolution, Sample
from .sticky_spot import SPOT_WIDTH, places

# Both flanks lie in the stroke: the place is at least so much of it away from either end, and the
# half-width no more than that. Half a hump at an end is a stop, or a cable that begins to pull.
_INSIDE = 0.125


def _within(scales):
    """Where both flanks are seen."""
    margin = _INSIDE * stroke(scales)
    return scales.low + margin, scales.high - margin


def _widths(scales):
    """From two samples at the top speed to what fits in between."""
    return shortest(scales), _INSIDE * stroke(scales)


_PLACE = Resolution(1, 1.5, None, 96, "local_force_width")


class LocalForce(AbstractLaw):
    """A force at one place, alike in both directions: F = A exp(−(x − x₀)²/(2w²)).

    `local_force_position` x₀, m; `local_force_width` w, m, of which both flanks lie in the stroke.
    """

    local_force_position: Float[Array, ""] | float = UNKNOWN
    local_force_width: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("local_force", FORCE),)
    nonlinear: ClassVar = (
        Parameter("local_force_position", POSITION, _within, logarithmic=False, resolution=_PLACE),
        Parameter("local_force_width", POSITION, _widths, resolution=SPOT_WIDTH),
    )
    coordinates: ClassVar = POSITION_ONLY

    def law(self, sample: Sample):
        return (hump(sample.position, self.local_force_position, self.local_force_width),)

    def text(self, s, place, width):
        return (hump_text(s, place, width),)

    def extent(self, values):
        return hump_extent(values["local_force_position"], values["local_force_width"])


def _places(term: AbstractTerm, view: View) -> np.ndarray:
    """Half a width apart, for widths by factors of 1.4.

    Three harmonics of a slow wave fit a hump to 2 % in power. A place a fourth of a width off and
    a width a fifth off leave 5 %: what leaves more would not be refined beside them.
    """
    every = places(view, 0.5, 10)
    (first, last), (_, widest) = _within(view.limits), _widths(view.limits)
    inside = (every[:, 0] >= first) & (every[:, 0] <= last) & (every[:, 1] <= 1.01 * widest)
    return np.minimum(every[inside], [last, widest])


def _pulled(which: str) -> str:
    """The sentence: the force that the axis needs is against the one that acts on it."""
    return (
        "Around {local_force_position}, half-width {local_force_width}, a force of "
        f"{{local_force:size}} acts towards {which} positions, whichever way the axis moves: a "
        "cable chain, a hose or a cover"
    )


LOCAL_FORCE = Effect(
    "local_force",
    "A exp(−(x − x₀)²/(2w²))",
    "position",
    _pulled("smaller"),
    laws=(LocalForce,),
    coordinates=("position",),
    needs=frozenset({"position"}),
    confusable_with=("cogging", "hardening_spring", "gravity_unbalance"),
    separate_by="Cross the place slowly, both ways, and well beyond it on either side.",
    leftover=True,
    local=True,
    vanishes=("local_force_width",),
    grid=_places,
    variant=lambda values, extent: _pulled("larger") if values["local_force"] < 0 else None,
    drawn=False,
)
