"""A load on a spring."""

from collections.abc import Mapping

import numpy as np

from ..base import AbstractTerm
from ..effect import GRID, Effect, Extent, View, inside
from ..transmission import Compliance, DryCompliance

# Damping ratios tried: a drive train's, a belt's, a soft coupling's.
_DAMPING = (0.05, 0.15, 0.45)
# A load's friction in parts of what its inertia asks for, where it shows at all.
_COASTING = (0.2, 0.6, 2.0, 6.0)
# With more damping a load does not swing: its second half-wave is below a tenth of the first.
SWINGING = 0.5


def coasting(view: View) -> np.ndarray:
    """Decelerations, m/s², at which a load would coast to rest."""
    return view.acceleration * np.array(_COASTING)


def resonances(term: AbstractTerm, view: View) -> np.ndarray:
    """Frequencies up to what the nodes still resolve, with a few dampings each."""
    count = len(term.nonlinear)
    low, most = inside(term, view.limits, np.array([[0.0] * count, [1.0] * count]))[:, 0]
    high = max(min(most, 0.5 * view.nodes / view.reach), 2 * low)
    swinging = [(f, z) for z in _DAMPING for f in np.geomspace(low, high, GRID)]
    if isinstance(term, DryCompliance):
        return np.array([(*place, d) for place in swinging for d in coasting(view)])
    return np.array(swinging)


def creeping(values: Mapping[str, float], extent: Extent) -> str | None:
    """Another sentence for a load that is too damped to swing."""
    if values.get("damping_ratio", 0.0) < SWINGING:
        return None
    return (
        "A part of the mass follows the drive late, with {load_resonance} and a damping ratio of "
        "{damping_ratio}: too damped to swing, as with rubber, grease or a slipping coupling"
    )


COMPLIANCE = Effect(
    "compliance",
    "M_L r̈, r̈ + 2ζω ṙ + ω² r = −a − (F_L/M_L) sign(v)",
    "reversals",
    "The load swings on the drive, at {load_resonance} against a held motor, with a damping ratio "
    "of {damping_ratio}: compliance",
    laws=(Compliance, DryCompliance),
    scaled=lambda scales: (
        *(Compliance(driven=by) for by in ("inertia", "friction", "both")),
        DryCompliance(),
    ),
    coordinates=("acceleration", "time_since_reversal"),
    confusable_with=("transport_delay", "actuator_lag", "backlash", "presliding"),
    separate_by="Excite with a sweep up to the resonance, or measure on the load side.",
    positive=True,
    at_reversals=True,
    sharp=True,
    delays=True,
    leftover=True,
    grid=resonances,
    variant=creeping,
)
