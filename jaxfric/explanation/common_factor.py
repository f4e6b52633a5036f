"""One factor for all forces of a baseline, instead of many wrong values: a gain that is another."""

import dataclasses
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from ..identification.uncertainty import Estimate
from ..models import Model
from ..terms import KNOWN_FORCE
from . import parameters as spelled, verification
from .acceptance import LINEARITY
from .baseline import Baseline, as_given
from .doubts import friction_of
from .evidence import Evidence
from .findings import Solution
from .intervals import spread
from .least_squares import orthonormal
from .mismatch import Mismatch, apart
from .predictions import with_predictions
from .regression import Fit, fit
from .significance import evenly

# The factor by its name among the values that moved.
FACTOR = "force_factor"
# A common factor says something where its error is a quarter of its distance from one.
KNOWN_FACTOR = 0.25


def scaled(model: Model, times: float | np.ndarray) -> Model:
    """The model with its forces, or each affine parameter, that many times as large."""
    return dataclasses.replace(model, alpha=jnp.asarray(np.asarray(model.alpha) * times))


def put_right(model: Model, wrong: Mismatch | None) -> tuple[Model, tuple[int, ...]]:
    """The model, with its factor if any, and the numbers of its values that are to be fitted."""
    if wrong is None:
        return model, ()
    if wrong.factor is None:
        return model, tuple(wrong.moved)
    return scaled(model, wrong.factor), wrong.unknown


def with_factor(known: Baseline, solution: Solution, wrong: Mismatch) -> Mismatch:
    """The wrong values, as one factor where what they leave less does not pay for their numbers
    (Schwarz 1978), or is no more than a sensor of force resolves.

    `friction` of the result: whether a factor of friction alone does as well, as where the motion
    hardly accelerates.
    """
    model, (problem, selection) = known.model, solution
    # A simulator's values are corrections of its force, none of them a part of it.
    if model is None or len(wrong.moved) < 2 or KNOWN_FORCE in model.term.coordinates:
        return wrong
    factor, unknown = factor_of(known, solution), _unknown(known)
    value, half = float(factor.value), float(factor.half_width())
    if not (value > 0 and half <= KNOWN_FACTOR * abs(value - 1)):
        return wrong
    evidence, last = problem.evidence, selection.last
    values = as_given(model, last, evidence, tuple(wrong.moved)).energy
    floor = LINEARITY**2 * float(evidence.force @ evidence.force)
    size = selection.remaining.size
    price = 0.5 * (len(wrong.moved) - 1 - len(unknown)) * np.log(max(size, 2.0))

    def as_well(times: float | np.ndarray) -> bool:
        """Whether the parameters that many times leave as little as the wrong values."""
        left = as_given(scaled(model, times), last, evidence, unknown).energy
        score = 0.5 * size * np.log(left / max(values, 1e-300)) - price
        return bool(score < 0 or left - values < floor)

    if not as_well(value):
        return wrong
    alpha = np.asarray(model.alpha, float)
    own = np.isin(np.arange(len(alpha)), friction_of((model.term,)))
    alone = _Rows.of(known, last, evidence, own).factor
    moved = {i: float(a) for i, a in enumerate(alpha) if a and i not in unknown}
    return wrong._replace(
        moved=moved, factor=value, unknown=unknown, friction=as_well(1 + own * (alone - 1)),
        instead={},
    )  # fmt: skip


def _unknown(known: Baseline) -> tuple[int, ...]:
    """The values of an earlier recording whose intervals hold zero: of a bump that it hardly shows
    it says nothing that a factor could be told by.
    """
    if known.errors is None or known.model is None:
        return ()
    values = np.concatenate([np.asarray(known.model.alpha), np.asarray(known.model.term.beta())])
    return tuple(int(i) for i in np.flatnonzero(2 * known.errors > np.abs(values)))


def factor_of(known: Baseline, solution: Solution) -> Estimate:
    """The factor of all of the baseline's forces, beside the terms found, with what a kernel of
    twice the width and the held-out recording change; of an earlier recording also with the errors
    of what that one obeys.
    """
    problem, selection = solution
    last, evidence = selection.last, problem.evidence
    found = {FACTOR: _by_rows(known, last, evidence, problem.block)}
    if problem.wide is not None:
        there = fit(last.terms, with_predictions(problem.wide, last), last.betas, 0)
        block = evenly(len(problem.wide.rows), int(problem.block[-1]) + 1)
        wide = {FACTOR: _by_rows(known, there, problem.wide, block)}
        found = spelled.with_smoothing(found, wide)
    if problem.held is not None:
        there = verification.lasting(last, selection.rephased)
        there = fit(there.terms, with_predictions(problem.held, there), there.betas, 0)
        block = evenly(len(problem.held.rows), int(problem.block[-1]) + 1)
        held = {FACTOR: _by_rows(known, there, problem.held, block)}
        found = spelled.with_elsewhere(found, held)
    return found[FACTOR]


class _Rows(NamedTuple):
    """The residual at the values as given, N, and the force that is to be some times as large, both
    `(J,)`, apart from the terms found and from values that are not known; the derivatives by all
    values, `(J, P)`, and a basis of what they are apart from, `(J, r)`.
    """

    residual: np.ndarray
    force: np.ndarray
    own: np.ndarray
    beside: np.ndarray

    @staticmethod
    def of(known: Baseline, last: Fit, evidence: Evidence, some: np.ndarray) -> "_Rows":
        """The rows of some evidence; `some`: of which affine values the force is, `(p,)`."""
        residual, own, beside = apart(known.model, last, evidence)
        unknown = list(_unknown(known))
        more = orthonormal(own[:, unknown])
        own, residual = own - more @ (more.T @ own), residual - more @ (more.T @ residual)
        own[:, unknown] = 0.0
        force = own[:, : len(some)] @ (some * np.asarray(known.model.alpha, float))
        return _Rows(residual, force, own, np.concatenate([beside, more], axis=1))

    @property
    def factor(self) -> float:
        """How many times the force leaves least."""
        power = max(float(self.force @ self.force), 1e-300)
        return 1 + float(self.force @ self.residual) / power


def _by_rows(known: Baseline, last: Fit, evidence: Evidence, block: np.ndarray) -> Estimate:
    """The factor by some rows."""
    rows = _Rows.of(known, last, evidence, np.ones(len(known.model.alpha)))
    current = last._replace(
        columns=np.concatenate([rows.force[:, None], rows.beside], axis=1),
        slopes=np.zeros((len(rows.force), 0)),
        residual=rows.residual - (rows.factor - 1) * rows.force,
    )
    seen = spread(current, block)
    freedom = seen.degrees_of_freedom(np.eye(1, len(seen.covariance)))[0]
    variance = float(seen.covariance[0, 0])
    if known.covariance is not None:
        # A value of the earlier recording that is off moves the factor by its part of the force.
        power = max(float(rows.force @ rows.force), 1e-300)
        pull = rows.factor * (rows.force @ rows.own) / power
        finite = np.where(np.isfinite(known.covariance), known.covariance, 0.0)
        variance += float(pull @ finite @ pull)
    return Estimate(np.float64(rows.factor), np.float64(np.sqrt(variance)), "1", float(freedom))
