"""The clock of a recording: the typical interval, and which samples belong together."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..data.recording import Recording

# An interval this many times the typical one is an interruption, not jitter of the clock.
GAP_FACTOR = 5.0


def is_traced(tree: Any) -> bool:
    """Whether any leaf, a signal of a recording, is an abstract value inside jit, vmap or grad."""
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(tree))


def interval(recording: Recording) -> Float[Array, ""]:
    """The typical sampling interval: the median over the valid steps, s."""
    if not is_traced(recording):
        return jnp.asarray(host_interval(recording), recording.time.dtype)
    steps = jnp.where(_linked(recording), jnp.diff(recording.time), jnp.nan)
    return quantile(steps, 0.5)


def continuous(recording: Recording, typical: Float[Array, ""]) -> Bool[Array, " M"]:
    """Whether sample i and i + 1 belong together, shape `(N - 1,)`: same segment, no gap."""
    steps = jnp.diff(recording.time)
    return _linked(recording) & (steps > 0) & (steps <= GAP_FACTOR * typical)


def _linked(recording: Recording) -> Bool[Array, " M"]:
    mask, segment = recording.mask, recording.segment
    return mask[1:] & mask[:-1] & (segment[1:] == segment[:-1])


def host_interval(recording: Recording) -> float:
    """[`interval`][] of a recording that is not traced, on the host; NaN without valid steps."""
    steps = np.diff(np.asarray(recording.time, float))
    known = _linked_on_host(recording)
    known &= ~np.isnan(steps)
    steps = steps if known.all() else steps[known]
    return float(np.median(steps, overwrite_input=True)) if steps.size else float("nan")


def host_intervals(recordings: Recording) -> np.ndarray:
    """[`host_interval`][] of each row of a batch, `(B,)`."""
    steps = np.diff(np.asarray(recordings.time, float))
    known = _linked_on_host(recordings) & ~np.isnan(steps)
    found, even = np.full(len(steps), np.nan), known.all(axis=1)
    if even.any() and steps.size:
        found[even] = np.median(steps[even], axis=1)
    for row in np.flatnonzero(~even & known.any(axis=1)):
        found[row] = np.median(steps[row, known[row]])
    return found


def _linked_on_host(recording: Recording) -> np.ndarray:
    mask, segment = np.asarray(recording.mask), np.asarray(recording.segment)
    return mask[..., 1:] & mask[..., :-1] & (segment[..., 1:] == segment[..., :-1])


def host_continuous(recording: Recording, typical: float | np.ndarray) -> np.ndarray:
    """[`continuous`][] of a recording that is not traced, or of a batch, on the host."""
    steps = np.diff(np.asarray(recording.time, float))
    longest = GAP_FACTOR * np.asarray(typical)[..., None]
    return _linked_on_host(recording) & (steps > 0) & (steps <= longest)


def quantile(values: Float[Array, " N"], share: float) -> Float[Array, ""]:
    """A quantile of the values that are numbers, as `numpy.nanquantile`; NaN where there are none.

    **Arguments:** `values`, `(N,)`; `share` of them that lie below it, from 0 to 1.
    """
    # As integers doubles have the same order, so that each bit of the one sought is found by
    # counting how many are smaller: five to eight times quicker than sorting, from 128 values on.
    integer = {4: jnp.int32, 8: jnp.int64}[values.dtype.itemsize]
    most, least = jnp.iinfo(integer).max, jnp.iinfo(integer).min
    number = ~jnp.isnan(values)
    count = jnp.sum(number)
    fixed = jax.lax.stop_gradient(jnp.where(number, values, jnp.inf))
    key = jax.lax.bitcast_convert_type(fixed + 0.0, integer)  # −0 to +0
    key = jnp.where(key < 0, key ^ most, key)
    place = share * jnp.maximum(count - 1, 0).astype(values.dtype)
    rank = jnp.floor(place).astype(integer)

    def fewer(bound):
        return jnp.sum(key < bound, dtype=integer) <= rank

    def refine(i, found):
        trial = found + (jnp.ones((), integer) << (jnp.iinfo(integer).bits - 2 - i))
        return jnp.where(fewer(trial), trial, found)

    zero = jnp.zeros((), integer)
    low = jnp.where(fewer(zero), zero, jnp.full((), least))
    low = jax.lax.fori_loop(0, jnp.iinfo(integer).bits - 1, refine, low)
    several = jnp.sum(key <= low, dtype=integer) > rank + 1
    high = jnp.where(several, low, jnp.min(jnp.where(key > low, key, most)))
    first, second = values[jnp.argmax(key == low)], values[jnp.argmax(key == high)]
    part = place - rank.astype(values.dtype)
    between = jnp.where(part > 0, first + part * (second - first), first)
    return jnp.where(count > 0, between, jnp.nan)
