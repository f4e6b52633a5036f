"""A force that does not arrive beyond a limit."""

from ..effect import Effect

FORCE_LIMIT = Effect(
    "force_limit",
    "u_real = clip(u, ±U)",
    "actuator",
    coordinates=("predicted_force",),
    confusable_with=("actuator_saturation", "disturbance_pulses"),
    separate_by="Command less: below the limit all of it arrives.",
    drawn=False,
)
