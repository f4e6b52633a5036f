"""Missing effects that say as much as the wrong values: in place of them, or beside them."""

from typing import NamedTuple

import numpy as np

from ..models import Model
from ..terms.effects.parameter_mismatch import MISMATCH
from .acceptance import LINEARITY, accepted
from .baseline import as_given
from .common_factor import put_right
from .contest import contest
from .evidence import Evidence
from .findings import Findings, Solution, alone
from .mismatch import Mismatch
from .physical_constraints import constrained
from .predictions import with_predictions
from .regression import Fit, freed
from .rivals import simplest, with_rivals
from .selection import SelectedTerm
from .significance import LEVEL
from .stepwise import joined, with_own_term
from .trials import RIVAL, Contest, Finalist


class _Beside(NamedTuple):
    """A contest beside the values as given: those that do as well as the wrong values."""

    given: Fit
    evidence: Evidence
    round_: Contest


def instead(
    model: Model, findings: Findings, wrong: Mismatch, seed: int
) -> tuple[Findings | None, tuple[str, ...]]:
    """The effect that stands for several wrong values with fewer numbers, `None` if none does; and
    the effects that do as well as the wrong values with as many numbers.

    The base with all its values free takes the larger part of a drag by friction and damping, and
    all of a friction that differs with the direction where a constant force is free: nothing is
    left of it for a finding. Here each effect competes beside the values as given.
    """
    beside = _beside(model, findings, wrong, seed)
    names = (f.effect.name for f in beside.round_.finalists if f.effect.name != MISMATCH)
    rivals = tuple(dict.fromkeys(names))
    if wrong.numbers == 1:
        return None, rivals
    return _one(model, findings, beside, wrong.numbers), rivals


def _beside(model: Model, findings: Findings, wrong: Mismatch, seed: int) -> _Beside:
    """The effects that compete beside the values as given and do as well as the wrong values.

    By odds of no more than those between rivals, or but for what no sensor of force resolves.
    """
    problem, selection = findings.recorded
    right, free = put_right(model, wrong)
    values = as_given(right, selection.base, problem.evidence, free)
    given = freed(as_given(model, selection.base, problem.evidence), ())
    evidence = with_predictions(problem.evidence, given)
    round_ = contest(evidence, given, problem.candidate_set, seed, lambda e: not e.momentary)
    floor = LINEARITY**2 * float(evidence.force @ evidence.force)

    def beside(each: Finalist) -> Finalist:
        last, _ = joined(each, selection.base, evidence)
        return each._replace(energy=as_given(model, last, problem.evidence).energy)

    def as_well(each: Finalist) -> bool:
        odds = 0.5 * round_.size * np.log(each.energy / max(values.energy, 1e-300))
        return odds < RIVAL or each.energy - values.energy < floor

    most = wrong.numbers
    tried = [f for f in round_.finalists if f.p_value <= LEVEL and _numbers(f) <= most]
    finalists = [each for each in map(beside, tried) if as_well(each)]
    round_ = constrained(round_._replace(finalists=finalists), given, evidence)
    return _Beside(given, evidence, round_)


def _one(model: Model, findings: Findings, beside: _Beside, most: int) -> Findings | None:
    """One effect of fewer numbers than `most`, beside the values as given."""
    problem, selection = findings.recorded
    given, evidence, round_ = beside
    round_ = round_._replace(finalists=[f for f in round_.finalists if _numbers(f) < most])
    best = accepted(round_, given, evidence, problem.other_rows, given, [], model)
    if best is None:
        return None
    best, rivals = with_rivals(simplest(best, round_), round_, given, evidence)
    last, _ = joined(best, selection.base, evidence)
    trial = with_own_term(best.trial, last)
    term = SelectedTerm(
        trial, (*rivals.names, MISMATCH), best.p_value, instead=rivals.instead, near=rivals.near
    )
    base, last = (as_given(model, each, problem.evidence) for each in (selection.base, last))
    found = selection._replace(base=base, last=last, selected=[term], given=model, trusted=True)
    return alone(Solution(problem, found))


def _numbers(finalist: Finalist) -> int:
    """How many numbers its law has."""
    return len(finalist.alpha) + len(finalist.betas[-1])
