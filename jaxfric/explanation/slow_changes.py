"""What changes slowly, along the stroke or over the record, by how much it changes there.

That is known where its period or time constant, and its size, may be any together.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..data.recording import Recording
from ..identification.uncertainty import Estimate
from ..terms.base import AbstractTerm
from ..terms.effect import REPEATED
from ..terms.effects import traits
from ..terms.position import POSITION_ONLY
from ..terms.sample import Scales
from ..terms.slow import ALONG, OVER_RECORD, RANGE
from ..units import POSITION, spell
from .intervals import Spread
from .regression import Fit

# The ends of the stroke, m.
Stroke = tuple[float, float]
# Places of a curve over time: more than ten in the shortest wave of a load that wanders.
MOMENTS = 200
# By which part of itself a nonlinear parameter is moved for a derivative: the root of the rounding.
STEP = 1e-7


def slow(term: AbstractTerm, beta: np.ndarray, stroke: Stroke) -> bool:
    """Whether a term is one wave over the position that does not repeat within the stroke."""
    if len(term.affine) != 2 or len(term.nonlinear) != 1:
        return False
    period = term.nonlinear[0]
    width = stroke[1] - stroke[0]
    return (
        period.repeats
        and period.dimension == POSITION
        and bool(float(beta[0]) * REPEATED > width > 0)
    )


def together(current: Fit, number: int, stroke: Stroke) -> list[int]:
    """The terms beside the base that a slow wave is told with: of a force over the position, all
    those that do not repeat. Two that overlap may each be any, and their sum is known.
    """
    if current.terms[number].coordinates != POSITION_ONLY:
        return [number]
    return [
        n
        for n, (term, beta) in enumerate(zip(current.terms, current.betas, strict=True))
        if n and term.coordinates == POSITION_ONLY
        and (slow(term, beta, stroke) or not any(p.repeats for p in term.nonlinear))
    ]  # fmt: skip


def stroke_of(limits: Scales) -> Stroke:
    """The ends of a recording's stroke, m."""
    return float(limits.low), float(limits.high)


def along(
    current: Fit, number: int, known: Spread, units: dict[str, str], limits: Scales
) -> dict[str, Estimate]:
    """What a slow wave is at the places of [`ALONG`][] more than in the middle of the stroke, with
    the terms it is told with; empty for another term, and where that is not known.
    """
    term, stroke = current.terms[number], stroke_of(limits)
    if not slow(term, current.betas[number], stroke):
        return {}
    low, high = stroke
    places = 0.5 * (low + high) + 0.5 * (high - low) * np.array([0.0, *ALONG.values()])
    values, weights = np.zeros(len(places)), np.zeros((len(places), len(known.covariance)))
    for n in together(current, number, stroke):
        own = (current.terms[n], current.alphas[n], current.betas[n])
        value, gradient = _wave(*own, places) if n == number else _law(*own, places)
        values += value
        weights[:, current.indices(n)] = gradient
    weights, more = weights[1:] - weights[0], values[1:] - values[0]
    return _estimates(dict(zip(ALONG, more, strict=True)), weights, term, known, units)


def over_record(
    current: Fit, number: int, known: Spread, units: dict[str, str], limits: Scales
) -> dict[str, Estimate]:
    """By how much a force that dies out with time, or one that settles, is more at the end of the
    record than at its start, in its own unit; empty for another term, and where that is not known.
    """
    term = current.terms[number]
    names = [p.name for p in term.nonlinear]
    if not traits(term).settles or len(term.affine) != 1:
        return {}
    at = names.index(traits(term).settles)
    size, constant = float(current.alphas[number][0]), float(current.betas[number][at])
    past = float(limits.duration) / constant
    weights = np.zeros((1, len(known.covariance)))
    weights[0, current.indices(number)[0]] = np.expm1(-past)
    weights[0, current.indices(number)[1 + at]] = size * np.exp(-past) * past / constant
    return _estimates({OVER_RECORD: size * np.expm1(-past)}, weights, term, known, units)


def range_of(
    current: Fit, number: int, known: Spread, units: dict[str, str], limits: Scales
) -> dict[str, Estimate]:
    """How far a curve over time alone moves over the record, from its least to its greatest, in its
    own unit; empty for another term, and where that is not known.

    To first order its error is that of the curve's values at these two moments.
    """
    term = current.terms[number]
    if not traits(term).wanders:
        return {}
    times = float(limits.start) + float(limits.duration) * np.linspace(0.0, 1.0, MOMENTS)
    none = jnp.zeros(MOMENTS)
    columns = np.asarray(term.columns(Recording(jnp.asarray(times), none, none, none)))
    curve = columns @ current.alphas[number]
    high, low = int(np.argmax(curve)), int(np.argmin(curve))
    weights = np.zeros((1, len(known.covariance)))
    weights[0, current.indices(number)] = columns[high] - columns[low]
    return _estimates({RANGE: float(curve[high] - curve[low])}, weights, term, known, units)


def _estimates(
    values: dict[str, float], weights: np.ndarray, term: AbstractTerm, known: Spread,
    units: dict[str, str],
) -> dict[str, Estimate]:  # fmt: skip
    """Sums of parameters, by their names; empty where they are not known."""
    errors = known.errors(weights)
    if not np.all(np.isfinite(errors)):
        return {}
    unit = spell(term.affine[0].dimension, units)
    rows = zip(values.items(), errors, known.degrees_of_freedom(weights), strict=True)
    return {
        name: Estimate(np.float64(value), np.float64(error), unit, float(freedom))
        for (name, value), error, freedom in rows
    }


Curve = tuple[Float[np.ndarray, " K"], Float[np.ndarray, "K q"]]


def _wave(term: AbstractTerm, alpha: np.ndarray, beta: np.ndarray, places: np.ndarray) -> Curve:
    """A wave without what it is multiplied by, and its derivatives, at places, m."""
    angle = 2 * np.pi * places / beta[0]
    waves = np.stack([np.sin(angle), np.cos(angle)], axis=1)
    bend = (alpha[1] * waves[:, 0] - alpha[0] * waves[:, 1]) * angle / beta[0]
    return waves @ alpha, np.concatenate([waves, bend[:, None]], axis=1)


def _law(term: AbstractTerm, alpha: np.ndarray, beta: np.ndarray, places: np.ndarray) -> Curve:
    """A force over the position alone, N, and its derivatives by all its parameters."""
    none = jnp.zeros(len(places))
    motion = Recording(none, none, jnp.asarray(places), none)

    def columns(beta: np.ndarray) -> np.ndarray:
        return np.asarray(term.with_beta(jnp.asarray(beta)).columns(motion))

    own = columns(beta)
    steps = STEP * np.maximum(np.abs(beta), np.ptp(places))
    moved = [columns(beta + step) for step in np.diag(steps)]
    slopes = [(m - own) @ alpha / s for m, s in zip(moved, steps, strict=True)]
    return own @ alpha, np.stack([*own.T, *slopes], axis=1)
