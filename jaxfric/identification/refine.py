"""Refinement of a grid's minimiser: (Gauss-)Newton on optimistix that never leaves its box."""

import math
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float

from . import small


class _Point(eqx.Module):
    """An accepted point: where, its cost ½|r|², gradient Jᵀr, and Gauss-Newton matrix JᵀJ."""

    place: Float[Array, " d"]
    cost: Float[Array, ""]
    gradient: Float[Array, " d"]
    matrix: Float[Array, "d d"]


class _State(eqx.Module):
    best: _Point
    secant: Float[Array, "d d"]
    damping: Float[Array, ""]
    flat: Bool[Array, ""]
    terminate: Bool[Array, ""]


class BoxGaussNewton(optx.AbstractLeastSquaresSolver):
    """Gauss-Newton inside a box, for few unknowns and any number of residuals.

    Each step evaluates residual and Jacobian once. The curvature that JᵀJ lacks is learned from
    the change of the gradient (symmetric rank one, as in Dennis, Gay & Welsch 1981, NL2SOL), and
    used while the sum stays positive definite, so that convergence is superlinear although
    the residual is large. A step that does not lower the cost is taken back and damped
    (Levenberg & Marquardt); unknowns that the box holds are left out of it. The result is
    never outside the box and never worse than the start, beyond rounding of the cost.

    `options`: `lower`, `upper` and `reach`, the longest step, arrays of the unknowns' shape `(d,)`.
    """

    rtol: float
    atol: float
    norm: Callable[[Any], Any] = optx.max_norm

    def init(self, fn, y, args, options, f_struct, aux_struct, tags):
        """No point yet: any cost is better than infinity."""
        return _start(y)

    def step(self, fn, y, args, options, state, tags):
        """Evaluate at y, accept it or not, and propose the next point."""

        def residual(y):
            value, aux = fn(y, args)
            return value, (value, aux)

        jacobian, (value, aux) = jax.jacfwd(residual, has_aux=True)(y)
        here = _Point(y, 0.5 * jnp.sum(value**2), jacobian.T @ value, jacobian.T @ jacobian)
        first = jnp.isinf(state.best.cost)
        learned = _rank_one(state.secant, state.best, here)
        secant = jnp.where(first, state.secant, learned)
        trial, state = _next(here, secant, state, options, self)
        return trial, state, aux

    def terminate(self, fn, y, args, options, state, tags):
        """Done when the next step would be smaller than the tolerance."""
        return state.terminate, optx.RESULTS.successful

    def postprocess(self, fn, y, aux, args, options, state, tags, result):
        """The best point, not the proposed one."""
        return state.best.place, aux, {}


class BoxNewton(optx.AbstractMinimiser):
    """Newton's method inside a box, for a function of few unknowns that is cheap.

    Steps, box and options are those of [`BoxGaussNewton`][]; value, gradient and Hessian are
    evaluated once a step, and where the Hessian is not clearly positive its diagonal's magnitude
    takes its place, so that the step goes downhill.
    """

    rtol: float
    atol: float
    norm: Callable[[Any], Any] = optx.max_norm

    def init(self, fn, y, args, options, f_struct, aux_struct, tags):
        """No point yet: any cost is better than infinity."""
        return _start(y)

    def step(self, fn, y, args, options, state, tags):
        """Evaluate at y, accept it or not, and propose the next point."""

        def value(y):
            cost, aux = fn(y, args)
            return cost, (cost, aux)

        def slope(y):
            gradient, (cost, aux) = jax.jacfwd(value, has_aux=True)(y)
            return gradient, (gradient, cost, aux)

        hessian, (gradient, cost, aux) = jax.jacfwd(slope, has_aux=True)(y)
        downhill = jnp.diag(jnp.abs(jnp.diagonal(hessian)))
        here = _Point(y, cost, gradient, downhill)
        trial, state = _next(here, hessian - downhill, state, options, self)
        return trial, state, aux

    def terminate(self, fn, y, args, options, state, tags):
        """Done when the next step would be smaller than the tolerance."""
        return state.terminate, optx.RESULTS.successful

    def postprocess(self, fn, y, aux, args, options, state, tags, result):
        """The best point, not the proposed one."""
        return state.best.place, aux, {}


def _start(y) -> _State:
    none = jnp.zeros((y.shape[0], y.shape[0]), y.dtype)
    worst = _Point(y, jnp.asarray(jnp.inf, y.dtype), jnp.zeros_like(y), none)
    no = jnp.zeros((), bool)
    return _State(worst, none, jnp.zeros((), y.dtype), no, no)


def _next(here: _Point, secant, state: _State, options, solver):
    """The next point to try, and the state with `here` accepted if it is no worse."""
    # Near the minimum a true step changes the cost by less than its rounding.
    rounding = 64 * jnp.finfo(here.place.dtype).eps * jnp.abs(state.best.cost)
    falls = here.cost <= state.best.cost + rounding
    best = jax.tree.map(lambda a, b: jnp.where(falls, a, b), here, state.best)
    secant = jnp.where(falls, secant, state.secant)
    damping = jnp.where(falls, state.damping / 8, jnp.maximum(8 * state.damping, 1e-2))
    damping = jnp.where(damping < 1e-4, 0.0, damping)
    lower, upper = options["lower"], options["upper"]
    move = _newton(best, secant, damping, lower, upper)
    move = jnp.clip(move, -options["reach"], options["reach"])
    trial = jnp.clip(best.place + move, lower, upper)
    # NaN takes no part: the point stays, and the solve ends.
    trial = jnp.where(jnp.isfinite(trial), trial, best.place)
    small = solver.norm(trial - best.place) <= solver.atol + solver.rtol * solver.norm(here.place)
    # In single precision no step ever is below the tolerance: twice in a row none that the cost
    # tells from its rounding will do. In double precision that would leave a gradient.
    flat = jnp.abs(best.gradient @ (trial - best.place)) <= rounding
    flat &= trial.dtype == jnp.float32
    done = small | (flat & state.flat) | (damping > 1e12)
    return trial, _State(best, secant, damping, flat, done)


def _rank_one(secant, before: _Point, after: _Point):
    """The curvature beyond JᵀJ, corrected so that it explains the last change of the gradient."""
    step = after.place - before.place
    missing = after.gradient - before.gradient - after.matrix @ step - secant @ step
    along = jnp.vdot(missing, step)
    size = jnp.linalg.norm(missing) * jnp.linalg.norm(step)
    clear = jnp.abs(along) > 1e-8 * size
    update = missing[:, None] * missing[None, :] / jnp.where(clear, along, 1.0)
    return secant + jnp.where(clear, update, 0.0)


def _newton(point: _Point, secant, damping, lower, upper):
    """The damped step on the unknowns that the box does not hold."""
    gradient, place = point.gradient, point.place
    held = ((place <= lower) & (gradient > 0)) | ((place >= upper) & (gradient < 0))
    free = jnp.where(held, 0.0, 1.0).astype(place.dtype)
    both = free[:, None] * free[None, :]
    full = (point.matrix + secant) * both
    largest = jnp.max(jnp.diagonal(point.matrix))
    rest = jnp.diag(1 - free) * largest
    floor = jnp.diag(damping * jnp.diagonal(point.matrix) + 1e-14 * largest + 1e-300)
    rest = rest + floor.astype(place.dtype)
    step, pivot = small.solve_positive(full + rest, gradient * free)
    plain, _ = small.solve_positive(point.matrix * both + rest, gradient * free)
    # Curvature that is not clearly positive would send the step uphill or far away.
    enough = jnp.all(jnp.diagonal(full + rest) > 0.05 * jnp.diagonal(point.matrix))
    return -jnp.where(enough & (pivot > 0.05), step, plain)


def refine(
    residuals: Callable[[Float[Array, " d"]], Float[Array, " J"]],
    start: Float[Array, " d"],
    cell: Float[Array, " d"],
) -> tuple[Float[Array, " d"], Bool[Array, ""]]:
    """The minimiser near a grid point, inside the unit cube; no step is longer than a grid cell.

    **Returns:** the refined point, never worse than `start`, and whether it converged.
    """
    solver = BoxGaussNewton(rtol=0.0, atol=_tolerance(start))
    return _refined(optx.least_squares, residuals, solver, start, cell)


def descend(
    function: Callable[[Float[Array, " d"]], Float[Array, ""]],
    start: Float[Array, " d"],
    cell: Float[Array, " d"],
) -> tuple[Float[Array, " d"], Bool[Array, ""]]:
    """Like [`refine`][], for a scalar function that is cheap."""
    solver = BoxNewton(rtol=0.0, atol=_tolerance(start))
    return _refined(optx.minimise, function, solver, start, cell)


def _tolerance(start) -> float:
    return math.sqrt(float(jnp.finfo(start.dtype).eps)) * 1e-4


def _refined(method, function, solver, start, cell):
    """The place where a solver ends inside the unit cube, and whether it converged."""
    found: optx.Solution = method(
        lambda y, _: function(y),
        solver,
        start,
        options={"lower": jnp.zeros_like(start), "upper": jnp.ones_like(start), "reach": cell},
        max_steps=60,
        throw=False,
        adjoint=optx.ImplicitAdjoint(),
    )
    return found.value, found.result == optx.RESULTS.successful
