"""What a search found: terms selected in a problem, and the same with a late force put back."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..models import Model
from . import parameters as spelled, verification
from .predictions import with_predictions
from .problem import Problem
from .regression import Fit, fit
from .selection import SelectedTerm, Selection


class Solution(NamedTuple):
    """A regression problem and the terms selected in it."""

    problem: Problem
    selection: Selection

    def fit_without(self, number: int) -> Fit:
        """The model refitted without the selected term of that number."""
        evidence = with_predictions(self.problem.evidence, self.selection.last)
        return verification.lacking(self.selection, evidence, number)

    def without(self, number: int) -> "Solution":
        """Without the selected term of that number, the others refitted."""
        selected = _but(self.selection.selected, number)
        if not selected:
            return self._replace(selection=self.selection.at_base(self.selection.base))
        last = self.fit_without(number)
        return self._replace(selection=self.selection._replace(last=last, selected=selected))


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
    def selection(self) -> Selection:
        """The terms selected in that problem."""
        return self.recorded.selection

    def examined_in(self, number: int) -> Solution:
        """Where a finding is compared with all the others: a delay or lag as recorded."""
        late = number == len(self.undelayed.selection.selected)
        return self.recorded if late else self.undelayed

    def with_selected(self, selected: Sequence[SelectedTerm]) -> "Findings":
        """With something else said of the same terms."""
        recorded, undelayed = (
            each._replace(selection=each.selection._replace(selected=list(selected[:count])))
            for each in self
            for count in (len(each.selection.selected),)
        )
        return Findings(recorded, undelayed)

    def at_base(self, base: Fit) -> "Findings":
        """No findings: that fit of the baseline alone."""
        return alone(Solution(self.problem, self.selection.at_base(base)))

    def fit_without(self, number: int) -> Fit:
        """The model without one of the findings, the others refitted.

        All that undoing a delay or lag removes is its own.
        """
        return self.examined_in(number).fit_without(number)

    def without(self, number: int) -> "Findings":
        """The findings without one of them, the others refitted."""
        count = len(self.undelayed.selection.selected)
        if len(self.selection.selected) == count or number == count:
            return alone(self.recorded.without(number))
        undelayed = self.undelayed.without(number)
        last, others = self.selection.last, undelayed.selection.last
        late, beta, alpha = last.terms[-1], last.betas[-1], last.alphas[-1]
        seen = with_predictions(self.problem.evidence, others)
        current = fit((*others.terms, late), seen, [*others.betas, beta], 0)
        current = current._replace(alphas=(*others.alphas, alpha), betas=(*others.betas, beta))
        selected = _but(self.selection.selected, number)
        selection = self.selection._replace(last=current, selected=selected)
        return Findings(Solution(self.problem, selection), undelayed)

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

    def model(self, current: Fit) -> Model:
        """One of its fits as a model of the force as recorded."""
        problem = self.undelayed.problem
        return spelled.model(current, problem.evidence.motion.units, problem.delay)

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


def _but(values: Sequence[SelectedTerm], number: int) -> list[SelectedTerm]:
    return [value for i, value in enumerate(values) if i != number]
