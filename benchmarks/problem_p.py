"""Problem (P) of Kim, Kim & Ha (2004), eq. (8): what the paper improves on, for comparison only.

Least squares of M dv/dt + f(v; θ) = u over the moving samples, the acceleration by central
differences of the velocity; the mass estimated, or given.
"""

import dataclasses

import jax.numpy as jnp
import optimistix as optx

from jaxfric import models, signals
from jaxfric.identification.reduced import least_squares
from jaxfric.terms.base import Directional, Sum


def problem_p(model, recording, start, mass=None):
    """Parameters by name, the mass included.

    **Arguments:** `model`, a sum whose first term is the inertia; `recording`; `start`, the
    nonlinear parameters (the comparison is kind to (P): give it the truth); `mass`, fixed where
    given.
    """
    ready = signals.prepare(recording)
    friction = Sum(tuple(t for t in model.terms if isinstance(t, Directional)))
    v = ready.velocity
    acceleration = jnp.gradient(v) / signals.interval(ready)
    slip = jnp.abs(v) > signals.scales(ready).slowest
    ready = dataclasses.replace(ready, velocity=jnp.where(slip, v, 0.0))
    known = 0.0 if mass is None else mass
    target = jnp.where(slip, ready.force - known * acceleration, 0.0)

    def solve(beta):
        columns = friction.with_beta(beta).columns(ready)
        if mass is None:
            columns = jnp.concatenate([acceleration[:, None], columns], axis=1)
        columns = jnp.where(slip[:, None], columns, 0.0)
        alpha = least_squares(columns, target)
        return columns @ alpha - target, alpha

    beta = jnp.asarray(start)
    if beta.size:
        found = optx.least_squares(
            lambda log_beta, _: solve(jnp.exp(log_beta))[0],
            optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8),
            jnp.log(beta),
            throw=False,
        )
        beta = jnp.exp(found.value)
    alpha = solve(beta)[1]
    if mass is not None:
        alpha = jnp.concatenate([jnp.asarray([mass]), alpha])
    names = [p.name for p in (*model.affine, *model.nonlinear)]
    return dict(zip(names, [float(x) for x in (*alpha, *beta)], strict=True))


def curve_error(parameters, truth, low, high):
    """As `curve_distance`, of the truth with other parameters."""
    return curve_distance(models.from_parameters(truth.term, parameters), truth, low, high)


def curve_distance(model, truth, low, high):
    """Root mean square of the friction curve's error between two speeds, both directions, N."""
    speeds = jnp.linspace(low, high, 400)
    v = jnp.concatenate([speeds, -speeds])
    return float(jnp.sqrt(jnp.mean((model.friction(v) - truth.friction(v)) ** 2)))
