"""Faults that the signals of a recording show by themselves, on the host."""

import numpy as np

from .. import signals
from ..data.recording import Recording
from ..signals.polynomial import white_noise
from .kinds import places

# A derived velocity is off by a hundredth of its size at the most. The estimate of the error is too
# small as a rule, by √2, since no bias is seen of what changes faster than the kernel.
UNCERTAIN = 0.01 / 2**0.5
# The position's increments that a velocity is compared with are this many times their noise.
ABOVE_NOISE = 30.0
# Two columns with less than half of their power in common are not the same motion.
UNRELATED = 0.5
# A drive's own filter and scaling leave a recorded velocity within a few hundredths; by a quarter
# it is no filter's doing.
GAIN, SCALE = 1.05, 1.25
# A delay counts where it takes 0.2 % of the power that position and velocity share: 2.5° at their
# frequency, by which a twentieth of the inertia's force is taken for viscous friction.
LATE = 0.002
# At the end of a clipped signal's range there are three times the samples of the band below it.
PILED = 3.0
BAND = 0.01
# Fewer than this share of samples at the end of the range move no parameter by a standard error.
CLIPPED = 0.005
# A signal of so few values is known to a thirtieth of its range, friction to a tenth or worse.
LEVELS = 32
# The fastest linear drives reach 20 m/s, the fastest spindles 30 000 rad/s.
FASTEST = {"m": 50.0, "rad": 5e4}
# A drive's peak force is three to four times what it works with: a lone sample ten times beyond all
# but a thousandth of the others was made by no actuator.
LONE, BEYOND, RAREST = 3, 10.0, 1e-3


# Of a force that is another signal nothing is left but rounding and the noise of a derivative; of
# a drive's force, with inertia and friction, a good part.
PROPORTIONAL = 0.01
# Samples in a span over which a force and what the velocity gains are compared.
SPAN = 16
# A velocity that errs by half of its size is noise.
NOISE_ONLY = 0.5
# Pieces of fewer samples hold no kernel.
PIECE = 32
# The shortest kernel of the weak form reaches 16 samples each way: of a cycle that is no longer it
# averages most of the motion away.
CYCLE = 16
# Eight tenths of the means of the speed within a tenth of it leave friction's slope and the
# acceleration to the noise.
ONE_SPEED = 1.1
# Moving is what is faster than a twentieth of the top speed; of a direction that takes less than a
# hundredth of that there are but the turns of the other one.
MOVING, RARE = 0.05, 0.01
# A value that lasts for this share of the record, in a signal that changes at every other sample.
FROZEN = 0.1
# Of a force held from one update to the next so many stretches last as long as the others, within
# a sample; those of a coarse count last as long as the force is slow.
HELD = 0.8
# No measured value comes twenty times as often as the next one, and between two samples a drive's
# force changes by less than half of its size, as a rule.
OFTEN, JUMP = 20, 0.5
# Between the corners of a signal that was interpolated its bend is rounding. Half the shortest
# kernel has to hold four of its own samples: its width is chosen by their noise.
STRAIGHT, DRAWN = 1e-4, CYCLE / 4
# A delay counts where it changes the force by a twentieth of its size.
SHIFTED = 0.05
# An overflow crosses this share of the range between two samples, far from any reversal.
ACROSS, FAR = 0.8, 0.3


def recorded(recording: Recording) -> np.ndarray:
    """The numbers of the faults of a recording, `(W,)`, as [`kinds`][] orders them; NaN for none.

    Signals of shape `(N,)`, as they were read: with the velocity that was recorded, or none.
    """
    found: dict[str, float] = {}
    valid = np.asarray(recording.mask) & np.isfinite(np.asarray(recording.force, float))
    if np.count_nonzero(valid) <= 2 * PIECE:
        return places(found)
    found |= _clock(recording)
    if recording.position is not None:
        found |= _position(recording)
        if recording.velocity is not None:
            found |= _compared(recording)
    choice = signals.choose(recording) if recording.velocity is None else None
    velocity = np.asarray(signals.prepare(recording, choice).velocity, float)
    valid &= np.isfinite(velocity)
    if choice is not None:
        found |= _derived(choice, velocity[valid])
    else:
        found |= _coarse(recording, velocity)
    if choice is None and (spikes := _jumps(recording, velocity)) > 0:
        found["velocity_spikes"] = spikes
    found |= _speeds(velocity, valid, recording.unit_names["position"])
    found |= _force(recording, velocity, valid)
    if "no_motion" not in found:
        found |= _same(recording, velocity, valid)
    return places(found)


def lone(values: np.ndarray) -> np.ndarray:
    """Samples that no motion or actuator made: at most three in a row, far beyond all others."""
    size = np.abs(values - np.median(values))
    at = len(size) - 1 - max(LONE, int(RAREST * len(size)))
    usual = np.partition(size, at)[at]
    far = (size > BEYOND * usual) & (usual > 0)
    ends = np.flatnonzero(np.diff(np.pad(far, 1).astype(np.int8)))
    for first, last in zip(ends[::2], ends[1::2], strict=True):
        if last - first > LONE:
            far[first:last] = False
    return far


def _force(recording: Recording, velocity: np.ndarray, valid: np.ndarray) -> dict[str, float]:
    whole, force = np.asarray(recording.force, float), np.asarray(recording.force, float)[valid]
    levels = len(np.unique(force[:: max(1, len(force) // 20_000)]))
    if levels <= 2:
        return {"force_constant": levels}
    found: dict[str, float] = {}
    if levels <= LEVELS:
        found["force_levels"] = levels
    alone = lone(force)
    if alone.any():
        found["force_spikes"] = int(np.count_nonzero(alone))
    share = clipped(force[~alone])
    if share > CLIPPED and levels > LEVELS:
        found["force_clipped"] = share
    speed = np.abs(velocity)
    fast = speed > FAR * np.quantile(speed[valid], 0.98)
    linked = signals.host_continuous(recording, signals.host_interval(recording))
    step = np.abs(np.diff(whole)) > ACROSS * np.ptp(force[~alone])
    across = step & linked & fast[1:] & fast[:-1] & (np.sign(velocity[1:] * velocity[:-1]) > 0)
    if np.count_nonzero(across) > LONE:
        found["force_wraps"] = int(np.count_nonzero(across))
    found |= _held(force) or _interpolated(force)
    found |= _filler(force, speed[valid])
    return found | ({} if "force_clipped" in found else _frozen(force, velocity[valid]))


def _frozen(force: np.ndarray, velocity: np.ndarray) -> dict[str, float]:
    """The longest time that the force keeps one value while the axis moves."""
    ends = np.flatnonzero(np.diff(force))
    edges = np.concatenate([[-1], ends, [len(force) - 1]])
    longest = int(np.argmax(np.diff(edges)))
    part = slice(edges[longest] + 1, edges[longest + 1] + 1)
    share = (part.stop - part.start) / len(force)
    changes = (len(ends) - 1) / max(1, len(force) - (part.stop - part.start))
    moves = np.std(velocity[part]) > 0.1 * np.std(velocity)
    return {"force_frozen": share} if share > FROZEN and changes > 0.5 and moves else {}


def _held(force: np.ndarray) -> dict[str, float]:
    """For how many samples a force keeps each value, where the delay of that counts."""
    lengths = np.diff(np.flatnonzero(np.diff(force)))
    if len(lengths) <= PIECE:
        return {}
    usual = int(np.median(lengths))
    if usual < 2 or np.mean(np.abs(lengths - usual) <= 1) < HELD:
        return {}
    # It is late by (n - 1)/2 samples.
    moved = 0.5 * (usual - 1) / usual * (force[usual:] - force[:-usual])
    return {"force_held": usual} if np.std(moved) > SHIFTED * np.std(force) else {}


def _interpolated(force: np.ndarray) -> dict[str, float]:
    """Over how many samples a force is straight, where a kernel is not much wider."""
    bend = np.abs(np.diff(force, 2))
    corners = np.flatnonzero(bend > STRAIGHT * np.max(bend, initial=0.0))
    # A corner between two samples bends at both.
    lengths = np.diff(corners[np.diff(corners, prepend=-2) > 1])
    if len(lengths) <= PIECE:
        return {}
    usual = float(np.median(lengths))
    even = np.mean(np.abs(lengths - usual) <= 1) >= HELD
    return {"force_interpolated": usual} if usual > DRAWN and even else {}


def _filler(force: np.ndarray, speed: np.ndarray) -> dict[str, float]:
    """The number that stands where no force was measured, at full speed too: a drive that is
    switched off at rest says zero.
    """
    values, counts = np.unique(force, return_counts=True)
    order = np.argsort(counts)[-2:]
    if len(order) < 2 or counts[order[1]] < max(CLIPPED * len(force), OFTEN * counts[order[0]]):
        return {}
    value = float(values[order[1]])
    ends = np.flatnonzero(np.diff(force == value))
    jumps = np.abs(np.diff(force))[ends]
    size = float(np.sqrt(np.mean((force - np.mean(force)) ** 2)))
    moves = np.median(speed[force == value]) > FAR * np.quantile(speed, 0.98)
    return {"force_filler": value} if moves and np.median(jumps) > JUMP * size else {}


def _same(recording: Recording, velocity: np.ndarray, valid: np.ndarray) -> dict[str, float]:
    """Whether the force is another signal of the recording, times a constant, plus another."""
    force = np.asarray(recording.force, float)[valid]
    motion = {"velocity": velocity[valid]}
    if recording.position is not None:
        motion["position"] = np.asarray(recording.position, float)[valid]
    for values in motion.values():
        if (left := _left(force, values)) < PROPORTIONAL:
            return {"force_is_motion": left}
    gained = _gains(recording, velocity)
    left = _left(*gained) if len(gained[0]) > PIECE else 1.0
    return {"force_is_acceleration": left} if left < PROPORTIONAL else {}


def _gains(recording: Recording, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The mean force over short unbroken spans, and what the velocity gains in them: a force that
    only accelerates is proportional to that, with no derivative taken.
    """
    force, count = np.asarray(recording.force, float), len(velocity) // SPAN
    linked = signals.host_continuous(recording, signals.host_interval(recording))
    whole = np.add.reduceat(~linked, np.arange(0, count * SPAN, SPAN))[:count] == 0
    ends = np.arange(count)[whole] * SPAN
    ends = ends[ends + SPAN < len(velocity)]
    sums = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]))])
    return (sums[ends + SPAN] - sums[ends]) / SPAN, velocity[ends + SPAN] - velocity[ends]


def _left(force: np.ndarray, values: np.ndarray) -> float:
    """The share of the force's variation that a multiple of other values leaves."""
    whole, part = np.std(force), np.std(values)
    if whole == 0 or part == 0:
        return 1.0
    correlation = np.mean((force - force.mean()) * (values - values.mean())) / (whole * part)
    return float(np.sqrt(max(1 - correlation**2, 0.0)))


def _clock(recording: Recording) -> dict[str, float]:
    linked = signals.host_continuous(recording, signals.host_interval(recording))
    valid = int(np.count_nonzero(np.asarray(recording.mask)))
    pieces = valid - int(np.count_nonzero(linked))
    return {"broken_clock": pieces} if pieces > 1 and valid / pieces < PIECE else {}


def _jumps(recording: Recording, velocity: np.ndarray) -> int:
    """Lone samples of a recorded velocity that are further from both neighbours than the top speed;
    a jump of the acceleration, as at a reversal, is far less.
    """
    linked = signals.host_continuous(recording, signals.host_interval(recording))
    bend = np.diff(velocity, 2)[linked[1:] & linked[:-1]]
    bend = bend[np.isfinite(bend)]
    if len(bend) <= 2 * LONE:
        return 0
    top = np.nanquantile(np.abs(velocity), 0.98)
    return -(-int(np.count_nonzero(lone(bend) & (np.abs(bend) > top))) // LONE)


def _coarse(recording: Recording, velocity: np.ndarray) -> dict[str, float]:
    """Samples a cycle of a recorded velocity, at the root mean square of its frequency, if few."""
    linked = signals.host_continuous(recording, signals.host_interval(recording))
    step, speed = np.diff(velocity)[linked], velocity[np.asarray(recording.mask)]
    power, size = np.nanmean(step**2) if len(step) else 0.0, np.nanmean(speed**2)
    if not power > 0 or not size > 0:
        return {}
    cycle = float(2 * np.pi * np.sqrt(size / power))
    return {"few_samples_a_cycle": cycle} if cycle < CYCLE else {}


def _speeds(velocity: np.ndarray, valid: np.ndarray, unit: str) -> dict[str, float]:
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
    low, high = np.quantile(moving, (0.1, 0.9)) if len(moving) > LONE else (0.0, 1.0)
    if high < ONE_SPEED * low:
        found["one_speed"] = high / low - 1
    slips = velocity[valid & (np.abs(velocity) > MOVING * top)]
    share = np.mean(slips > 0) if len(slips) else 0.5
    if min(share, 1 - share) < RARE:
        found["one_direction"] = float(min(share, 1 - share))
    return found


def clipped(force: np.ndarray) -> float:
    """The share of the samples at which the force is cut off at the end of its range."""
    span = float(np.ptp(force))
    step = np.abs(np.diff(force))
    quantum = float(np.min(step[step > 1e-9 * span], initial=span))
    band = max(BAND * span, 1.5 * quantum)
    total = 0
    for signed in (force, -force):
        top = float(np.max(signed))
        flat = signed >= top - 1e-9 * span
        stays = flat[:-2] & flat[1:-1] & flat[2:]
        below = (signed < top) & ~flat & (signed >= top - band)
        if stays.any() and np.count_nonzero(flat) >= PILED * (np.count_nonzero(below) or 1):
            total += int(np.count_nonzero(flat))
    return total / len(force)


def _position(recording: Recording) -> dict[str, float]:
    """Lone samples of the position: one such makes its second difference g, −2 g, g."""
    position, time = np.asarray(recording.position, float), np.asarray(recording.time, float)
    linked = signals.host_continuous(recording, signals.host_interval(recording))
    whole = linked[1:] & linked[:-1]
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


def _derived(choice: signals.Choice, velocity: np.ndarray) -> dict[str, float]:
    size = float(np.sqrt(np.mean(velocity**2))) if len(velocity) else 0.0
    if size == 0 or choice.error > NOISE_ONLY * size:
        return {"no_motion": 0.0}
    if choice.error <= UNCERTAIN * size:
        return {}
    # Of bias and noise the larger one names it.
    biased = choice.bias**2 > 0.5 * choice.error**2
    return {"coarse_sampling" if biased else "velocity_noise": choice.error / size}


def _compared(recording: Recording) -> dict[str, float]:
    """The recorded velocity's integral beside the position's increments, over the same spans."""
    moved, driven, step = _increments(recording)
    if len(moved) < 32 or not (np.any(moved) and np.any(driven)):
        return {}
    shared, lag = _correlation(moved, driven)
    at_once = float(moved @ driven / np.sqrt((moved @ moved) * (driven @ driven)))
    if abs(at_once) < UNRELATED**0.5:
        return {"velocity_unrelated": at_once**2}
    if shared < 0:
        return {"velocity_sign": shared}
    found = {}
    if shared**2 - at_once**2 > LATE and abs(lag) > 1:
        found["velocity_late"] = lag * step
    late = slice(lag, None) if lag >= 0 else slice(None, lag)
    early = slice(None, len(moved) - lag) if lag >= 0 else slice(-lag, None)
    a, b = moved[early], driven[late]
    gain = float(a @ a / (a @ b)) if a @ b else np.inf
    off = abs(np.log(gain)) if gain > 0 and np.isfinite(gain) else 0.0
    if off > np.log(SCALE):
        return {"velocity_scale": gain}
    return found | ({"velocity_gain": gain} if off > np.log(GAIN) else {})


def _increments(recording: Recording) -> tuple[np.ndarray, np.ndarray, float]:
    """What the position and the velocity say the axis moved in spans that stand out of the noise,
    both `(n,)` and unbroken, and the sampling interval, s.
    """
    position, velocity = (np.asarray(x, float) for x in (recording.position, recording.velocity))
    typical = signals.host_interval(recording)
    linked = signals.host_continuous(recording, typical)
    linked &= np.isfinite(position[1:] + position[:-1] + velocity[1:] + velocity[:-1])
    steps = np.where(linked, np.diff(np.asarray(recording.time, float)), 0.0)
    mean = np.where(linked, 0.5 * (velocity[1:] + velocity[:-1]), 0.0)
    moved = np.concatenate([[0], np.cumsum(np.where(linked, np.diff(position), 0.0))])
    driven = np.concatenate([[0], np.cumsum(mean * steps)])
    noise, span = white_noise(position[np.asarray(recording.mask)]), 4
    while (
        span < len(moved) // 16
        and float(np.std(moved[span:] - moved[:-span])) < ABOVE_NOISE * noise
    ):
        span *= 2
    return moved[span:] - moved[:-span], driven[span:] - driven[:-span], typical


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
