"""Any number of samples of functions of speed, replaced by a few hundred weighted nodes.

Between zero and infinity a Stribeck bump is smooth at the scale of the speed or of its own width.
On panels that grow away from the slowest sample a polynomial therefore carries it, and a sum over
samples Σ w e(v) becomes a sum over the panels' Chebyshev points with the weights Σ w ℓₘ(v), ℓₘ
the Lagrange polynomials there (interpolatory quadrature; Trefethen, "Approximation Theory
and Approximation Practice", 2013, ch. 3 and 19). Its cost does not depend on the number of samples.
"""

from collections.abc import Callable
from functools import cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from .reduced import PLACES, Moments

# A polynomial through 20 points carries exp(−v²) over an octave to rounding.
ORDER = 20
# Through 8 it carries it to 1e-6 or so: enough to propose places of a grid.
FEWER = 8
# 13 octaves from the finest panel to the fastest speed: a ratio of 8000.
PANELS = 13
# Samples are summed over pieces of a panel first. What 20 polynomials carry over a panel, 6 carry
# over a 64th of it (each is worth a factor of some 2 · 64), and a sample adds to fewer sums.
PIECES = 64
PIECE_ORDER = 6
# Samples whose polynomials are written down together, 0.8 MB: they stay in the cache.
TOGETHER = 8192
# The passes over the samples cost about as much as 10 bumps, and the refinement evaluates 30 more;
# on short recordings smaller grids are not worth it.
LEAST_POINTS = 100


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


def nodes(panels: Float[Array, " P+1"], order: int = ORDER) -> Float[Array, " M"]:
    """The Chebyshev points of all panels, m/s, `(PANELS·order,)`."""
    places = jnp.asarray(_points(order), panels.dtype)
    low, high = panels[:-1, None], panels[1:, None]
    return (0.5 * (low + high) + 0.5 * (high - low) * places[None, :]).reshape(-1)


def compress(
    speed: Float[Array, " N"],
    side: Int[Array, " N"],
    values: Float[Array, "k N"],
    panels: Float[Array, " P+1"],
) -> Float[Array, "2 k M"]:
    """Weights on the nodes: Σₙ values f(vₙ) = Σₘ weights f(ξₘ) for every f smooth on the panels.

    **Arguments:** `speed`, m/s; `side`, 0 or 1, the sum that a sample goes into; `values`, what f
    is summed with, zero for samples out of the panels; `panels`, from [`edges`][].
    """

    def add(sums, samples):
        speed, side, values = samples
        panel = jnp.searchsorted(panels, speed, side="right", method="compare_all") - 1
        panel = jnp.clip(panel, 0, PANELS - 1).astype(side.dtype)
        scale = PIECES / jnp.diff(panels)
        place = jnp.clip((speed - panels[panel]) * scale[panel], 0.0, PIECES)
        whole = jnp.minimum(jnp.floor(place), PIECES - 1)
        powers = _polynomials(2 * (place - whole) - 1, PIECE_ORDER)
        items = jnp.concatenate([x[:, None] * powers for x in values], axis=1)
        piece = (side * PANELS + panel) * PIECES + whole.astype(side.dtype)
        return sums.at[piece].add(items), None

    sums = jnp.zeros((2 * PANELS * PIECES, len(values) * PIECE_ORDER), speed.dtype)
    whole = len(speed) // TOGETHER * TOGETHER
    if whole:
        parts = [x[..., :whole].reshape(*x.shape[:-1], -1, TOGETHER) for x in (speed, side, values)]
        sums, _ = jax.lax.scan(add, sums, (*parts[:2], jnp.moveaxis(parts[2], 1, 0)))
    sums, _ = add(sums, (speed[whole:], side[whole:], values[:, whole:]))
    sums = sums.reshape(2, PANELS, PIECES, len(values), PIECE_ORDER)
    spread = jnp.asarray(_from_pieces(), speed.dtype)
    return jnp.einsum("spikl,ilm->skpm", sums, spread).reshape(2, len(values), -1)


class Lines(eqx.Module):
    """Two functions of speed in each direction, scale · (1, speed − centre); `(2,)`, `(2, 2)`."""

    centre: Float[Array, " 2"]
    scale: Float[Array, "2 2"]

    def __call__(self, speed: Float[Array, " n"]) -> Float[Array, "2 2 n"]:
        """Their values in both directions."""
        rise = speed[None, :] - self.centre[:, None]
        return self.scale[:, :, None] * jnp.stack([jnp.ones_like(rise), rise], axis=1)

    def straight(self, shares: Float[Array, "2 2"]) -> Float[Array, "2 2"]:
        """Constant and slope of a combination of them in each direction."""
        first, second = (shares * self.scale).T
        return jnp.stack([first - second * self.centre, second], axis=1)


def orthonormal_lines(speed: Float[Array, " n"], weights: Float[Array, "2 n"]) -> Lines:
    """The [`Lines`][] that are orthonormal over weighted places; zero where there are none."""
    total, moment = jnp.sum(weights, axis=1), weights @ speed
    there = total > 0
    centre = moment / jnp.where(there, total, 1.0)
    square = jnp.sum(weights * (speed[None, :] - centre[:, None]) ** 2, axis=1)
    squares = jnp.stack([total, square], axis=1)
    # Rounding alone, where all samples have one speed.
    least = 1e3 * jnp.finfo(speed.dtype).eps * total * centre**2
    there = squares > jnp.stack([jnp.zeros_like(least), least], axis=1)
    return Lines(centre, jnp.where(there, 1 / jnp.sqrt(jnp.where(there, squares, 1.0)), 0.0))


class Straightened(eqx.Module):
    """Samples of two directions, the best straight line of each taken off the force.

    `speed`, m/s, `side`, 0 or 1, the direction, `weight`, s, and `force`, N, all `(N,)`, from
    which the line `rest` is still to be taken; `lines`, orthonormal over the samples of each
    direction; `taken`, all that is taken off. Lines are constant, N, and slope, N·s/m, `(2, 2)`;
    `slowest` speed, m/s.
    """

    speed: Float[Array, " N"]
    side: Int[Array, " N"]
    weight: Float[Array, " N"]
    force: Float[Array, " N"]
    rest: Float[Array, "2 2"]
    lines: Lines
    taken: Float[Array, "2 2"]
    slowest: Float[Array, ""]

    def gained(
        self,
        bump: Callable[[Float[Array, " N"], Int[Array, " N"]], Float[Array, " N"]],
        height: Float[Array, " 2"],
        line: Float[Array, "2 2"],
    ) -> Float[Array, ""]:
        """What bumps of that height, N, less a line each, take off both directions' cost, N²·s.

        At the best height and line that is [`Moments.gains`][],
        summed over the directions. **Arguments:** `bump`, of speeds and directions.
        """
        left = self.force - _line(self.rest, self.speed, self.side)
        law = _of(self.side, height) * bump(self.speed, self.side)
        law = law - _line(line, self.speed, self.side)
        return (self.weight * law) @ (2 * left - law)


def compressed(
    speed: Float[Array, " N"],
    force: Float[Array, " N"],
    weights: Float[Array, "2 N"],
    panels: Float[Array, " P+1"],
) -> tuple[Moments, Straightened]:
    """The [`Moments`][] of bumps given at the nodes, beside the samples.

    For columns without β that are a constant and the speed (Coulomb and viscous).

    **Arguments:** `speed`, m/s; `force` along the motion, N; `weights` of each direction, s, of
    which a sample has at most one; `panels`, from [`edges`][].
    """
    side, weight = (weights[1] > 0).astype(jnp.int32), weights[0] + weights[1]
    # What a line through some of the samples explains goes first: where the force has a large
    # offset, sums of what is left keep their digits.
    some = slice(None, None, max(1, speed.shape[0] // PLACES))
    rough = orthonormal_lines(speed[some], weights[:, some])
    share = _shares(rough(speed[some]), weights[:, some] * force[None, some])
    taken = rough.straight(share)
    force = force - _line(taken, speed, side)
    sums = compress(speed, side, jnp.stack([weight, weight * force]), panels)
    places, few, loads = nodes(panels), sums[:, 0], sums[:, 1]
    lines = orthonormal_lines(places, few)
    values = lines(places)
    share = _shares(values, loads)
    rest, whole = lines.straight(share), weights @ force**2 - jnp.sum(share**2, axis=1)
    along = values * few[:, None, :]
    loads = loads - jnp.sum(share[:, :, None] * along, axis=1)
    against = jnp.concatenate([along, loads[:, None, :]], axis=1)
    whole = jnp.maximum(whole, 0.0)  # rounding, where the force is a line
    moments = _moments(places, against, few, whole)
    samples = Straightened(speed, side, weight, force, rest, lines, taken + rest, panels[0])
    return moments, samples


def fewer(rows: Moments, panels: Float[Array, " P+1"]) -> tuple[Float[Array, " M"], Moments]:
    """Fewer nodes, m/s, and the moments there, good for the grid: half of its time."""
    matrix = jnp.asarray(_to_fewer(), panels.dtype)

    def moved(values):
        parts = values.reshape(*values.shape[:-1], PANELS, ORDER) @ matrix
        return parts.reshape(*values.shape[:-1], -1)

    places = nodes(panels, FEWER)
    return places, _moments(places, moved(rows.against), moved(rows.weights), rows.whole)


def _moments(places, against, weights, whole) -> Moments:
    total = jnp.sum(weights, axis=0)
    shared = orthonormal_lines(places, total[None])(places)[0].T
    return Moments(shared, total[:, None] * shared, against, weights, whole)


def _shares(lines, loads):
    """The best combination of two orthonormal functions for weighted values, `(2, 2)`."""
    return jnp.sum(lines * loads[:, None, :], axis=2)


def _line(line, speed, side):
    """Constant and slope of each direction as a line at each sample, by its direction."""
    first, second = _of(side, line)
    return first + second * speed


def _of(side, pair):
    """Of values for both directions those of each sample's direction, one array for each."""
    low, high = pair
    second = jnp.expand_dims(side == 1, tuple(range(low.ndim)))
    return jnp.where(second, high[..., None], low[..., None])


def _points(order=ORDER):
    """The Chebyshev points of that order in [−1, 1]."""
    return np.cos(np.pi * (np.arange(order) + 0.5) / order)


def _transform(order):
    """From values at the Chebyshev points to coefficients: the discrete cosine transform."""
    matrix = np.cos(np.arange(order)[:, None] * np.arccos(_points(order))) * 2 / order
    matrix[0] /= 2
    return matrix


@cache
def _to_fewer():
    """Lagrange polynomials through the fewer points of a panel, at all, `(ORDER, FEWER)`."""
    return np.cos(np.arange(FEWER) * np.arccos(_points())[:, None]) @ _transform(FEWER)


@cache
def _from_pieces():
    """Lagrange polynomials of a panel as sums of few Chebyshev polynomials on each piece.

    `(PIECES, PIECE_ORDER, ORDER)`: exact, and cut off.
    """
    middles = (2 * np.arange(PIECES) + 1) / PIECES - 1
    places = middles[:, None] + _points() / PIECES
    values = np.cos(np.arange(ORDER) * np.arccos(places)[..., None]) @ _transform(ORDER)
    return np.einsum("ln,inm->ilm", _transform(ORDER)[:PIECE_ORDER], values)


def _polynomials(place, order):
    """Chebyshev polynomials at places in [−1, 1], `(n, order)`, by their recurrence."""
    values = [jnp.ones_like(place), place]
    while len(values) < order:
        values.append(2 * place * values[-1] - values[-2])
    return jnp.stack(values, axis=1)
