"""Stepwise selection: the winner of a contest joins the model, and all terms are refitted."""

import copy
from collections.abc import Hashable
from functools import partial

from .acceptance import LEAST_SHARE, accepted, needed
from .contest import Finalist, Trial, contest
from .evidence import Evidence
from .intervals import left_out
from .physical_constraints import constrained, nil
from .predictions import with_predictions
from .problem import Problem
from .regression import Fit, fit, without
from .rivals import simplest, with_rivals
from .selection import SelectedTerm, Selection
from .significance import blocks

# More terms than this are no explanation.
MOST_TERMS = 4


def select(
    problem: Problem,
    seed: int = 0,
    in_slip: Selection | None = None,
    refused: frozenset[Hashable] = frozenset(),
    begun: Selection | None = None,
    first: bool = False,
) -> Selection:
    """Add terms while they are accepted; after each, drop those that have become idle.

    `in_slip`: what the rows in slip have shown, where those of the problem reach across reversals.
    Then only effects that act at reversals compete: all others have, where nothing hides them.
    `refused`: forms of laws that do not compete, since beside the rows the model with them is
    worse; what fits the rows as they do cannot be told from them, though. `begun`: what has been
    selected for these rows already; `first`: end with the first term.
    """
    current, selected = _started(problem, in_slip)
    if begun is not None:
        current, selected = begun.last, begun.selected
    evidence, known = with_predictions(problem.evidence, current), len(selected)
    visited, nothing = set[Hashable](), set[Hashable]()
    while True:
        round_ = contest(
            evidence, current, problem.candidate_set, seed,
            lambda effect: in_slip is None or effect.at_reversals,
            partial(needed, current=current, evidence=evidence, base=problem.base,
                    selected=selected),
        )  # fmt: skip
        there = [f for f in round_.finalists if f.trial.candidate.form not in nothing]
        round_ = constrained(round_._replace(finalists=there), current, evidence)
        spoiling = [f for f in round_.finalists if f.trial.candidate.form in refused]
        allowed = [f for f in round_.finalists if f.trial.candidate.form not in refused]
        round_ = round_._replace(finalists=allowed)
        best = accepted(round_, current, evidence, problem.wide_kernels, problem.base, selected)
        # Two terms that make each other idle would take turns for ever.
        names = *sorted(each.effect.name for each in selected), len(nothing)
        if best is None or len(selected) >= MOST_TERMS or names in visited:
            break
        visited.add(names)
        best, rivals, instead = with_rivals(
            simplest(best, round_), round_, current, evidence, spoiling
        )
        current, evidence = joined(best, current, evidence)
        trial = with_own_term(best.trial, current)
        selected = [*selected, SelectedTerm(trial, rivals, best.p_value, instead=instead)]
        current, selected = _pruned(evidence, current, selected, round_.size)
        for number in nil(current, len(selected), evidence, problem.wide):
            nothing.add(selected[number].form)
            current = without(current, evidence, len(current.terms) - len(selected) + number)
            selected = [each for i, each in enumerate(selected) if i != number]
        if first and selected:
            break
    if in_slip is not None and len(selected) == known and selected:
        # No effect acts there, and the base fits these rows as well as it can.
        betas = (problem.base.betas[0], *current.betas[1:])
        current = fit(current.terms, evidence, betas, 6)
    # Terms that were dropped again leave the base as it was, not as it was refitted on the way.
    last = current if selected else problem.base
    return Selection(problem.base, last, selected, round_, in_slip=in_slip)


def _started(problem: Problem, in_slip: Selection | None) -> tuple[Fit, list[SelectedTerm]]:
    """The base; across reversals the model in slip, without what acts at reversals.

    There the base would bend its curve to what acts at reversals; in slip it did not.
    """
    if in_slip is None:
        return problem.base, []
    current, selected = elsewhere(in_slip)
    evidence = with_predictions(problem.evidence, current)
    return fit(current.terms, evidence, current.betas, 0), selected


def joined(best: Finalist, current: Fit, evidence: Evidence) -> tuple[Fit, Evidence]:
    """The model with a term of its own for the winner: two waves of one candidate are two terms."""
    terms = (*current.terms, copy.copy(best.trial.candidate.term))
    current = fit(terms, evidence, best.betas)
    evidence = with_predictions(evidence, current)
    return fit(terms, evidence, current.betas, 4), evidence


def with_own_term(trial: Trial, current: Fit) -> Trial:
    """The trial with the term as the model holds it, its last."""
    return trial._replace(candidate=trial.candidate._replace(term=current.terms[-1]))


def elsewhere(selection: Selection) -> tuple[Fit, list[SelectedTerm]]:
    """What was selected but for what acts at reversals."""
    start = selection.term_index(0)
    kept = [i for i, each in enumerate(selection.selected) if not each.effect.at_reversals]
    last = selection.last.only([*range(start), *(start + i for i in kept)])
    return last, [selection.selected[i] for i in kept]


def _pruned(
    evidence: Evidence, current: Fit, selected: list[SelectedTerm], size: float
) -> tuple[Fit, list[SelectedTerm]]:
    """Without terms that the newest one, or the base refitted beside it, has made idle.

    A term is idle, too, if it does not help to predict blocks that it was not fitted to; of a force
    of one moment no other block knows.
    """
    start = len(current.terms) - len(selected)
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    for index in reversed(range(start, len(current.terms))):
        less = without(current, evidence, index)
        gain, trial = 1 - current.energy / less.energy, selected[index - start].trial
        idle = trial.score(gain, size) <= 0 or gain < LEAST_SHARE
        if not trial.effect.momentary:
            idle |= left_out(current, index, block) >= less.energy
        if idle:
            current = less
            selected = [each for i, each in enumerate(selected) if i != index - start]
    return current, selected
