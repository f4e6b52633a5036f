"""Springs along the stroke."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from ...units import POSITION, STIFFNESS, Dimension
from ..base import AbstractLaw
from ..effect import Effect, Extent
from ..position import POSITION_ONLY, within
from ..sample import UNKNOWN, Parameter, Sample
from ..text import signed


class Spring(AbstractLaw):
    """Linear spring: F = k (x − x₀).

    `rest` x₀, m, is a given number: moving it adds a constant, which the offset or the two
    Coulomb levels take up. A place inside the stroke keeps that constant small: the position's
    zero, if it is there.
    """

    rest: float = eqx.field(static=True, default=0.0)
    in_joint: ClassVar = "spring"
    affine: ClassVar = (Parameter("stiffness", STIFFNESS),)
    coordinates: ClassVar = POSITION_ONLY

    def law(self, sample: Sample):
        return (sample.position - self.rest,)

    def text(self, s):
        return (f"(x - {signed(self.rest)})",)


class HardeningSpring(AbstractLaw):
    """Cubic part of a spring: F = k₃ (x − x₀)³ (Duffing 1918).

    `spring_centre` x₀, m, lies in the stroke.
    """

    spring_centre: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("cubic_stiffness", Dimension(force=1, position=-3)),)
    nonlinear: ClassVar = (Parameter("spring_centre", POSITION, within, logarithmic=False),)
    coordinates: ClassVar = POSITION_ONLY

    def law(self, sample: Sample):
        return ((sample.position - self.spring_centre) ** 3,)

    def text(self, s, centre):
        away = f"(x - {centre})"
        return (f"{away} * {away} * {away}",)


def _from_an_end(values: Mapping[str, float], extent: Extent) -> str | None:
    if extent.low <= 0 <= extent.high:
        return None
    return (
        "A force proportional to the distance from the end of the stroke that is nearest to zero, "
        "{stiffness}: a spring"
    )


SPRING = Effect(
    "spring",
    "k (x − x₀)",
    "position",
    "A force proportional to position, {stiffness}: a spring",
    variant=_from_an_end,
    laws=(Spring,),
    scaled=lambda scales: (Spring(float(np.clip(0.0, scales.low, scales.high))),),
    coordinates=("position",),
    needs=frozenset({"position"}),
    confusable_with=("gravity_unbalance", "hardening_spring", "end_stop"),
    separate_by="Use the whole stroke: the shapes part at its ends.",
)
HARDENING_SPRING = Effect(
    "hardening_spring",
    "k₃ (x − x₀)³",
    "position",
    "A force that grows with the cube of position, {cubic_stiffness} about {spring_centre}: a "
    "hardening spring",
    laws=(HardeningSpring,),
    coordinates=("position",),
    needs=frozenset({"position"}),
    confusable_with=("spring", "end_stop", "gravity_unbalance"),
    separate_by="Use the whole stroke: the shapes part at its ends.",
)
