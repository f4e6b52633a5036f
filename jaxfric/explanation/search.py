"""The search for missing physics: in slip, then across reversals; with a late force put back."""

from collections.abc import Hashable

import numpy as np

from ..models import Model
from ..terms.base import AbstractTerm
from ..terms.effects import EFFECTS, traits
from . import verification
from .acceptance import HALF
from .baseline import as_given
from .findings import Findings, Solution, alone
from .motion import Motion
from .predictions import with_predictions
from .problem import Problem, across_reversals, problem_of, realigned
from .regression import fit
from .selection import SelectedTerm, Selection
from .stepwise import select
from .timing import MOST_LATE, LateForce, late, overlooked, with_late_force
from .trials import RIVAL, Contest

# Forms of laws that do not compete.
Refused = frozenset[Hashable]


def searched(
    motion: Motion, problem: Problem, seed: int, refused: Refused = frozenset()
) -> Findings:
    """The findings on a recording; laws of the forms in `refused` do not compete.

    One law for all parts of the force takes more than the law of any one part, whatever is true.
    Where it was found or came first, the search is done once more without it, and what explains
    more, the numbers paid for, is told.
    """
    first = select(problem, seed, refused=refused, first=True)
    found = _searched(motion, problem, seed, refused, first)
    if not any(each.effect.composite for each in (*first.selected, *found.selection.selected)):
        return found
    every = problem.candidate_set.candidates
    without = refused | {each.form for each in every if each.effect.composite}
    first = select(problem, seed, refused=without, first=True)
    return _of_two(found, _searched(motion, problem, seed, without, first))


def _of_two(found: Findings, other: Findings) -> Findings:
    """The better ones of two findings, which may be the others where these do nearly as well.

    An effect that is composite has been told, as a whole, from the effects in its place.
    """
    size = min(each.selection.remaining.size for each in (found, other))
    scores = [_score(each, size) for each in (found, other)]
    if scores[1] > scores[0]:
        found, other = other, found
    told = abs(scores[1] - scores[0]) > RIVAL
    names = found.selection.names, other.selection.names

    def rivalled(each: SelectedTerm) -> SelectedTerm:
        rivals = tuple(name for name in each.rivals if not EFFECTS[name].composite)
        if not told and each.effect.name not in names[1]:
            rivals = tuple(dict.fromkeys((*rivals, *sorted(names[1] - names[0]))))
        return each._replace(rivals=rivals)

    return found.with_selected(list(map(rivalled, found.selection.selected)))


def _score(findings: Findings, size: float) -> float:
    """The log-likelihood less the price of the numbers of all terms (Schwarz 1978)."""
    terms = [each.trial.candidate.term for each in findings.selection.selected]
    count = sum(len(term.affine) + len(term.nonlinear) + term.chosen for term in terms)
    return -0.5 * float(size * np.log(_left(findings.undelayed)) + count * np.log(max(size, 2)))


def _searched(
    motion: Motion, problem: Problem, seed: int, refused: Refused, first: Selection
) -> Findings:
    """The findings on a recording that begin with the `first`.

    To first order a delay is a column; what it leaves of second order would be selected too. So
    where the force acts late it is put back, and the search is done once more.
    """
    at_once = _late_at_once(motion, problem, first, seed, refused)
    if at_once is not None:
        return at_once
    found = aligned(motion, problem, seed, refused, first)
    # Rows across reversals hold more than a delay or a lag, of which not all may be known.
    in_slip = found.problem.in_slip or found.problem, found.selection.in_slip or found.selection
    lateness = None
    if any(traits(term).late for term in found.selection.last.terms):
        lateness = late(motion, *in_slip)
    sure = lateness is not None
    lateness = lateness or overlooked(motion, *in_slip, seed)
    if lateness is None:
        return alone(found)
    findings = with_late_force(found, _put_back(motion, found, lateness, seed, refused), lateness)
    after, before = (
        verification.error(each.selection.last, each.problem.evidence)
        for each in (findings.undelayed, found)
    )
    return alone(found) if not sure and after >= before else findings


def _late_at_once(
    motion: Motion, problem: Problem, first: Selection, seed: int, refused: Refused
) -> Findings | None:
    """The findings where the first is a late force that takes most of what there is.

    Its second order would be fitted by other terms before it is put back. It is late where most
    goes with it beside what is found then, too; else the whole search has to tell.
    """
    if not any(each.effect.late for each in first.selected):
        return None
    if 1 - first.last.energy / first.base.energy < MOST_LATE:
        return None
    lateness = late(motion, problem, first)
    if lateness is None:
        return None
    found = Solution(problem, first)
    undelayed = _put_back(motion, found, lateness, seed, refused)
    later = _beside(motion, found, undelayed, lateness)
    if later is None:
        return None
    if abs(later.time - lateness.time) > later.time_error:
        lateness, undelayed = later, _put_back(motion, found, later, seed, refused)
    if undelayed.problem.reversals:
        found = Solution(across_reversals(motion, problem), first)
    findings = with_late_force(found, undelayed, lateness)
    others = findings.undelayed.selection.last
    evidence = with_predictions(found.problem.evidence, others)
    without = fit(others.terms, evidence, others.betas, 6)
    error = verification.error(others, findings.undelayed.problem.evidence)
    late_part = 1 - (error / verification.error(without, evidence)) ** 2
    return findings if late_part >= MOST_LATE else None


def _beside(
    motion: Motion, found: Solution, undelayed: Solution, lateness: LateForce
) -> LateForce | None:
    """The late force beside the terms that are selected once it is put back, in slip."""
    problem, selection = undelayed
    if not selection.selected:
        return lateness
    in_slip = Solution(problem.in_slip or problem, selection.in_slip or selection)
    both = with_late_force(found, in_slip, lateness)
    return late(motion, *both.recorded)


def _put_back(
    motion: Motion, found: Solution, lateness: LateForce, seed: int, refused: Refused
) -> Solution:
    """The terms selected once a late force is put back."""
    undone = lateness.undone(motion)
    before = found.problem
    again = problem_of(undone, before.structure, before, before.evidence.width)
    return aligned(undone, again, seed, refused)


def nothing(problem: Problem) -> Findings:
    """No findings, and no search for any."""
    problem.close()
    remaining = Contest([], [], float(len(problem.base.residual)))
    return alone(Solution(problem, Selection(problem.base, problem.base, [], remaining)))


def obeying(motion: Motion, structure: AbstractTerm, seed: int) -> Solution:
    """The terms that a recording obeys beside a structure."""
    return aligned(motion, problem_of(motion, structure), seed)


def aligned(
    motion: Motion,
    problem: Problem,
    seed: int,
    refused: Refused = frozenset(),
    first: Selection | None = None,
) -> Solution:
    """The terms selected, force and motion aligned by them.

    The base alone may be aligned falsely by what it lacks, so that the first term aligns them anew
    before others are looked for; and all of them once more, if they still ask for it. `first`: the
    selection of the first term, where that is known.
    """
    first = first or select(problem, seed, refused=refused, first=True)
    if not first.selected:
        return _across(motion, problem, first, seed, refused)
    again = realigned(motion, problem, first.last)
    found = _selected(motion, again, seed, refused, first if again is problem else None)
    if len(found.selection.selected) == 1 and found.selection.names == first.names:
        return found
    again = realigned(motion, found.problem, found.selection.last)
    if again is found.problem:
        return found
    other = _selected(motion, again, seed, refused)
    # Another way through the candidates may miss what is known already: noise cannot be halved.
    return found if _left(found) < HALF * _left(other) else other


def _left(solution: Solution) -> float:
    """The part of the force's power that a solution leaves in its rows."""
    return verification.error(solution.selection.last, solution.problem.evidence) ** 2


def _selected(
    motion: Motion, problem: Problem, seed: int, refused: Refused, begun: Selection | None = None
) -> Solution:
    """What rows in slip show, and then rows across reversals."""
    in_slip = select(problem, seed, refused=refused, begun=begun)
    return _across(motion, problem, in_slip, seed, refused)


def _across(
    motion: Motion, problem: Problem, in_slip: Selection, seed: int, refused: Refused
) -> Solution:
    """What rows across reversals show beyond those in slip, where the axis yields there.

    What acts at reversals is ten times as large in those, and no term has quite its shape: the
    remainder would hide all else.
    """
    across = across_reversals(motion, problem)
    if not across.reversals:
        return Solution(across, in_slip)
    return Solution(across, select(across, seed, in_slip, refused))


def at_given(model: Model, findings: Findings, free: tuple[int, ...]) -> Findings:
    """The findings beside the baseline's own values, but for those that the recording refutes."""

    def given(solution: Solution) -> Solution:
        problem, selection = solution
        base, last = (
            as_given(model, each, problem.evidence, free)
            for each in (selection.base, selection.last)
        )
        return Solution(problem, selection._replace(base=base, last=last, given=model, free=free))

    recorded = given(findings.recorded)
    if findings.undelayed is findings.recorded:
        return Findings(recorded, recorded)
    undelayed = given(findings.undelayed)
    # A delay or a lag is known by undoing it: what its first order would be is another time.
    known, others = recorded.selection.last, undelayed.selection.last
    late = findings.selection.last.alphas[len(others.terms) :]
    last = known._replace(betas=(*others.betas, *known.betas[len(others.terms) :]),
                          alphas=(*others.alphas, *late))  # fmt: skip
    selection = recorded.selection._replace(last=last)
    return Findings(recorded._replace(selection=selection), undelayed)
