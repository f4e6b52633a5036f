"""Friction that follows velocity late."""

import dataclasses

import numpy as np

from ..base import AbstractTerm, leaves
from ..effect import Effect, View, inside, product
from ..friction import AbstractBump, Gaussian
from ..presliding import FrictionalLag

# Times and widths of a bump that is late (a factor of 1.7 in either changes little), and exponents.
_COUNTS = (12, 8, 3)


def suited(term: FrictionalLag, base: AbstractTerm, turn: float | None) -> AbstractTerm:
    """With the kind of bump that the baseline has, or a Gaussian one."""
    own = (leaf for leaf in leaves(base) if isinstance(leaf, AbstractBump))
    return dataclasses.replace(term, bump=next(own, Gaussian()))


def memories(term: AbstractTerm, view: View) -> np.ndarray:
    """All combinations of times, widths and exponents."""
    along = [(np.arange(n) + 0.5) / n for n in _COUNTS[: len(term.nonlinear)]]
    return inside(term, view.limits, product(along))


FRICTIONAL_LAG = Effect(
    "frictional_lag",
    "F_b sign(v) (exp(−(s/v_s)²) − exp(−(v/v_s)²)), s = abs v(t − τ) or filtered",
    "reversals",
    "Friction follows velocity {frictional_lag} late",
    laws=(FrictionalLag,),
    scaled=lambda scales: tuple(FrictionalLag(poles=poles) for poles in (0, 1, 2)),
    suited=suited,
    coordinates=("time_since_reversal", "acceleration"),
    confusable_with=("actuator_lag", "presliding", "transport_delay"),
    separate_by="Cycle at low speed without a reversal: the loop in force over speed remains.",
    positive=True,
    at_reversals=True,
    sharp=True,
    grid=memories,
    sizes=("stribeck_force",),
)
