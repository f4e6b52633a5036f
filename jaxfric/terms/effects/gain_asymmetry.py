"""A gain that differs with the sign of the force."""

from ..actuator import GainAsymmetry
from ..effect import Effect

GAIN_ASYMMETRY = Effect(
    "gain_asymmetry",
    "κ max(f, 0)",
    "actuator",
    "Positive force has a gain that differs by {gain_asymmetry}",
    laws=(GainAsymmetry,),
    coordinates=("predicted_force",),
    needs=frozenset({"predicted_force"}),
    confusable_with=("load_dependent_friction", "actuator_saturation", "asymmetric_friction"),
    separate_by="Accelerate hard both ways: inertia is the same in both directions.",
)
