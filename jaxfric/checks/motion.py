"""Faults that clock, position and velocity of a recording show by themselves, on the host."""

import dataclasses
from itertools import pairwise
from math import comb

import numpy as np

from .. import signals
from ..data.cleaning.lone import LONE, lone
from ..data.recording import Recording
from ..signals.comparing import GAIN
from ..signals.late_velocity import ALIKE, BLOCKS, FEWEST, SHARED
from .clock import Clock
from .lengths import CYCLE, PIECE, SPAN

# Increments are 30 times their noise, which so takes 0.1 % off the scale: this is twice that. And
# three standard errors, which chance exceeds on some axes in a thousand.
SCALE, SURE = 0.002, 3.0
# A delay counts where it takes 0.2 % of the power that position and velocity share: 2.5° at their
# frequency, by which a twentieth of the inertia's force is taken for viscous friction.
LATE = 0.002
# The fastest linear drives reach 20 m/s, the fastest spindles 30 000 rad/s.
FASTEST = {"m": 50.0, "rad": 5e4}
# A velocity that errs by half of its size is noise.
NOISE_ONLY = 0.5
# Of a motion that is sampled once in half a second no drive's friction can be told.
SLOWEST_LOG = 0.5
# Means of the speed within a tenth of it, but for a tenth that is slower (ramps) and a fiftieth
# that is faster (overshoot), leave friction's slope and the acceleration to the noise.
ONE_SPEED, BETWEEN = 1.1, (0.1, 0.98)
# Moving is what is faster than a twentieth of the top speed; of a direction that takes less than a
# hundredth of that there are but the turns of the other one.
MOVING, RARE = 0.05, 0.01

# A stamp that is off by a hundredth of a step puts as much error on a velocity (data/cleaning).
# Scatter that is as many seconds of velocity in each of three octaves of speed, within a half, is
# the clock's: an encoder's, which is as many metres, is four times as much between the outer two.
# It is white, by fourth as by eighth differences, as no motion is; of so many samples an octave it
# is known to a tenth.
OFF, OCTAVES, STEADY, WHITE, ENOUGH = 0.01, 3, 1.5, 0.8, 100
# So many samples of a long recording tell of its clock.
CLOCK = 2**15


def clock_faults(recording: Recording, clock: Clock) -> dict[str, float]:
    """Into how many pieces a clock that is broken cuts the recording."""
    mask = np.asarray(recording.mask)
    valid = int(np.count_nonzero(mask))
    # Samples that are left out are no fault of the clock.
    stretches = int(np.count_nonzero(mask & ~np.pad(mask, (1, 0))[:-1]))
    pieces = valid - int(np.count_nonzero(clock.linked)) - max(stretches - 1, 0)
    return {"broken_clock": pieces} if pieces > 1 and valid / pieces < PIECE else {}


def jumps(recording: Recording, velocity: np.ndarray, clock: Clock) -> int:
    """Lone samples of a recorded velocity that are further from both neighbours than the top speed;
    a jump of the acceleration, as at a reversal, is far less.
    """
    bend = np.diff(velocity, 2)[clock.linked[1:] & clock.linked[:-1]]
    bend = bend[np.isfinite(bend)]
    if len(bend) <= 2 * LONE:
        return 0
    top = np.nanquantile(np.abs(velocity), 0.98)
    return -(-int(np.count_nonzero(lone(bend) & (np.abs(bend) > top))) // LONE)


def coarse(recording: Recording, velocity: np.ndarray, clock: Clock) -> dict[str, float]:
    """Samples a cycle of a recorded velocity, at the root mean square of its frequency, if few."""
    velocity = np.where(np.isfinite(velocity), velocity, np.nan)
    step, speed = np.diff(velocity)[clock.linked], velocity[np.asarray(recording.mask)]
    power, size = np.nanmean(step**2) if len(step) else 0.0, np.nanmean(speed**2)
    if not power > 0 or not size > 0:
        return {}
    cycle = float(2 * np.pi * np.sqrt(size / power))
    return {"few_samples_a_cycle": cycle} if cycle < CYCLE else {}


def speed_faults(velocity: np.ndarray, valid: np.ndarray, unit: str) -> dict[str, float]:
    """Magnitude of the speed, and whether it is one speed or one direction only."""
    speed = np.abs(velocity[valid])
    if not len(speed):
        return {}
    top = float(np.quantile(speed, 0.98))
    found = {}
    if top > FASTEST.get(unit, np.inf):
        found["magnitude"] = top
    # Means over spans, since the noise of single samples is no other speed.
    count = len(velocity) // SPAN
    whole = valid[: count * SPAN].reshape(count, SPAN).all(axis=1)
    means = velocity[: count * SPAN].reshape(count, SPAN)[whole].mean(axis=1)
    moving = np.abs(means[np.abs(means) > MOVING * top])
    low, high = np.quantile(moving, BETWEEN) if len(moving) > LONE else (0.0, 1.0)
    if high < ONE_SPEED * low:
        found["one_speed"] = high / low - 1
    slips = velocity[valid & (np.abs(velocity) > MOVING * top)]
    share = np.mean(slips > 0) if len(slips) else 0.5
    if min(share, 1 - share) < RARE:
        found["one_direction"] = float(min(share, 1 - share))
    return found


def position_faults(recording: Recording, clock: Clock) -> dict[str, float]:
    """A position that stays where it is, and lone samples: one such makes its second difference g,
    −2 g, g.
    """
    if recording.velocity is None and _rests(recording):
        return {"no_motion": 0.0}
    position, time = np.asarray(recording.position, float), np.asarray(recording.time, float)
    whole = clock.linked[1:] & clock.linked[:-1]
    bend = np.diff(position, 2) / np.maximum(np.diff(time)[1:] + np.diff(time)[:-1], 1e-300)
    bend = bend[whole & np.isfinite(bend)]
    if len(bend) <= 2 * LONE:
        return {}
    count = int(np.count_nonzero(lone(bend)))
    found = {"position_spikes": float(-(-count // LONE))} if count else {}
    goal = recording.channels.get("reference")
    if goal is not None and np.array_equal(np.asarray(goal, float), position, equal_nan=True):
        found["position_is_reference"] = 1.0
    return found


def _rests(recording: Recording) -> bool:
    """Whether the position shows no more than an encoder at rest: a count and the two beside it."""
    position = np.asarray(recording.position, float)[np.asarray(recording.mask)]
    moved = np.abs(np.diff(position))
    moved = moved[moved > 0]
    return not moved.size or bool(np.nanmax(position) - np.nanmin(position) < 2.5 * moved.min())


def unsteady(recording: Recording, clock: Clock) -> dict[str, float]:
    """By how many seconds of its velocity the position scatters about the stamps, as it does where
    samples are not taken when these say.
    """
    position, time = (np.asarray(x, float)[:CLOCK] for x in (recording.position, recording.time))
    linked = clock.linked[: len(position) - 1]
    if len(position) <= OCTAVES * ENOUGH or not clock.interval > 0:
        return {}
    broken = np.pad(np.cumsum(~linked), (1, 0))
    whole = broken[8:] == broken[:-8]
    velocity = (position[8:] - position[:-8])[whole] / (time[8:] - time[:-8])[whole]
    fourth, eighth = (_scatter(position, time, velocity, whole, order) for order in (4, 8))
    speed = np.abs(velocity)
    if not len(speed) or not np.mean(fourth) > 0.5 * OFF * clock.interval * np.mean(speed):
        return {}
    octaves = np.clip(np.quantile(speed, 0.98) * 2.0 ** -np.arange(OCTAVES + 1), 1e-300, None)
    of = [(speed <= high) & (speed > low) for high, low in pairwise(octaves)]
    if min(map(np.count_nonzero, of)) < ENOUGH:
        return {}
    times = np.array([np.mean(fourth[each]) / np.mean(speed[each]) for each in of])
    white = np.array([np.mean(eighth[each]) / np.mean(fourth[each]) for each in of])
    alike = max(times) < STEADY * min(times) and np.all(np.abs(np.log(white)) < -np.log(WHITE))
    return {"clock_jitter": float(times[0])} if alike and times[0] > OFF * clock.interval else {}


def _scatter(position, time, velocity, whole, order: int) -> np.ndarray:
    """What differences of an order see of white noise, in its standard deviations on average,
    less what the stamps make of the motion.
    """
    inner = slice(4 - order // 2, len(position) - 4 - order // 2)
    seen, made = (np.diff(x, order)[inner][whole] for x in (position, time))
    return np.abs(seen - velocity * made) * np.sqrt(np.pi / 2 / comb(2 * order, order))


def derivative_faults(choice: signals.Choice, velocity: np.ndarray) -> dict[str, float]:
    """Whether the derived velocity is noise, or off by more than a hundredth."""
    size = float(np.sqrt(np.mean(velocity**2))) if len(velocity) else 0.0
    if size == 0 or choice.error > NOISE_ONLY * size:
        return {"no_motion": 0.0}
    if choice.error <= signals.UNCERTAIN * size:
        return {}
    # Of bias and noise the larger one names it.
    biased = choice.bias**2 > 0.5 * choice.error**2
    return {"coarse_sampling" if biased else "velocity_noise": choice.error / size}


def compared(recording: Recording, clock: Clock) -> dict[str, float]:
    """The recorded velocity's integral beside the position's increments, over the same spans."""
    increments = signals.Increments.of(recording)
    moved, driven = increments.moved, increments.driven
    if len(moved) < FEWEST or not (np.any(moved) and np.any(driven)):
        return {}
    shared, lag = _correlation(moved, driven)
    at_once = float(moved @ driven / np.sqrt((moved @ moved) * (driven @ driven)))
    if (left := _exchanged(recording, moved, driven)) is not None:
        return {"force_is_velocity": left}
    if abs(at_once) < SHARED**0.5:
        return {"velocity_unrelated": at_once**2}
    if shared < 0:
        return {"velocity_sign": shared}
    found = {}
    if (late_by := signals.lag_of_velocity(recording, increments)) > 0:
        found["velocity_late"] = late_by
    elif shared**2 - at_once**2 > LATE and abs(lag) > 1:
        found["velocity_shifted"] = lag * clock.interval
    late = slice(lag, None) if lag >= 0 else slice(None, lag)
    early = slice(None, len(moved) - lag) if lag >= 0 else slice(-lag, None)
    a, b = moved[early], driven[late]
    gain = float(a @ a / (a @ b)) if a @ b else np.inf
    off = abs(np.log(gain)) if gain > 0 and np.isfinite(gain) else 0.0
    if off > np.log(ALIKE):
        slow = clock.interval > SLOWEST_LOG and clock.interval * gain < SLOWEST_LOG
        return {"time_scale" if slow else "velocity_scale": gain}
    if off <= np.log(GAIN):
        # The first is exact for a filter, the other for a delay, and a scale shows in both.
        span, changed = recording.num_samples - len(moved), increments.changed
        both = _slow_gain(moved, driven, changed, span), _slow_gain(a, b, changed[late], span)
        gain = min(both, key=lambda each: abs(each - 1))
    return found | ({"velocity_gain": gain} if gain != 1 else {})


def smoothed(recording: Recording, anew: signals.Derivable) -> dict[str, float]:
    """By how much a recorded velocity errs where the axis turns, beside its top speed, where the
    position knows it better and the column's own noise is no reason.
    """
    velocity = np.asarray(recording.velocity)[np.asarray(recording.mask)]
    rough = signals.COLOURED * signals.counted_noise(velocity) ** 2
    if not anew.off**2 > rough:
        return {}
    return {"velocity_smoothed": anew.off / float(np.quantile(np.abs(velocity), 0.98))}


def _slow_gain(moved: np.ndarray, driven: np.ndarray, changed: np.ndarray, span: int) -> float:
    """How many times as fast as the velocity column says the position moves, if for sure; else 1.

    A filter takes off what is fast alone: beside one of second order the true velocity is
    v + a v̇ + b v̈, and the first coefficient of the increments' regression is the scale. `span`,
    samples, of each.
    """
    half = max(2, span // 2)
    if len(moved) < 2 * half + FEWEST:
        return 1.0
    bent = changed[2 * half :] - changed[: -2 * half]
    moved, driven, changed = (x[half:-half] for x in (moved, driven, changed))
    columns = np.stack([driven, changed, bent], axis=1)
    size = np.linalg.norm(columns, axis=0)
    if not np.all(size > 0):
        return 1.0
    columns = columns / size
    gram = columns.T @ columns
    if np.linalg.cond(gram) * np.finfo(float).eps > 1:
        return 1.0
    inverse = np.linalg.inv(gram)
    found = inverse @ (columns.T @ moved)
    ends = np.arange(BLOCKS) * len(moved) // BLOCKS
    scores = np.add.reduceat(columns * (moved - columns @ found)[:, None], ends)
    gain, error = found[0] / size[0], np.linalg.norm(scores @ inverse[0]) / size[0]
    # Of one frequency a scale is a filter: what noise takes off counts by what no filter makes.
    least = SCALE * float(np.sqrt(inverse[0, 0]))
    return float(gain) if abs(gain - 1) > max(least, SURE * error) else 1.0


def _exchanged(recording: Recording, moved: np.ndarray, driven: np.ndarray) -> float | None:
    """What the force's integral leaves of the position, if next to nothing where the velocity's
    leaves much, both taken as they are.
    """
    size, left = float(moved @ moved), float(np.sum((moved - driven) ** 2))
    if left < (GAIN - 1) * size:
        return None
    other = signals.Increments.of(dataclasses.replace(recording, velocity=recording.force))
    if other.driven.shape != other.moved.shape or not np.any(other.moved):
        return None
    left = float(np.sum((other.moved - other.driven) ** 2) / (other.moved @ other.moved)) ** 0.5
    return left if left < GAIN - 1 else None


def _correlation(moved: np.ndarray, driven: np.ndarray) -> tuple[float, int]:
    """The largest correlation, by magnitude, and by how many samples the second is late there."""
    length = 1 << (2 * len(moved) - 1).bit_length()
    product = np.conj(np.fft.rfft(moved, length)) * np.fft.rfft(driven, length)
    cross = np.fft.irfft(product, length) / np.sqrt((moved @ moved) * (driven @ driven))
    most = len(moved) // 4  # beyond, too little of the two overlaps
    lags = np.concatenate([np.arange(most), np.arange(-most, 0)])
    near = cross[lags]
    if abs(cross[0]) > 0.7:  # the same motion: a delay by a whole period is none
        lags = lags[np.sign(near) == np.sign(cross[0])]
        near = cross[lags]
    best = int(np.argmax(np.abs(near)))
    return float(near[best]), int(lags[best])
