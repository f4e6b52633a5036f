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
# Places at which a bump is looked at to see what of it is constant or straight.
PLACES = 512
# From so many rows on, fewer passes over them are worth the PLACES rows' own Gram-Schmidt.
TALL = 8 * PLACES
# The least share of a column, squared, that the ones before it must leave for an orthonormal basis
# by products to be exact to ten times the rounding.
NEAR = 0.1
# Points for one, two, three, … nonlinear parameters: a ratio of 100 between the ends is then
# stepped by under 4 %, resp. 7 %, finer than a bump's own relative width.
GRID_POINTS = (128, 64, 24, 12, 8)


def part(term: AbstractTerm, nonlinear: bool) -> AbstractTerm | None:
    """The summands with (or without) nonlinear parameters, wrappers kept; else `None`."""
    if isinstance(term, Sum):
        kept = tuple(p for p in (part(t, nonlinear) for t in term.terms) if p is not None)
        return Sum(kept) if kept else None
    if isinstance(term, Directional):
        positive, negative = part(term.positive, nonlinear), part(term.negative, nonlinear)
        return None if positive is None else Directional(positive, negative)
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


def gram_schmidt(columns: Float[Array, "J p"]) -> tuple[Float[Array, "J p"], Float[Array, "p p"]]:
    """The basis as by [`orthonormal`][], and the matrix that makes it out of the columns.

    Classical Gram-Schmidt, repeated for rounding (Golub & Van Loan, 4th ed. 2013, section 5.2.7).
    """

    def append(state, item):
        basis, matrix = state
        column, place = item
        rest, made = column, place
        for _ in range(2):
            share = basis.T @ rest
            rest, made = rest - basis @ share, made - matrix @ share
        # Zero where the rest is but rounding beside the column.
        square, size = jnp.sum(rest**2), root(jnp.sum(column**2))
        new = square > (100 * jnp.finfo(rest.dtype).eps * size) ** 2
        scale = jnp.where(new, 1 / jnp.sqrt(jnp.where(new, square, 1.0)), 0.0)
        basis = basis + scale * rest[:, None] * place[None, :]
        return (basis, matrix + scale * made[:, None] * place[None, :]), None

    places = jnp.eye(columns.shape[1], dtype=columns.dtype)
    empty = jnp.zeros_like(columns), jnp.zeros_like(places)
    return jax.lax.scan(append, empty, (columns.T, places))[0]


class Basis(eqx.Module):
    """An orthonormal basis Q = A M of columns A, as A `first` = `near` and Q = `near` `white`."""

    near: Float[Array, "J p"]
    first: Float[Array, "p p"]
    white: Float[Array, "p p"]

    def orthonormal(self) -> Float[Array, "J p"]:
        """Q."""
        return self.near @ self.white

    def solve(self, target: Float[Array, " J"]) -> Float[Array, " p"]:
        """Least-squares coefficients M Qᵀ t."""
        return self.first @ (self.white @ (self.white.T @ (self.near.T @ target)))

    def divide(self, vector: Float[Array, " p"]) -> Float[Array, " p"]:
        """(AᵀA)⁻¹ = M Mᵀ times a vector."""
        matrix = self.first @ self.white
        return matrix @ (matrix.T @ vector)


def basis_of(columns: Float[Array, "J p"]) -> Basis:
    """The basis of [`gram_schmidt`][], of tall columns in a quicker way where that is as exact.

    Gram-Schmidt on some of the rows makes the columns nearly orthonormal on all of them, and what
    is left to do to those loses nothing in the product QᵀQ (a Cholesky QR with a preconditioner;
    Fukaya et al. 2020).
    """
    if columns.shape[1] == 1:
        square = jnp.sum(columns**2)
        there = square > 0
        scale = jnp.where(there, 1 / jnp.sqrt(jnp.where(there, square, 1.0)), 0.0)
        return Basis(columns, jnp.ones((1, 1), columns.dtype), scale[None, None])

    def slow():
        basis, matrix = gram_schmidt(columns)
        return Basis(basis, matrix, jnp.eye(columns.shape[1], dtype=columns.dtype))

    if columns.shape[0] < TALL:
        return slow()
    some = jax.lax.stop_gradient(columns[:: columns.shape[0] // PLACES])
    first = gram_schmidt(some)[1]
    # What the few rows do not tell from the columns before it is left as it is.
    first = first + jnp.diag(jnp.where(jnp.diagonal(first) > 0, 0.0, 1.0).astype(first.dtype))
    near = columns @ first
    white, pivot = small.whiten(near.T @ near)
    return jax.lax.cond(pivot > NEAR, lambda: Basis(near, first, white), slow)


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
    dual, matrix = gram_schmidt(some)
    # The functions whose values at these places are the orthonormal ones.
    function = signed @ matrix
    dual = dual * together[:, None]
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


def each(function: Callable, rows: Moments, *more):
    """`function` of the moments of each weighting alone and its row of `more`, stacked."""

    def side(item):
        against, weights, whole, *rest = item
        alone = (against[None], weights[None], whole[None])
        return function(Moments(rows.shared, rows.dual, *alone), *rest)

    return jax.lax.map(side, (rows.against, rows.weights, rows.whole, *more))
