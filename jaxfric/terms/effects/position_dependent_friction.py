"""Friction that varies along the stroke."""

from ..effect import Effect, Waves, slowly
from ..position import PositionDependentFriction

POSITION_DEPENDENT_FRICTION = Effect(
    "position_dependent_friction",
    "sign(v) A sin(2πx/L + φ)",
    "position",
    "Friction varies along the stroke by {amplitude}, with a period of {friction_period}",
    laws=(PositionDependentFriction,),
    coordinates=("position_by_direction",),
    needs=frozenset({"position"}),
    confusable_with=("sticky_spot", "asymmetric_friction"),
    separate_by="Cross the stroke slowly, both ways.",
    waves=lambda term: Waves("position", True, sided=True),
    variant=slowly(
        "friction_period",
        "Friction varies slowly along the stroke, by {amplitude}: it does not repeat within the "
        "stroke, as with a guide or a belt that is tight in one place",
    ),
)
