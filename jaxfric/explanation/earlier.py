"""Another recording as the baseline: what it obeys, and which of its values hold here no more.

The other is an earlier recording of the same machine, or a simulator's run of another motion.
"""

import dataclasses
from pathlib import PurePath

import numpy as np

from ..data.recording import Recording
from . import parameters as spelled, verification
from .acceptance import LINEARITY
from .baseline import Baseline, beginning
from .evidence import Evidence
from .findings import Findings, Solution
from .intervals import spread
from .locate import locate
from .mismatch import SURE, Mismatch
from .predictions import PREDICTED, with_predictions
from .problem import LEAST_SHARE
from .regression import Fit, fit
from .structure import significant
from .uncertainty import estimated
from .verdict import rough

# Steps from where a model was fitted: with one law more it is near.
REFITTED = 8


@dataclasses.dataclass(frozen=True)
class Earlier:
    """An earlier recording of the same machine, as a baseline: what has changed since?

    Its force is measured; a Recording alone, of the same motion, is taken for a simulator's.
    """

    recording: Recording


def obeyed(recording: Recording, solution: Solution, seed: int = 0) -> Baseline:
    """The baseline that a recording obeys, as explaining it found it.

    Without what belongs to a moment of it, which says nothing about another, and without what acts
    on the force that the rest predicts, which no baseline can hold.
    """
    problem, current = solution.problem, solution.selection.last
    evidence = with_predictions(problem.evidence, current)
    lasting = verification.lasting(current)
    plain = [i for i, t in enumerate(lasting.terms) if not t.coordinates & PREDICTED]
    lasting = lasting.only(plain)
    if len(lasting.terms) < len(current.terms):
        current = fit(lasting.terms, evidence, lasting.betas)
    force = float(np.sqrt(np.mean(evidence.force**2)))
    seen = with_predictions(problem.evidence, current)
    found = significant(locate(seen, current, seed), LEAST_SHARE, LINEARITY * force)
    own = verification.error(current, problem.evidence)
    errors = {
        "force_error": {"before": own, "after": own},
        "holdout_force_error": None,
        "noise_floor": verification.noise(current, evidence.force),
    }
    model = spelled.model(current, recording.units)
    return Baseline(
        spelled.whole(current),
        f"recording {PurePath(recording.source).name}".rstrip(),
        model,
        spread(current, problem.block).covariance,
        current,
        frozenset(each.coordinate for each in found),
        rough(errors, {}),
        beginning(model.term),
        problem.evidence,
    )


def rephased(known: Baseline, evidence: Evidence) -> Baseline:
    """The baseline with its waves over position at their phase here, with the same amplitude.

    The zero of an incremental encoder is another after each homing.
    """
    current: Fit = known.fit
    waves = frozenset(i for i in range(1, len(current.terms)) if verification.wavelike(current, i))
    if not waves:
        return known
    there = verification.at_phase(current, evidence, waves)
    return known._replace(model=spelled.model(there, known.model.units), fit=there)


def without_unchanged(known: Baseline, findings: Findings) -> Findings:
    """The findings without what is no change since the other recording.

    What the model of that lacks of the machine shows in both, over other speeds and places: with
    the law as found here the model is nearer to that recording, too. And of what has grown from
    none the interval that is told leaves out zero.
    """
    if known.rows is None or not findings.selection.selected:
        return findings
    seen = with_predictions(known.rows, known.fit)
    there = fit(known.fit.terms, seen, known.fit.betas, REFITTED)
    number = 0
    while number < len(findings.selection.selected):
        if _as_before(seen, there, findings, number):
            findings, number = findings.without(number), 0
        else:
            number += 1
    return findings


def _as_before(seen: Evidence, there: Fit, findings: Findings, number: int) -> bool:
    """Whether a finding may be none, or is in the other recording's rows too, beside its model
    `there`, refitted. Of what belongs to a moment the other recording says nothing.
    """
    problem, selection = findings.examined_in(number)
    if selection.selected[number].effect.momentary:
        return False
    index, last = selection.term_index(number), selection.last
    term = last.terms[index]
    told = estimated(findings)[findings.selection.term_index(number)]
    if spelled.may_be_none(term, told, as_told=True):
        return True
    channels = term.coordinates & set(problem.evidence.motion.channels)
    if not channels <= set(seen.motion.channels):
        return False
    force = seen.columns(term, last.betas[index][None])[0] @ last.alphas[index]
    rows = seen._replace(target=seen.target - force)
    return fit(there.terms, rows, there.betas, REFITTED).energy < there.energy


def changed(wrong: Mismatch | None, known: Baseline, current: Fit, errors) -> Mismatch | None:
    """The values that hold here no more; `None` where all lie within what both recordings leave
    open. Values that do move with the others.

    **Arguments:** `current`, the baseline refitted here, `errors`, the standard errors of its
    parameters, affine ones first.
    """
    if wrong is None or known.errors is None:
        return wrong
    values = [*current.alphas[0], *current.betas[0]]
    within = frozenset(
        i
        for i, before in wrong.moved.items()
        if not abs(values[i] - before) > SURE * np.hypot(errors[i], known.errors[i])
    )
    return wrong._replace(within=within) if within < set(wrong.moved) else None
