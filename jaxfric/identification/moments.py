"""How well the moment of a change is known, which few rows tell."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..terms.base import AbstractTerm
from . import reduced, uncertainty
from .projections import Rows

# Samples that a jump is drawn out over: enough that a clock's jitter adds or drops no good part of
# them, and a quarter of the shortest kernel's reach, which blurs them anyway.
RAMP = 4
# Kernels overlap up to the fourth neighbour.
NEIGHBOURS = 4
# 95 % of the estimated moments of a jump δ in noise of the density S are within 11 S/δ² of the true
# one (Yao 1987, "Approximating the distribution of the maximum likelihood estimate of the
# change-point", Annals of Statistics 15): up to there the rows change by an energy of 11 S.
QUANTILE = 11.0


def between(before, after, reach):
    """The standard error, s, of a moment that may be anywhere between two rows.

    At rest rows are far apart, and each is blurred by its kernel.

    **Arguments:** `before`, `after`: their times, s; `reach` of the kernel, s.
    """
    return (after - before + reach) / 12**0.5


def dated(
    term: AbstractTerm,
    alpha: Float[Array, " p"],
    beta: Float[Array, " d"],
    recording: Recording,
    rows: Rows,
    interval: Float[Array, ""],
    error: Float[Array, " J"],
    matrix: Float[Array, "P P"],
) -> tuple[Float[Array, " d"], Float[Array, "P P"]]:
    """β and the covariance `matrix` with what is known about the moments among β.

    Only the rows about a moment tell it. The fit leaves no score in them, so that the cosines of
    the scores say nothing. Instead the interval reaches to where another moment would change the
    rows by more than noise does; and a moment may be anywhere between two rows. A change at rest
    shows in no row: its moment is put in the middle of the rest.

    **Arguments:** `term`, the fitted terms, with their `alpha` and `beta`; `interval` between the
    samples, s; `error`, the residual.
    """
    for number, parameter in enumerate(term.nonlinear):
        if not (parameter.moment or parameter.lasting):
            continue
        begin = beta[number - 1] if parameter.lasting else jnp.zeros_like(beta[number])
        known = term, alpha, beta, number, begin
        moment, variance = _dated(*known, recording, rows, interval, error)
        at = matrix.shape[0] - beta.size + number
        beta, matrix = beta.at[number].set(moment), matrix.at[at, at].set(variance)
    return beta, matrix


def _dated(term, alpha, beta, number, begin, recording, rows, interval, error):
    """One moment, s after `begin`, and its variance, s²."""
    weight = rows.positive + rows.negative

    def force(moment):
        return rows.force(term.with_beta(beta.at[number].set(moment)), alpha, recording)

    before, after = _around(rows.time - begin, weight > 0, beta[number])
    inside = jnp.isfinite(before) & jnp.isfinite(after)
    unmoved = jnp.sum(weight * jax.jacfwd(force)(beta[number]) ** 2) == 0
    moment = jnp.where(inside & unmoved, 0.5 * (before + after), beta[number])
    there, noise = force(moment), _power(reduced.root(weight) * error)

    def beyond(step):
        return jnp.sum(weight * (force(moment + step) - there) ** 2) > QUANTILE * noise

    # Half octaves from one sample to all of them.
    count = 1 + int(2 * np.log2(recording.num_samples))
    steps = interval * 2 ** (0.5 * jnp.arange(count, dtype=moment.dtype))
    far = jax.lax.map(lambda step: beyond(step) & beyond(-step), steps)
    first = jnp.where(jnp.any(far), steps[jnp.argmax(far)], jnp.inf)
    own = uncertainty.reach(jnp.minimum(first, interval * recording.num_samples))
    blurred = jnp.where(inside, between(before, after, rows.reach * interval), 0.0)
    # Of a change of nothing there is no moment.
    told = jnp.any(weight * (there - force(rows.time[-1] - begin)) ** 2 > 0)
    return moment, jnp.where(told, jnp.maximum(own, blurred) ** 2, jnp.inf)


def _power(left: Float[Array, " J"]) -> Float[Array, ""]:
    """The density of a weighted residual, N²·s, correlated as overlapping kernels are."""
    count = jnp.maximum(jnp.sum(left != 0), 1).astype(left.dtype)
    lags = [jnp.abs(jnp.sum(left[k:] * left[:-k])) for k in range(1, 1 + NEIGHBOURS)]
    return (jnp.sum(left**2) + 2 * sum(lags)) / count


def _around(time, used, moment):
    """The times of the rows in use before and after a moment, s; infinite where there is none."""
    before = jnp.max(jnp.where(used & (time <= moment), time, -jnp.inf))
    after = jnp.min(jnp.where(used & (time > moment), time, jnp.inf))
    return before, after
