"""How well a recording determines the parameters.

The residual of an axis is far from white, so that independent-sample formulas promise too much.
Here slow cosines of time vote: the covariance is the sandwich A⁻¹ (Σ_k s_k s_kᵀ / K) A⁻¹ with s_k
the scores summed with the weight √2 cos(πk t), k = 1 … K (the equal-weighted cosine estimate of
the long-run variance; Müller 2007; Lazarus, Lewis, Stock & Watson 2018), each freed of the fit's
pull on it (as CR3 of Bell & McCaffrey 2002 does for blocks). It asks of the residual only that its
spectrum is flat below K half-periods a record, whereas blocks have to be many correlation times
long. What the record cannot see is infinitely uncertain.
"""

import math
from statistics import NormalDist
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from . import reduced, small

# Votes, and so the degrees of freedom. Correlation times up to 1/(2πK) of the slip time, 2 %, keep
# the spectrum flat enough; the price is Student's t with 8 degrees: intervals 18 % longer than with
# infinitely many.
COSINES = 8
# At least so many blocks of rows, in each of which a cosine is one number where it says how much
# of a vote the fit has explained: the fastest turns by 0.2 rad in one, and its mean there is its
# middle to 0.2 %.
BLOCKS = 128


class Estimate(NamedTuple):
    """A parameter's value with its standard error (infinite if the data cannot see it) and unit."""

    value: Float[Array, ""]
    standard_error: Float[Array, ""]
    unit: str
    degrees_of_freedom: float = COSINES

    def half_width(self, level: float = 0.95) -> Array:
        """Half the confidence interval of that level, from Student's t distribution."""
        return student_quantile(0.5 + 0.5 * level, self.degrees_of_freedom) * self.standard_error

    def interval(self, level: float = 0.95) -> tuple[Array, Array]:
        """The confidence interval of that level, from Student's t distribution."""
        half = self.half_width(level)
        return self.value - half, self.value + half

    def to_dict(self) -> dict[str, Any]:
        """A scalar estimate as plain data, with its 95 % interval; `None` for what is not seen."""
        value, error = float(self.value), float(self.standard_error)
        seen = math.isfinite(value) and math.isfinite(error)
        return {
            "value": value if math.isfinite(value) else None,
            "standard_error": error if math.isfinite(error) else None,
            "interval": [float(end) for end in self.interval()] if seen else None,
            "unit": self.unit,
        }


def student_quantile(probability: float, degrees: float) -> float:
    """Quantile of Student's t: exactly for one and two degrees of freedom, else by its expansion
    about the normal (Abramowitz & Stegun 26.7.5), of 97.5 % off by less than 0.5 % from three on.
    """
    if degrees == 1:
        return math.tan(math.pi * (probability - 0.5))
    if degrees == 2:
        return (2 * probability - 1) / math.sqrt(2 * probability * (1 - probability))
    z = NormalDist().inv_cdf(probability)
    first = (z**3 + z) / 4
    second = (5 * z**5 + 16 * z**3 + 3 * z) / 96
    third = (3 * z**7 + 19 * z**5 + 17 * z**3 - 15 * z) / 384
    fourth = (79 * z**9 + 776 * z**7 + 1482 * z**5 - 1920 * z**3 - 945 * z) / 92160
    return z + first / degrees + second / degrees**2 + third / degrees**3 + fourth / degrees**4


def places(weight: Float[Array, " J"]) -> Float[Array, " J"]:
    """Where each row stands in the slip time, from 0 to 1."""
    total = jnp.cumsum(weight)
    return (total - 0.5 * weight) / jnp.where(total[-1] > 0, total[-1], 1.0)


def reach(off):
    """The standard errors whose 95 % interval reaches as far as `off`, an array in any unit."""
    return off / student_quantile(0.975, COSINES)


class Deviations(NamedTuple):
    """How far each cosine finds the estimate from the truth, and what the rows do not determine.

    - `votes`: a deviation of all parameters for each cosine, `(K, p)`, scaled so that the sum of
      squares is the covariance.
    - `hidden`: parameters with a part in a direction that the rows do not determine, `(p,)`.
    """

    votes: Float[Array, "K p"]
    hidden: Bool[Array, " p"]

    @property
    def covariance(self) -> Float[Array, "p p"]:
        """Covariance of the parameters, `(p, p)`; infinite variance for the hidden ones."""
        hidden = jnp.where(self.hidden, jnp.inf, 0.0).astype(self.votes.dtype)
        return self.votes.T @ self.votes + jnp.diag(hidden)

    def beyond(self, off: Float[Array, " p"]) -> "Deviations":
        """The same with 95 % intervals that reach as far as the parameters may be off, `(p,)`."""
        return Deviations(jnp.concatenate([self.votes, reach(off)[None, :]]), self.hidden)


def deviations(
    jacobian: Float[Array, "J p"],
    error: Float[Array, " J"],
    weight: Float[Array, " J"],
    place: Float[Array, " J"],
) -> Deviations:
    """The deviations of weighted least-squares parameters, by cosines of the scores.

    **Arguments:** `jacobian`, derivative of the rows by the parameters, `(J, p)`; `error`, the
    residual, `(J,)`; `weight`, `(J,)`; `place`, from [`places`][].
    """
    # A power of two: what a recording is padded with, alone or in a batch, moves no block.
    length = 1 << max(0, ((weight.shape[0] - 1) // BLOCKS).bit_length() - 1)
    many = length * min(BLOCKS, max(1, reduced.PIECE // length))
    more = -weight.shape[0] % many
    jacobian = jnp.pad(jacobian, ((0, more), (0, 0)))
    error, weight, place = (jnp.pad(x, (0, more)) for x in (error, weight, place))

    def products(jacobian, weight):
        return jacobian.T @ (weight[:, None] * jacobian)

    def blocks(jacobian, error, weight, place):
        """Products of the columns with themselves and with the error, and where a block stands."""
        table = jnp.concatenate([jacobian @ first, error[:, None]], axis=1)
        table = jnp.sqrt(weight)[:, None] * table
        waves = _cosines(jnp.pi * place)
        scores = (waves * table[None, :, -1]) @ table[:, :-1]
        table = table[:, :-1].reshape(-1, length, table.shape[1] - 1)
        own = jnp.einsum("bni,bnj->bij", table, table)
        used = (weight > 0).astype(place.dtype).reshape(-1, length)
        sums = jnp.sum(used * place.reshape(-1, length), axis=1)
        return own, sums / jnp.maximum(jnp.sum(used, axis=1), 1), scores

    gram = jnp.sum(reduced.by_pieces(products, (jacobian, weight), many), axis=0)
    first, pivots = reduced.nearly_white(jax.lax.stop_gradient(gram))
    pieces = reduced.by_pieces(blocks, (jacobian, error, weight, place), many)
    own, middles = (x.reshape(-1, *x.shape[2:]) for x in pieces[:2])
    scores = jnp.sum(pieces[2], axis=0)
    gram = jnp.sum(own, axis=0)
    white = reduced.whiten_again(gram, pivots)
    # The triangular factor R of the columns, from near = columns first.
    empty = jnp.diag(jnp.where(jnp.diagonal(first) > 0, 0.0, 1.0).astype(first.dtype))
    upper = jnp.triu(white.T @ gram @ small.invert_upper(first + empty))
    scale = jnp.linalg.norm(upper, axis=0)
    scale = jnp.where(scale > 0, scale, 1.0)
    upper = upper / scale[None, :]
    seen = jnp.diagonal(upper) > jnp.sqrt(jnp.finfo(jacobian.dtype).eps)
    identity = jnp.eye(scale.size, dtype=upper.dtype)
    inverse = small.invert_upper(jnp.where(seen[:, None], upper, identity))
    votes = _votes(own, scores, white, jnp.pi * middles, seen)
    spread = votes @ inverse.T / COSINES**0.5
    # A column that the others span, and every column that takes part in spanning it.
    spanned = jnp.where(seen[None, :], 0.0, inverse)
    hidden = jnp.max(jnp.abs(spanned), axis=1) > 1e-3
    return Deviations(spread / scale[None, :], hidden)


def _votes(
    own: Float[Array, "b p p"],
    scores: Float[Array, "K p"],
    white: Float[Array, "p p"],
    angle: Float[Array, " b"],
    seen: Bool[Array, " p"],
) -> Float[Array, "K p"]:
    """The scores with each cosine's weights, freed of the fit's pull: (I − A²H⁻¹)⁻¹ Xᵀ C e.

    X are the columns of the basis that are `seen`, near `white`, of which `own` are the products,
    block by block, and `scores` those with the error; C is a cosine, A = Xᵀ C X and H = Xᵀ C² X:
    the fit leaves e = (I − X Xᵀ) d of the disturbance d, so that of white noise the vote has the
    covariance H − A² instead of H. A² is never more than H, and near it only in a direction that
    few moments tell. It enters by 15/16, which limits what a direction that the fit explains by
    itself is credited with.
    """
    waves = _cosines(angle)

    def by(weights):
        sums = jnp.einsum("kb,bij->kij", weights, own)
        sums = jnp.einsum("ia,kij,jb->kab", white, sums, white)
        return jnp.where(seen[:, None] & seen[None, :], sums, 0.0)

    scores = jnp.where(seen, scores @ white, 0.0)

    def freed(pull, power, score):
        return power @ small.solve_positive(power - (15 / 16) * pull @ pull, score)[0]

    return jax.vmap(freed)(by(waves), by(waves**2), scores)


def _cosines(angle: Float[Array, " n"]) -> Float[Array, "K n"]:
    """√2 cos(k angle) for k = 1 … K, by their recurrence from one cosine."""
    first = jnp.cos(angle)
    waves = [jnp.ones_like(first), first]
    while len(waves) <= COSINES:
        waves.append(2 * first * waves[-1] - waves[-2])
    return 2**0.5 * jnp.stack(waves[1:])
