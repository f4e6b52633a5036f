"""Force lost around zero command."""

from ..actuator import ActuatorDeadband
from ..effect import Effect

ACTUATOR_DEADBAND = Effect(
    "actuator_deadband",
    "δ sign(f)",
    "actuator",
    "{deadband} of command is lost around zero force: a dead-band",
    laws=(ActuatorDeadband,),
    coordinates=("predicted_force",),
    needs=frozenset({"predicted_force"}),
    confusable_with=("load_dependent_friction", "gain_asymmetry"),
    separate_by="Decelerate hard, so that force and velocity have opposite signs.",
    positive=True,
    switches=True,
    sizes=("deadband",),
)
