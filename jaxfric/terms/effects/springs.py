"""Springs along the stroke."""

from ..effect import Effect
from ..position import HardeningSpring, Spring

SPRING = Effect(
    "spring",
    "k (x − x₀)",
    "position",
    "A force proportional to position, {stiffness}: a spring",
    laws=(Spring,),
    scaled=lambda scales: (Spring(float(0.5 * (scales.low + scales.high))),),
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
