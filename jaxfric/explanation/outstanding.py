"""Effects whose grid the residual itself determines: isolated pushes, say."""

import numpy as np

from ..terms.effect import Effect, Residual
from ..terms.effects import EFFECTS, traits
from .candidates import Candidate
from .evidence import Evidence
from .regression import Fit
from .significance import LEVEL


def outstanding(evidence: Evidence, current: Fit) -> list[Candidate]:
    """What stands out of a residual, of each effect that is not in the fit its best law."""
    if not evidence.clock:
        return []
    known = {traits(term).name for term in current.terms}
    residual = _residual(evidence, current)
    others = [effect for effect in EFFECTS.values() if effect.name not in known]
    best = (_best(effect, residual, evidence, current) for effect in others)
    return [candidate for candidate in best if candidate is not None]


def _residual(evidence: Evidence, current: Fit) -> Residual:
    clock = np.asarray(evidence.motion.time)
    run, velocity = evidence.elapsed[: evidence.nodes], np.asarray(evidence.motion.velocity)
    interval = float(evidence.limits.interval)
    passed = velocity * interval / (evidence.counted or np.nan)
    return Residual(
        values=current.residual,
        time=clock[evidence.centre],
        elapsed=evidence.elapsed[evidence.centre],
        reach=evidence.reach,
        clock=clock[: evidence.nodes],
        run=run,
        turns=run[1:][np.diff(np.sign(velocity[: evidence.nodes])) != 0],
        level=LEVEL,
        interval=interval,
        counts=evidence.project(passed) if evidence.counted else None,
        noise=evidence.noise,
    )


def _best(effect: Effect, residual: Residual, evidence: Evidence, current: Fit) -> Candidate | None:
    most, found = 0.0, None
    for term in effect.outstanding(residual):
        candidate = Candidate(effect, term, np.zeros((1, 0)))
        columns = candidate.columns(evidence)[0]
        gain = (
            current.residual @ columns @ np.linalg.lstsq(columns, current.residual, rcond=1e-9)[0]
        )
        if gain > most:
            most, found = gain, candidate
    return found
