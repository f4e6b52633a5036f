"""Inertia that varies along the stroke."""

import numpy as np

from ..base import AbstractTerm
from ..effect import Effect, View, slowly
from ..position import PositionDependentInertia


def periods(term: AbstractTerm, view: View) -> np.ndarray:
    """From eight strokes to an eighth of one."""
    stroke = view.limits.high - view.limits.low
    cycles = np.concatenate([2.0 ** np.arange(-3, 0, 0.5), np.arange(1, 8, 0.25)])
    return (stroke / cycles)[:, None]


POSITION_DEPENDENT_INERTIA = Effect(
    "position_dependent_inertia",
    "d(M₁v)/dt − ½ M₁′v², M₁ = A sin(2πx/L + φ)",
    "position",
    "Inertia varies along the stroke by {amplitude}, with a period of {inertia_period}",
    laws=(PositionDependentInertia,),
    coordinates=("position_by_acceleration",),
    needs=frozenset({"position"}),
    confusable_with=("gravity_unbalance",),
    separate_by="Cross the stroke at two accelerations: a weight does not scale with them.",
    grid=periods,
    variant=slowly("inertia_period", "Inertia varies slowly along the stroke, by {amplitude}"),
)
