"""An eccentric mass on a turning axis."""

from ..effect import Effect, slowly
from ..position import GravityUnbalance

GRAVITY_UNBALANCE = Effect(
    "gravity_unbalance",
    "A sin(2πx/L + φ)",
    "position",
    "A force that follows position with a period of {unbalance_period}, amplitude {amplitude}: "
    "gravity on an eccentric mass",
    laws=(GravityUnbalance,),
    coordinates=("position",),
    needs=frozenset({"position"}),
    confusable_with=("spring", "hardening_spring", "cogging"),
    separate_by="Use the whole stroke: an unbalance is periodic, a spring is not.",
    variant=slowly(
        "unbalance_period",
        "A force varies slowly along the stroke, by {amplitude}: it does not repeat within the "
        "stroke, so that a spring or a cable would look the same",
    ),
)
