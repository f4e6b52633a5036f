"""Friction that is curved in speed."""

from ..curvature import PowerLaw, QuadraticDrag, ShearThinning
from ..effect import Effect

VISCOUS_NONLINEARITY = Effect(
    "viscous_nonlinearity",
    "c v abs(v), b v/(1 + abs(v)/v₀) or k sign(v) abs(v)ⁿ",
    "friction",
    "Friction is curved in speed, beyond a Coulomb and a viscous part",
    laws=(QuadraticDrag, ShearThinning, PowerLaw),
    scaled=lambda scales: (
        QuadraticDrag(),
        ShearThinning(),
        PowerLaw(unit_speed=float(scales.fastest)),
    ),
    coordinates=("velocity",),
    confusable_with=("thermal_drift", "stribeck"),
    separate_by="Run to the top speed from cold and again warm.",
)
