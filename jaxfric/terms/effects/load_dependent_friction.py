"""Friction that grows with the load."""

from ..curvature import LoadDependentFriction
from ..effect import Effect

LOAD_DEPENDENT_FRICTION = Effect(
    "load_dependent_friction",
    "μ abs(N) sign(v)",
    "friction",
    "Friction grows with the load by {load_friction} of it",
    laws=(LoadDependentFriction,),
    coordinates=("predicted_force_by_direction", "predicted_force"),
    needs=frozenset({"predicted_force"}),
    confusable_with=("gain_asymmetry", "actuator_saturation"),
    separate_by="Record the load, or repeat with another payload.",
    positive=True,
)
