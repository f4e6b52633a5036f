"""What a search found: terms selected in a problem, and the same with a late force put back."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from . import verification
from .naming import Named, Taken
from .predictions import with_predictions
from .problem import Problem
from .regression import Fit, fit


class Solution(NamedTuple):
    """A regression problem and the terms selected in it."""

    problem: Problem
    selection: Named

    def fit_without(self, number: int) -> Fit:
        """The model refitted without the selected term of that number."""
        evidence = with_predictions(self.problem.evidence, self.selection.last)
        return verification.lacking(self.selection, evidence, number)

    def without(self, number: int) -> "Solution":
        """Without the selected term of that number, the others refitted."""
        taken = _but(self.selection.taken, number)
        last = self.fit_without(number) if taken else self.selection.base
        return self._replace(selection=self.selection._replace(last=last, taken=taken))


class Findings(NamedTuple):
    """The terms selected, `recorded`, and what they are examined in, `undelayed`.

    To first order a delay or lag is a column; what that leaves of second order is no fault of the
    other terms. So where the force acts late, `undelayed` is the problem with the force put back,
    and all selected terms but the last, the delay or lag itself. Elsewhere it is `recorded`.
    """

    recorded: Solution
    undelayed: Solution

    @property
    def problem(self) -> Problem:
        """The problem of the force as recorded."""
        return self.recorded.problem

    @property
    def selection(self) -> Named:
        """The terms selected in that problem."""
        return self.recorded.selection

    def examined_in(self, number: int) -> Solution:
        """Where a finding is compared with all the others: a delay or lag as recorded."""
        late = number == len(self.undelayed.selection.taken)
        return self.recorded if late else self.undelayed

    def with_taken(self, taken: Sequence[Taken]) -> "Findings":
        """With something else said of the same terms."""
        recorded, undelayed = (
            each._replace(selection=each.selection._replace(taken=list(taken[:count])))
            for each in self
            for count in (len(each.selection.taken),)
        )
        return Findings(recorded, undelayed)

    def at_base(self, base: Fit) -> "Findings":
        """No findings: that fit of the baseline alone."""
        return alone(Solution(self.problem, self.selection._replace(last=base, taken=[])))

    def fit_without(self, number: int) -> Fit:
        """The model without one of the findings, the others refitted.

        All that undoing a delay or lag removes is its own.
        """
        return self.examined_in(number).fit_without(number)

    def without(self, number: int) -> "Findings":
        """The findings without one of them, the others refitted."""
        count = len(self.undelayed.selection.taken)
        if len(self.selection.taken) == count or number == count:
            return alone(self.recorded.without(number))
        undelayed = self.undelayed.without(number)
        last, others = self.selection.last, undelayed.selection.last
        late, beta, alpha = last.terms[-1], last.betas[-1], last.alphas[-1]
        seen = with_predictions(self.problem.evidence, others)
        now = fit((*others.terms, late), seen, [*others.betas, beta], 0)
        now = now._replace(alphas=(*others.alphas, alpha), betas=(*others.betas, beta))
        taken = _but(self.selection.taken, number)
        recorded = self.recorded._replace(selection=self.selection._replace(last=now, taken=taken))
        return Findings(recorded, undelayed)

    def with_late(self, current: Fit) -> Fit:
        """A fit with the force put back, with the delay or lag itself where there is one."""
        last = self.selection.last
        late = len(last.terms) - len(self.undelayed.selection.last.terms)
        if not late:
            return current
        return current._replace(
            terms=(*current.terms, *last.terms[-late:]),
            betas=(*current.betas, *last.betas[-late:]),
            alphas=(*current.alphas, *last.alphas[-late:]),
        )

    def holdout_residuals(self, less: Fit, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Residuals of the held-out recording without a finding, and with all of them, N, `(J,)`.

        `less`: the fit without it.
        """
        problem, selection = self.undelayed
        rows = self.examined_in(number).problem.held, problem.held
        return verification.residuals(less, selection.last, rows, selection.rephased)


def alone(solution: Solution) -> Findings:
    """The findings of one solution, where the force does not act late."""
    return Findings(solution, solution)


def _but(values: Sequence[Taken], number: int) -> list[Taken]:
    return [value for i, value in enumerate(values) if i != number]
