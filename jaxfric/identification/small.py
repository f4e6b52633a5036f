"""Linear algebra of a few unknowns in plain operations, without LAPACK.

jaxlib hands a batch of small factorisations to the thread pool on which the calling operation
itself waits: two that run at once on a machine of two cores wait for each other for ever (seen
with jaxlib 0.10.2 in batched QR). For a handful of unknowns plain elimination is quick as well.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def solve_positive(
    matrix: Float[Array, "p p"], right: Float[Array, " p"]
) -> tuple[Float[Array, " p"], Float[Array, ""]]:
    """Solution of a symmetric positive definite system, and the smallest pivot, relative.

    Gauss-Jordan elimination, which needs no pivoting for such matrices (Golub & Van Loan, 4th
    ed. 2013, section 4.2). The matrix is scaled to a unit diagonal first; a smallest pivot that is
    not positive tells that the matrix was not positive definite, and the solution means nothing.
    """
    count = matrix.shape[0]
    diagonal = jnp.abs(jnp.diagonal(matrix))
    scale = 1 / jnp.sqrt(jnp.where(diagonal > 0, diagonal, 1.0))
    table = jnp.concatenate(
        [matrix * scale[:, None] * scale[None, :], (right * scale)[:, None]], axis=1
    )

    def eliminate(state, place):
        table, smallest = state
        row, column = place @ table, table[:, :count] @ place
        pivot = jnp.vdot(place, column)
        row = row / jnp.where(pivot != 0, pivot, 1.0)
        # Every row less its share of the pivot row; the pivot row itself becomes the scaled one.
        table = table * (1 - place)[:, None] - (column * (1 - place))[:, None] * row[None, :]
        table = table + place[:, None] * row[None, :]
        return (table, jnp.minimum(smallest, pivot)), None

    start = (table, jnp.asarray(jnp.inf, matrix.dtype))
    places = jnp.eye(count, dtype=matrix.dtype)
    (table, smallest), _ = jax.lax.scan(eliminate, start, places)
    return table[:, count] * scale, smallest


def invert_upper(matrix: Float[Array, "p p"]) -> Float[Array, "p p"]:
    """Inverse of an upper triangular matrix with a non-zero diagonal, by back substitution."""

    def add(inverse, item):
        row, place = item
        line = (place - row @ inverse) / jnp.vdot(row, place)
        return inverse + place[:, None] * line[None, :], None

    places = jnp.eye(matrix.shape[0], dtype=matrix.dtype)
    return jax.lax.scan(add, jnp.zeros_like(matrix), (matrix, places), reverse=True)[0]


def whiten(
    gram: Float[Array, "p p"], spanned: Float[Array, "*p"] | float = 0.0
) -> Float[Array, "p p"]:
    """Upper triangular W with Wᵀ G W = 1.

    Gram-Schmidt on the unit vectors with the inner product G, scaled to a unit diagonal. A row and
    column of zeros stays zero in W; a column with a pivot of `spanned` or less counts as spanned by
    those before it, and stays zero too.
    """
    return _whiten(gram, spanned)[0]


def nearly_white(
    gram: Float[Array, "p p"], least: float
) -> tuple[Float[Array, "p p"], Float[Array, " p"]]:
    """A matrix like that of [`whiten`][], and the pivots that it counts with, `(p,)`, none below
    `least`: a column that has less is freed of those before it, but no other of that one.
    """
    white, rests, pivots = _whiten(gram, least)
    pivots = jnp.maximum(pivots, least)
    return white + rests / least**0.5, pivots


def _whiten(gram, spanned):
    """W, the scaled rest of each column that is spanned, and the pivots."""
    diagonal = jnp.diagonal(gram)
    there = diagonal > 0
    scale = jnp.where(there, 1 / jnp.sqrt(jnp.where(there, diagonal, 1.0)), 0.0)
    gram = gram * scale[:, None] * scale[None, :]

    def add(white, item):
        place, limit = item
        rest = place - white @ (white.T @ (gram @ place))
        pivot = jnp.vdot(rest, gram @ rest)
        valid = pivot > limit
        unit = jnp.where(valid, rest / jnp.sqrt(jnp.where(valid, pivot, 1.0)), 0.0)
        return white + unit[:, None] * place[None, :], (jnp.where(valid, 0.0, rest), pivot)

    limits = jnp.broadcast_to(jnp.asarray(spanned, gram.dtype), scale.shape)
    places = jnp.eye(gram.shape[0], dtype=gram.dtype)
    white, (rests, pivots) = jax.lax.scan(add, jnp.zeros_like(gram), (places, limits))
    return scale[:, None] * white, scale[:, None] * rests.T, pivots
