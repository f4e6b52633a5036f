"""More or less friction at one place."""

from collections.abc import Mapping
from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...units import FORCE, POSITION
from ..base import AbstractLaw, AbstractTerm
from ..effect import Effect, Extent, View
from ..position import WITH_DIRECTION, hump, hump_extent, hump_text, shortest, stroke, within
from ..sample import UNKNOWN, Burden, Parameter, Resolution, Sample


def _spot_bounds(scales):
    """From two samples at the top speed to a quarter of the stroke, beyond which it is no spot."""
    return shortest(scales), 0.25 * stroke(scales)


# Two spots one width apart overlap by exp(−1/4) = 0.8; 1.5 points a width and two widths an octave
# leave no spot without a neighbour that overlaps it by 0.9.
_BY_WIDTH = Resolution(1, 1.5, None, 96, "spot_width")


SPOT_WIDTH = Resolution(0, 2, None, 12)


class StickySpot(AbstractLaw):
    """More or, where A < 0, less friction at one place: F = A sign(v) exp(−(x − x₀)²/(2w²)).

    `spot_position` x₀, m; `spot_width` w, m. Less is no more than the friction that there is.
    """

    spot_position: Float[Array, ""] | float = UNKNOWN
    spot_width: Float[Array, ""] | float = UNKNOWN
    sided: ClassVar = True
    affine: ClassVar = (Parameter("spot_force", FORCE),)
    nonlinear: ClassVar = (
        Parameter("spot_position", POSITION, within, logarithmic=False, resolution=_BY_WIDTH),
        Parameter("spot_width", POSITION, _spot_bounds, resolution=SPOT_WIDTH),
    )
    coordinates: ClassVar = WITH_DIRECTION

    def law(self, sample: Sample):
        spot = hump(sample.position, self.spot_position, self.spot_width)
        return (jnp.sign(sample.velocity) * spot,)

    def text(self, s, place, width):
        return (f"{s.call('sign', 'v')} * {hump_text(s, place, width)}",)

    def burden(self, beta, alpha) -> Burden | None:
        return Burden(0.0, -float(alpha[0])) if alpha[0] < 0 else None

    def extent(self, values):
        return hump_extent(values["spot_position"], values["spot_width"])


def places(view: View, apart: float, count: int) -> np.ndarray:
    """Places so many widths apart, for some widths from what the kernel resolves, `(G, 2)`."""
    low, high = float(view.limits.low), float(view.limits.high)
    stroke = high - low
    narrowest = np.clip(0.5 * view.speed * view.reach, stroke / 100, stroke / 8)
    widths = np.geomspace(narrowest, stroke / 4, count)
    ends = [(low + 0.5 * apart * w, apart * w) for w in widths]
    return np.array([
        (at, w)
        for w, (first, step) in zip(widths, ends, strict=True)
        for at in np.arange(first, high, step)
    ])  # fmt: skip


def spots(term: AbstractTerm, view: View) -> np.ndarray:
    """Places one width apart, for widths by factors of 1.6 from what the kernel resolves."""
    return places(view, 1.0, 6)


def _slippery(values: Mapping[str, float], extent: Extent) -> str | None:
    if values["spot_force"] >= 0:
        return None
    return (
        "Friction is lower by {spot_force:size} around {spot_position}, half-width {spot_width}: a "
        "worn or a well-greased place"
    )


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
    grid=spots,
    variant=_slippery,
)
