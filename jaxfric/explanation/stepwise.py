"""Stepwise selection: the winner of a contest joins the model, and all terms are refitted."""

import copy
from collections.abc import Callable, Hashable
from functools import partial
from typing import NamedTuple

from ..terms.base import AbstractTerm
from ..terms.effect import Effect
from .acceptance import LEAST_SHARE, accepted, needed
from .contest import contest
from .evidence import Evidence
from .intervals import left_out, left_out_again
from .physical_constraints import constrained, nil, told_parts
from .predictions import with_predictions
from .problem import Problem
from .refining import imitated
from .regression import Fit, fit, without, without_shapes
from .rivals import simplest, with_rivals
from .selection import SelectedTerm, Selection
from .significance import blocks
from .trials import RIVAL, Contest, Finalist, Trial

# More terms than this are no explanation.
MOST_TERMS = 4


class Round(NamedTuple):
    """A contest for what the fit `current` leaves, its accepted winner, if any, as `best`.

    `spoiling`: finalists that may not win, as beside the rows the model with them is worse;
    `strong`: the best of the others that lacks nothing but significance.
    """

    contest: Contest
    current: Fit
    evidence: Evidence
    best: Finalist | None
    spoiling: list[Finalist]
    strong: Finalist | None


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

    def among(effect: Effect) -> bool:
        return in_slip is None or effect.at_reversals

    def round_beside(current: Fit, evidence: Evidence, selected: list[SelectedTerm]) -> Round:
        least = partial(
            needed, current=current, evidence=evidence, base=problem.base, selected=selected
        )
        found = contest(evidence, current, problem.candidate_set, seed, among, least, refused)
        there = [f for f in found.finalists if f.trial.candidate.form not in nothing]
        found = constrained(found._replace(finalists=there), current, evidence)
        spoiling = [f for f in found.finalists if f.trial.candidate.form in refused]
        allowed = [f for f in found.finalists if f.trial.candidate.form not in refused]
        found = found._replace(finalists=allowed)
        best = accepted(found, current, evidence, problem.other_rows, problem.base, selected)
        enough = (f for f in allowed if current.energy - f.energy >= least(f.trial))
        strong = next((f for f in enough if f.score >= RIVAL), None)
        return Round(found, current, evidence, best, spoiling, strong)

    while True:
        own = round_ = round_beside(current, evidence, selected)
        if own.best is None and in_slip is None and len(selected) + 1 < MOST_TERMS:
            own = _hidden(round_, selected, round_beside)
        # Two terms that make each other idle would take turns for ever.
        names = *sorted(each.effect.name for each in selected), len(nothing)
        if own.best is None or len(selected) >= MOST_TERMS or names in visited:
            break
        visited.add(names)
        best, rivals = with_rivals(
            simplest(own.best, own.contest), own.contest, own.current, own.evidence, own.spoiling
        )
        betas = (*best.betas[: len(current.betas)], best.betas[-1])
        with_it, seen = joined(best._replace(betas=betas), current, evidence)
        if with_it.energy >= current.energy:
            nothing.add(best.trial.candidate.form)
            continue
        current, evidence = with_it, seen
        trial = with_own_term(best.trial, current)
        term = SelectedTerm(trial, rivals.names, best.p_value)
        selected = [*selected, term._replace(instead=rivals.instead, near=rivals.near)]
        current, evidence, selected = _pruned(evidence, current, selected, round_.contest.size)
        for number in nil(current, len(selected), evidence, problem.wide):
            nothing.add(selected[number].form)
            current, evidence, selected = _less(evidence, current, selected, number)
        for number, part in told_parts(current, len(selected), evidence):
            current, evidence, selected = _instead(evidence, current, selected, number, part)
        if first and selected:
            break
    if in_slip is not None and len(selected) == known and selected:
        # No effect acts there, and the base fits these rows as well as it can: by its curve there
        # or by that beside the terms, from which it may be far.
        starts = (problem.base.betas[0], current.betas[0])
        fits = (fit(current.terms, evidence, [b, *current.betas[1:]], 6) for b in starts)
        current = min(fits, key=lambda each: each.energy)
    # Terms that were dropped again leave the base as it was, not as it was refitted on the way.
    last = current if selected else problem.base
    return Selection(problem.base, last, selected, round_.contest, in_slip=in_slip)


def _hidden(
    round_: Round,
    selected: list[SelectedTerm],
    round_beside: Callable[[Fit, Evidence, list[SelectedTerm]], Round],
) -> Round:
    """A round beside its strong finalist, of two effects that hide each other; else the same round.

    What the one leaves is structure, whose flipped signs do as well as the other. Beside each other
    both have to be accepted: then the round's winner is selected first, and the other one after it.
    """
    first = round_.strong
    if first is None:
        return round_

    def with_term(finalist: Finalist) -> Round:
        betas = (*round_.current.betas, finalist.betas[-1])
        current, evidence = joined(finalist._replace(betas=betas), round_.current, round_.evidence)
        term = SelectedTerm(with_own_term(finalist.trial, current), (), finalist.p_value)
        return round_beside(current, evidence, [*selected, term])

    beside = with_term(first)
    if beside.best is None:
        return round_
    again = with_term(beside.best).best
    both = again is not None and again.effect.name == first.effect.name
    return beside if both else round_


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
    """The model with a term of its own for the winner: two waves of one candidate are two terms.

    It may leave more than without: some laws act on the force that the others predict, and beside
    what they predicted before, a part of it does for the whole.
    """
    terms = (*current.terms, copy.copy(best.trial.candidate.term))
    return _predicting(fit(terms, evidence, best.betas), evidence)


def _predicting(current: Fit, evidence: Evidence) -> tuple[Fit, Evidence]:
    """The fit refined beside what it predicts itself, and the rows that say so."""
    evidence = with_predictions(evidence, current)
    return fit(current.terms, evidence, current.betas, 4), evidence


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
) -> tuple[Fit, Evidence, list[SelectedTerm]]:
    """Without terms that the newest one, or the base refitted beside it, has made idle.

    A term is idle, too, if it does not help to predict blocks that it was not fitted to; of a force
    of one moment no other block knows.
    """
    start = len(current.terms) - len(selected)
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    for index in reversed(range(start, len(current.terms))):
        less, trial = without(current, evidence, index), selected[index - start].trial
        if imitated(trial, current):
            others = [i for i in range(len(current.terms)) if i != index]
            anew = without_shapes(current.terms[0], current.betas[0])
            betas = [anew, *(current.betas[i] for i in others[1:])]
            afresh = fit(less.terms, evidence, betas, 8)
            less = min(less, afresh, key=lambda each: each.energy)
        gain = 1 - current.energy / less.energy
        idle = trial.score(gain, size) <= 0 or gain < LEAST_SHARE
        if current.terms[index].stepped:
            idle |= left_out_again(current, evidence, block) >= less.energy
        elif not trial.effect.momentary:
            idle |= left_out(current, index, block) >= less.energy
        if idle:
            current, evidence = _predicting(less, evidence)
            selected = [each for i, each in enumerate(selected) if i != index - start]
    return current, evidence, selected


def _less(
    evidence: Evidence, current: Fit, selected: list[SelectedTerm], number: int
) -> tuple[Fit, Evidence, list[SelectedTerm]]:
    """Without one of the selected terms."""
    less = without(current, evidence, len(current.terms) - len(selected) + number)
    return *_predicting(less, evidence), [*selected[:number], *selected[number + 1 :]]


def _instead(
    evidence: Evidence, current: Fit, selected: list[SelectedTerm], number: int, term: AbstractTerm
) -> tuple[Fit, Evidence, list[SelectedTerm]]:
    """With another term of as many nonlinear parameters in the place of a selected one."""
    index = len(current.terms) - len(selected) + number
    terms = (*current.terms[:index], term, *current.terms[index + 1 :])
    own = selected[number]
    trial = own.trial._replace(candidate=own.trial.candidate._replace(term=term))
    selected = [*selected[:number], own._replace(trial=trial), *selected[number + 1 :]]
    return *_predicting(fit(terms, evidence, current.betas), evidence), selected
