"""Another axis that pulls along."""

from ..curvature import CrossAxis
from ..effect import Effect

CROSS_AXIS = Effect(
    "cross_axis",
    "d(C v₂)/dt + h v₂",
    "neighbour",
    "The other axis pulls along: {coupling_inertia} times its acceleration and {coupling_viscous} "
    "times its velocity",
    laws=(CrossAxis,),
    coordinates=("neighbour",),
    needs=frozenset({"neighbour_velocity"}),
    confusable_with=("load_drift", "periodic_disturbance"),
    separate_by="Hold the other axis still.",
)
