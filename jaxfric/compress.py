"""Any number of samples of functions of speed, replaced by a few hundred weighted nodes.

Between zero and infinity a Stribeck bump is smooth at the scale of the speed or of its own width.
On panels that grow away from the slowest sample a polynomial therefore carries it, and a sum over
samples Σ w e(v) becomes a sum over the panels' Chebyshev points with the weights Σ w ℓₘ(v), ℓₘ
the Lagrange polynomials there (interpolatory quadrature; Trefethen, "Approximation Theory
and Approximation Practice", 2013, ch. 3 and 19). Its cost does not depend on the number of samples.
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .reduced import Moments

# A polynomial through 20 points carries exp(−v²) over an octave to rounding.
ORDER = 20
# 13 octaves from the finest panel to the fastest speed: a ratio of 8000.
PANELS = 13
# One pass over the samples costs about as much as 70 bumps, and the refinement evaluates 30 more;
# smaller grids are not worth it.
LEAST_POINTS = 100
# Samples at a time: their 20 polynomials stay in the cache.
_BLOCK = 1024


def edges(
    slowest: Float[Array, ""], fastest: Float[Array, ""], narrowest: Float[Array, ""]
) -> Float[Array, " P+1"]:
    """Edges of the panels, m/s, `(PANELS + 1,)`: they grow geometrically away from `slowest`.

    The first is as wide as the finest variation of a bump of width `narrowest`: exp(−(v/β)²) falls
    by a factor e within β²/2v. A panel is at most twice as wide as the one before if the speeds
    are within 8000 of that; beyond, the quadrature loses digits gradually.
    """
    fine = jnp.minimum(jnp.minimum(narrowest, slowest), narrowest * (narrowest / slowest))
    span = jnp.maximum(fastest - slowest, fine)
    growth = jnp.log1p(span / fine) / PANELS
    steps = jnp.arange(PANELS + 1, dtype=slowest.dtype)
    return slowest + span * jnp.expm1(growth * steps) / jnp.expm1(growth * PANELS)


def nodes(panels: Float[Array, " P+1"]) -> Float[Array, " M"]:
    """The Chebyshev points of all panels, m/s, `(PANELS·ORDER,)`."""
    places = jnp.asarray(_points(), panels.dtype)
    low, high = panels[:-1, None], panels[1:, None]
    return (0.5 * (low + high) + 0.5 * (high - low) * places[None, :]).reshape(-1)


def compress(
    speed: Float[Array, " N"], values: Float[Array, "k N"], panels: Float[Array, " P+1"]
) -> Float[Array, "k M"]:
    """Weights on the nodes: Σₙ values f(vₙ) = Σₘ weights f(ξₘ) for every f smooth on the panels.

    **Arguments:** `speed`, m/s; `values`, what f is summed with, zero for samples out of the
    panels; `panels`, from [`edges`][].
    """
    rows, count = values.shape
    blocks = -(-count // _BLOCK)
    fill = blocks * _BLOCK - count
    speed = jnp.pad(speed, (0, fill), mode="edge").reshape(blocks, _BLOCK)
    values = jnp.pad(values, ((0, 0), (0, fill))).reshape(rows, blocks, _BLOCK)

    def add(total, block):
        v, weights = block
        panel = jnp.clip(jnp.searchsorted(panels, v, side="right") - 1, 0, PANELS - 1)
        low, high = panels[panel], panels[panel + 1]
        place = jnp.clip((2 * v - low - high) / (high - low), -1.0, 1.0)
        items = _polynomials(place)[:, :, None] * weights.T[:, None, :]
        return total.at[panel].add(items), None

    empty = jnp.zeros((PANELS, ORDER, rows), speed.dtype)
    sums = jax.lax.scan(add, empty, (speed, jnp.swapaxes(values, 0, 1)))[0]
    spread = jnp.asarray(_from_polynomials(), speed.dtype)
    return jnp.einsum("pkr,km->rpm", sums, spread).reshape(rows, -1)


def compressed(rows: Moments, speed: Float[Array, " N"], panels: Float[Array, " P+1"]) -> Moments:
    """The same [`Moments`][jaxfric.reduced.Moments] for bumps given at the nodes, not the samples.

    For rows whose columns without β are a constant and the speed (Coulomb and viscous), and
    bumps without parity: on the nodes the straight line is taken off that way.
    """
    directions, length = rows.against.shape[:2]
    stacked = jnp.concatenate([rows.against.reshape(directions * length, -1), rows.weights])
    sums = compress(speed, stacked, panels)
    against = sums[: directions * length].reshape(directions, length, -1)
    places = nodes(panels)
    top = panels[-1]
    line = jnp.stack([jnp.ones_like(places), places / top], axis=1)
    weight = sums[directions * length :]
    total = jnp.sum(weight, axis=0)
    mean = jnp.sum(total * line[:, 1]) / jnp.sum(total)
    slope = line[:, 1] - mean
    spread = jnp.sum(total * slope**2)
    spread = jnp.where(spread > 0, spread, 1.0)
    shared = jnp.stack([line[:, 0], slope], axis=1)
    dual = jnp.stack([total / jnp.sum(total), total * slope / spread], axis=1)
    return Moments(shared, dual, against, weight, rows.whole)


def _points():
    return np.cos(np.pi * (np.arange(ORDER) + 0.5) / ORDER)


def _from_polynomials():
    """Lagrange polynomials at the Chebyshev points as sums of Chebyshev polynomials, `(K, M)`."""
    matrix = np.cos(np.arange(ORDER)[:, None] * np.arccos(_points())[None, :]) * 2 / ORDER
    matrix[0] /= 2
    return matrix


def _polynomials(place):
    """Chebyshev polynomials at places in [−1, 1], `(n, ORDER)`, by their recurrence."""
    values = [jnp.ones_like(place), place]
    while len(values) < ORDER:
        values.append(2 * place * values[-1] - values[-2])
    return jnp.stack(values, axis=1)
