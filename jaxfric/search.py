"""β of the least reduced cost: the grid in one batched call, the refinement, its derivative."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from . import reduced
from .projections import Rows
from .recording import Recording
from .terms.base import AbstractTerm, Directional, Sum, summands


class Found(NamedTuple):
    """The nonlinear parameters β `(d,)`, whether the refinement converged, and whether β lies on
    the border of its bounds."""

    beta: Float[Array, " d"]
    converged: Bool[Array, ""]
    on_border: Bool[Array, ""]


def _sides(term: AbstractTerm):
    """The shared summands, and the two directions' own, where the directions can be separated."""
    terms = summands(term)
    shared = tuple(t for t in terms if not isinstance(t, Directional))
    sided = [t for t in terms if isinstance(t, Directional)]
    if not any(t.nonlinear for t in sided) or any(t.nonlinear for t in shared):
        return None
    positive = Sum(tuple(leaf for t in sided for leaf in summands(t.positive)))
    return shared, positive


def search(
    term: AbstractTerm, recording: Recording, rows: Rows, box: Float[Array, "2 d"], grid: int | None
) -> Found:
    """β of the least reduced cost L(β) (Kim, Kim & Ha 2004, eq. 17) inside the bounds `box`.

    **Arguments:** `term`, `recording` (prepared), `rows`, its rows; `box`, lower and upper bounds
    `(2, d)`; `grid`, points a side, or `None` for a default.
    """
    if not term.nonlinear:
        yes = jnp.ones((), bool)
        return Found(jnp.zeros((0,), rows.target.dtype), yes, ~yes)
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
            columns = rows.columns(bumps.with_beta(beta), recording)
            return reduced.residual(linear, target, root[:, None] * columns)

        return residuals

    unit, converged = reduced.refine(residuals_of(frozen, frozen_rows, limits), start, cell)
    border = jnp.any((unit <= 0) | (unit >= 1))
    unit = _implicit(residuals_of, unit, (recording, rows, box), (frozen, frozen_rows, limits))
    return Found(reduced.decode(unit, box, logarithmic), converged, border)


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
    columns = rows.columns(reduced.part(term, False), recording)
    basis = reduced.orthonormal(root[:, None] * columns)
    target = root * (rows.target - rows.offset(term, recording))
    return basis, root, reduced.project_out(basis, target[:, None])[:, 0]


def _grid_whole(term, recording, rows, box, logarithmic, points):
    """The best grid point over all nonlinear parameters together, in the unit cube."""
    basis, root, target = _linear(term, recording, rows)
    bumps = reduced.part(term, True)

    def columns(unit):
        beta = reduced.decode(unit, box, logarithmic)
        return rows.columns(bumps.with_beta(beta), recording)

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
    columns = [rows.columns(t, recording) for t in linear if t is not None]
    stacked = jnp.concatenate(columns, axis=1)
    bases = jax.vmap(lambda root: reduced.orthonormal(root[:, None] * stacked))(roots)
    targets = jax.vmap(
        lambda basis, root: reduced.project_out(basis, (root * rows.target)[:, None])[:, 0]
    )(bases, roots)
    bumps = reduced.part(inner, True)
    count = len(inner.nonlinear)

    def columns_at(unit):
        beta = reduced.decode(unit, box[:, :count], logarithmic[:count])
        return rows.columns(bumps.with_beta(beta), recording)

    grid = reduced.grid_points(count, points, roots.dtype)
    costs = reduced.grid_costs(columns_at, grid, bases, targets, roots, False)
    starts, cells = jax.vmap(lambda c: _best(grid, c))(costs)
    return starts.reshape(-1), cells.reshape(-1)


def _best(grid, costs):
    start = grid[jnp.argmin(costs)]
    side = round(grid.shape[0] ** (1 / grid.shape[1]))
    return start, jnp.full_like(start, 1 / (side - 1))
