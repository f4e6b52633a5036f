"""The smooth compact kernel of the weak form, on the host and inside jax alike."""

from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np

_Array = TypeVar("_Array", np.ndarray, jax.Array)


def kernel(tau: _Array) -> _Array:
    """The kernel φ(τ) = (1 − τ²)⁴ for |τ| < 1, else 0 (Messenger & Bortz 2021)."""
    return _space(tau).maximum(1 - tau**2, 0.0) ** 4


def kernel_slope(tau: _Array) -> _Array:
    """dφ/dτ of [`kernel`][]."""
    return -8 * tau * _space(tau).maximum(1 - tau**2, 0.0) ** 3


def kernel_weights(average: _Array, slope: _Array, rise: _Array) -> tuple[_Array, _Array]:
    """Weights `(K, J)` of a local mean and of a derivative, 1/s, around each of J centres.

    The mean of a constant is itself, its derivative zero, and that of a straight line in time its
    slope, on any clock.

    **Arguments:** `average`, `slope`: the kernel and its derivative times the duration of each
    sample, `(K, J)`, the centre in the middle; `rise`: the sums of `slope` times the time since the
    centre, s, `(J,)`.
    """
    where, middle = _space(average).where, len(slope) // 2
    mass = average.sum(axis=0)
    average = average / where(mass > 0, mass, 1.0)[None, :]
    slope = slope / where(rise != 0, rise, 1.0)[None, :]
    excess = slope.sum(axis=0)
    if isinstance(slope, jax.Array):
        return average, slope.at[middle].add(-excess)
    slope[middle] -= excess
    return average, slope


def _space(values):
    return jnp if isinstance(values, jax.Array) else np
