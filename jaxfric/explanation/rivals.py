"""Which of several candidates that fit alike is selected, and which cannot be told from it."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .predictions import with_predictions
from .problem import Problem
from .regression import Fit
from .selection import Selection
from .significance import LEVEL
from .trials import RIVAL, Contest, Finalist

# No idealisation of a reversal, or of what makes a force late, is right to the last tenth of its
# score. A law of three nonlinear parameters finds that tenth in any of them: then the law with
# fewer is selected.
NO_EVIDENCE = 0.9


def simplest(best: Finalist, round_: Contest) -> Finalist:
    """The best, or an idealisation of the same with fewer parameters that does nearly as well."""

    def enough(other: Finalist) -> bool:
        effect = other.effect
        known = effect.at_reversals and not effect.sharp and other.p_value <= LEVEL
        fewer = len(other.betas[-1]) < len(best.betas[-1])
        return known and fewer and other.score >= NO_EVIDENCE * best.score

    if not best.effect.at_reversals:
        return best
    return next((other for other in round_.finalists if enough(other)), best)


# Effects whose force is the same but for 5 % cannot be told apart: between them only noise decides,
# which is never quite as assumed. But one that leaves more than twice as much as the other, four
# times its energy, has been told from it: what it leaves is no noise.
ALIKE, TOLD = 0.95, 4.0


class Rivals(NamedTuple):
    """What cannot be told from the winner of a round.

    `names` of effects, `instead`: of its own effect the parameters; `near`: those that only do as
    well, with another force.
    """

    names: tuple[str, ...]
    instead: tuple[str, ...]
    near: tuple[Finalist, ...]


def with_rivals(
    best: Finalist, round_: Contest, current: Fit, evidence, besides: Sequence[Finalist] = ()
) -> tuple[Finalist, Rivals]:
    """The best, and what cannot be told from it.

    `besides`: finalists that cannot be selected, though they may fit as well.

    Of a line in position and one in time, which are the same at constant speed, the one in position
    is selected: a machine has more pitches than clocks.
    """
    basis, force = current.basis(), _force(best, evidence)
    force = force - basis @ (basis.T @ force)
    alike, near = [], []
    for other in [*round_.finalists, *besides]:
        if other.effect.name == best.effect.name and not _of_another(other, best):
            continue
        theirs = _force(other, evidence)
        theirs = theirs - basis @ (basis.T @ theirs)
        same = _same(force, theirs) and other.energy <= TOLD * best.energy
        # The remainder of a term that is but the first order of its effect is no evidence, neither
        # against significant effects that it is known to be confused with nor against itself.
        effect, rival = best.effect, other.effect
        rough = effect.first_order or rival.first_order
        excused = rough and rival.name in effect.confusable_with
        half = current.energy - other.energy >= 0.5 * (current.energy - best.energy)
        significant = other.p_value <= LEVEL and half
        if same or other.score > best.score - RIVAL or (excused and significant):
            alike.append((other, same))
            near += [other] * (not same and not excused)
    own = best.effect.name
    names = [f.effect.name for f, _ in alike if f.effect.name != own]
    instead = [_parameter(f) for f, _ in alike if f.effect.name == own]
    twin = [f for f, same in alike if same and _line(f, "position") and _selectable(f, round_)]
    if _line(best, "time") and twin and twin[0].p_value <= LEVEL:
        best = twin[0]
        names = [own, *(name for name in names if name != best.effect.name)]
    every, others = dict.fromkeys(names), dict.fromkeys(instead)
    return best, Rivals(tuple(every), tuple(others), tuple(near))


def beside(problem: Problem, selection: Selection, number: int) -> set[str]:
    """The rivals of a selected term that stand beside it in the model.

    One that did as well with another force, and is that force there, has been told from it: the
    model needs both.
    """
    own = selection.selected[number]
    evidence, last = with_predictions(problem.evidence, selection.last), selection.last
    basis = selection.base.basis()
    there: dict[str, list[np.ndarray]] = {}
    for n, each in enumerate(selection.selected):
        if n != number and each.effect.name in own.rivals:
            i = selection.term_index(n)
            force = evidence.columns(last.terms[i], last.betas[i][None])[0] @ last.alphas[i]
            there.setdefault(each.effect.name, []).append(force - basis @ (basis.T @ force))
    forces: dict[str, list[np.ndarray]] = {}
    for finalist in own.near:
        if finalist.effect.name in there:
            force = _force(finalist, evidence)
            forces.setdefault(finalist.effect.name, []).append(force - basis @ (basis.T @ force))
    return {
        name
        for name, theirs in forces.items()
        if all(any(_same(force, other) for other in there[name]) for force in theirs)
    }


def _same(force: np.ndarray, other: np.ndarray) -> bool:
    size = np.linalg.norm(force) * np.linalg.norm(other)
    return bool(size > 0 and abs(force @ other) > ALIKE * size)


def _selectable(finalist: Finalist, round_: Contest) -> bool:
    return any(each is finalist for each in round_.finalists)


def _parameter(finalist: Finalist) -> str:
    """What its force is proportional to."""
    return finalist.trial.candidate.term.affine[0].name


def _of_another(other: Finalist, best: Finalist) -> bool:
    """Whether two terms of one effect are of different parameters of the baseline."""
    return best.effect.by_parameter and _parameter(other) != _parameter(best)


def _line(finalist: Finalist, coordinate: str) -> bool:
    """Whether it is a wave over a coordinate alone."""
    lines = finalist.trial.candidate.lines
    return lines is not None and lines.coordinate == coordinate and not lines.factor


def _force(finalist: Finalist, evidence) -> np.ndarray:
    columns = evidence.columns(finalist.trial.candidate.term, finalist.betas[-1][None])[0]
    return columns @ finalist.alpha
