"""Refinement of a grid's minimiser: Gauss-Newton on optimistix that never leaves its box."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import optimistix as optx
from jaxtyping import Array, Bool, Float


class _State(eqx.Module):
    lower: Float[Array, " d"]
    upper: Float[Array, " d"]
    cost: Float[Array, ""]
    damping: Float[Array, ""]
    step: Float[Array, ""]
    terminate: Bool[Array, ""]


class BoxGaussNewton(optx.AbstractLeastSquaresSolver):
    """Gauss-Newton inside a box, for few unknowns and any number of residuals.

    The curvature is the exact Hessian of the cost where that is positive definite, else the
    Gauss-Newton matrix JᵀJ. With one unknown the derivative's sign shrinks the box to a bracket of its
    root, and a step that would leave the bracket is replaced by bisection; with more unknowns a
    Levenberg-Marquardt damping grows until the cost falls, and unknowns that are held by the box
    are left out of the step.

    `options`: `lower` and `upper`, arrays of the unknowns' shape `(d,)`.
    """

    rtol: float
    atol: float
    norm: Callable[[Any], Any] = optx.max_norm

    def init(self, fn, y, args, options, f_struct, aux_struct, tags):
        del f_struct, aux_struct, tags
        residual, _ = fn(y, args)
        one = jnp.ones((), y.dtype)
        return _State(
            options["lower"], options["upper"], 0.5 * jnp.sum(residual**2), 0 * one, one, one < 0
        )

    def step(self, fn, y, args, options, state, tags):
        del tags

        def residual(y):
            return fn(y, args)

        def cost(y):
            return 0.5 * jnp.sum(residual(y)[0] ** 2)

        jacobian, aux = jax.jacfwd(residual, has_aux=True)(y)

        def slope(y):
            gradient = jax.jacfwd(cost)(y)
            return gradient, gradient

        hessian, gradient = jax.jacfwd(slope, has_aux=True)(y)
        move = _newton(hessian, jacobian.T @ jacobian, gradient, y, state)
        if y.shape == (1,):
            new, lower, upper = _bracketed(y, gradient, move, state)
            damping, value = state.damping, state.cost
        else:
            lower, upper = state.lower, state.upper
            trial = jnp.clip(y + move, lower, upper)
            value = cost(trial)
            falls = value <= state.cost * (1 + 8 * jnp.finfo(y.dtype).eps)
            new = jnp.where(falls, trial, y)
            value = jnp.where(falls, value, state.cost)
            damping = jnp.where(falls, state.damping / 8, jnp.maximum(8 * state.damping, 1e-3))
            damping = jnp.where(falls & (damping < 1e-6), 0.0, damping)
            move = trial - y
        size = self.norm(new - y)
        small = jnp.where(size > 0, size, self.norm(move)) <= self.atol + self.rtol * self.norm(y)
        stuck = damping > 1e12
        return new, _State(lower, upper, value, damping, size, small | stuck), aux

    def terminate(self, fn, y, args, options, state, tags):
        return state.terminate, optx.RESULTS.successful

    def postprocess(self, fn, y, aux, args, options, state, tags, result):
        return y, aux, {}


def _newton(hessian, gauss_newton, gradient, y, state):
    """The damped step on the unknowns that the box does not hold."""
    held = ((y <= state.lower) & (gradient > 0)) | ((y >= state.upper) & (gradient < 0))
    free = jnp.where(held, 0.0, 1.0)
    both = free[:, None] * free[None, :]
    identity = jnp.diag(1 - free)
    smallest = jnp.linalg.eigvalsh(hessian * both + identity * jnp.max(jnp.abs(hessian)))[0]
    # Curvature that is not clearly positive would send the step uphill or far away.
    convex = smallest > 1e-3 * jnp.max(jnp.diagonal(gauss_newton * both))
    chosen = jnp.where(convex, hessian, gauss_newton)
    scale = jnp.max(jnp.diagonal(chosen)) * jnp.eye(y.shape[0], dtype=y.dtype)
    tiny = jnp.finfo(y.dtype).tiny
    matrix = chosen * both + identity + (state.damping + 1e-14) * scale + tiny * jnp.eye(y.shape[0], dtype=y.dtype)
    return -jnp.linalg.solve(matrix, gradient * free)


def _bracketed(y, gradient, move, state):
    """Step, lower and upper end for one unknown: Newton inside the bracket, else its middle."""
    rises = gradient > 0
    lower, upper = jnp.where(rises, state.lower, y), jnp.where(rises, y, state.upper)
    trial = y + move
    inside = (trial > lower) & (trial < upper)
    at_end = (gradient > 0) & (y <= state.lower) | (gradient < 0) & (y >= state.upper)
    new = jnp.where(inside, trial, 0.5 * (lower + upper))
    new = jnp.where((gradient == 0) | at_end, y, new)
    return new, lower, upper
