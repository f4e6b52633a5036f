"""How well a recording determines the parameters.

The residual of an axis is far from white, so that independent-sample formulas promise too much.
Here blocks of the record vote: the covariance is the sandwich A⁻¹ (Σ_b s_b s_bᵀ) A⁻¹ with s_b the
score summed over block b (Liang & Zeger 1986), each freed of its own pull on the fit (the
delete-one-block jackknife, CR3 of Bell & McCaffrey 2002). What the record cannot see is infinitely
uncertain.
"""

from statistics import NormalDist
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from . import small
from .reduced import orthonormal

# Blocks a direction: enough that the spread of the votes is known to ±13 %, few enough that a
# block spans many samples of the residual's correlation on any record worth identifying.
BLOCKS = 32


class Estimate(NamedTuple):
    """A parameter's value with its standard error (infinite if the data cannot see it) and unit."""

    value: Float[Array, ""]
    standard_error: Float[Array, ""]
    unit: str
    degrees_of_freedom: int = BLOCKS

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """The confidence interval of that level, from Student's t distribution."""
        half = student_quantile(0.5 + 0.5 * level, self.degrees_of_freedom) * self.standard_error
        return self.value - half, self.value + half


def student_quantile(probability: float, degrees: int) -> float:
    """Quantile of Student's t by its expansion about the normal (Abramowitz & Stegun 26.7.5)."""
    z = NormalDist().inv_cdf(probability)
    first = (z**3 + z) / 4
    second = (5 * z**5 + 16 * z**3 + 3 * z) / 96
    third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
    return z + first / degrees + second / degrees**2 + third / degrees**3


def blocks(positive: Float[Array, " J"], negative: Float[Array, " J"]) -> Int[Array, " J"]:
    """Number of the block of each row: `BLOCKS` stretches of equal slip time in each direction."""

    def share(weight):
        total = jnp.cumsum(weight)
        part = total / jnp.where(total[-1] > 0, total[-1], 1.0)
        return jnp.clip((part * BLOCKS).astype(jnp.int32), 0, BLOCKS - 1)

    return jnp.where(positive >= negative, share(positive), BLOCKS + share(negative))


def covariance(
    jacobian: Float[Array, "J p"],
    error: Float[Array, " J"],
    weight: Float[Array, " J"],
    block: Int[Array, " J"],
) -> Float[Array, "p p"]:
    """Covariance of weighted least-squares parameters by block scores, `(p, p)`.

    **Arguments:** `jacobian`, derivative of the rows by the parameters, `(J, p)`; `error`, the
    residual, `(J,)`; `weight`, `(J,)`; `block`, the block of each row.

    **Returns:** the covariance; infinite variance for every parameter with a part in a direction
    that the rows do not determine.
    """
    root = jnp.sqrt(weight)[:, None]
    scale = jnp.linalg.norm(root * jacobian, axis=0)
    scale = jnp.where(scale > 0, scale, 1.0)
    scaled = root * jacobian / scale[None, :]
    white = orthonormal(scaled)
    upper = jnp.triu(white.T @ scaled)
    seen = jnp.diagonal(upper) > jnp.sqrt(jnp.finfo(jacobian.dtype).eps)
    white = jnp.where(seen[None, :], white, 0.0)
    identity = jnp.eye(scale.size, dtype=upper.dtype)
    inverse = small.invert_upper(jnp.where(seen[:, None], upper, identity))
    votes = jax.ops.segment_sum(white * root * error[:, None], block, 2 * BLOCKS)
    spread = inverse @ _without_own_pull(votes, _gram(white, block)).T
    matrix = spread @ spread.T / (scale[:, None] * scale[None, :])
    # A column that the others span, and every column that takes part in spanning it.
    spanned = jnp.where(seen[None, :], 0.0, inverse)
    hidden = jnp.max(jnp.abs(spanned), axis=1) > 1e-3
    return matrix + jnp.diag(jnp.where(hidden, jnp.inf, 0.0))


def _gram(white: Float[Array, "J p"], block: Int[Array, " J"]) -> Float[Array, "b p p"]:
    """Each block's part of the information, in coordinates where the whole is the identity."""

    def column(values):
        return jax.ops.segment_sum(white * values[:, None], block, 2 * BLOCKS)

    return jnp.moveaxis(jax.lax.map(column, white.T), 0, 1)


def _without_own_pull(
    votes: Float[Array, "b p"], gram: Float[Array, "b p p"]
) -> Float[Array, "b p"]:
    """The votes that blocks would cast had they not taken part in the fit: (I − A_b)⁻¹ s_b.

    A block that alone determines a direction pulls the fit onto itself and shows no residual
    there; A_b enters by 95 %, which limits what such a block is credited with to a factor of 20.
    """

    def free(vote, own):
        identity = jnp.eye(vote.size, dtype=vote.dtype)
        return small.solve_positive(identity - 0.95 * own, vote)[0]

    return jax.vmap(free)(votes, gram)
