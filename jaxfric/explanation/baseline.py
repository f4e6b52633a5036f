"""What a recording is compared with: a model's name, a model, or another simulator's output."""

from typing import NamedTuple

import numpy as np

from ..data.recording import described
from ..identification.identified import Identified
from ..models import Model, named, require
from ..terms import KNOWN_FORCE
from ..terms.base import AbstractTerm
from .evidence import Evidence
from .least_squares import orthonormal, solve
from .predictions import with_predictions
from .regression import Fit, fit


class Baseline(NamedTuple):
    """A sum of terms, its name, and its parameters where it comes with values.

    Of another recording also what it obeys, term by term, `fit`, and the `covariance` of its
    parameters, affine ones first, `(P, P)`, infinite where not visible; `structured`, the
    coordinates over which it leaves structure, and whether its residual is `rough`: neither is a
    difference; and its `rows`. `start`: β from which the sum is fitted, `(d,)`, where they are
    known.
    """

    structure: AbstractTerm
    name: str
    model: Model | None = None
    covariance: np.ndarray | None = None
    fit: Fit | None = None
    structured: frozenset[str] = frozenset()
    rough: bool = False
    start: np.ndarray | None = None
    rows: Evidence | None = None

    @property
    def errors(self) -> np.ndarray | None:
        """The standard errors of another recording's parameters, `(P,)`."""
        return None if self.covariance is None else np.sqrt(np.diagonal(self.covariance))


def baseline_of(given) -> Baseline:
    """The baseline that a name, a sum of terms, a model or an identification stands for.

    **Raises:** `ValueError` for anything else, and for a model that lacks values.
    """
    if isinstance(given, Baseline):
        return given
    if isinstance(given, str):
        return Baseline(named(given), given)
    if isinstance(given, Identified):
        given = given.model
    if isinstance(given, Model):
        require(given, "explain (baseline)")
        _check_values(given)
        name = "simulator" if KNOWN_FORCE in given.term.coordinates else "model"
        return Baseline(given.term, name, given, start=beginning(given.term))
    if isinstance(given, AbstractTerm):
        return Baseline(given, "model")
    raise ValueError(
        f"baseline is {described(given)}; give a model's name, a sum of terms, a Model, an "
        "Identified, simulators.Known(force), a function from a recording to a simulator's force, "
        "or a Recording: an earlier one of this machine, or of another simulator."
    )


def beginning(term: AbstractTerm) -> np.ndarray | None:
    """The parameters of a term that comes with values, `(d,)`, where it has a wave: whose period is
    known to a part of a cycle in the stroke, which no grid tells as well. `None`, to look for them
    anew, of others.
    """
    if not any(parameter.repeats for parameter in term.nonlinear):
        return None
    return np.asarray(term.beta(), float).reshape(len(term.nonlinear))


def _check_values(model: Model) -> None:
    """Raise `ValueError` for a model of which not every value is known."""
    lacking = [n for n, value in model.parameters.items() if not np.isfinite(float(value))]
    if lacking:
        raise ValueError(
            f"The baseline has no value for {', '.join(lacking)}, which its recording did not "
            "show. Give the model's name, or its terms alone, to have all of them fitted."
        )


def at_values(model: Model, evidence: Evidence) -> Fit:
    """The model at its own values, as a fit to which nothing was fitted."""
    term = model.term
    alpha = np.asarray(model.alpha, float)
    beta = np.asarray(term.beta(), float).reshape(len(term.nonlinear))
    empty = np.zeros((len(evidence.target), 0))
    start = Fit((term,), (beta,), (alpha,), empty, empty, evidence.target, 0.0)
    seen = with_predictions(evidence, start)
    columns = seen.columns(term, beta[None])[0]
    residual = evidence.target - columns @ alpha
    return start._replace(columns=columns, residual=residual, energy=float(residual @ residual))


def refitted(
    evidence: Evidence, known: Fit, model: Model | None, free: tuple[int, ...], iterations: int
) -> Fit:
    """A fit fitted again to other rows of the machine; with `model`, as [`as_given`][]."""
    if model is not None:
        return as_given(model, known, evidence, free, iterations)
    return fit(known.terms, with_predictions(evidence, known), known.betas, iterations)


def as_given(
    model: Model, current: Fit, evidence: Evidence, free: tuple[int, ...] = (), iterations: int = 6
) -> Fit:
    """A fit with its base, the first term, at the model's own values, the others fitted beside.

    `free`: parameters of the base that are fitted too, numbers among affine and nonlinear ones. The
    derivatives are those of all parameters, which say what these values are worth. `iterations`: of
    the others' β.
    """
    given, others = at_values(model, evidence), current.terms[1:]
    count = len(given.alphas[0])
    searched = given.betas[0].copy()
    for i in free:
        if i >= count:
            searched[i - count] = current.betas[0][i - count]
    fixed = [i for i in range(count) if i not in free]
    for _ in range(2):  # some terms act on what the others predict
        seen = with_predictions(evidence, current)
        if others:
            columns = seen.columns(given.terms[0], searched[None])[0]
            rest = seen.target - columns[:, fixed] @ given.alphas[0][fixed]
            beside = orthonormal(np.delete(columns, fixed, axis=1)) if free else None
            own = fit(others, seen._replace(target=rest), current.betas[1:], iterations, beside)
            current = current._replace(betas=(searched, *own.betas))
        current = fit(current.terms, seen, (searched, *current.betas[1:]), 0)
        alpha = np.zeros(current.columns.shape[1])
        alpha[fixed] = given.alphas[0][fixed]
        open_ = [i for i in range(len(alpha)) if i not in fixed]
        alpha[open_] = solve(current.columns[:, open_], seen.target - current.columns @ alpha)
        residual = seen.target - current.columns @ alpha
        ends = np.cumsum([len(a) for a in current.alphas])[:-1]
        current = current._replace(
            betas=(searched, *current.betas[1:]),
            alphas=tuple(np.split(alpha, ends)),
            residual=residual,
            energy=float(residual @ residual),
        )
    return current
