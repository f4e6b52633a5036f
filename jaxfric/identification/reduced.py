"""Problem (L) of Kim, Kim & Ha (2004), eq. (17): the affine parameters solved, β left to search.

Every function here works on weighted rows. The columns without nonlinear parameters are
orthonormalised once and projected out of the force and out of each bump, so that the reduced cost
L(β) = |r|² − hᵀ D⁻¹ h is a difference that has lost nothing to the large common part.
"""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..terms.base import AbstractTerm, Directional, Sum
from . import small

# A tile of grid points times samples stays below this many numbers, so that it lives in the cache
# and the memory does not grow with the grid: 2¹⁷ doubles are 1 MiB.
TILE = 2**17
# Rows of a few columns that stay in the cache while they are multiplied.
PIECE = 2**13
# Places at which a bump is looked at to see what of it is constant or straight.
PLACES = 512
# What the columns before it leave of a column is rounding up to so many times the last digit.
ROUNDING = 100
# Points for one, two, three, … nonlinear parameters: a ratio of 100 between the ends is then
# stepped by under 4 %, resp. 7 %, finer than a bump's own relative width.
GRID_POINTS = (128, 64, 24, 12, 8)


def part(term: AbstractTerm, nonlinear: bool) -> AbstractTerm | None:
    """The summands with (or without) nonlinear parameters, wrappers kept; else `None`."""
    if isinstance(term, Sum):
        kept = tuple(p for p in (part(t, nonlinear) for t in term.terms) if p is not None)
        return Sum(kept) if kept else None
    if isinstance(term, Directional):
        sides = [part(side, nonlinear) for side in (term.positive, term.negative)]
        if sides == [None, None]:
            return None
        return Directional(*(Sum(()) if side is None else side for side in sides))
    return term if bool(term.nonlinear) is nonlinear else None


def root(square: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Square root with derivative zero, not infinity, at zero."""
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)


def orthonormal(columns: Float[Array, "J p"]) -> Float[Array, "J p"]:
    """An orthonormal basis of the columns' span, each column freed of those before it.

    A column that the ones before it already span becomes zero, and so do its derivatives: a
    Householder QR would return an arbitrary direction and NaN derivatives there.
    """
    return basis_of(columns).orthonormal()


class Basis(eqx.Module):
    """An orthonormal basis Q = A M of columns A, as A `first` = `near` and Q = `near` `white`."""

    near: Float[Array, "J p"]
    first: Float[Array, "p p"]
    white: Float[Array, "p p"]

    @property
    def matrix(self) -> Float[Array, "p p"]:
        """M."""
        return self.first @ self.white

    def orthonormal(self) -> Float[Array, "J p"]:
        """Q."""
        return self.near @ self.white

    def solve(self, target: Float[Array, " J"]) -> Float[Array, " p"]:
        """Least-squares coefficients M Qᵀ t."""
        return self.first @ (self.white @ (self.white.T @ (self.near.T @ target)))

    def divide(self, vector: Float[Array, " p"]) -> Float[Array, " p"]:
        """(AᵀA)⁻¹ = M Mᵀ times a vector."""
        return self.matrix @ (self.matrix.T @ vector)


def basis_of(columns: Float[Array, "J p"]) -> Basis:
    """The basis of [`orthonormal`][], by a Cholesky QR that is done twice.

    The first makes the columns nearly orthonormal; what its products lose of a column that is
    nearly spanned the second finds, since there that column is large (Fukaya et al. 2020).
    """
    if columns.shape[1] == 1:
        square = jnp.sum(columns**2)
        there = square > 0
        scale = jnp.where(there, 1 / jnp.sqrt(jnp.where(there, square, 1.0)), 0.0)
        return Basis(columns, jnp.ones((1, 1), columns.dtype), scale[None, None])
    first, pivots = nearly(columns)
    near = columns @ first
    return Basis(near, first, whiten_again(near.T @ near, pivots))


def nearly(columns: Float[Array, "J p"]) -> tuple[Float[Array, "p p"], Float[Array, " p"]]:
    """A matrix that makes columns nearly orthonormal, and the pivots it counts with, `(p,)`."""
    columns = jax.lax.stop_gradient(columns)
    return nearly_white(columns.T @ columns)


def nearly_white(gram: Float[Array, "p p"]) -> tuple[Float[Array, "p p"], Float[Array, " p"]]:
    """As [`nearly`][], from the products of the columns.

    Any matrix serves that is near enough: the derivatives of this one are left out.
    """
    return small.nearly_white(gram, 10 * float(jnp.finfo(gram.dtype).eps))


def whiten_again(gram: Float[Array, "p p"], pivots: Float[Array, " p"]) -> Float[Array, "p p"]:
    """The matrix that makes columns orthonormal which [`nearly`][] are, from their products.

    Zero for a column whose rest is but rounding beside the column as it was.
    """
    size = jnp.diagonal(gram) * pivots
    least = (ROUNDING * jnp.finfo(gram.dtype).eps) ** 2
    return small.whiten(gram, jax.lax.stop_gradient(least / jnp.where(size > 0, size, 1.0)))


def project_out(basis: Float[Array, "J q"], values: Float[Array, "J k"]) -> Float[Array, "J k"]:
    """Values less their part in the span of an orthonormal basis, twice for rounding."""
    for _ in range(2):
        values = values - basis @ (basis.T @ values)
    return values


def residual(
    basis: Float[Array, "J q"], target: Float[Array, " J"], bumps: Float[Array, "J k"]
) -> Float[Array, " J"]:
    """What is left of the (already projected) target after the best bump amplitudes, `(J,)`.

    Its squared norm is the reduced cost L(β), eq. (17).
    """
    directions = orthonormal(project_out(basis, bumps))
    return project_out(directions, target[:, None])[:, 0]


def cost(
    basis: Float[Array, "J q"], target: Float[Array, " J"], bumps: Float[Array, "J k"]
) -> Float[Array, ""]:
    """The reduced cost L(β) of eq. (17) at one β, N²·s."""
    return jnp.sum(residual(basis, target, bumps) ** 2)


@jax.custom_jvp
def least_squares(
    columns: Float[Array, "J p"],
    target: Float[Array, " J"],
    known: Float[Array, " p"] | None = None,
) -> Float[Array, " p"]:
    """Least-squares coefficients, eq. (19); zero for a column that the ones before it span.

    `known`: the coefficients themselves, where they come from a shorter way and only their
    derivative is asked for.
    """
    return basis_of(columns).solve(target) if known is None else known


@least_squares.defjvp
def _(primals, tangents):
    """By the normal equations Aᵀ(t − Aα) = 0: the steps of the solution are not differentiated."""
    columns, target, known = primals
    turned, moved, _ = tangents
    basis = basis_of(columns)
    alpha = basis.solve(target) if known is None else least_squares(*primals)
    rest = target - columns @ alpha
    return alpha, basis.solve(moved - turned @ alpha) + basis.divide(turned.T @ rest)


class Moments(eqx.Module):
    """All that the reduced cost of one bump needs of the rows, for several weightings of them.

    A bump e is any function given by its values at the `J` places; the rows of the batch (the
    directions of motion, eq. 24) differ in weights alone.

    - `shared`: functions in the span of the columns without β, `(J, q)`, and `dual`, the weights
      that give a bump's coefficients on them from every `J // K`-th place, `(K, q)`.
    - `against`: for each weighting, what e is multiplied with: its own orthonormal columns and
      the force less its part in them, weighted, `(R, q + 1, J)`.
    - `weights`: those of e², `(R, J)`. `whole`: the cost without a bump, N²·s, `(R,)`.
    """

    shared: Float[Array, "J q"]
    dual: Float[Array, "K q"]
    against: Float[Array, "R t J"]
    weights: Float[Array, "R J"]
    whole: Float[Array, " R"]

    def costs(self, bumps: Float[Array, "B J"]) -> Float[Array, "R B"]:
        """L of each bump and weighting, eq. (17), N²·s."""
        return self.whole[:, None] - self.gains(bumps)

    def gains(self, bumps: Float[Array, "B J"]) -> Float[Array, "R B"]:
        """What each bump takes off the cost, hᵀ D⁻¹ h less its part without the bump, N²·s.

        What all weightings can explain is first taken off the bump itself, so that the difference
        e·e − |Qᵀe|² does not cancel where the bump is nearly constant or straight.
        """
        some = bumps[:, :: bumps.shape[1] // self.dual.shape[0]][:, : self.dual.shape[0]]
        parts = some @ self.dual
        left = bumps
        for i in range(self.dual.shape[1]):
            left = left - parts[:, i, None] * self.shared[None, :, i]
        height, length, count = *self.against.shape[:2], bumps.shape[0]
        products = self.against.reshape(height * length, -1) @ left.T
        products = products.reshape(height, length, count)
        size = jnp.stack([jnp.sum(w[None, :] * left * left, axis=1) for w in self.weights])
        most = jnp.sum(self.weights, axis=1)[:, None] * jnp.max(some**2, axis=1)[None, :]
        inside = jnp.sum(products[:, :-1] ** 2, axis=1)
        return taken_off(products[:, -1], size, inside, most)


def taken_off(along, size, inside, most) -> Float[Array, "*n"]:
    """What a column takes off the cost: (r·e)²/(e·e − |Qᵀe|²), N²·s.

    Nothing if it is in the span of Q, its rest but rounding beside e·e, `size`, or beside `most`,
    the square before what was common went.
    """
    rest = size - inside
    eps = 1e3 * jnp.finfo(rest.dtype).eps
    visible = (rest > eps * size) & (rest > eps**2 * most)
    return jnp.where(visible, along**2 / jnp.where(visible, rest, 1.0), 0.0)


def moments(
    columns: Float[Array, "J p"],
    target: Float[Array, " J"],
    roots: Float[Array, "R J"],
    parity: Float[Array, " J"] | None = None,
) -> Moments:
    """The [`Moments`][] of rows: columns without β, the force, N, and square roots of weights.

    `parity` is a sign for each row that bumps will be given without.
    """
    bases = jax.lax.map(lambda r: orthonormal(r[:, None] * columns), roots)
    left = jax.vmap(lambda b, r: project_out(b, (r * target)[:, None])[:, 0])(bases, roots)
    # A rough share is enough to take off, and any function of the span may be: few places do.
    step = max(1, columns.shape[0] // PLACES)
    place = slice(0, columns.shape[0] // step * step, step)
    together = root(jnp.sum(roots[:, place] ** 2, axis=0))
    signed = columns if parity is None else columns * parity[:, None]
    some = together[:, None] * signed[place]
    basis = basis_of(some)
    # The functions whose values at these places are the orthonormal ones.
    function = signed @ basis.matrix
    dual = basis.orthonormal() * together[:, None]
    against = jnp.concatenate([jnp.swapaxes(bases, 1, 2), left[:, None, :]], axis=1)
    against = against * roots[:, None, :]
    if parity is not None:
        against = against * parity[None, None, :]
    return Moments(function, dual, against, roots**2, jnp.sum(left**2, axis=1))


def grid_costs(
    bump: Callable[[Float[Array, " d"]], Float[Array, " J"]],
    grid: Float[Array, "G d"],
    rows: Moments,
) -> Float[Array, "R G"]:
    """The reduced cost of one bump, eq. (17), over a grid of β, N²·s, for each weighting.

    `bump` maps β to its values at the places of `rows`. In tiles: memory is bounded at any grid.
    """

    def tile(betas):
        return rows.costs(jax.vmap(bump)(betas))

    return tiled(tile, grid, rows.weights.shape[1])


def general_grid_costs(
    bumps: Callable[[Float[Array, " d"]], Float[Array, "J k"]],
    grid: Float[Array, "G d"],
    basis: Float[Array, "J q"],
    target: Float[Array, " J"],
) -> Float[Array, " G"]:
    """The reduced cost of any number of weighted nonlinear columns over a grid of β, N²·s.

    `basis`, orthonormal weighted columns without β; `target`, the projected weighted force.
    """

    def tile(betas):
        return jax.vmap(lambda beta: cost(basis, target, bumps(beta)))(betas)[None, :]

    return tiled(tile, grid, 4 * target.shape[0])[0]


def tiled(tile: Callable, grid: Float[Array, "G d"], width: int) -> Float[Array, "R G"]:
    """A function of grid points, `(B, d)` to `(R, B)`, over a grid piece by piece.

    Each point takes `width` numbers; the last piece is filled up so that one program serves all.
    """
    count, dimensions = grid.shape
    batch = int(np.clip(TILE // max(1, width), 1, min(64, count)))
    pieces = -(-count // batch)
    padded = jnp.pad(grid, ((0, pieces * batch - count), (0, 0)), mode="edge")
    costs = jax.lax.map(tile, padded.reshape(pieces, batch, dimensions))
    return jnp.moveaxis(costs, 1, 0).reshape(costs.shape[1], -1)[:, :count]


def grid_points(dimensions: int, points: int | None, dtype) -> Float[Array, "G d"]:
    """An equally spaced grid of the unit cube, `(G, d)`: `points` a side, or a default."""
    side = points or GRID_POINTS[min(dimensions, len(GRID_POINTS)) - 1]
    axis = np.linspace(0.0, 1.0, side)
    mesh = np.meshgrid(*([axis] * dimensions), indexing="ij")
    return jnp.asarray(np.stack([m.ravel() for m in mesh], axis=1), dtype)


def decode(
    unit: Float[Array, " d"], limits: Float[Array, "2 d"], logarithmic: tuple[bool, ...]
) -> Float[Array, " d"]:
    """β from the unit cube: geometric between its bounds where its scale is a ratio."""
    low, high = limits
    linear = low + unit * (high - low)
    positive = jnp.where(low > 0, low, 1.0)
    ratio = jnp.where(low > 0, high, 1.0) / positive
    return jnp.where(jnp.asarray(logarithmic), positive * ratio**unit, linear)


def by_pieces(function: Callable, values: tuple, length: int):
    """`function` of pieces of that many rows, one after the other, its results stacked.

    Temporaries stay in the cache. Rows that are no more, or have been in the piece before, are
    zeros.
    """
    lacking = max(0, length - values[0].shape[0])
    values = tuple(jnp.pad(x, ((0, lacking), *[(0, 0)] * (x.ndim - 1))) for x in values)
    count = values[0].shape[0]

    def piece(start):
        at = jnp.minimum(start, count - length)
        fresh = at + jnp.arange(length) >= start
        parts = (jax.lax.dynamic_slice_in_dim(x, at, length) for x in values)
        return function(*(jnp.where(fresh.reshape(-1, *[1] * (x.ndim - 1)), x, 0) for x in parts))

    return jax.lax.map(piece, jnp.arange(0, count, length))


def each(function: Callable, rows: Moments, *more):
    """`function` of the moments of each weighting alone and its row of `more`, stacked."""

    def side(item):
        against, weights, whole, *rest = item
        alone = (against[None], weights[None], whole[None])
        return function(Moments(rows.shared, rows.dual, *alone), *rest)

    return jax.lax.map(side, (rows.against, rows.weights, rows.whole, *more))
