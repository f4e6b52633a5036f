"""Friction that falls with speed."""

from ..base import Directional
from ..effect import Effect
from ..friction import Exponential, Gaussian, Generalised, Lorentzian

STRIBECK = Effect(
    "stribeck",
    "F_b sign(v) exp(−(v/v_s)²), 1/(1 + (v/v_s)²) or exp(−abs(v)/v_s)",
    "friction",
    "Friction falls with speed at low velocity: a Stribeck bump of {stribeck_force+} forward and "
    "{stribeck_force-} backward, over {stribeck_velocity+} and {stribeck_velocity-}",
    laws=(Gaussian, Lorentzian, Exponential, Generalised),
    scaled=lambda scales: tuple(
        Directional(bump()) for bump in (Gaussian, Lorentzian, Exponential)
    ),
    coordinates=("velocity",),
    confusable_with=("presliding", "frictional_lag", "viscous_nonlinearity"),
    separate_by="Hold several constant slow speeds: a Stribeck curve stays, a transient goes.",
    positive=True,
    sizes=("stribeck_force",),
)
