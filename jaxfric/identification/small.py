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
    gram: Float[Array, "p p"], spanned: float = 0.0
) -> tuple[Float[Array, "p p"], Float[Array, ""]]:
    """Upper triangular W with Wᵀ G W = 1, and the least pivot of G scaled to a unit diagonal.

    Gram-Schmidt on the unit vectors with the inner product G. A row and column of zeros stays zero
    in W and has no pivot; where the pivot is not well above rounding, W means nothing. A column
    with a pivot of `spanned` or less counts as spanned by those before it, and stays zero too.
    """
    diagonal = jnp.diagonal(gram)
    there = diagonal > 0
    scale = jnp.where(there, 1 / jnp.sqrt(jnp.where(there, diagonal, 1.0)), 0.0)
    gram = gram * scale[:, None] * scale[None, :]

    def add(state, place):
        white, least = state
        rest = place - white @ (white.T @ (gram @ place))
        pivot = jnp.vdot(rest, gram @ rest)
        valid = pivot > spanned
        unit = rest / jnp.sqrt(jnp.where(valid, pivot, 1.0))
        least = jnp.where(jnp.vdot(place, scale) > 0, jnp.minimum(least, pivot), least)
        return (white + jnp.where(valid, unit, 0.0)[:, None] * place[None, :], least), None

    start = jnp.zeros_like(gram), jnp.ones((), gram.dtype)
    (white, least), _ = jax.lax.scan(add, start, jnp.eye(gram.shape[0], dtype=gram.dtype))
    return scale[:, None] * white, least
