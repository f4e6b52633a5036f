"""Gain that falls at high force."""

from ..actuator import ActuatorSaturation
from ..effect import Effect

ACTUATOR_SATURATION = Effect(
    "actuator_saturation",
    "c max(abs(f) − U, 0) sign(f)",
    "actuator",
    "Above {knee} the actuator gives less than commanded: saturation, {saturation} of the excess",
    laws=(ActuatorSaturation,),
    coordinates=("predicted_force",),
    needs=frozenset({"predicted_force"}),
    confusable_with=("gain_asymmetry", "load_dependent_friction"),
    separate_by="Repeat at half the acceleration, below the knee.",
    positive=True,
)
