"""The white noise of a signal, as pure functions of arrays for jit, and on the host.

From the mean magnitude of fourth differences (von Neumann's idea: a smooth signal has none), where
the signal moves, since at rest an encoder shows no noise. White noise gives the same by eighth
differences and a staircase 0.6 of it, while a motion of few samples a cycle gives less: where it is
under half, the motion is what the fourth differences see.
"""

from math import comb

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.recording import Recording
from .clock import continuous

# Counts of an encoder are no white noise where the motion is slow: between two widths they may
# differ by twice what white noise of their size would, that is, four times in power.
COLOURED = 4.0
# Four standard deviations: one sample of noise in 16,000 passes for slip.
SLIP_DEVIATIONS = 4.0
# Shorter even stretches say little about the noise: two lengths of an eighth difference.
SHORT = 16


def white_noise(
    recording: Recording, signal: Float[Array, " N"], typical: Float[Array, ""]
) -> Float[Array, ""]:
    """Standard deviation of the white part of a signal, rounding to encoder counts included.

    By fourth differences, or by eighth ones where a motion of few samples a cycle shows in those,
    as [`host_white_noise`][] does. `typical` is the sampling [`interval`][], s.
    """
    together = continuous(recording, typical)
    fourth, eighth = (_by_differences(signal, together, order) for order in (4, 8))
    return jnp.where(eighth < 0.5 * fourth, eighth, fourth)


def _by_differences(signal, together, order: int) -> Float[Array, ""]:
    factors = np.array([(-1) ** i * comb(order, i) for i in range(order + 1)], float)
    size = signal.shape[0] - order
    pieces = jnp.stack([signal[i : i + size] for i in range(order + 1)])
    whole = jnp.all(jnp.stack([together[i : i + size] for i in range(order)]), axis=0)
    used = whole & (pieces[0] != pieces[-1])
    magnitude = jnp.where(used, jnp.abs(jnp.asarray(factors, signal.dtype) @ pieces), 0.0)
    mean = jnp.sum(magnitude) / jnp.maximum(jnp.sum(used), 1).astype(signal.dtype)
    # E|z| = σ √(2/π); the squared weights add to C(2n, n).
    return mean * np.sqrt(np.pi / 2 / comb(2 * order, order)).astype(signal.dtype)


def host_white_noise(signal: np.ndarray, together: np.ndarray) -> float:
    """[`white_noise`][] on the host; `together`, `(N - 1,)`: samples that belong together."""
    fourth, eighth = (_host_differences(signal, together, order) for order in (4, 8))
    return eighth if eighth < 0.5 * fourth else fourth


def _host_differences(signal: np.ndarray, together: np.ndarray, order: int) -> float:
    broken = np.pad(np.cumsum(~together), (1, 0))
    used = (broken[order:] == broken[:-order]) & (signal[order:] != signal[:-order])
    mean = np.sum(np.abs(np.diff(signal, order)), where=used) / max(np.count_nonzero(used), 1)
    return float(mean * np.sqrt(np.pi / 2 / comb(2 * order, order)))


def counted_noise(signal: np.ndarray) -> float:
    """[`host_white_noise`][] of an unbroken signal, `(N,)`, rounding to counts included."""
    size = host_white_noise(signal, np.ones(max(len(signal) - 1, 0), bool))
    return max(size, _rounding(signal, size))


def _rounding(signal: np.ndarray, seen: float) -> float:
    """The noise of rounding to counts, count/√12, as large as white noise would have to be where
    a count lasts for several samples; zero where the signal is not counted.

    `seen`: the noise by differences. Signals whose steps are multiples of one by construction
    (a ramp of the set-point) have much less of it than counts of that size would make.
    """
    count = count_of(signal)
    if not count or seen < 0.3 * count / np.sqrt(12):
        return 0.0
    lasting = np.median(np.diff(np.flatnonzero(np.diff(signal))))
    return count * float(np.sqrt(lasting / 12))


# A log that rounds counts to decimals holds no whole multiples of one; nine of ten are this near to
# them. That says more than chance only where the signal stays for samples between two counts, as
# one that is not counted never does.
DECIMALS, STAYS = 0.05, 0.1


def count_of(signal: np.ndarray) -> float:
    """The step that all changes of a signal, `(N,)`, are multiples of, but for the decimals that a
    log has; zero where there is none.
    """
    changes = np.flatnonzero(np.diff(signal))
    if len(changes) < SHORT:
        return 0.0
    moved = np.abs(np.diff(signal)[changes])
    count = float(np.min(moved))
    if count < np.finfo(float).eps * float(np.max(moved)):
        return 0.0
    # Of uncounted steps one in a hundred is this near a whole number of counts by chance.
    exact = np.finfo(float).eps * np.max(np.abs(signal)) < 1e-4 * count
    if exact and _off(moved, count) <= 5e-3:
        return count
    mean = float(np.sum(moved) / np.sum(np.rint(moved / count)))
    stays = len(signal) - 1 - len(changes) >= STAYS * len(changes)
    return mean if exact and stays and _off(moved, mean) <= DECIMALS else 0.0


def _off(moved: np.ndarray, count: float) -> float:
    """By what part of a count nine of ten steps are off a whole number of them, at most."""
    return float(np.quantile(np.abs(moved / count - np.rint(moved / count)), 0.9))
