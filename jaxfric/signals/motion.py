"""The motion of a recording: its velocity, its magnitudes, and what counts as slip."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple, Self

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..terms.sample import Scales
from .choosing import choose
from .clock import host_continuous, host_interval, interval, is_traced, quantile
from .comparing import Derivable, derivable
from .derivatives import derivative
from .late_velocity import with_timely_velocity
from .noise import SLIP_DEVIATIONS, host_white_noise, white_noise
from .parabolas import TRACED_REACH, choose_half_width, local_quadratic
from .polynomial import HALF_WIDTHS, Choice, weights

# Slower than this share of the 98 % quantile of the speed, a reversal takes less than a sample's
# worth of the friction curve; it also bounds the dynamic range that a velocity grid has to cover.
SLIP_SHARE = 0.006


def prepare(
    recording: Recording, choice: Choice | None = None, step: float | None = None
) -> Recording:
    """A recording with a velocity and without values that cannot be computed with.

    A recorded velocity is kept, and corrected where it is late beside the position, unless the
    position [surely knows it better][jaxfric.signals.derivable]. Else the velocity is the
    zero-phase smoothing derivative of the position, by the local polynomial that
    [`choose`][jaxfric.signals.choose] finds most accurate or by the one that is given; inside
    `jax.jit` by local parabolas, whose widths reach less far, and a recorded velocity is kept.
    Samples that are not finite but valid by their mask stay: `identify` reports them.
    `step`: the typical interval, s, where it is known.
    """
    recording, anew = measured(recording)
    if recording.velocity is not None:
        return recording
    if choice is None and anew is not None:
        choice = anew.choice
    if is_traced(recording):
        width = choose_half_width(recording, TRACED_REACH)
        span = (width + 0.5) * interval(recording)
        velocity = local_quadratic(recording, recording.position, span, TRACED_REACH)[1]
        return dataclasses.replace(recording, velocity=velocity)
    choice = choose(recording) if choice is None else choice
    position = np.asarray(recording.position)
    slope = derivative(recording, position, choice.half_width, choice.degree, step=step)
    usable = np.isfinite(position) | ~np.asarray(recording.mask)
    derived = np.where(usable, slope, np.nan).astype(position.dtype, copy=False)
    return dataclasses.replace(recording, velocity=derived)


def measured(recording: Recording) -> tuple[Recording, Derivable | None]:
    """A recording whose velocity is in time; without it, where the position tells it better.

    So it does at the turns for sure, or of a velocity that is late, as by a filter, which takes off
    what is fast, where it tells the velocity well.

    **Returns:** also how the position would derive it anew, where both are recorded.
    """
    if recording.velocity is None:
        return recording, None
    timely = with_timely_velocity(recording)
    anew = derivable(timely)
    if anew is None or not (anew.better or (timely is not recording and anew.fine)):
        return timely, anew
    return dataclasses.replace(timely, velocity=None), anew


class Ready(NamedTuple):
    """A prepared recording, and the local polynomial that its velocity was derived by; `None` for
    one that was recorded.

    Of a recorded one: `anew`, how the position would derive it; `filtered`, whether it was late or
    is doubtful at the turns.
    """

    recording: Recording
    choice: Choice | None
    anew: Derivable | None = None
    filtered: bool = False

    @classmethod
    def of(cls, recording: Recording) -> Self:
        """A recording that is not traced, prepared, with its signals of shape `(N,)`."""
        best, anew = measured(recording)
        if best.velocity is not None:
            late, doubtful = best is not recording, anew is not None and anew.doubtful
            return cls(best, None, anew, late or doubtful)
        choice = choose(best) if anew is None else anew.choice
        return cls(prepare(best, choice), choice, anew)


def velocity_noise(recording: Recording, typical: Float[Array, ""]) -> Float[Array, ""]:
    """Standard deviation of the white part of the velocity, m/s; `typical`: sampling interval."""
    return white_noise(recording, recording.velocity, typical)


def scales(recording: Recording) -> Scales:
    """Magnitudes of a prepared recording, from which bounds and thresholds are derived."""
    if not is_traced(recording):
        return jax.tree.map(jnp.asarray, host_scales(recording)[0])
    valid = recording.mask
    speed = jnp.where(valid, jnp.abs(recording.velocity), jnp.nan)
    fastest, typical = quantile(speed, 0.98), interval(recording)
    noise = velocity_noise(recording, typical)
    slowest = jnp.maximum(SLIP_DEVIATIONS * noise, SLIP_SHARE * fastest)
    position = recording.velocity if recording.position is None else recording.position
    inside = jnp.where(valid, position, jnp.nan)
    time = jnp.where(valid, recording.time, jnp.nan)
    count = jnp.maximum(jnp.sum(valid), 1).astype(speed.dtype)
    sizes = jnp.where(valid, jnp.abs(recording.force), 0.0)
    force, peak = jnp.sqrt(jnp.sum(sizes**2) / count), jnp.max(sizes)
    start, end = jnp.nanmin(time), jnp.nanmax(time)
    low, high = jnp.nanmin(inside), jnp.nanmax(inside)
    return Scales(slowest, fastest, low, high, force, start, end - start, typical, peak)


def host_scales(recording: Recording) -> tuple[Scales, np.ndarray]:
    """[`scales`][] and [`velocity_noise`][] of a recording that is not traced, on the host."""
    valid, velocity = np.asarray(recording.mask), np.asarray(recording.velocity)
    typical = host_interval(recording)
    noise = host_white_noise(velocity, host_continuous(recording, typical))
    fastest = _of_numbers(np.abs(velocity[valid]), lambda speed: np.quantile(speed, 0.98))
    slowest = np.maximum(SLIP_DEVIATIONS * noise, SLIP_SHARE * fastest)
    place = velocity if recording.position is None else np.asarray(recording.position)
    low, high = (_of_numbers(place[valid], end) for end in (np.min, np.max))
    start, end = (_of_numbers(np.asarray(recording.time)[valid], end) for end in (np.min, np.max))
    sizes = np.abs(np.asarray(recording.force)[valid])
    force, peak = np.sqrt(np.sum(sizes**2) / max(sizes.size, 1)), np.max(sizes, initial=0.0)
    found = (slowest, fastest, low, high, force, start, end - start, typical, peak, noise)
    *magnitudes, deviation = (np.asarray(each, velocity.dtype) for each in found)
    return Scales(*magnitudes), deviation


def _of_numbers(values: np.ndarray, what: Callable[[np.ndarray], float]) -> float:
    """A property of the values that are numbers; NaN where there are none."""
    numbers = values[~np.isnan(values)]
    return what(numbers) if numbers.size else np.nan


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


def kernel_half_width(recording: Recording, least: int = 16) -> int:
    """Half-width, in samples, of the weak form's kernel for a prepared recording.

    The shortest of the ladder, from `least` samples (on 16 the kernel's quadrature is exact to
    rounding), for which the noise of velocity or position is under a thousandth of the power of
    the acceleration column, so that it biases the mass by under 0.1 %; but an eighth of the typical
    slip stretch at most, so that most rows survive the reversals. Inside jit, where the
    recording has no values yet: 24 samples.
    """
    if is_traced(recording):
        return 24
    velocity = np.asarray(recording.velocity, float)
    velocity = np.where(np.isfinite(velocity), velocity, 0.0)
    limits, noise = host_scales(recording)
    linked = host_continuous(recording, float(limits.interval))
    position = recording.position
    jitter = 0.0 if position is None else host_white_noise(np.asarray(position), linked)
    slipping = velocity[np.abs(velocity) > limits.slowest]
    # Not `num_segments`, which a batch has of its row with the most.
    valid = np.asarray(recording.mask)
    pieces = len(np.unique(np.asarray(recording.segment)[valid]))
    stretches = int(np.count_nonzero(np.diff(np.sign(slipping)))) + max(1, pieces)
    longest = int(np.count_nonzero(valid)) // stretches // 8
    fitting = [k for k in HALF_WIDTHS if k <= max(2, longest)]
    broken = np.pad(np.cumsum(~linked), (1, 0))
    if not limits.interval > 0:  # a clock that stands
        return fitting[-1]
    for width in (k for k in fitting if k >= least):
        shape = weights(width, 2) / limits.interval
        whole = broken[2 * width :] == broken[: -2 * width]
        slopes = np.convolve(velocity, shape[::-1], "valid")
        power = np.sum(slopes[whole] ** 2) / max(1, np.count_nonzero(whole))
        rough = np.diff(shape, prepend=0.0, append=0.0) / limits.interval
        if max(noise**2 * np.sum(shape**2), jitter**2 * np.sum(rough**2)) <= 1e-3 * power:
            return width
    return fitting[-1]
