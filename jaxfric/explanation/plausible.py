"""What a machine can have: a load within its inertia and friction, a memory of a curve it shows."""

import numpy as np

from .. import terms as laws
from ..terms.friction import AbstractBump
from .candidates import leaves
from .contest import Finalist
from .evidence import Evidence
from .regression import Fit, fit

_LOADS = laws.Compliance | laws.DryCompliance | laws.ElasticBacklash


def plausible(finalist: Finalist, now: Fit, evidence: Evidence) -> bool:
    """Whether a candidate beside the rest of the model is a machine.

    A part of the inertia and of the friction hangs on a spring or behind a gap, not more than there
    is, nor does it rest while the motor moves by a tenth of the stroke: that were a spring to the
    ground. What follows speed late is a part of the friction, by a Stribeck curve that is there in
    steady slip too.
    """
    term = finalist.trial.candidate.term
    if not isinstance(term, _LOADS | laws.FrictionalLag):
        return True
    bumps = any(isinstance(leaf, AbstractBump) for t in now.terms for leaf in leaves(t))
    if isinstance(term, laws.FrictionalLag) and not bumps:
        return False
    if isinstance(term, laws.DryCompliance):
        resonance, _, slow = finalist.betas[-1]
        give = slow / (2 * np.pi * resonance) ** 2
        if give > 0.1 * (evidence.limits.high - evidence.limits.low):
            return False
    both = fit((*now.terms, term), evidence, finalist.betas, 0)
    inertia, friction = _parts(term, both.betas[-1], both.alphas[-1])
    values = [
        (p.name.rstrip("+-"), float(a))
        for t, alpha in zip(both.terms[:-1], both.alphas, strict=False)
        for p, a in zip(t.affine, alpha, strict=True)
    ]
    most = {
        name: max((a for n, a in values if n == name), default=default)
        for name, default in (("inertia", np.inf), ("coulomb", np.inf), ("stribeck_force", 0.0))
    }
    return inertia <= most["inertia"] and friction <= most["coulomb"] + most["stribeck_force"]


def _parts(term, beta, alpha) -> tuple[float, float]:
    """Inertia, kg, and friction, N, of the load or the bump."""
    if isinstance(term, laws.FrictionalLag):
        return 0.0, float(alpha[0])
    if isinstance(term, laws.ElasticBacklash):
        return float(alpha[0] / beta[2]), float(alpha[0])
    if isinstance(term, laws.DryCompliance):
        return float(alpha[0]), float(alpha[0] * beta[2])
    known = {p.name: float(a) for p, a in zip(term.affine, alpha, strict=True)}
    return known.get("load_inertia", 0.0), known.get("load_friction", 0.0)
