"""Amplitude and phase of waves, from the two columns that they are solved for."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float


class Wave(NamedTuple):
    """Amplitude and phase, rad, of a pair of sine and cosine columns, with standard errors."""

    amplitude: Float[Array, ""]
    amplitude_error: Float[Array, ""]
    phase: Float[Array, ""]
    phase_error: Float[Array, ""]


def wave(sine: Float[Array, ""], cosine: Float[Array, ""], covariance: Float[Array, "2 2"]) -> Wave:
    """Amplitude and phase of a_s sin θ + a_c cos θ = A sin(θ + φ), by the delta method.

    **Arguments:** the amplitudes of sine and cosine, and their covariance, `(2, 2)`.
    """
    amplitude = jnp.hypot(sine, cosine)
    size = jnp.where(amplitude > 0, amplitude, 1.0)
    along = jnp.stack([sine, cosine]) / size
    across = jnp.stack([-cosine, sine]) / size
    spread = [jnp.sqrt(direction @ covariance @ direction) for direction in (along, across)]
    return Wave(amplitude, spread[0], jnp.arctan2(cosine, sine), spread[1] / size)
