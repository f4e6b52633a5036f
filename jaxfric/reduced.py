"""Problem (L) of Kim, Kim & Ha (2004), eq. (17): the affine parameters solved, β left to search.

Every function here works on weighted rows. The columns without nonlinear parameters are
orthonormalised once and projected out of the force and out of each bump, so that the reduced cost
L(β) = |r|² − hᵀ D⁻¹ h is a difference that has lost nothing to the large common part.
"""

import math
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float

from .refine import BoxGaussNewton
from .terms.base import AbstractTerm, Directional, Sum

# A tile of grid points times samples stays below this many numbers, so that it lives in the cache
# and the memory does not grow with the grid: 2¹⁷ doubles are 1 MiB.
TILE = 2**17
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
    """An orthonormal basis of the columns' span by Gram-Schmidt, repeated for rounding.

    A column that the ones before it already span becomes zero, and so do its derivatives: a
    Householder QR would return an arbitrary direction and NaN derivatives there.
    """
    if columns.shape[1] == 1:
        return _normalised(columns[:, 0], root(jnp.sum(columns**2)))[:, None]

    def append(basis, item):
        column, place = item
        rest = column
        for _ in range(2):
            rest = rest - basis @ (basis.T @ rest)
        unit = _normalised(rest, root(jnp.sum(column**2)))
        return basis + unit[:, None] * place[None, :], None

    places = jnp.eye(columns.shape[1], dtype=columns.dtype)
    return jax.lax.scan(append, jnp.zeros_like(columns), (columns.T, places))[0]


def _normalised(rest, size):
    """A vector of length one, or zero where it is but rounding beside `size`."""
    square = jnp.sum(rest**2)
    new = square > (100 * jnp.finfo(rest.dtype).eps * size) ** 2
    return jnp.where(new, rest / jnp.sqrt(jnp.where(new, square, 1.0)), 0.0)


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


def _single_bump_costs(bases, targets, roots, bump):
    """L for one bump in every row at once: the bump is evaluated once, rows differ in weights.

    Removing the weighted mean first keeps the difference e·e − |Qᵀe|² from cancelling where the
    bump is nearly constant.
    """
    weighted = roots * bump[None, :]
    own = jnp.sum(roots * weighted, axis=1) / jnp.sum(roots**2, axis=1)
    centred = roots * (bump[None, :] - own[:, None])
    inside = jnp.einsum("rjq,rj->rq", bases, centred)
    along = jnp.sum(targets * centred, axis=1)
    size = jnp.sum(centred**2, axis=1)
    rest = size - jnp.sum(inside**2, axis=1)
    visible = rest > 1e3 * jnp.finfo(rest.dtype).eps * size
    gain = jnp.where(visible, along**2 / jnp.where(visible, rest, 1.0), 0.0)
    return jnp.sum(targets**2, axis=1) - gain


def grid_costs(
    bumps: Callable[[Float[Array, " d"]], Float[Array, "J k"]],
    grid: Float[Array, "G d"],
    bases: Float[Array, "R J q"],
    targets: Float[Array, "R J"],
    roots: Float[Array, "R J"],
    constant_spanned: bool,
) -> Float[Array, "R G"]:
    """The reduced cost over a grid of β, for several weightings of the same rows.

    **Arguments:** `bumps`, from β to the nonlinear columns, `(J, k)`; `grid`, `(G, d)`; for each
    row of the batch (a direction of motion, eq. 24) `bases`, orthonormal weighted linear columns
    `(R, J, q)`, `targets`, the projected weighted force `(R, J)`, `roots`, square roots of the
    weights `(R, J)`; `constant_spanned`, whether one bump differs from a function that may be
    shifted by a constant in the span.

    Evaluated in tiles, so that memory is bounded whatever the grid.
    """

    def at(beta):
        columns = bumps(beta)
        if constant_spanned:
            return _single_bump_costs(bases, targets, roots, columns[:, 0])
        weigh = jax.vmap(lambda q, u, w: cost(q, u, w[:, None] * columns))
        return weigh(bases, targets, roots)

    batch = int(np.clip(TILE // max(1, roots.shape[1]), 1, 64))
    return jax.lax.map(at, grid, batch_size=batch).T


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


def refine(
    residuals: Callable[[Float[Array, " d"]], Float[Array, " J"]],
    start: Float[Array, " d"],
    cell: Float[Array, " d"],
) -> tuple[Float[Array, " d"], Bool[Array, ""]]:
    """The minimiser near a grid point, inside the neighbouring points and the unit cube.

    **Returns:** the refined point, never worse than `start`, and whether it converged.
    """
    tolerance = math.sqrt(float(jnp.finfo(start.dtype).eps)) * 1e-4
    solver = BoxGaussNewton(rtol=0.0, atol=tolerance)
    box = {"lower": jnp.maximum(start - cell, 0.0), "upper": jnp.minimum(start + cell, 1.0)}
    found: optx.Solution = optx.least_squares(
        lambda y, _: residuals(y),
        solver,
        start,
        options=box,
        max_steps=60,
        throw=False,
        adjoint=optx.RecursiveCheckpointAdjoint(),
    )
    return found.value, found.result == optx.RESULTS.successful
