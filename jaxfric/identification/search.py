"""β of the least reduced cost: the grid in one batched call, the refinement, its derivative."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..data.recording import Recording
from ..terms.base import AbstractTerm, Directional, Sum, summands
from ..terms.friction import AbstractBump, Coulomb, Viscous
from . import blocks, compress, reduced, small
from .grids import Plan
from .problem import Problem
from .projections import Rows
from .sides import Sides

# Roundings by which sums over many samples may differ from those over nodes; up to a million
# samples they differ by four.
EXACT = 64
# Points of a grid in a row of which fewer nodes choose the one that all nodes are asked about:
# some 40 % of β, less than a bump's relative width. Fewer nodes alone went astray on 17 of 2000
# drawn problems, so not at all.
STRETCH = 8


class Found(NamedTuple):
    """The nonlinear parameters β `(d,)`, whether the refinement converged, and which of them lie on
    the border of their bounds; where nodes say them too, with no derivative: `alpha`, the affine
    parameters `(p,)`, and `minimum`, the cost of the samples there, N²·s, infinite where they do
    not agree.
    """

    beta: Float[Array, " d"]
    converged: Bool[Array, ""]
    border: Bool[Array, " d"]
    alpha: Float[Array, " p"] | None = None
    minimum: Float[Array, ""] | None = None
    rival: Float[Array, " d"] | None = None

    @property
    def on_border(self) -> Bool[Array, ""]:
        """Whether any parameter lies on the border of its bounds."""
        return jnp.any(self.border)


def _sides(term: AbstractTerm):
    """The shared summands, and the two directions' own, where the directions can be separated."""
    terms = summands(term)
    shared = tuple(t for t in terms if not isinstance(t, Directional))
    sided = [t for t in terms if isinstance(t, Directional)]
    if not any(t.nonlinear for t in sided) or any(t.nonlinear for t in shared):
        return None
    if any(
        len({jax.tree.structure(t.positive), jax.tree.structure(t.negative)}) > 1 for t in sided
    ):
        return None
    positive = Sum(tuple(leaf for t in sided for leaf in summands(t.positive)))
    return shared, positive


def search(
    term: AbstractTerm,
    recording: Recording,
    rows: Rows,
    box: Float[Array, "2 d"],
    grid: Plan | int | None,
    alike: bool = False,
) -> Found:
    """β of the least reduced cost L(β) (Kim, Kim & Ha 2004, eq. 17) inside the bounds `box`.

    **Arguments:** `term`, `recording` (prepared), `rows`, its rows; `box`, lower and upper bounds
    `(2, d)`; `grid`, points along each parameter, a plan of them, or `None` for a default; `alike`,
    whether the bounds of both directions are known to be the same, so that the grid of one serves
    both.
    """
    if not term.nonlinear:
        yes = jnp.ones((), bool)
        return Found(jnp.zeros((0,), rows.target.dtype), yes, jnp.zeros((0,), bool))
    logarithmic = tuple(p.logarithmic for p in term.nonlinear)
    problem = Problem(term, recording, rows, box, logarithmic, alike)
    frozen = jax.lax.stop_gradient(problem)
    if blocks.staged(term):
        return _staged(problem, frozen, blocks.wanted(grid, term))
    sides = _sides(term)
    best = _grid_whole(frozen, grid) if sides is None else _grid_sides(sides, frozen, grid)
    unit, converged, minimum = jax.lax.stop_gradient(_refine(frozen, best))
    alpha = None if best.samples is None else _affine(frozen, best, unit)
    unit = _implicit(unit, problem)
    border = (unit <= 0) | (unit >= 1)
    return Found(reduced.decode(unit, box, logarithmic), converged, border, alpha, minimum)


def _staged(problem: Problem, frozen: Problem, plan: Plan) -> Found:
    """The same for several nonlinear terms, or for one that needs a fine grid."""
    found = jax.lax.stop_gradient(blocks.search(frozen, plan))
    unit = _implicit(found.unit, problem)
    border = (unit <= 0) | (unit >= 1)
    beta = reduced.decode(unit, problem.box, problem.logarithmic)
    return Found(beta, found.converged, border, rival=found.rival)


class _Best(NamedTuple):
    """The best grid point and the cell around it, in the unit cube.

    `sides`, where each direction is one bump's own problem, and `samples`, where `sides` stands on
    nodes instead of these.
    """

    start: Float[Array, " d"]
    cell: Float[Array, " d"]
    sides: "Sides | None" = None
    samples: compress.Straightened | None = None


def _refine(problem: Problem, best: _Best):
    """The minimiser near the best grid point, whether the refinement converged, and the samples'
    cost there, where nodes stand for them.

    What nodes say is checked on the samples: the result is not worse there than the grid's, by
    twice what the nodes are off by, and has not converged where the two disagree.
    """
    if best.sides is None:
        from . import refine  # optimistix takes long to import, and a kept program does without

        return *refine.refine(problem.residuals(), best.start, best.cell), None
    start = best.start.reshape(2, -1)
    unit, converged = best.sides.refined(start, best.cell.reshape(2, -1))
    minimum = None
    if best.samples is not None:
        eps, whole = jnp.finfo(unit.dtype).eps, jnp.sum(best.sides.moments.whole)
        before, after = best.sides.gains(jnp.stack([start, unit], axis=1)).T
        gained = best.sides.gained(unit, best.samples)
        off = jnp.abs(gained - jnp.sum(after))
        # What the refinement has gained stands out of what the nodes are off by, at either point,
        # or of nothing at all; and nodes that are off by half the digits do not stand for these
        # samples.
        fine = (after - before >= 2 * off) | (off <= EXACT * eps * whole)
        minimum = jnp.where(jnp.all(fine), whole - gained, jnp.inf)
        unit = jnp.where(fine[:, None], unit, start)
        converged = converged & fine & (off <= eps**0.5 * whole)
    return unit.reshape(-1), jnp.all(converged), minimum


def _affine(problem: Problem, best: _Best, unit) -> Float[Array, " p"] | None:
    """The affine parameters as the nodes say them.

    `None` where a direction has another term than one constant, one line and one bump.
    """
    places = [
        (direction, leaf)
        for term in summands(problem.term)
        if isinstance(term, Directional)
        for direction, side in enumerate((term.positive, term.negative))
        for leaf in summands(side)
    ]
    if len(places) != 2 * 3:
        return None
    units, taken = unit.reshape(2, -1), best.samples.taken
    bump = next(leaf for _, leaf in places if isinstance(leaf, AbstractBump))

    def most(point, box):
        beta = reduced.decode(point, box, best.sides.logarithmic)
        return bump.with_beta(beta).shape(best.samples.slowest)

    # Of a bump that vanishes in all samples nothing is known.
    top = jax.vmap(most)(units, problem.boxes)
    seen = top > jnp.finfo(top.dtype).tiny ** 0.5
    height, line = best.sides.fitted(units, best.samples)
    height = jnp.where(seen, height, 0.0)
    constant, slope = (taken - jnp.where(seen[:, None], line, 0.0)).T
    # The sides' bump is the ratio to its value at the slowest speed, less one.
    values = jnp.stack([constant - height, slope, height / jnp.where(seen, top, 1.0)])
    columns = {Coulomb: 0, Viscous: 1, type(bump): 2}
    return jnp.stack([values[columns[type(leaf)], direction] for direction, leaf in places])


@jax.custom_jvp
def _implicit(unit, problem: Problem):
    """The minimiser, with the derivative that the implicit function theorem gives it.

    −H⁻¹ ∂(∇L)/∂data at the minimiser: neither the grid nor the iterations are differentiated.
    An unknown on the border of its bounds does not move.
    """
    return unit


@_implicit.defjvp
def _(primals, tangents):
    unit, problem = _implicit(*primals), primals[1]  # so that derivatives of this follow it too

    def affine(unit):
        return reduced.least_squares(*problem.weighted(unit))

    alpha, slope = affine(unit), jax.jacfwd(affine)(unit)

    def residual(unit, problem, start=unit):
        # α follows β to first order, so that its own movement does not couple to that of β.
        columns, target = problem.weighted(unit)
        return target - columns @ (alpha + slope @ (unit - start))

    def gradient(unit, problem):
        left = residual(unit, problem)
        return jax.jacfwd(residual)(unit, problem).T @ left

    _, change = jax.jvp(lambda p: gradient(unit, p), (problem,), (tangents[1],))
    hessian = jax.jacfwd(gradient)(unit, problem)
    free = (unit > 0) & (unit < 1) & (jnp.diagonal(hessian) > 0)
    free = free.astype(unit.dtype)
    hessian = hessian * (free[:, None] * free[None, :]) + jnp.diag(1 - free)
    # The inverse first: the rule must be linear in the tangent by its structure.
    identity = jnp.eye(unit.shape[0], dtype=unit.dtype)
    inverse = jax.vmap(lambda e: small.solve_positive(hessian, e)[0])(identity)
    return unit, -inverse @ (change * free)


def _grid_whole(problem: Problem, points):
    """The best grid point over all nonlinear parameters together, in the unit cube."""
    basis, root, target = problem.linear()
    bumps = reduced.part(problem.term, True)
    grid = reduced.grid_points(len(problem.logarithmic), points, root.dtype)

    def columns(unit):
        return root[:, None] * problem.columns(bumps, unit)

    return _best(grid, reduced.general_grid_costs(columns, grid, basis, target))


def _grid_sides(sides, problem: Problem, points):
    """The best grid points of the two directions: two rows of one batch (eq. 24).

    Where terms are shared (the weak form's inertia), each direction has a copy of its own here;
    the refinement that follows ties them again.
    """
    shared, inner = sides
    rows, recording = problem.rows, problem.recording
    roots = reduced.root(jnp.stack([rows.positive, rows.negative]))
    linear = [term for term in (reduced.part(inner, False), *shared) if term is not None]
    columns = jnp.concatenate([rows.columns(term, recording) for term in linear], axis=1)
    target = rows.target - rows.offset(problem.term, recording)
    bumps, count = reduced.part(inner, True), len(inner.nonlinear)
    grid = reduced.grid_points(count, points, roots.dtype)
    one = summands(bumps)
    if len(bumps.affine) > 1:
        best = _best(grid, _general_sides(problem, bumps, grid, columns, target, roots))
    elif rows.sampled and isinstance(one[0], AbstractBump) and _has_constant(linear):
        best = _bump_sides(problem, one[0], grid, columns, target, roots, linear)
    else:
        moments = reduced.moments(columns, target, roots)

        def values(beta, _):
            return rows.columns(bumps.with_beta(beta), recording)[:, 0]

        scale = problem.logarithmic_side
        here = Sides(values, values, rows.time, moments, problem.boxes, scale, problem.alike)
        best = _best(grid, here.costs(grid))
    at = jnp.asarray(problem.order.ravel())
    start, cell = best.start.ravel(), jnp.tile(best.cell, 2)
    both = _Best(jnp.zeros_like(start).at[at].set(start), jnp.zeros_like(cell).at[at].set(cell))
    # Shared terms tie the directions; then neither is a problem of its own.
    return both if shared else both._replace(sides=best.sides, samples=best.samples)


def _has_constant(linear) -> bool:
    """Whether the columns without β contain Coulomb friction, a constant in each direction."""
    return any(isinstance(t, Coulomb) for term in linear for t in summands(term))


def _bump_sides(problem, bump: AbstractBump, grid, columns, target, roots, linear):
    """The grid of one smooth bump over samples, by its contrast, and on nodes where that pays."""
    velocity = problem.recording.velocity
    weights = problem.rows.positive, problem.rows.negative
    speed, used = jnp.abs(velocity), weights[0] + weights[1] > 0
    slowest = jnp.min(jnp.where(used, speed, jnp.inf))
    slowest = jnp.where(jnp.isfinite(slowest), slowest, 1.0)
    speed = jnp.where(used, speed, slowest)
    sign = jnp.sign(velocity)

    def contrast(beta, speed):
        return bump.with_beta(beta).contrast(speed, slowest)

    def ratio(beta, speed):
        return bump.with_beta(beta).ratio(speed, slowest)

    def sides(places, moments):
        scale = problem.logarithmic_side
        return Sides(contrast, ratio, places, moments, problem.boxes, scale, problem.alike)

    if _straight(linear) and grid.shape[0] >= compress.LEAST_POINTS:
        # The first nonlinear parameter of a bump is its width.
        panels = compress.edges(slowest, jnp.max(speed), jnp.min(problem.boxes[:, 0, 0]))
        moments, samples = compress.compressed(speed, sign * target, jnp.stack(weights), panels)
        here, few = sides(compress.nodes(panels), moments), compress.fewer(moments, panels)
        return _proposed(grid, sides(*few).costs(grid), here)._replace(samples=samples)
    here = sides(speed, reduced.moments(columns, target, roots, sign))
    return _best(grid, here.costs(grid))._replace(sides=here)


def _proposed(grid, costs, sides: Sides) -> _Best:
    """The best of what each stretch of the grid proposes by its costs, as all nodes see them."""
    pad = -grid.shape[0] % STRETCH
    costs = jnp.pad(costs, ((0, 0), (0, pad)), constant_values=jnp.inf).reshape(2, -1, STRETCH)
    units = grid[jnp.argmin(costs, axis=2) + STRETCH * jnp.arange(costs.shape[1])[None, :]]
    best = jnp.argmax(sides._replace(bump=sides.coarse).gains(units), axis=1)
    return _Best(units[jnp.arange(2), best], _cell(grid), sides)


def _straight(linear) -> bool:
    """Whether the columns without β are Coulomb and viscous friction, a straight line of speed."""
    return {type(t) for term in linear for t in summands(term)} == {Coulomb, Viscous}


def _general_sides(problem, bumps, grid, columns, target, roots):
    """The grid of several nonlinear columns, one direction after the other."""

    def side(item):
        weigh, box = item
        basis = reduced.orthonormal(weigh[:, None] * columns)
        left = reduced.project_out(basis, (weigh * target)[:, None])[:, 0]

        def weighted(unit):
            return weigh[:, None] * problem.columns(bumps, unit, box)

        return reduced.general_grid_costs(weighted, grid, basis, left)

    return jax.lax.map(side, (roots, problem.boxes))


def _best(grid, costs) -> _Best:
    """The best points of a grid, by costs `(..., G)`."""
    return _Best(grid[jnp.argmin(costs, axis=-1)], _cell(grid))


def _cell(grid):
    side = round(grid.shape[0] ** (1 / grid.shape[1]))
    return jnp.full_like(grid[0], 1 / (side - 1))
