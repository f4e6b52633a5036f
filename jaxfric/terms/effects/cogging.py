"""Detent force of a motor, or the error of a screw or a gear."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...units import (
    FORCE,
    POSITION,
)
from ..base import AbstractLaw
from ..effect import Effect, Waves, slowly
from ..position import (
    POSITION_ONLY,
    cycles,
    shortest,
    stroke,
    wave,
    waves,
)
from ..sample import UNKNOWN, Parameter, Sample

# A pitch is one that is seen to repeat: a whole period and a quarter in the stroke. What does not
# is a turn of the whole axis.
_REPEATED = 0.8


def _pitch_bounds(scales):
    """From the shortest period that is sampled to the longest that repeats within the stroke."""
    return shortest(scales), _REPEATED * stroke(scales)


class Cogging(AbstractLaw):
    """Detent force of a motor or mesh: F = Σ_n A_n sin(2πn x/p + φ_n), n = 1 … `harmonics`.

    `pitch` p, m (Otten, de Vries, van Amerongen, Rankers & Gaal, "Linear motor motion control
    using a learning feedforward controller", IEEE/ASME Trans. Mechatronics 2(3), 1997).
    """

    pitch: Float[Array, ""] | float = UNKNOWN
    harmonics: int = eqx.field(static=True, default=1)
    coordinates: ClassVar = POSITION_ONLY

    @property
    def affine(self):
        return wave("cogging", FORCE, self.harmonics)

    @property
    def nonlinear(self):
        grid = cycles(self.harmonics)
        return (Parameter("pitch", POSITION, _pitch_bounds, resolution=grid, repeats=True),)

    def law(self, sample: Sample):
        return waves(2 * jnp.pi * sample.position / self.pitch, self.harmonics)

    def text(self, s, pitch):
        return s.waves("x", pitch, self.harmonics)


COGGING = Effect(
    "cogging",
    "Σ A_n sin(2πn x/p + φ_n)",
    "position",
    "A force periodic in position, period {pitch}, amplitude {amplitude}: cogging of a motor, or "
    "the error of a screw or a gear; an unbalance would repeat once per revolution",
    laws=(Cogging,),
    scaled=lambda scales: tuple(Cogging(harmonics=n) for n in (1, 2, 3)),
    coordinates=("position_lines", "position"),
    needs=frozenset({"position"}),
    confusable_with=("periodic_disturbance", "gravity_unbalance"),
    separate_by="Change the speed: a line in position keeps its pitch, a tone its frequency.",
    waves=lambda term: Waves("position", True, harmonics=term.harmonics),
    variant=slowly(
        "pitch",
        "A force varies slowly along the stroke, by {amplitude}: it does not repeat within the "
        "stroke",
    ),
)
