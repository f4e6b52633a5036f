"""Smoothing derivatives as pure functions of arrays, for use inside jit, vmap and grad."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from ..data.recording import Recording
from .clock import continuous, interval
from .kernels import kernel
from .noise import COLOURED, white_noise
from .polynomial import HALF_WIDTHS, weights

# Inside jax.jit the width is data while the loop length is not, so the ladder ends earlier there.
TRACED_REACH = 64


def local_quadratic(
    recording: Recording, signal: Float[Array, " N"], half_width: Float[Array, ""], reach: int
) -> tuple[Float[Array, " N"], Float[Array, " N"]]:
    """Level and slope of a signal by local quadratic regression, without phase lag.

    At every sample a parabola is fitted to the valid samples of its segment nearer than
    `half_width` in time, weighted by [`kernel`][]: the clock may be irregular. (Savitzky & Golay
    1964, with a tapered weight.)

    **Arguments:** `signal`, shape `(N,)`; `half_width`, s; `reach`, the number of samples to each
    side that are looked at.

    **Returns:** level and slope, both `(N,)`; those of a straight line where only two samples are
    near, as at the end of a record with a jittery clock, and zero slope where there is but one.
    """
    time, valid, segment = recording.time, recording.mask, recording.segment
    padded = [
        jnp.pad(x, reach, mode="edge") for x in (time, jnp.where(valid, signal, 0.0), segment)
    ]
    present = jnp.pad(valid, reach)
    size = time.shape[0]

    def add(sums, start):
        t, x, s = (jax.lax.dynamic_slice_in_dim(p, start, size) for p in padded)
        tau = (t - time) / half_width
        near = jax.lax.dynamic_slice_in_dim(present, start, size) & (s == segment)
        weight = jnp.where(near, kernel(tau), 0.0)
        dx = x - signal
        terms = (weight, weight * tau, weight * tau**2, weight * tau**3, weight * tau**4)
        terms += (weight * dx, weight * tau * dx, weight * tau**2 * dx)
        return tuple(a + b for a, b in zip(sums, terms, strict=True)), None

    zeros = tuple(jnp.zeros_like(time) for _ in range(8))
    (s0, s1, s2, s3, s4, x0, x1, x2), _ = jax.lax.scan(add, zeros, jnp.arange(2 * reach + 1))
    minor0, minor1, minor2 = s2 * s4 - s3**2, s1 * s4 - s2 * s3, s1 * s3 - s2**2
    determinant = s0 * minor0 - s1 * minor1 + s2 * minor2
    enough = determinant > 1e-9 * (s0**3 + jnp.finfo(time.dtype).tiny)
    safe = jnp.where(enough, determinant, 1.0)
    level = (x0 * minor0 - x1 * minor1 + x2 * minor2) / safe
    slope = (-x0 * minor1 + x1 * (s0 * s4 - s2**2) - x2 * (s0 * s3 - s1 * s2)) / safe
    spread = s0 * s2 - s1**2
    two = spread > 1e-9 * (s0**2 + jnp.finfo(time.dtype).tiny)
    safe = jnp.where(two, spread, 1.0)
    straight = jnp.where(two, s0 * x1 - s1 * x0, 0.0) / safe
    flat = jnp.where(two, s2 * x0 - s1 * x1, 0.0) / safe
    return (
        signal + jnp.where(enough, level, flat),
        jnp.where(enough, slope, straight) / half_width,
    )


def mean_slope(
    recording: Recording,
    signal: Float[Array, " N"],
    reach: int,
    typical: Float[Array, ""],
    alike: Bool[Array, " M"] | None = None,
) -> Float[Array, " N"]:
    """The signal's mean slope from `reach` samples before each sample to as many after it, `(N,)`.

    It ends where the recording breaks off, or two samples are not `alike`, `(N - 1,)`; and is zero
    where a sample stands alone. `typical` is the sampling [`interval`][], s.
    """
    linked, index = continuous(recording, typical), jnp.arange(recording.num_samples)
    linked = linked if alike is None else linked & alike
    breaks_before = jnp.pad(~linked, (1, 0), constant_values=True)
    breaks_after = jnp.pad(~linked, (0, 1), constant_values=True)
    begin = jax.lax.cummax(jnp.where(breaks_before, index, 0))
    end = jax.lax.cummin(jnp.where(breaks_after, index, index.size), reverse=True)
    after, before = jnp.minimum(index + reach, end), jnp.maximum(index - reach, begin)
    elapsed = recording.time[after] - recording.time[before]
    moved = jnp.where(elapsed > 0, signal[after] - signal[before], 0.0)
    return moved / jnp.where(elapsed > 0, elapsed, 1.0)


def _ladder(size: int, reach: int) -> tuple[int, ...]:
    """The half-widths that a record of that many samples can carry: an eighth of it at most."""
    return tuple(k for k in HALF_WIDTHS if k <= min(reach, max(2, size // 8)))


def _pilots(widths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For each width, the two of the ladder whose difference shows its bias: itself and the
    largest of at most half its size; for the narrowest, the two narrowest.
    """
    wide = np.maximum(np.arange(widths.size), min(1, widths.size - 1))
    half = np.searchsorted(widths, widths / 2, side="right") - 1
    return wide, np.maximum(half, 0)


def choose_half_width(recording: Recording, reach: int = HALF_WIDTHS[-1]) -> Float[Array, ""]:
    """The half-width, in samples, that makes the derivative of the position most accurate.

    Minimises an unbiased estimate of the mean-square error of the slope, bias² + σ² |k_h|², with σ
    the white noise of the position (encoder resolution included). A width h is biased by
    μ_h x‴/6, with μ_h the third moment of its weights k_h; the difference to the slope of a pilot
    g of half the width shows (1 − μ_g/μ_h) of that, and noise of variance σ² |k_h − k_g|². (A
    pilot that is much narrower, as in Stein's estimate, would drown the bias in its own noise.)
    Outside of jit [`choose`][jaxfric.signals.choose] has more to choose from.
    """
    size, dtype = recording.num_samples, recording.time.dtype
    widths = np.asarray(_ladder(size, reach))
    reach = int(widths[-1])
    shapes = np.stack([weights(int(k), 2, reach=reach) for k in widths])
    kernels = jnp.asarray(shapes, dtype)
    position = recording.position - recording.position[0]
    length = size + 2 * reach
    spectrum = jnp.fft.rfft(position, length)[None, :] * jnp.fft.rfft(kernels[:, ::-1], length)
    slopes = jnp.fft.irfft(spectrum, length)[:, reach : reach + size]

    wide, pilot = _pilots(widths)
    typical = interval(recording)
    breaks = jnp.cumsum(~continuous(recording, typical))
    breaks = jnp.pad(breaks, (1, 0))
    index, span = jnp.arange(size)[None, :], jnp.asarray(widths[wide])[:, None]
    after, before = jnp.minimum(index + span, size - 1), jnp.maximum(index - span, 0)
    whole = (breaks[after] == breaks[before]) & (after - before == 2 * span)

    moment = shapes @ np.arange(-reach, reach + 1.0) ** 3
    shown = moment[wide] - moment[pilot]
    share = jnp.asarray(moment / np.where(shown > 0, shown, np.inf), dtype)
    rough = jnp.asarray(np.sum((shapes[wide] - shapes[pilot]) ** 2, axis=1), dtype)
    error = jnp.where(whole, slopes[wide] - slopes[pilot], 0.0)
    count = jnp.sum(whole, axis=1)
    mean = jnp.sum(error**2, axis=1) / jnp.maximum(count, 1).astype(dtype)
    power = white_noise(recording, position, typical) ** 2
    bias = share**2 * jnp.maximum(mean - power * rough, 0.0)
    # What two narrower widths differ by beyond any noise is bias of the wider ones too.
    sure = share**2 * jnp.maximum(mean - COLOURED * power * rough, 0.0)
    sure = jnp.where(count > 0, sure, 0.0)
    bias = jnp.maximum(bias, jnp.concatenate([jnp.zeros(1, dtype), jax.lax.cummax(sure)[:-1]]))
    risk = jnp.where(count > 0, bias + power * jnp.sum(kernels**2, axis=1), jnp.inf)
    return jnp.asarray(widths, dtype)[jnp.argmin(risk)]
