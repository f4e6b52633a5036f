"""What a recording is compared with: a model's name, a model, or another simulator's output."""

from typing import NamedTuple

import numpy as np

from ..identified import Identified
from ..models import Model, named
from ..recording import Recording
from ..terms.base import AbstractTerm
from . import parameters as spelled
from .chance import LEVEL, Judge, blocks
from .evidence import Evidence
from .naming import LEAST_SHARE, Named
from .predictions import with_predictions
from .regression import Fit, fit


class Baseline(NamedTuple):
    """A sum of terms, its name, and its parameters where it comes with values."""

    structure: AbstractTerm
    name: str
    model: Model | None = None


class Mismatch(NamedTuple):
    """Parameters whose values are wrong, and what that costs.

    `moved`: number of each parameter among affine and nonlinear ones, with its value before;
    `share`: part of the mean-square residual before that the right values remove; `p_value`;
    `energy`: of the residual before, N².
    """

    moved: dict[int, float]
    share: float
    p_value: float
    energy: float


def baseline_of(given) -> Baseline:
    """The baseline that a name, a sum of terms, a model or an identification stands for."""
    if isinstance(given, str):
        return Baseline(named(given), given)
    if isinstance(given, Identified):
        given = given.model
    if isinstance(given, Model):
        return Baseline(given.term, "model", given)
    if isinstance(given, AbstractTerm):
        return Baseline(given, "model")
    raise ValueError(
        f"baseline is {type(given).__name__}; give a model's name, a sum of terms, a Model, an "
        "Identified, or a Recording of another simulator."
    )


def simulated(simulation: Recording, found: Named) -> Baseline:
    """The baseline that another simulator's output obeys, as explaining that output found it."""
    return Baseline(
        spelled.whole(found.last), "simulation", spelled.model(found.last, simulation.units)
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
    left = evidence.target - columns @ alpha
    return start._replace(columns=columns, residual=left, energy=float(left @ left))


def as_given(model: Model, now: Fit, evidence: Evidence) -> Fit:
    """A fit with its base, the first term, at the model's own values, the others fitted beside.

    The derivatives are those of all parameters, which say what these values are worth.
    """
    given, others = at_values(model, evidence), now.terms[1:]
    for _ in range(2):  # some terms act on what the others predict
        seen = with_predictions(evidence, now)
        beside = seen._replace(target=given.residual)
        rest = fit(others, beside, now.betas[1:], 6) if others else given.only([])
        betas = (*given.betas, *rest.betas)
        now = fit(now.terms, seen, betas, 0)._replace(
            betas=betas,
            alphas=(*given.alphas, *rest.alphas),
            residual=rest.residual,
            energy=rest.energy,
        )
    return now


def mismatch(model: Model, refitted: Fit, evidence: Evidence, seed: int = 0) -> Mismatch | None:
    """Which of a model's values are wrong on a recording; `None` if none is.

    The refitted parameters differ from the given ones by more than their intervals (all of them
    together at 1 %), and by enough of the residual.
    """
    given = at_values(model, evidence)
    share = 1 - refitted.energy / given.energy if given.energy > 0 else 0.0
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    empty = given._replace(columns=given.slopes)
    raw = (refitted.jacobian / np.maximum(np.abs(refitted.jacobian).max(axis=0), 1e-300)).T[None]
    scan = Judge(empty, block, seed)(raw.astype(np.float32))
    p_value = float((1 + np.sum(scan.drawn >= scan.gain[0])) / (1 + len(scan.drawn)))
    if share < LEAST_SHARE or p_value > LEVEL:
        return None
    estimates = list(spelled.estimates(refitted, block, dict(model.units))[0].values())
    before = [*given.alphas[0], *given.betas[0]]
    distance = [
        abs(float(e.value) - b) / max(float(e.standard_error), 1e-300)
        for e, b in zip(estimates, before, strict=False)
    ]
    limit = 3.5  # the normal quantile of 1 % shared among twenty parameters
    moved = {i: b for i, (b, d) in enumerate(zip(before, distance, strict=True)) if d > limit}
    if not moved:
        moved = {int(np.argmax(distance)): before[int(np.argmax(distance))]}
    return Mismatch(moved, float(share), p_value, given.energy)
