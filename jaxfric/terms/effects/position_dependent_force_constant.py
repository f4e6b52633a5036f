"""A force constant that varies slowly along the stroke, as of a voice coil."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ...units import DIMENSIONLESS
from ..actuator import PREDICTED
from ..base import AbstractLaw, AbstractTerm
from ..effect import Effect
from ..position import POSITION_ONLY
from ..sample import Parameter, Sample, Scales
from ..table import reading
from ..text import literal, signed

# Where on the way from the middle of the stroke to its ends polynomials have their parameters.
_WAY = {
    2: {"end": 1.0},
    4: {"half": 1 / 2, "end": 1.0},
    6: {"third": 1 / 3, "two_thirds": 2 / 3, "end": 1.0},
}
_SIDES = {"low": -1.0, "high": 1.0}


def _places(degree: int) -> dict[str, float]:
    """The same from −1 to 1, by name."""
    way = _WAY[degree]
    return {f"{side}_{n}": sign * way[n] for side, sign in _SIDES.items() for n in way}


class PositionDependentForceConstant(AbstractLaw):
    """Force constant that varies along the stroke: u = f + f h(ξ), ξ = (2x − x₁ − x₂)/(x₂ − x₁).

    h is a polynomial of even `degree`, 2, 4 or 6, by its values at both ends and on the way to
    them; it is zero in the middle, since no log shows the gain of the whole force. The force
    constant is 1/(1 + h) of that in the middle. `low` x₁ and `high` x₂, m, the ends of the stroke,
    are given numbers; beyond them the ends' values hold. (Klippel, "Tutorial: loudspeaker
    nonlinearities: causes, parameters, symptoms", J. Audio Eng. Soc. 54(10), 2006: a coil's force
    factor Bl(x).)

    **Raises:** `ValueError` for a low end that is not below the high one, or another degree.
    """

    low: float = eqx.field(static=True, default=-1.0)
    high: float = eqx.field(static=True, default=1.0)
    degree: int = eqx.field(static=True, default=2)
    coordinates: ClassVar = POSITION_ONLY | {PREDICTED}

    def __check_init__(self):
        if self.degree not in _WAY or not self.low < self.high:
            raise ValueError(
                f"PositionDependentForceConstant({self.low}, {self.high}, {self.degree}) needs a "
                "low end below the high one, and the degree 2, 4 or 6."
            )

    @property
    def affine(self):
        return tuple(Parameter(f"command_at_{n}", DIMENSIONLESS) for n in _places(self.degree))

    def law(self, sample: Sample):
        force, middle = reading(sample, PREDICTED), 0.5 * (self.low + self.high)
        place = jnp.clip((sample.position - middle) / (self.high - middle), -1.0, 1.0)
        columns = []
        for at, zeros in _lagrange(self.degree):
            column = force
            for zero in zeros:
                column = column * ((place - zero) / (at - zero))
            columns.append(column)
        return tuple(columns)

    def text(self, s):
        middle = 0.5 * (self.low + self.high)
        place = s.clip(f"(x - {signed(middle)}) / {literal(self.high - middle)}", "-1.0", "1.0")
        return tuple(
            " * ".join(["f", *(f"({place} - {signed(o)}) / {signed(at - o)}" for o in zeros)])
            for at, zeros in _lagrange(self.degree)
        )

    def extent(self, values):
        return {"position": (self.low, self.high)}


def _lagrange(degree: int) -> list[tuple[float, list[float]]]:
    """Where each polynomial of Lagrange's is one, and where it is zero: in the middle they all."""
    places = [*_places(degree).values(), 0.0]
    return [(at, [other for other in places if other != at]) for at in places[:-1]]


# The command of a force constant that falls by a parabola, 1 − c ξ², has a part c² ξ⁴: without it
# the intervals at the ends, narrower than that, would be wrong. A wave of k periods in the stroke
# has less than a fiftieth above the degree πk + 3, which is 6.9 where a `ForceRipple` begins.
DEGREES = (4, 6)


def _shapes(scales: Scales) -> tuple[AbstractTerm, ...]:
    """Polynomials over the stroke."""
    low, high = float(scales.low), float(scales.high)
    ends = (low, high) if low < high else ()  # of an axis that stands still, any
    return tuple(PositionDependentForceConstant(*ends, degree=degree) for degree in DEGREES)


POSITION_DEPENDENT_FORCE_CONSTANT = Effect(
    "position_dependent_force_constant",
    "f Σ c_n ξⁿ, ξ = −1 … 1 along the stroke",
    "actuator",
    "The force constant varies slowly along the stroke: it is {command_at_low_end:gain} at the low "
    "end of the stroke and {command_at_high_end:gain} at the high end than in the middle, as of a "
    "voice coil or a linear motor that leaves its magnets",
    laws=(PositionDependentForceConstant,),
    scaled=_shapes,
    coordinates=("position_by_acceleration", "position_by_direction"),
    needs=frozenset({"position", "predicted_force"}),
    confusable_with=("position_dependent_inertia", "position_dependent_friction", "cogging"),
    composite=True,
    separate_by="Press on a force gauge with one command, at rest, in the middle and near both "
    "ends: inertia and friction of the axis do not show there.",
)
