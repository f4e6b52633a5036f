"""Friction that falls with speed."""

from collections.abc import Mapping

import numpy as np

from ..base import Directional
from ..effect import Effect, Extent, View, even
from ..friction import Exponential, Gaussian, Generalised, Lorentzian

# Exponents of a bump beside those that have a law of their own, 1 and 2: from 1/2 on (Bo &
# Pavelescu 1982) such bumps fall over decades of the speed.
_EXPONENTS = (0.5, 0.7)


def bumps(term: Directional, view: View) -> np.ndarray:
    """Speeds, the same for both directions, with a few exponents where they are free."""
    if not isinstance(term.positive, Generalised):
        return even(term, view)
    speeds = even(Exponential(), view)[:, 0]
    return np.array([(v, n, v, n) for n in _EXPONENTS for v in speeds])


def _rising(values: Mapping[str, float], extent: Extent) -> str | None:
    """Of a bump upside down."""
    if any(value > 0 for name, value in values.items() if name.startswith("stribeck_force")):
        return None
    return (
        "Friction rises with speed at low velocity: a Stribeck bump upside down, of "
        "{stribeck_force+} forward and {stribeck_force-} backward, over {stribeck_velocity+} and "
        "{stribeck_velocity-}"
    )


STRIBECK = Effect(
    "stribeck",
    "F_b sign(v) exp(−(v/v_s)²), 1/(1 + (v/v_s)²), exp(−abs(v)/v_s) or exp(−abs(v/v_s)^δ)",
    "friction",
    "Friction falls with speed at low velocity: a Stribeck bump of {stribeck_force+} forward and "
    "{stribeck_force-} backward, over {stribeck_velocity+} and {stribeck_velocity-}",
    laws=(Gaussian, Lorentzian, Exponential, Generalised),
    scaled=lambda scales: tuple(
        Directional(bump()) for bump in (Gaussian, Lorentzian, Exponential, Generalised)
    ),
    coordinates=("velocity",),
    confusable_with=("presliding", "frictional_lag", "viscous_nonlinearity"),
    separate_by="Hold several constant slow speeds: a Stribeck curve stays, a transient goes.",
    positive=True,
    grid=bumps,
    variant=_rising,
    sizes=("stribeck_force",),
)
