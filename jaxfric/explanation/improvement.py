"""After is never worse than before: findings go until the model that is saved is no worse."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..models import Model
from ..simulation.prediction import delay_of
from ..terms.effects.parameter_mismatch import MISMATCH
from . import parameters as spelled, verification
from .figures import Figures
from .naming import LEAST_SHARE, Named
from .predictions import with_predictions
from .problem import Problem
from .regression import Fit, fit

# The problem in which the remainder of the findings is examined, and the selection there.
Rest = tuple[Problem, Named]


class Errors(NamedTuple):
    """Force errors of one model, by `predict` and through the kernel; `None` without a held-out
    recording.
    """

    here: float
    held: float | None
    filtered: float
    filtered_held: float | None

    def worse(self, before: "Errors", rounding: float) -> list[str]:
        """Which of the figures are worse than before, by more than rounding."""
        pairs = {
            name: (ours, theirs)
            for name, ours, theirs in zip(self._fields, self, before, strict=True)
            if ours is not None and theirs is not None
        }
        # What is not a number is no better than what is.
        return [n for n, (ours, was) in pairs.items() if not ours <= was * (1 + rounding)]


class Improved(NamedTuple):
    """What is reported: the baseline, the findings that are left, and both models' errors.

    `first`: the baseline; `gone`: effects whose findings went, as the model with them is worse;
    `spoilt`: its errors; `refitted`: whether the baseline's values are others than those given;
    `claimed`: the findings that the recording shows, of which the held-out recording does not
    bear out those of the numbers `refuted`.
    """

    first: Fit
    found: Named
    rest: Rest
    refitted: bool
    before: Errors
    after: Errors
    gone: tuple[str, ...] = ()
    spoilt: Errors | None = None
    claimed: tuple[Named, Rest] | None = None
    refuted: tuple[int, ...] = ()


def improved(first: Fit, found: Named, rest: Rest, problem: Problem, figures: Figures) -> Improved:
    """The findings, without those that make the saved model worse than the baseline `first`.

    By either figure, over the same samples. The one goes without which the force error is least.
    """
    units = problem.evidence.motion.units
    base = found._replace(last=first, taken=[])
    refitted = first is not found.base
    start, spoilt = found, None
    while True:
        delay = delay_of(spelled.model(found.last, units))
        before = force_errors(base, (problem, base), problem, figures, units, delay)
        alike = not found.taken and not refitted
        after = before if alike else force_errors(found, rest, problem, figures, units)
        if not after.worse(before, figures.rounding):
            less = None if spoilt is None else _without_idle(found, rest, problem)
            if less is None:
                break
            found, rest = less
            continue
        spoilt = spoilt or after
        if not found.taken:
            found, rest, refitted = base, (problem, base), False
            continue
        fewer = (lacking(found, rest, problem, n) for n in range(len(found.taken)))
        found, rest = min(fewer, key=lambda pair: _here(pair[0], figures, units))
    kept = [taken.trial.candidate.effect.name for taken in found.taken]
    names = [taken.trial.candidate.effect.name for taken in start.taken]
    gone = tuple(dict.fromkeys(n for n in names if names.count(n) > kept.count(n)))
    if spoilt is not None and not gone:
        gone = (MISMATCH,)
    return Improved(first, found, rest, refitted, before, after, gone, spoilt)


def _without_idle(found: Named, rest: Rest, problem: Problem) -> tuple[Named, Rest] | None:
    """Without a finding that stood beside one that went, and by itself is a trifle."""
    for number in range(len(found.taken)):
        less, other = lacking(found, rest, problem, number)
        if 1 - rest[1].last.energy / other[1].last.energy < LEAST_SHARE:
            return less, other
    return None


def elsewhere(found: Named, rest: Rest, units) -> Model:
    """The model as it stands on the held-out recording.

    That is the saved one, but for waves at their phase there and without what belongs to a moment
    that does not return.
    """
    where, left = rest
    there = verification.carried(left.last, where.held, left.rephased)
    late = len(found.last.terms) - len(left.last.terms)
    if late:
        there = with_late(there, found.last, late)
    return spelled.model(there, units)


def with_late(now: Fit, last: Fit, count: int) -> Fit:
    """A fit and the last terms of another one."""
    return now._replace(
        terms=(*now.terms, *last.terms[-count:]),
        betas=(*now.betas, *last.betas[-count:]),
        alphas=(*now.alphas, *last.alphas[-count:]),
    )


def _here(found: Named, figures: Figures, units) -> float:
    error = figures.here(spelled.model(found.last, units))
    return error if np.isfinite(error) else np.inf


def force_errors(
    found: Named, rest: Rest, problem: Problem, figures: Figures, units, delay: float | None = None
) -> Errors:
    """The force errors of a model, on the held-out recording too where there are rows of it.

    `delay`: that of the model whose samples the figures are to be taken over, if another's.
    """
    where, left = rest
    filtered = verification.error(left.last, where.evidence)
    here = figures.here(spelled.model(found.last, units), delay)
    if problem.held is None:
        return Errors(here, None, filtered, None)
    held = figures.held(elsewhere(found, rest, units), delay)
    return Errors(here, held, filtered, verification.error(left.last, where.held, left.rephased))


def beside_others(found: Named, rest: Rest, problem: Problem, number: int) -> Fit:
    """The model without one of the findings, the others refitted.

    Of a force that acts late all that undoing it takes away is its own; the others are refitted
    with the force put back.
    """
    late = number == len(rest[1].taken)
    place, named = (problem, found) if late else rest
    return verification.lacking(named, with_predictions(place.evidence, named.last), number)


def lacking(found: Named, rest: Rest, problem: Problem, number: int) -> tuple[Named, Rest]:
    """The findings without one of them, the others refitted; where the force acts late, too."""
    where, left = rest
    if where is problem or number == len(left.taken):
        less = _less(found, problem, number)
        return less, (problem, less)
    left = _less(left, where, number)
    late = found.last.terms[-1]
    beta, alpha = found.last.betas[-1], found.last.alphas[-1]
    seen = with_predictions(problem.evidence, left.last)
    now = fit((*left.last.terms, late), seen, [*left.last.betas, beta], 0)
    now = now._replace(alphas=(*left.last.alphas, alpha), betas=(*left.last.betas, beta))
    return found._replace(last=now, taken=_but(found.taken, number)), (where, left)


def _less(found: Named, problem: Problem, number: int) -> Named:
    taken = _but(found.taken, number)
    if not taken:
        return found._replace(last=found.base, taken=[])
    evidence = with_predictions(problem.evidence, found.last)
    last = verification.lacking(found, evidence, number)
    return found._replace(last=last, taken=taken)


def _but(values: Iterable, number: int) -> list:
    return [value for i, value in enumerate(values) if i != number]
