"""A constant force that wanders."""

from ..base import AbstractTerm
from ..effect import Effect
from ..sample import Scales
from ..time import LoadDrift


def shapes(scales: Scales) -> tuple[AbstractTerm, ...]:
    """A straight line, and a cubic polynomial, over the recording."""
    start, duration = float(scales.start), float(scales.duration)
    return tuple(LoadDrift(start, duration, degree) for degree in (1, 3))


LOAD_DRIFT = Effect(
    "load_drift",
    "Σ F_n P_n(t)",
    "time",
    "A constant force wanders slowly over the record",
    laws=(LoadDrift,),
    scaled=shapes,
    coordinates=("time",),
    confusable_with=("periodic_disturbance", "cross_axis", "friction_step"),
    separate_by="Record longer.",
    momentary=True,
    ubiquitous=True,
)
