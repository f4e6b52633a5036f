"""Friction that builds up over a distance."""

from ..effect import Effect
from ..presliding import Dahl, LuGre

PRESLIDING = Effect(
    "presliding",
    "F_p (z − sign v), dz = (dx/x_d)(1 − z sign(dx))",
    "reversals",
    "After a reversal friction builds up over {presliding_distance} instead of at once, "
    "{presliding_force} of it: presliding",
    laws=(Dahl, LuGre),
    scaled=lambda scales: (Dahl(),),
    coordinates=("distance_since_reversal",),
    confusable_with=("backlash", "compliance", "frictional_lag", "stribeck"),
    separate_by="Reverse slowly over a few micrometres: presliding is elastic before it slips.",
    positive=True,
    first_order=True,
    at_reversals=True,
    sizes=("presliding_force",),
)
