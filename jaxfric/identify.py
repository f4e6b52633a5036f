"""Identification: the grid in one batched call, the refinement, the mass, the intervals."""

from collections.abc import Mapping

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from . import reduced, signals, uncertainty
from .models import Model, named
from .projections import AbstractProjection, ClosedWindows, Rows, WeakForm
from .recording import Recording
from .terms.base import AbstractTerm, Directional, Sum, bounds as term_bounds
from .terms.inertia import Inertia
from .uncertainty import Estimate
from .units import spell

# Closed windows that use less than this share of the slip time leave most of the record's
# information on the floor; then the weak form, which needs no closing, is the better choice.
LEAST_COVERED = 0.5


class Result(eqx.Enumeration):
    """How an identification ended; each member's text is the diagnosis and the remedy."""

    successful = "The parameters were identified."
    on_border = (
        "The cost is least on the border of a nonlinear parameter's bounds, so that parameter is "
        "not determined. Excite slower motion (the Stribeck velocity must lie well inside the "
        "speeds that the axis slips at), give bounds, or use a model without the bump."
    )
    not_converged = (
        "The refinement stopped before it converged; the parameters are those of the best point "
        "found, never worse than the grid's. Usually the bump hardly shows in the data."
    )
    not_excited = (
        "Condition (15) fails: some columns are linearly dependent on this recording, so that the "
        "parameters with infinite standard error are not determined. Move in both directions and "
        "over a range of speeds, neither constant speed nor rest alone."
    )
    open_windows = (
        "Condition (14) fails: no window with equal end velocities lets the axis slip. Record "
        "until the axis returns to a velocity that it had before (rest, or a whole period), or "
        "use the weak form."
    )
    no_slip = (
        "The axis never slips: its speed does not rise above its noise. Check the velocity or the "
        "column that it was read from, or move faster."
    )
    not_finite = (
        "The signals contain NaN or infinity at samples marked valid. Mask those samples "
        "(Recording(mask=...)) or repair the log."
    )


class Identified(eqx.Module):
    """What identification found.

    - `model`: the sum with its parameters, a [`Model`][jaxfric.models.Model].
    - `covariance`: of `names`, shape `(P, P)`; infinite where not visible.
    - `result`: a member of [`Result`][].
    - `windows`, `covered`: how many windows were used and which share of the slip time they hold.
    - `force_error`: norm(u − û)/norm(u) of the rows of the weak form in slip, inertia included.
    - `cost`: the minimum of the reduced cost, N²·s.
    - `projection`: "closed_windows" or "weak_form".
    """

    model: Model
    covariance: Float[Array, "P P"]
    result: Result
    windows: Float[Array, ""]
    covered: Float[Array, ""]
    force_error: Float[Array, ""]
    cost: Float[Array, ""]
    projection: str = eqx.field(static=True)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters, affine ones first."""
        term = self.model.term
        return tuple(p.name for p in (*term.affine, *term.nonlinear))

    @property
    def parameters(self) -> dict[str, Estimate]:
        """Each parameter's value, standard error and unit, by name."""
        term, units = self.model.term, dict(self.model.units)
        errors = jnp.sqrt(jnp.diagonal(self.covariance, axis1=-2, axis2=-1))
        freedom = uncertainty.BLOCKS - (len(self.names) + 1) // 2
        values = self.model.parameters
        return {
            p.name: Estimate(values[p.name], errors[..., i], spell(p.dimension, units), freedom)
            for i, p in enumerate((*term.affine, *term.nonlinear))
        }


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
    term = _structure(model)
    batched = recording.time.ndim == 2
    prepared = _prepare_batch(recording) if batched else signals.prepare(recording)
    _check(term, projection, prepared)
    if projection is None:
        projection = choose_projection(term, prepared)
    width = projection.half_width if isinstance(projection, WeakForm) else _width(prepared)
    limits = {name: tuple(map(float, pair)) for name, pair in (bounds or {}).items()}
    solve = _identify_batch if batched else _identify
    found = solve(term, prepared, projection, width, tuple(sorted(limits.items())), grid)
    if throw:
        raise_unless_successful(found)
    return found


def raise_unless_successful(found: Identified) -> None:
    """Raises `ValueError` with the diagnosis of the first row that is not successful."""
    for i, index in enumerate(jnp.ravel(found.result._value)):
        if index != Result.successful._value:
            row = f"Row {i}: " if jnp.ndim(found.result._value) else ""
            raise ValueError(row + Result[getattr(Result, result_names()[int(index)])])


def result_names() -> tuple[str, ...]:
    """Names of the members of [`Result`][], in the order of their numbers."""
    return tuple(Result._name_to_item)


def choose_projection(term: AbstractTerm, recording: Recording) -> AbstractProjection:
    """The projection that fits the terms and, outside of jit, the recording."""
    if _beyond_velocity(term):
        return WeakForm(_width(recording))
    if isinstance(recording.time, jax.core.Tracer) or recording.time.ndim == 2:
        return ClosedWindows()
    covered = float(_covered(recording))
    return ClosedWindows() if covered >= LEAST_COVERED else WeakForm(_width(recording))


@eqx.filter_jit
def _covered(recording):
    return ClosedWindows().rows(recording).covered


def _width(recording: Recording) -> int:
    """Half-width of the weak form's kernel, samples: see [`signals.kernel_half_width`][]."""
    return signals.kernel_half_width(recording)


def _structure(model) -> AbstractTerm:
    if isinstance(model, str):
        return named(model)
    if isinstance(model, Identified):
        return model.model.term
    return model.term if isinstance(model, Model) else model


def _beyond_velocity(term: AbstractTerm) -> frozenset[str]:
    return term.coordinates - {"velocity", "acceleration"}


def _check(term, projection, recording):
    beyond = _beyond_velocity(term)
    if isinstance(projection, ClosedWindows) and beyond:
        raise ValueError(
            f"ClosedWindows leaves inertia out, which is exact only for functions of velocity; "
            f"this model depends on {', '.join(sorted(beyond))} too, and acceleration is not "
            "orthogonal to that. Use projection=jaxfric.WeakForm(...), or leave it to the default."
        )
    missing = {"position"} & beyond if recording.position is None else set()
    missing |= {c for c in beyond if c not in ("position", "time") and c not in recording.channels}
    if missing:
        raise ValueError(
            f"The model needs {', '.join(sorted(missing))}, which the recording lacks; "
            f"it has {', '.join(['time', 'velocity', *recording.channels])}."
        )


def _prepare_batch(recording: Recording) -> Recording:
    if recording.velocity is not None:
        return recording
    if isinstance(recording.position, jax.core.Tracer):
        return jax.vmap(signals.prepare)(recording)
    widest = int(jnp.max(jax.vmap(signals.choose_half_width)(recording)))
    return jax.vmap(lambda r: signals.prepare(r, widest))(recording)


@eqx.filter_jit
def _identify_batch(term, recording, projection, width, given, grid):
    def one(row):
        return _identify(term, row, projection, width, given, grid)

    # Small batches: a refinement loop under vmap makes every row wait for the slowest.
    return jax.lax.map(one, recording, batch_size=min(16, recording.time.shape[0]))


@eqx.filter_jit
def _identify(term, recording, projection, width, given, grid) -> Identified:
    finite = _finite(recording)
    recording = _sanitised(recording)
    limits = signals.scales(recording)
    rows = projection.rows(recording)
    weak = rows if projection.keeps_inertia else WeakForm(width).rows(recording)
    active = term if projection.keeps_inertia else _without_inertia(term)
    box = term_bounds(active, limits, dict(given))
    beta, converged, border = _search(active, recording, rows, box, grid)
    solved, jacobian, error = _solve(active, beta, recording, rows)
    weight = rows.positive + rows.negative
    minimum = jnp.sum(weight * error**2)
    inertia = _inertia(term, active, solved, beta, recording, weak, rows, error)
    matrix, alpha, force_error = _assemble(
        term, active, solved, beta, recording, rows, weak, jacobian, error, inertia
    )
    model = Model(term.with_beta(beta), alpha, recording.units)
    slipping = limits.fastest > signals.SLIP_DEVIATIONS * signals.velocity_noise(recording)
    hidden = jnp.any(jnp.isinf(jnp.diagonal(matrix)))
    result = _verdict(finite, slipping, jnp.sum(weight) > 0, hidden, border, converged)
    nothing = ~finite | (jnp.sum(weight) <= 0)
    alpha = jnp.where(nothing, jnp.nan, alpha)
    model = eqx.tree_at(lambda m: m.alpha, model, alpha)
    matrix = jnp.where(nothing, jnp.inf, matrix)
    name = "weak_form" if projection.keeps_inertia else "closed_windows"
    return Identified(
        model, matrix, result, rows.windows, rows.covered, force_error, minimum, name
    )


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
    kept = tuple(t for t in _summands(term) if "acceleration" not in t.coordinates)
    if not kept:
        raise ValueError("The model has no term but inertia; add friction, e.g. terms.Coulomb().")
    return Sum(kept)


def _summands(term: AbstractTerm) -> tuple[AbstractTerm, ...]:
    return term.terms if isinstance(term, Sum) else (term,)


def _sides(term: AbstractTerm):
    """The shared summands, and the two directions' own, where the directions can be separated."""
    terms = _summands(term)
    shared = tuple(t for t in terms if not isinstance(t, Directional))
    sided = [t for t in terms if isinstance(t, Directional)]
    if not any(t.nonlinear for t in sided) or any(t.nonlinear for t in shared):
        return None
    positive = Sum(tuple(leaf for t in sided for leaf in _summands(t.positive)))
    return shared, positive


def _search(term, recording, rows: Rows, box, grid):
    """β of the least reduced cost: grid, then refinement; with what can be said about it."""
    if not term.nonlinear:
        yes = jnp.ones((), bool)
        return jnp.zeros((0,), rows.target.dtype), yes, ~yes
    stopped = jax.lax.stop_gradient
    frozen, frozen_rows, limits = stopped(recording), stopped(rows), stopped(box)
    logarithmic = tuple(p.logarithmic for p in term.nonlinear)
    sides = _sides(term)
    if sides is None:
        start, cell = _grid_whole(term, frozen, frozen_rows, limits, logarithmic, grid)
    else:
        start, cell = _grid_sides(sides, frozen, frozen_rows, limits, logarithmic, grid)

    def residuals_of(recording, rows, box):
        linear, root, target = _linear(term, recording, rows)
        bumps = reduced.part(term, True)

        def residuals(unit):
            beta = reduced.decode(unit, box, logarithmic)
            columns = reduced.weighted(rows, bumps.with_beta(beta), recording)
            return reduced.residual(linear, target, root[:, None] * columns)

        return residuals

    unit, converged = reduced.refine(residuals_of(frozen, frozen_rows, limits), start, cell)
    border = jnp.any((unit <= 0) | (unit >= 1))
    unit = _implicit(residuals_of, unit, (recording, rows, box), (frozen, frozen_rows, limits))
    return reduced.decode(unit, box, logarithmic), converged, border


def _implicit(residuals_of, unit, data, frozen):
    """The minimiser with its derivative by the data: one Newton step with a frozen Hessian.

    At the minimiser the step is zero, and its derivative is that of the implicit function
    theorem, −H⁻¹ ∂(∇L)/∂data; neither grid nor iterations are differentiated.
    """
    unit = jax.lax.stop_gradient(unit)

    def height(residuals, y):
        return 0.5 * jnp.sum(residuals(y) ** 2)

    gradient = jax.jacfwd(lambda y: height(residuals_of(*data), y))(unit)
    hessian = jax.jacfwd(jax.jacfwd(lambda y: height(residuals_of(*frozen), y)))(unit)
    free = jnp.where((unit > 0) & (unit < 1), 1.0, 0.0)
    hessian = hessian * (free[:, None] * free[None, :]) + jnp.diag(1 - free)
    step = jnp.linalg.solve(jax.lax.stop_gradient(hessian), gradient * free)
    # Only the derivative of the step is wanted; its value is rounding.
    step = step - jax.lax.stop_gradient(step)
    return unit - jnp.where(jnp.isfinite(step), step, 0.0)


def _linear(term, recording, rows: Rows):
    """Orthonormal weighted columns without β, root weights, and the force projected, weighted."""
    root = jnp.sqrt(rows.positive + rows.negative)
    columns = reduced.weighted(rows, reduced.part(term, False), recording)
    basis = reduced.orthonormal(root[:, None] * columns)
    offset = term.offset(recording)[:, None]
    target = root * (rows.target - rows.project(offset, jnp.zeros_like(offset))[:, 0])
    return basis, root, reduced.project_out(basis, target[:, None])[:, 0]


def _grid_whole(term, recording, rows, box, logarithmic, points):
    """The best grid point over all nonlinear parameters together, in the unit cube."""
    basis, root, target = _linear(term, recording, rows)
    bumps = reduced.part(term, True)

    def columns(unit):
        beta = reduced.decode(unit, box, logarithmic)
        return reduced.weighted(rows, bumps.with_beta(beta), recording)

    grid = reduced.grid_points(len(logarithmic), points, root.dtype)
    costs = reduced.grid_costs(columns, grid, basis[None], target[None], root[None], False)
    return _best(grid, costs[0])


def _grid_sides(sides, recording, rows, box, logarithmic, points):
    """The best grid points of the two directions: two rows of one batch (eq. 24).

    Where terms are shared (the weak form's inertia), each direction has a copy of its own here;
    the refinement that follows ties them again.
    """
    shared, inner = sides
    roots = jnp.sqrt(jnp.stack([rows.positive, rows.negative]))
    linear = [reduced.part(inner, False), *shared]
    columns = [reduced.weighted(rows, t, recording) for t in linear if t is not None]
    stacked = jnp.concatenate(columns, axis=1)
    bases = jax.vmap(lambda root: reduced.orthonormal(root[:, None] * stacked))(roots)
    targets = jax.vmap(
        lambda basis, root: reduced.project_out(basis, (root * rows.target)[:, None])[:, 0]
    )(bases, roots)
    bumps = reduced.part(inner, True)
    count = len(inner.nonlinear)

    def columns_at(unit):
        beta = reduced.decode(unit, box[:, :count], logarithmic[:count])
        return reduced.weighted(rows, bumps.with_beta(beta), recording)

    grid = reduced.grid_points(count, points, roots.dtype)
    costs = reduced.grid_costs(columns_at, grid, bases, targets, roots, False)
    starts, cells = jax.vmap(lambda c: _best(grid, c))(costs)
    return starts.reshape(-1), cells.reshape(-1)


def _best(grid, costs):
    start = grid[jnp.argmin(costs)]
    side = round(grid.shape[0] ** (1 / grid.shape[1]))
    return start, jnp.full_like(start, 1 / (side - 1))


def _solve(term, beta, recording, rows: Rows):
    """Affine parameters at β, the Jacobian by all parameters, and the residual, unweighted."""
    known = term.with_beta(beta)
    columns = reduced.weighted(rows, known, recording)
    offset = known.offset(recording)[:, None]
    target = rows.target - rows.project(offset, jnp.zeros_like(offset))[:, 0]
    root = jnp.sqrt(rows.positive + rows.negative)
    alpha = least_squares(root[:, None] * columns, root * target)

    def by_beta(beta):
        return reduced.weighted(rows, term.with_beta(beta), recording) @ jax.lax.stop_gradient(alpha)

    steep = jax.jacfwd(by_beta)(beta) if term.nonlinear else jnp.zeros((target.shape[0], 0))
    return alpha, jnp.concatenate([columns, steep.astype(columns.dtype)], axis=1), target - columns @ alpha


def least_squares(columns: Float[Array, "J p"], target: Float[Array, " J"]) -> Float[Array, " p"]:
    """Least-squares coefficients, eq. (19), of least norm where columns depend on each other."""
    scale = jnp.linalg.norm(columns, axis=0)
    scale = jnp.where(scale > 0, scale, 1.0)
    basis = reduced.orthonormal(columns / scale[None, :])
    # R of the QR factorisation; a dependent column has a zero row, and takes no part.
    upper = jnp.triu(basis.T @ (columns / scale[None, :]))
    idle = jnp.diagonal(upper) <= 0
    upper = jnp.where(idle[:, None], jnp.eye(scale.shape[0], dtype=upper.dtype), upper)
    return jax.scipy.linalg.solve_triangular(upper, basis.T @ target) / scale


def _inertia(term, active, alpha, beta, recording, weak: Rows, rows, error):
    """Mass and the variance of it, from what friction leaves in the weak form; NaN without one."""
    if not any(isinstance(t, Inertia) for t in _summands(term)) or active is term:
        return None
    push = weak.project(jnp.zeros_like(recording.velocity)[:, None], recording.velocity[:, None])[:, 0]
    known = active.with_beta(beta)
    friction = known.columns(recording) @ alpha + known.offset(recording)
    friction = weak.project(friction[:, None], jnp.zeros_like(friction)[:, None])[:, 0]
    left = weak.target - friction
    weight = weak.positive + weak.negative
    mass = least_squares((jnp.sqrt(weight) * push)[:, None], jnp.sqrt(weight) * left)
    block = uncertainty.blocks(weak.positive, weak.negative)
    matrix = uncertainty.covariance(push[:, None], left - push * mass[0], weight, block)
    return mass[0], matrix[0, 0]


def _assemble(term, active, alpha, beta, recording, rows, weak, jacobian, error, inertia):
    """Covariance and affine parameters in the order of the whole model, and the force error."""
    weight = rows.positive + rows.negative
    block = uncertainty.blocks(rows.positive, rows.negative)
    if inertia is not None:
        slope = signals.local_quadratic(
            recording, recording.velocity, 8 * signals.interval(recording), 8
        )[1]
        error = error - inertia[0] * slope
    matrix = uncertainty.covariance(jacobian, error, weight, block)
    if inertia is not None:
        place = [i for i, p in enumerate(term.affine) if p.name == "inertia"][0]
        alpha = jnp.insert(alpha, place, inertia[0])
        matrix = jnp.insert(jnp.insert(matrix, place, 0.0, axis=0), place, 0.0, axis=1)
        matrix = matrix.at[place, place].set(inertia[1])
    known = term.with_beta(beta)
    predicted = weak.project(known.columns(recording), known.momentum(recording)) @ alpha
    offset = known.offset(recording)[:, None]
    predicted = predicted + weak.project(offset, jnp.zeros_like(offset))[:, 0]
    use = (weak.positive + weak.negative) > 0
    left = jnp.where(use, weak.target - predicted, 0.0)
    size = jnp.linalg.norm(jnp.where(use, weak.target, 0.0))
    return matrix, alpha, jnp.linalg.norm(left) / jnp.where(size > 0, size, 1.0)

