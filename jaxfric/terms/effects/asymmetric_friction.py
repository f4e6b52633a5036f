"""Friction that differs with the direction."""

from ..curvature import FrictionAsymmetry
from ..effect import Effect

ASYMMETRIC_FRICTION = Effect(
    "asymmetric_friction",
    "ΔFc abs(sign v) + ΔFv abs(v)",
    "friction",
    "Friction differs with the direction: half the difference is {viscous_asymmetry} with speed "
    "and, at any speed, {coulomb_asymmetry}",
    laws=(FrictionAsymmetry,),
    coordinates=("velocity",),
    confusable_with=("load_drift",),
    separate_by="Let the axis stick: a constant force shifts both break-away levels alike.",
)
