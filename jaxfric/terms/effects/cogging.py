"""Force that repeats along the axis: detent and force ripple of a motor, the error of a screw."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...units import DIMENSIONLESS, FORCE, POSITION
from ..actuator import PREDICTED
from ..base import AbstractLaw
from ..effect import Effect, Extent, Waves
from ..position import POSITION_ONLY, cycles, shortest, stroke, wave, waves
from ..sample import UNKNOWN, Parameter, Sample
from ..slow import slowly
from ..table import reading

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


class ForceRipple(AbstractLaw):
    """Ripple of the force constant: u = f + f a sin(2πx/p + φ), in parts of the force f delivered.

    `pitch` p, m. A current that is measured with an error of gain repeats twice in an electrical
    period, and phases out of step as often (Jahns & Soong, "Pulsating torque minimization
    techniques for permanent magnet AC motor drives", IEEE Trans. Ind. Electron. 43(2), 1996). A
    detent is as large at rest.
    """

    pitch: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = wave("ripple", DIMENSIONLESS)
    nonlinear: ClassVar = (
        Parameter("pitch", POSITION, _pitch_bounds, resolution=cycles(), repeats=True),
    )
    coordinates: ClassVar = POSITION_ONLY | {PREDICTED}

    def law(self, sample: Sample):
        force = reading(sample, PREDICTED)
        return tuple(force * part for part in waves(2 * jnp.pi * sample.position / self.pitch))

    def text(self, s, pitch):
        return tuple(f"f * {wave}" for wave in s.waves("x", pitch))


def _over_position(term: Cogging | ForceRipple) -> Waves:
    if isinstance(term, ForceRipple):
        return Waves("position", True, PREDICTED)
    return Waves("position", True, harmonics=term.harmonics)


_slowly = slowly(
    "pitch",
    "A force varies slowly along the stroke",
    "; it does not repeat within the stroke",
)


def _variant(values: Mapping[str, float], extent: Extent) -> str | None:
    if "ripple_sin" not in values:
        return _slowly(values, extent)
    return (
        "The force differs from what is commanded by {amplitude} of it, periodic in position, "
        "period {pitch}: force ripple of a motor, or an error of its current's measurement"
    )


COGGING = Effect(
    "cogging",
    "Σ A_n sin(2πn x/p + φ_n), or f a sin(2πx/p + φ)",
    "position",
    "A force periodic in position, period {pitch}, amplitude {amplitude}: cogging of a motor, or "
    "the error of a screw or a gear; an unbalance would repeat once per revolution",
    laws=(Cogging, ForceRipple),
    scaled=lambda scales: (*(Cogging(harmonics=n) for n in (1, 2, 3)), ForceRipple()),
    coordinates=("position_lines", "position"),
    needs=frozenset({"position"}),
    confusable_with=("periodic_disturbance", "gravity_unbalance"),
    separate_by="Change the speed: a line in position keeps its pitch, a tone its frequency.",
    waves=_over_position,
    variant=_variant,
)
