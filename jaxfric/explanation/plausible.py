"""What a machine can have: a load within its inertia and friction, a memory of a curve it shows."""

import numpy as np

from .. import terms as laws
from ..terms.friction import AbstractBump
from .candidates import leaves
from .contest import Contest, Finalist
from .evidence import Evidence
from .regression import Fit, fit

_LOADS = laws.Compliance | laws.DryCompliance | laws.ElasticBacklash
# Of a load behind a gap the rows tell the friction well, and the inertia only by how it coasts;
# where they ask for somewhat more of that than there is, they are asked about all there is.
TRIES = 3


def machines(round_: Contest, now: Fit, evidence: Evidence) -> Contest:
    """The finalists that are parts of a machine, the best first: as they are, or the nearest."""
    found = []
    for finalist in round_.finalists:
        for _ in range(TRIES):
            if plausible(finalist, now, evidence):
                found.append(finalist)
                break
            lighter = _lighter(finalist, now, evidence, round_.size)
            if lighter is None:
                break
            finalist = lighter
    return round_._replace(finalists=sorted(found, key=lambda each: -each.score))


def _lighter(finalist: Finalist, now: Fit, evidence: Evidence, size: float) -> Finalist | None:
    """A load behind a gap with no more inertia than the machine has, its friction fitted again.

    `None` for any other, and where it is the friction that is too much.
    """
    trial = finalist.trial
    if not isinstance(trial.candidate.term, laws.ElasticBacklash):
        return None
    inertia, friction, most = _beside(finalist, now, evidence)
    if friction > most["coulomb"] + most["stribeck_force"] or not 0 < most["inertia"] < inertia:
        return None
    beta = finalist.betas[-1] * np.array([1.0, 1.0, 1.01 * inertia / most["inertia"]])
    there = fit([trial.candidate.term], evidence, [beta], 0, now.basis())
    gain = 1 - there.energy / now.energy
    return finalist._replace(
        score=trial.score(gain, size),
        p_value=finalist.p_value if gain > trial.threshold else 1.0,
        energy=there.energy,
        betas=(*finalist.betas[:-1], there.betas[0]),
        alpha=there.alphas[0],
    )


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
    inertia, friction, most = _beside(finalist, now, evidence)
    return inertia <= most["inertia"] and friction <= most["coulomb"] + most["stribeck_force"]


def _beside(finalist: Finalist, now: Fit, evidence: Evidence) -> tuple[float, float, dict]:
    """Inertia, kg, and friction, N, of the load or the bump, and what the machine has of each."""
    term = finalist.trial.candidate.term
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
    return inertia, friction, most


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
