"""β of the least reduced cost: the grid in one batched call, the refinement, its derivative."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from . import reduced
from .projections import Rows
from .recording import Recording
from .terms.base import AbstractTerm, Directional, Sum, summands


class Found(NamedTuple):
    """The nonlinear parameters β `(d,)`, whether the refinement converged, and whether β lies on
    the border of its bounds.
    """

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
    logarithmic = tuple(p.logarithmic for p in term.nonlinear)
    problem = _Problem(term, recording, rows, box, logarithmic)
    frozen = jax.lax.stop_gradient(problem)
    sides = _sides(term)
    if sides is None:
        start, cell = _grid_whole(frozen, grid)
    else:
        start, cell = _grid_sides(sides, frozen, grid)
    unit, converged = reduced.refine(frozen.residuals(), start, cell)
    unit = _implicit(jax.lax.stop_gradient(unit), problem)
    border = jnp.any((unit <= 0) | (unit >= 1))
    return Found(reduced.decode(unit, box, logarithmic), converged, border)


class _Problem(eqx.Module):
    """Problem (L) of one recording over the unit cube of its nonlinear parameters."""

    term: AbstractTerm
    recording: Recording
    rows: Rows
    box: Float[Array, "2 d"]
    logarithmic: tuple[bool, ...] = eqx.field(static=True)

    def columns(self, term: AbstractTerm, unit, count: int | None = None) -> Float[Array, "J k"]:
        """The rows of the nonlinear columns of a term at a point of the unit cube."""
        beta = reduced.decode(unit, self.box[:, :count], self.logarithmic[:count])
        return self.rows.columns(term.with_beta(beta), self.recording)

    def linear(self):
        """Orthonormal weighted columns without β, root weights, and the weighted force less
        their part in it.
        """
        root = reduced.root(self.rows.positive + self.rows.negative)
        columns = self.rows.columns(reduced.part(self.term, False), self.recording)
        basis = reduced.orthonormal(root[:, None] * columns)
        target = root * (self.rows.target - self.rows.offset(self.term, self.recording))
        return basis, root, reduced.project_out(basis, target[:, None])[:, 0]

    def residuals(self):
        """The function from the unit cube to the residual whose squared norm is L(β)."""
        basis, root, target = self.linear()
        bumps = reduced.part(self.term, True)

        def residuals(unit):
            columns = root[:, None] * self.columns(bumps, unit)
            return reduced.residual(basis, target, columns)

        return residuals


@jax.custom_jvp
def _implicit(unit, problem: _Problem):
    """The minimiser, with the derivative that the implicit function theorem gives it.

    −H⁻¹ ∂(∇L)/∂data at the minimiser: neither the grid nor the iterations are differentiated.
    An unknown on the border of its bounds does not move.
    """
    return unit


@_implicit.defjvp
def _(primals, tangents):
    unit, problem = primals

    def gradient(unit, problem):
        residuals = problem.residuals()
        return jax.jacfwd(lambda y: 0.5 * jnp.sum(residuals(y) ** 2))(unit)

    _, change = jax.jvp(lambda p: gradient(unit, p), (problem,), (tangents[1],))
    hessian = jax.jacfwd(gradient)(unit, problem)
    free = (unit > 0) & (unit < 1) & (jnp.diagonal(hessian) > 0)
    free = free.astype(unit.dtype)
    hessian = hessian * (free[:, None] * free[None, :]) + jnp.diag(1 - free)
    return unit, -jnp.linalg.solve(hessian, change * free)


def _grid_whole(problem: _Problem, points):
    """The best grid point over all nonlinear parameters together, in the unit cube."""
    basis, root, target = problem.linear()
    bumps = reduced.part(problem.term, True)
    grid = reduced.grid_points(len(problem.logarithmic), points, root.dtype)
    costs = reduced.grid_costs(
        lambda unit: problem.columns(bumps, unit),
        grid,
        basis[None],
        target[None],
        root[None],
        False,
    )
    return _best(grid, costs[0])


def _grid_sides(sides, problem: _Problem, points):
    """The best grid points of the two directions: two rows of one batch (eq. 24).

    Where terms are shared (the weak form's inertia), each direction has a copy of its own here;
    the refinement that follows ties them again.
    """
    shared, inner = sides
    rows, recording = problem.rows, problem.recording
    roots = reduced.root(jnp.stack([rows.positive, rows.negative]))
    linear = [term for term in (reduced.part(inner, False), *shared) if term is not None]
    stacked = jnp.concatenate([rows.columns(term, recording) for term in linear], axis=1)
    bases = jax.vmap(lambda root: reduced.orthonormal(root[:, None] * stacked))(roots)
    targets = jax.vmap(
        lambda basis, root: reduced.project_out(basis, (root * rows.target)[:, None])[:, 0]
    )(bases, roots)
    bumps, count = reduced.part(inner, True), len(inner.nonlinear)
    grid = reduced.grid_points(count, points, roots.dtype)
    costs = reduced.grid_costs(
        lambda unit: problem.columns(bumps, unit, count), grid, bases, targets, roots, False
    )
    starts, cells = jax.vmap(lambda c: _best(grid, c))(costs)
    return starts.reshape(-1), cells.reshape(-1)


def _best(grid, costs):
    start = grid[jnp.argmin(costs)]
    side = round(grid.shape[0] ** (1 / grid.shape[1]))
    return start, jnp.full_like(start, 1 / (side - 1))
