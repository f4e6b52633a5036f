"""Friction that changes its sign gradually."""

from ..base import Directional
from ..effect import Effect
from ..friction import SmoothCrossing

SMOOTH_FRICTION = Effect(
    "smooth_friction",
    "F_s (tanh(v/v_c) − sign(v))",
    "friction",
    "Friction passes zero speed gradually, not by a jump: {smoothed_force+} forward and "
    "{smoothed_force-} backward build up as tanh(v/w), w {crossing_velocity+} and "
    "{crossing_velocity-}",
    laws=(SmoothCrossing,),
    scaled=lambda scales: (Directional(SmoothCrossing()),),
    coordinates=("velocity",),
    confusable_with=("stribeck", "viscous_nonlinearity", "presliding"),
    separate_by="Hold several constant speeds close to zero, either way: what is a function of "
    "speed stays.",
    positive=True,
    idealised=True,
    sizes=("smoothed_force",),
    # How dry friction passes zero is drawn of every machine.
    drawn=False,
)
