"""Identification: the grid in one batched call, the refinement, the mass, the intervals."""

from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from . import programs, reduced, signals, uncertainty, weighing
from .identified import Identified, Result, raise_unless_successful
from .models import Model
from .projections import AbstractProjection, Rows, WeakForm
from .question import ask
from .recording import Recording
from .search import Found, search
from .terms.base import AbstractTerm, Sum, bounds as term_bounds, summands
from .terms.inertia import Inertia
from .terms.sample import Scales

# Closed windows that use less than this share of the slip time leave most of the record's
# information on the floor; then the weak form, which needs no closing, is the better choice.
LEAST_COVERED = 0.5


def identify(
    model: AbstractTerm | Model | Identified | str,
    recording: Recording,
    *,
    projection: AbstractProjection | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    grid: int | None = None,
    throw: bool = False,
) -> Identified:
    """The parameters of a sum of terms from a recording (Kim, Kim & Ha 2004, section III).

    **Arguments:**

    - `model`: a sum of terms, a model's name, or an earlier result (its structure is used).
    - `recording`: one recording, or a batch made by `stack`: then every leaf of the result has a
      leading axis, and what goes wrong in a row stays in that row.
    - `projection`: `ClosedWindows()` (no mass, no acceleration; the paper) or
      `WeakForm(half_width)`; by default the terms decide, and closed windows that would
      use less than half of the slip time give way to the weak form.
    - `bounds`: lower and upper bound of nonlinear parameters by name; else from the recording.
    - `grid`: points a side of the grid over the nonlinear parameters.
    - `throw`: raise if any result is not successful.

    **Raises:** `ValueError` for closed windows with terms that depend on more than velocity, and,
    with `throw`, for any other failure.
    """
    question = ask(model, recording, projection, bounds, grid)
    solve = solve_rows if recording.time.ndim == 2 else _identify
    found = solve(*question)
    weak = WeakForm(question.width)
    if projection is None and question.projection != weak and _too_open(found):
        found = solve(*question._replace(projection=weak))
    if throw:
        raise_unless_successful(found)
    return found


def _too_open(found: Identified) -> bool:
    """Whether closed windows leave out too much of a recording that is not traced or a batch."""
    known = not isinstance(found.covered, jax.core.Tracer) and jnp.ndim(found.covered) == 0
    return known and float(found.covered) < LEAST_COVERED


@eqx.filter_jit
def solve_rows(term, recording, projection, width, given, grid) -> Identified:
    """What a [`Question`][jaxfric.question.Question] about a batch asks, row by row."""

    def one(row):
        return _identify(term, row, projection, width, given, grid)

    # Small batches: a refinement loop under vmap makes every row wait for the slowest. Long rows
    # one by one, so that of the ways of `reduced.orthonormal` each goes one, not both.
    count, samples = recording.time.shape
    together = None if samples >= reduced.TALL else min(8, count)
    return jax.lax.map(one, recording, batch_size=together)


class _Sought(NamedTuple):
    """What the nonlinear parameters were sought in, and what was found."""

    limits: Scales
    rows: Rows
    found: Found


def _seek(term, recording, projection, width, given, grid) -> _Sought:
    """The nonlinear parameters."""
    recording = _sanitised(recording)
    limits = signals.scales(recording)
    rows = projection.rows(recording, limits)
    active = term if projection.keeps_inertia else _without_inertia(term)
    box = term_bounds(
        active, limits._replace(fastest=_reached(rows, recording, limits)), dict(given)
    )
    # By default both directions have the bounds that the whole recording suggests.
    alike = not any(name.endswith(("+", "-")) for name, _ in given)
    return _Sought(limits, rows, search(active, recording, rows, box, grid, alike))


def _judge(sought: _Sought, term, recording, projection, width, given, grid) -> Identified:
    """All parameters and what is known about them, from the nonlinear ones."""
    limits, rows, (beta, converged, border, alpha, _) = sought
    finite = _finite(recording)
    recording = _sanitised(recording)
    weak = rows if projection.keeps_inertia else WeakForm(width).rows(recording, limits)
    active = term if projection.keeps_inertia else _without_inertia(term)
    alpha, jacobian, error = _solve(active, beta, recording, rows, alpha)
    weight = rows.positive + rows.negative
    minimum = jnp.sum(weight * error**2)
    alpha, spread, left, pull = _judged(
        active.with_beta(beta), alpha, jacobian, error, term, recording, limits, rows, weak
    )
    matrix = spread.covariance
    nothing = ~finite | (jnp.sum(weight) <= 0)
    alpha = jnp.where(nothing, jnp.nan, alpha)
    matrix = jnp.where(nothing, jnp.inf, matrix)
    model = Model(term.with_beta(beta), alpha, recording.units)
    noise = signals.velocity_noise(recording, limits.interval)
    slipping = limits.fastest > signals.SLIP_DEVIATIONS * noise
    hidden = jnp.any(jnp.isinf(jnp.diagonal(matrix)))
    return Identified(
        model,
        matrix,
        _verdict(finite, slipping, jnp.sum(weight) > 0, hidden, border, converged),
        rows.windows,
        rows.covered,
        weak.relative(left),
        minimum,
        pull,
        "weak_form" if projection.keeps_inertia else "closed_windows",
    )


_identify = programs.kept(_seek, _judge)


class _Judged(NamedTuple):
    """Affine parameters of the whole term, deviations of all parameters, what is left of the weak
    form's rows, and the bias that open ends would leave.
    """

    alpha: Float[Array, " q"]
    deviations: uncertainty.Deviations
    left: Float[Array, " J"]
    open_ends: Float[Array, " q"]


def _judged(
    known, alpha, jacobian, error, term, recording, limits: Scales, rows: Rows, weak: Rows
) -> _Judged:
    """A fit of the term `known` with its uncertainty, and the mass where `term` has one beyond."""
    weight = rows.positive + rows.negative
    place = uncertainty.places(weight)
    index = [i for i, p in enumerate(term.affine) if p.name == "inertia"]
    if not index or alpha.size == len(term.affine):
        left = error
        if weak is not rows:
            left = weak.target - weak.offset(known, recording)
            left = left - weak.columns(known, recording) @ alpha
        spread = uncertainty.deviations(jacobian, error, weight, place)
        return _Judged(alpha, spread, left, jnp.zeros_like(alpha))
    offset = known.offset(recording)
    weighed = weighing.weigh(alpha, jacobian, offset, place, recording, weak)
    # The mass times acceleration is no noise of the friction: Lemma 1 has removed its effect.
    span = 8 * limits.interval
    slope = signals.local_quadratic(recording, recording.velocity, span, 8)[1]
    spread = uncertainty.deviations(jacobian, error - weighed.mass * slope, weight, place)
    pull = weighing.open_ends(jacobian[:, : alpha.size], slope, rows.moving) * weighed.mass
    return _Judged(
        jnp.insert(alpha, index[0], weighed.mass),
        weighed.beside(spread, index[0]),
        weighed.left,
        jnp.insert(pull, index[0], 0.0),
    )


def _reached(rows: Rows, recording: Recording, limits: Scales) -> Float[Array, ""]:
    """The speed that both directions reach in the rows, m/s: no faster bump could be seen."""
    velocity = recording.velocity
    used = jnp.stack([rows.positive > 0, rows.negative > 0])
    if rows.target.shape != velocity.shape:
        used = jnp.stack([velocity > 0, velocity < 0])
    top = jnp.max(jnp.where(used, jnp.abs(velocity)[None, :], 0.0), axis=1)
    both = jnp.min(jnp.where(top > limits.slowest, top, jnp.inf))
    return jnp.maximum(jnp.minimum(limits.fastest, both), 4 * limits.slowest)


def _verdict(finite, slipping, closed, hidden, border, converged):
    result = Result.where(converged, Result.successful, Result.not_converged)
    result = Result.where(border, Result.on_border, result)
    result = Result.where(hidden & ~border, Result.not_excited, result)
    result = Result.where(closed, result, Result.open_windows)
    result = Result.where(slipping, result, Result.no_slip)
    return Result.where(finite, result, Result.not_finite)


def _finite(recording: Recording) -> Bool[Array, ""]:
    signals_ = [recording.time, recording.force, recording.velocity, recording.position]
    good = [jnp.all(jnp.isfinite(s) | ~recording.mask) for s in signals_ if s is not None]
    return jnp.all(jnp.stack(good))


def _sanitised(recording: Recording) -> Recording:
    """Zeros for what is not finite, so that one bad sample cannot spoil sums or gradients."""

    def clean(x):
        inexact = jnp.issubdtype(x.dtype, jnp.inexact)
        return jnp.where(jnp.isfinite(x), x, 0.0) if inexact else x

    usable = recording.mask
    for signal in (recording.force, recording.velocity, recording.time):
        usable = usable & jnp.isfinite(signal)
    return eqx.tree_at(lambda r: r.mask, jax.tree.map(clean, recording), usable)


def _without_inertia(term: AbstractTerm) -> AbstractTerm:
    kept = tuple(t for t in summands(term) if not isinstance(t, Inertia))
    if not kept:
        raise ValueError("The model has no term but inertia; add friction, e.g. terms.Coulomb().")
    return Sum(kept)


def _solve(term, beta, recording, rows: Rows, alpha=None):
    """Affine parameters at β, the Jacobian by all parameters, and the residual, unweighted.

    `alpha`: their values, if known.
    """
    known = term.with_beta(beta)
    columns = rows.columns(known, recording)
    target = rows.target - rows.offset(known, recording)
    root = reduced.root(rows.positive + rows.negative)
    alpha = reduced.least_squares(root[:, None] * columns, root * target, alpha)
    if not term.nonlinear:
        return alpha, columns, target - columns @ alpha

    def by_beta(beta):
        return rows.columns(term.with_beta(beta), recording) @ jax.lax.stop_gradient(alpha)

    jacobian = jnp.concatenate([columns, jax.jacfwd(by_beta)(beta)], axis=1)
    return alpha, jacobian, target - columns @ alpha
