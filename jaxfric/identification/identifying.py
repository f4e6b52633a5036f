"""Identification: the grid in one batched call, the refinement, the mass, the intervals."""

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .. import checks, programs, signals
from ..checks import Design
from ..data.excerpt import excerpt
from ..data.recording import Recording, require, uniform
from ..models import Model
from ..terms.base import AbstractTerm, Sum, bounds as term_bounds, summands
from ..terms.inertia import Inertia
from ..terms.sample import Scales
from . import reduced, uncertainty, weighing
from .checking import checked, faults
from .identified import LEAST_EXPLAINED, Identified, Result, raise_unless_successful
from .projections import AbstractProjection, Rows, WeakForm
from .search import Found, search
from .setup import set_up

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

    Outside of `jax.jit` the signals and what the model leaves of them are checked too: `warnings`
    and `remarks` of the result, and signals that contradict each other are its `result`. Of more
    than 262,144 samples sixteen pieces, evenly spread, are used, and a remark says so.

    **Raises:** `ValueError` for closed windows with terms that depend on more than velocity, and,
    with `throw`, for any other failure.
    """
    require(recording, "identify", batch=True)
    traced, batch = signals.is_traced(recording), recording.time.ndim == 2
    given = recording.num_samples
    recording = recording if traced or batch else excerpt(recording)
    setup = set_up(
        model, recording if traced or batch else _plain(recording), projection, bounds, grid
    )
    solve = solve_rows if batch else _identify
    found, design = solve(*setup)
    weak = WeakForm(setup.width)
    if projection is None and setup.projection != weak and _too_open(found):
        found, design = solve(*setup._replace(projection=weak))
    found = eqx.tree_at(lambda f: f.model, found, _named_in(found.model, recording.units))
    if not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves((found, recording))):
        found = checked(found, design, recording, faults(recording, given))
    if throw:
        raise_unless_successful(found)
    return found


def _plain(recording: Recording) -> Recording:
    """A recording with nothing of its own that a compiled program would be made for: no name, no
    units, and one of few lengths.
    """
    return dataclasses.replace(uniform(recording), units=())


def _named_in(model: Model, units) -> Model:
    return dataclasses.replace(model, units=units)


def _too_open(found: Identified) -> bool:
    """Whether closed windows leave out too much of a recording that is not traced or a batch."""
    known = not isinstance(found.covered, jax.core.Tracer) and jnp.ndim(found.covered) == 0
    return known and float(found.covered) < LEAST_COVERED


def _solve_rows(term, recording, projection, width, given, grid) -> tuple[Identified, Design]:
    """What a [`Setup`][] of a batch describes, row by row."""

    def one(row):
        return _identify(term, row, projection, width, given, grid)

    # Small batches: a refinement loop under vmap makes every row wait for the slowest. Long rows
    # one by one, so that of the ways of `reduced.orthonormal` each goes one, not both.
    count, samples = recording.time.shape
    together = None if samples >= reduced.TALL else min(8, count)
    return jax.lax.map(one, recording, batch_size=together)


solve_rows = programs.compiled(_solve_rows)


class _Searched(NamedTuple):
    """What the nonlinear parameters were searched in, and what was found; the velocity's noise."""

    limits: Scales
    noise: Float[Array, ""]
    rows: Rows
    found: Found


@programs.compiled
def _search_rows(magnitudes, term, recording, projection, width, given, grid) -> _Searched:
    """The nonlinear parameters."""
    recording = _sanitised(recording)
    limits, noise = _magnitudes(recording) if magnitudes is None else magnitudes
    rows = projection.rows(recording, limits)
    active = term if projection.keeps_inertia else _without_inertia(term)
    box = term_bounds(
        active, limits._replace(fastest=_reached(rows, recording, limits)), dict(given)
    )
    # By default both directions have the bounds that the whole recording suggests.
    alike = not any(name.endswith(("+", "-")) for name, _ in given)
    return _Searched(limits, noise, rows, search(active, recording, rows, box, grid, alike))


@programs.compiled
def _assess(
    searched: _Searched, term, recording, projection, width, given, grid
) -> tuple[Identified, Design]:
    """All parameters and what is known about them, from the nonlinear ones."""
    limits, noise, rows, best = searched
    beta, converged, border, alpha = best[:4]
    finite = _finite(recording)
    recording = _sanitised(recording)
    weak = rows if projection.keeps_inertia else WeakForm(width).rows(recording, limits)
    active = term if projection.keeps_inertia else _without_inertia(term)
    alpha, jacobian, error = _solve(active, beta, recording, rows, alpha)
    weight = rows.positive + rows.negative
    minimum = jnp.sum(weight * error**2)
    alpha, spread, design, pull = _solved(
        active.with_beta(beta), alpha, jacobian, error, term, recording, limits, rows, weak
    )
    matrix = spread.covariance
    nothing = ~finite | (jnp.sum(weight) <= 0)
    alpha = jnp.where(nothing, jnp.nan, alpha)
    matrix = jnp.where(nothing, jnp.inf, matrix)
    unseen = _unseen(term, active, jacobian, weight) & jnp.isinf(jnp.diagonal(matrix))
    known = jnp.where(unseen, jnp.nan, jnp.concatenate([alpha, beta.astype(alpha.dtype)]))
    model = Model(
        term.with_beta(known[alpha.size :].astype(beta.dtype)), known[: alpha.size], recording.units
    )
    slipping = limits.fastest > signals.SLIP_DEVIATIONS * noise
    hidden = jnp.any(jnp.isinf(jnp.diagonal(matrix)))
    rival = jnp.full_like(beta, jnp.nan) if best.rival is None else best.rival
    ambiguous = _outside(rival, beta, matrix)
    error = weak.relative(design.left)
    odd = _Odd(
        described=~(error**2 > 1 - LEAST_EXPLAINED),
        passive=_passive(term, alpha, matrix, design, weak, recording),
    )
    found = Identified(
        model,
        matrix,
        _verdict(finite, slipping, jnp.sum(weight) > 0, hidden, border, converged, ambiguous, odd),
        rows.windows,
        rows.covered,
        error,
        minimum,
        pull,
        "weak_form" if projection.keeps_inertia else "closed_windows",
        jnp.where(ambiguous, rival, jnp.nan) if beta.size else None,
        jnp.full(len(checks.NAMES), jnp.nan, error.dtype),
    )
    return found, design


def _unseen(term, active, jacobian, weight) -> Bool[Array, " P"]:
    """Which parameters, affine ones first, act in no row: zero would be a friction, not a lack.

    A nonlinear one of a direction does not if no affine one of that direction does.
    """
    acts = jnp.any((weight > 0)[:, None] & (jacobian != 0), axis=0)
    own = {p.name: acts[i] for i, p in enumerate(active.affine)}
    idle = [~own[p.name] if p.name in own else jnp.zeros((), bool) for p in term.affine]
    for parameter in term.nonlinear:
        sign = parameter.name[-1]
        beside = [act for name, act in own.items() if name.endswith(sign)] if sign in "+-" else []
        idle.append(~jnp.any(jnp.stack(beside)) if beside else jnp.zeros((), bool))
    return jnp.stack(idle)


class _Odd(NamedTuple):
    """Whether the model explains the force, and whether its inertia and friction are positive."""

    described: Bool[Array, ""]
    passive: Bool[Array, ""]


def _passive(term, alpha, matrix, design: Design, weak: Rows, recording) -> Bool[Array, ""]:
    """Whether neither the inertia nor the friction drives the axis, beyond their intervals.

    Of the friction half the difference of its means forward and backward counts: a constant load,
    which terms that know the direction take up, cancels. The slower and the faster half of the rows
    count each, since a line through both may be negative where nothing moved.
    """
    bound = uncertainty.student_quantile(0.975, uncertainty.COSINES)
    variance = jnp.diagonal(matrix)
    inertia = np.array([p.name == "inertia" for p in term.affine], bool)
    heavy = alpha + bound * jnp.sqrt(variance[: alpha.size]) >= 0
    passive = jnp.all(heavy | ~inertia)
    friction = _by_velocity(term)
    if not friction.any():
        return passive
    speed = jnp.abs(weak.project(recording.velocity[:, None])[:, 0])
    forward, backward = weak.positive > 0, weak.negative > 0
    middle = jnp.nanmedian(jnp.where(forward | backward, speed, jnp.nan))
    for half in (speed <= middle, speed > middle):
        ways = [side & half for side in (forward, backward)]
        both = jnp.stack(ways).astype(alpha.dtype)
        count = jnp.sum(both, axis=1)
        means = both @ design.columns[:, : alpha.size] / jnp.maximum(count, 1)[:, None]
        share = jnp.where(friction, 0.5 * (means[0] - means[1]), 0.0)
        own = jnp.where(jnp.isfinite(matrix), matrix, 0.0)[: alpha.size, : alpha.size]
        error = jnp.sqrt(jnp.maximum(share @ own @ share, 0.0))
        seen = jnp.all(jnp.isfinite(variance[: alpha.size]) | (share == 0)) & jnp.all(count > 0)
        passive = passive & (~seen | (share @ alpha + bound * error >= 0))
    return passive


def _by_velocity(term: AbstractTerm) -> np.ndarray:
    """Which affine parameters are those of functions of the velocity alone, `(p,)`."""
    leaves = summands(term)
    own = [leaf.coordinates == {"velocity"} and not leaf.inertial for leaf in leaves]
    return np.repeat(own, [len(leaf.affine) for leaf in leaves])


def _outside(rival, beta, matrix) -> Bool[Array, ""]:
    """Whether a rival minimum lies beyond the 95 % interval of some parameter; not where NaN."""
    errors = jnp.sqrt(jnp.diagonal(matrix)[matrix.shape[0] - beta.size :])
    bound = uncertainty.student_quantile(0.975, uncertainty.COSINES)
    return jnp.any(jnp.abs(rival - beta) > bound * errors)


def _identify(*setup) -> tuple[Identified, Design]:
    """What a [`Setup`][] of one recording describes, in two programs.

    What is found once in a recording is found on the host, where it needs no compiling.
    """
    recording = setup[1]
    magnitudes = None
    if not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(setup)):
        magnitudes = signals.host_scales(_sanitised(jax.tree.map(np.asarray, recording), np))
    return _assess(_search_rows(magnitudes, *setup), *setup)


def _magnitudes(recording: Recording) -> tuple[Scales, Float[Array, ""]]:
    limits = signals.scales(recording)
    return limits, signals.velocity_noise(recording, limits.interval)


class _Solved(NamedTuple):
    """Affine parameters of the whole term, deviations of all parameters, the rows of the weak form
    that they are compared on, and the bias that open ends would leave.
    """

    alpha: Float[Array, " q"]
    deviations: uncertainty.Deviations
    design: Design
    open_ends: Float[Array, " q"]


def _solved(
    known, alpha, jacobian, error, term, recording, limits: Scales, rows: Rows, weak: Rows
) -> _Solved:
    """A fit of the term `known` with its uncertainty, and the mass where `term` has one beyond."""
    weight = rows.positive + rows.negative
    place = uncertainty.places(weight)
    index = [i for i, p in enumerate(term.affine) if p.name == "inertia"]
    if not index or alpha.size == len(term.affine):
        left, columns = error, jacobian
        if weak is not rows:
            columns = weak.columns(known, recording)
            left = weak.target - weak.offset(known, recording) - columns @ alpha
        spread = uncertainty.deviations(jacobian, error, weight, place)
        design = _design(columns, left, weak)
        return _Solved(alpha, spread, design, jnp.zeros_like(alpha))
    offset = known.offset(recording)
    weighed = weighing.weigh(alpha, jacobian, offset, place, recording, weak)
    # The mass times acceleration is no noise of the friction: Lemma 1 has removed its effect.
    span = 8 * limits.interval
    slope = signals.local_quadratic(recording, recording.velocity, span, 8)[1]
    spread = uncertainty.deviations(jacobian, error - weighed.mass * slope, weight, place)
    pull = weighing.open_ends(jacobian[:, : alpha.size], slope, rows.moving) * weighed.mass
    return _Solved(
        jnp.insert(alpha, index[0], weighed.mass),
        weighed.beside(spread, index[0]),
        _design(_inserted(weighed.columns, index[0]), weighed.left, weak),
        jnp.insert(pull, index[0], 0.0),
    )


def _inserted(columns: Float[Array, "J p"], index: int) -> Float[Array, "J p"]:
    """Columns of which the first belongs at that index."""
    others = columns[:, 1:]
    return jnp.concatenate([others[:, :index], columns[:, :1], others[:, index:]], axis=1)


def _design(columns, left, weak: Rows) -> Design:
    return Design(columns, weak.target, left, weak.positive + weak.negative, weak.time)


def _reached(rows: Rows, recording: Recording, limits: Scales) -> Float[Array, ""]:
    """The speed that both directions reach in the rows, m/s: no faster bump could be seen."""
    velocity = recording.velocity
    used = jnp.stack([rows.positive > 0, rows.negative > 0])
    if rows.target.shape != velocity.shape:
        used = jnp.stack([velocity > 0, velocity < 0])
    top = jnp.max(jnp.where(used, jnp.abs(velocity)[None, :], 0.0), axis=1)
    both = jnp.min(jnp.where(top > limits.slowest, top, jnp.inf))
    return jnp.maximum(jnp.minimum(limits.fastest, both), 4 * limits.slowest)


def _verdict(finite, slipping, closed, hidden, border, converged, ambiguous, odd: _Odd):
    result = Result.where(converged, Result.successful, Result.not_converged)
    result = Result.where(ambiguous, Result.ambiguous, result)
    result = Result.where(border, Result.on_border, result)
    result = Result.where(odd.passive, result, Result.not_passive)
    result = Result.where(odd.described, result, Result.not_described)
    unseen = hidden & (~border | ~odd.described)
    result = Result.where(unseen, Result.not_excited, result)
    result = Result.where(closed, result, Result.open_windows)
    result = Result.where(slipping, result, Result.no_slip)
    return Result.where(finite, result, Result.not_finite)


def _finite(recording: Recording) -> Bool[Array, ""]:
    signals_ = [recording.time, recording.force, recording.velocity, recording.position]
    good = [jnp.all(jnp.isfinite(s) | ~recording.mask) for s in signals_ if s is not None]
    return jnp.all(jnp.stack(good))


def _sanitised(recording: Recording, of=jnp) -> Recording:
    """Zeros for what is not finite, so that one bad sample cannot spoil sums or gradients.

    `of`: the arrays' module, `numpy` on the host.
    """

    def clean(x):
        inexact = jnp.issubdtype(x.dtype, jnp.inexact)
        return of.where(of.isfinite(x), x, x.dtype.type(0)) if inexact else x

    usable = recording.mask
    for signal in (recording.force, recording.velocity, recording.time):
        usable = usable & of.isfinite(signal)
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
