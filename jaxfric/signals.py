"""Velocity without phase lag, what counts as slip, and windows with equal end velocities."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from . import programs
from .recording import Recording
from .terms.sample import Scales

# Half-widths, in samples, that the choice of the smoothing derivative runs over: steps of about
# √2, which changes the noise of the derivative by √2³ = 2.8, from the central difference up.
HALF_WIDTHS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
# Inside jax.jit the width is data while the loop length is not, so the ladder ends earlier there.
TRACED_REACH = 64
# Slower than this share of the 98 % quantile of the speed, a reversal takes less than a sample's
# worth of the friction curve; it also bounds the dynamic range that a velocity grid has to cover.
SLIP_SHARE = 0.006
# Four standard deviations: one sample of noise in 16,000 passes for slip.
SLIP_DEVIATIONS = 4.0
# An interval this many times the typical one is an interruption, not jitter of the clock.
GAP_FACTOR = 5.0


def kernel(tau: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """The smooth compact kernel φ(τ) = (1 − τ²)⁴ for |τ| < 1, else 0 (Messenger & Bortz 2021)."""
    return jnp.maximum(1 - tau**2, 0.0) ** 4


def kernel_slope(tau: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """dφ/dτ of [`kernel`][]."""
    return -8 * tau * jnp.maximum(1 - tau**2, 0.0) ** 3


# Sorting takes n log n steps one by one, counting 63 n that the processor takes eight at a time.
SORTED = 8192


def quantile(values: Float[Array, " N"], share: float) -> Float[Array, ""]:
    """A quantile of the values that are numbers, as `numpy.nanquantile`; NaN where there are none.

    **Arguments:** `values`, `(N,)`; `share` of them that lie below it, from 0 to 1.
    """
    if values.shape[0] <= SORTED:
        return jnp.nanquantile(values, share)
    # As integers doubles have the same order, so that each bit of the one sought is found by
    # counting how many are smaller.
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


def is_traced(recording: Recording) -> bool:
    """Whether any signal is an abstract value inside jit, vmap or grad."""
    return any(isinstance(leaf, jax.core.Tracer) for leaf in jax.tree.leaves(recording))


def interval(recording: Recording) -> Float[Array, ""]:
    """The typical sampling interval: the median over the valid steps, s."""
    steps = jnp.where(_linked(recording), jnp.diff(recording.time), jnp.nan)
    return quantile(steps, 0.5)


def continuous(recording: Recording, typical: Float[Array, ""]) -> Bool[Array, " M"]:
    """Whether sample i and i + 1 belong together, shape `(N - 1,)`: same segment, no gap."""
    steps = jnp.diff(recording.time)
    return _linked(recording) & (steps > 0) & (steps <= GAP_FACTOR * typical)


def _linked(recording: Recording) -> Bool[Array, " M"]:
    mask, segment = recording.mask, recording.segment
    return mask[1:] & mask[:-1] & (segment[1:] == segment[:-1])


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


def white_noise(
    recording: Recording, signal: Float[Array, " N"], typical: Float[Array, ""]
) -> Float[Array, ""]:
    """Standard deviation of the white part of a signal, rounding to encoder counts included.

    From the mean magnitude of fourth differences (von Neumann's idea: a smooth signal has none),
    over the samples where the signal moves, since at rest an encoder shows no noise. `typical` is
    the sampling [`interval`][], s.
    """
    weights = jnp.asarray([1.0, -4.0, 6.0, -4.0, 1.0], signal.dtype)
    together = continuous(recording, typical)
    size = signal.shape[0] - 4
    pieces = jnp.stack([signal[i : i + size] for i in range(5)])
    whole = jnp.all(jnp.stack([together[i : i + size] for i in range(4)]), axis=0)
    used = whole & (pieces[0] != pieces[4])
    magnitude = jnp.where(used, jnp.abs(weights @ pieces), 0.0)
    mean = jnp.sum(magnitude) / jnp.maximum(jnp.sum(used), 1).astype(signal.dtype)
    # E|z| = σ √(2/π); the squared weights add to 70.
    return mean * jnp.sqrt(jnp.pi / 2 / 70)


def _derivative_weights(half_width: int, reach: int) -> np.ndarray:
    """Weights of the local quadratic slope on a clock of one second, centred in 2 reach + 1."""
    offsets = np.arange(-reach, reach + 1) / (half_width + 0.5)
    weight = np.maximum(1 - offsets**2, 0.0) ** 4 * offsets
    return weight / np.sum(weight * offsets) / (half_width + 0.5)


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
    """
    size, dtype = recording.num_samples, recording.time.dtype
    widths = np.asarray(_ladder(size, reach))
    reach = int(widths[-1])
    shapes = np.stack([_derivative_weights(int(k), reach) for k in widths])
    weights = jnp.asarray(shapes, dtype)
    position = recording.position - recording.position[0]
    length = size + 2 * reach
    spectrum = jnp.fft.rfft(position, length)[None, :] * jnp.fft.rfft(weights[:, ::-1], length)
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
    risk = jnp.where(count > 0, bias + power * jnp.sum(weights**2, axis=1), jnp.inf)
    return jnp.asarray(widths, dtype)[jnp.argmin(risk)]


_choose = programs.kept(choose_half_width)


def smoothing(half_width: int) -> float:
    """By how much the [`derivative`][] of that half-width smooths the velocity, in samples².

    The velocity less that times its second difference is what was smoothed, to first order: a
    sixth of the third moment of the derivative's weights.
    """
    offsets = np.arange(-half_width, half_width + 1.0)
    return float(_derivative_weights(half_width, half_width) @ offsets**3) / 6


@programs.kept
def _slope(recording, signal, half_width, reach):
    # Half a sample more, so that the last sample to each side still counts.
    return local_quadratic(recording, signal, (half_width + 0.5) * interval(recording), reach)[1]


def derivative(
    recording: Recording, signal: Float[Array, " N"], half_width: int
) -> Float[Array, " N"]:
    """Zero-phase smoothing derivative of a signal, its unit per second, shape `(N,)`.

    **Arguments:** `signal`, `(N,)`; `half_width`, in samples of the typical interval.
    """
    return _slope(recording, signal, jnp.asarray(half_width, signal.dtype), half_width)


def prepare(
    recording: Recording, half_width: int | None = None, reach: int | None = None
) -> Recording:
    """A recording with a velocity and without values that cannot be computed with.

    A recorded velocity is kept. Else the velocity is the zero-phase smoothing derivative of the
    position, its width chosen from resolution and noise ([`choose_half_width`][]) or given in
    samples (traced, where `reach` bounds it). Samples that are not finite but valid by their mask
    stay: `identify` reports them.
    """
    if recording.velocity is not None:
        return recording
    if half_width is not None:
        width, reach = jnp.asarray(half_width, recording.time.dtype), reach or half_width
    elif is_traced(recording):
        width, reach = choose_half_width(recording, TRACED_REACH), TRACED_REACH
    else:
        width = _choose(recording)
        reach = int(width)
    velocity = _slope(recording, recording.position, width, reach)
    return dataclasses.replace(recording, velocity=velocity)


def velocity_noise(recording: Recording, typical: Float[Array, ""]) -> Float[Array, ""]:
    """Standard deviation of the white part of the velocity, m/s; `typical`: sampling interval."""
    return white_noise(recording, recording.velocity, typical)


def scales(recording: Recording) -> Scales:
    """Magnitudes of a prepared recording, from which bounds and thresholds are derived."""
    valid = recording.mask
    speed = jnp.where(valid, jnp.abs(recording.velocity), jnp.nan)
    fastest, typical = quantile(speed, 0.98), interval(recording)
    noise = velocity_noise(recording, typical)
    slowest = jnp.maximum(SLIP_DEVIATIONS * noise, SLIP_SHARE * fastest)
    position = recording.velocity if recording.position is None else recording.position
    inside = jnp.where(valid, position, jnp.nan)
    time = jnp.where(valid, recording.time, jnp.nan)
    count = jnp.maximum(jnp.sum(valid), 1).astype(speed.dtype)
    force = jnp.sqrt(jnp.sum(jnp.where(valid, recording.force, 0.0) ** 2) / count)
    start, end = jnp.nanmin(time), jnp.nanmax(time)
    low, high = jnp.nanmin(inside), jnp.nanmax(inside)
    return Scales(slowest, fastest, low, high, force, start, end - start, typical)


def counter_velocity(
    counts: Float[Array, " N"], clock: Float[Array, " N"], resolution: float, tick: float = 1.0
) -> Float[Array, " N"]:
    """Velocity by the M/T method: counts between two pulses over the clock time between them.

    **Arguments:** `counts`, accumulated encoder counts at the last pulse before each sample,
    shape `(N,)`; `clock`, timer reading at that pulse; `resolution`, m per count; `tick`, s per
    unit of `clock`.

    **Returns:** velocity, m/s, shape `(N,)`; zero while no pulse arrives. The value is the mean
    over the pulse interval, as in Kim, Kim & Ha (2004), section IV.
    """
    elapsed = jnp.diff(clock, prepend=clock[:1]) * tick
    moved = jnp.diff(counts, prepend=counts[:1]) * resolution
    fresh = elapsed > 0
    velocity = jnp.where(fresh, moved / jnp.where(fresh, elapsed, 1.0), 0.0)
    return velocity.at[0].set(velocity[1])


@programs.kept
def _host_facts(recording):
    limits, position = scales(recording), recording.position
    typical = limits.interval
    jitter = jnp.zeros(()) if position is None else white_noise(recording, position, typical)
    return limits, velocity_noise(recording, typical), jitter, continuous(recording, typical)


def kernel_half_width(recording: Recording) -> int:
    """Half-width, in samples, of the weak form's kernel for a prepared recording.

    The shortest of the ladder, from 16 samples (on which the kernel's quadrature is exact to
    rounding), for which the noise of velocity or position is under a thousandth of the power of
    the acceleration column, so that it biases the mass by under 0.1 %; but an eighth of the typical
    slip stretch at most, so that most rows survive the reversals. Inside jit, where the
    recording has no values yet: 24 samples.
    """
    if is_traced(recording):
        return 24
    velocity = np.nan_to_num(np.asarray(recording.velocity, float))
    limits, noise, jitter, linked = jax.tree.map(np.asarray, _host_facts(recording))
    slipping = velocity[np.abs(velocity) > limits.slowest]
    stretches = int(np.count_nonzero(np.diff(np.sign(slipping)))) + (recording.num_segments or 1)
    longest = int(np.count_nonzero(recording.mask)) // stretches // 8
    fitting = [k for k in HALF_WIDTHS if k <= max(2, longest)]
    broken = np.pad(np.cumsum(~linked), (1, 0))
    for width in (k for k in fitting if k >= 16):
        weights = _derivative_weights(width, width) / limits.interval
        whole = broken[2 * width :] == broken[: -2 * width]
        slopes = np.convolve(velocity, weights[::-1], "valid")
        power = np.sum(slopes[whole] ** 2) / max(1, np.count_nonzero(whole))
        rough = np.diff(weights, prepend=0.0, append=0.0) / limits.interval
        if max(noise**2 * np.sum(weights**2), jitter**2 * np.sum(rough**2)) <= 1e-3 * power:
            return width
    return fitting[-1]
