"""Friction that changes its sign gradually."""

from ..base import AbstractTerm, Directional, summands
from ..effect import Effect, with_parameter
from ..friction import SmoothCrossing


def suited(term: AbstractTerm, base: AbstractTerm, turn: float | None) -> tuple[AbstractTerm, ...]:
    """Of each direction by itself where the baseline has that: else it would be its asymmetry."""
    sided = any(isinstance(part, Directional) for part in summands(base))
    return (Directional(term),) if sided else (term,)


SMOOTH_FRICTION = Effect(
    "smooth_friction",
    "F_s (tanh(v/v_c) − sign(v))",
    "friction",
    "Friction passes zero speed gradually, not by a jump: {smoothed_force+} forward and "
    "{smoothed_force-} backward build up as tanh(v/w), w {crossing_velocity+} and "
    "{crossing_velocity-}",
    laws=(SmoothCrossing,),
    suited=suited,
    coordinates=("velocity",),
    confusable_with=("stribeck", "viscous_nonlinearity", "presliding"),
    separate_by="Hold several constant speeds close to zero, either way: what is a function of "
    "speed stays.",
    positive=True,
    idealised=True,
    sizes=("smoothed_force",),
    variant=with_parameter(
        "smoothed_force",
        "Friction passes zero speed gradually, not by a jump: {smoothed_force} builds up as "
        "tanh(v/w), w {crossing_velocity}",
    ),
    # How dry friction passes zero is drawn of every machine.
    drawn=False,
)
