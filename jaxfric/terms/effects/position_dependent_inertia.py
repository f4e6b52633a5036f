"""Inertia that varies along the stroke."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...units import INERTIA, POSITION
from ..base import AbstractLaw, AbstractTerm
from ..effect import Effect, View
from ..position import any_period, cycles, wave, waves
from ..sample import UNKNOWN, Parameter, Sample
from ..slow import slowly
from ..text import TURN, literal


class PositionDependentInertia(AbstractLaw):
    """Inertia that varies along the stroke: u = d(M₁v)/dt − ½ M₁′v², M₁ = A sin(2πx/L + φ).

    Lagrange's equation for the kinetic energy ½ M₁(x) v². `inertia_period` L, m.
    """

    inertia_period: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = wave("inertia", INERTIA)
    nonlinear: ClassVar = (
        Parameter("inertia_period", POSITION, any_period, resolution=cycles(), repeats=True),
    )
    coordinates: ClassVar = frozenset({"position", "velocity", "acceleration"})

    def law(self, sample: Sample):
        rate = 2 * jnp.pi / self.inertia_period
        sine, cosine = waves(rate * sample.position)
        half = 0.5 * rate * sample.velocity**2
        return (-half * cosine, half * sine)

    def impulse(self, sample: Sample):
        angle = 2 * jnp.pi * sample.position / self.inertia_period
        return tuple(part * sample.velocity for part in waves(angle))

    def text(self, s, period):
        # The derivative carried out: u = M₁ a + ½ M₁′ v².
        sine, cosine = s.waves("x", period)
        half = f"{literal(0.5 * TURN)} / {period} * v * v"
        return (f"(a * {sine} + {half} * {cosine})", f"(a * {cosine} - {half} * {sine})")


def periods(term: AbstractTerm, view: View) -> np.ndarray:
    """From eight strokes to an eighth of one, and of an axis that turns, as a crank does, a
    revolution and half of one.
    """
    stroke = view.limits.high - view.limits.low
    cycles = np.concatenate([2.0 ** np.arange(-3, 0, 0.5), np.arange(1, 8, 0.25)])
    return view.with_turns(stroke / cycles)[:, None]


POSITION_DEPENDENT_INERTIA = Effect(
    "position_dependent_inertia",
    "d(M₁v)/dt − ½ M₁′v², M₁ = A sin(2πx/L + φ)",
    "position",
    "Inertia varies along the stroke by {amplitude}, with a period of {inertia_period}",
    laws=(PositionDependentInertia,),
    coordinates=("position_by_acceleration",),
    needs=frozenset({"position"}),
    confusable_with=("gravity_unbalance", "position_dependent_force_constant"),
    separate_by="Cross the stroke at two accelerations: a weight does not scale with them. A "
    "position that is off once a turn, by an encoder off centre, does: compare a second sensor.",
    grid=periods,
    variant=slowly("inertia_period", "Inertia varies slowly along the stroke"),
)
