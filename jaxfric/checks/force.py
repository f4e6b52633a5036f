"""Faults that a recorded force shows by itself, on the host."""

import itertools

import numpy as np

from ..data.cleaning.lone import LONE, lone
from ..data.recording import Recording
from .clock import Clock
from .lengths import CYCLE, PIECE, SPAN

# At the end of a clipped signal's range there are three times the samples of the band below it.
PILED = 3.0
BAND = 0.01
# Fewer than this share of samples at the end of the range move no parameter by a standard error.
CLIPPED = 0.005
# A signal of so few values is known to a thirtieth of its range, friction to a tenth or worse. So
# many samples show them.
LEVELS, THINNED = 32, 20_000
# Of a force that is another signal nothing is left but rounding and the noise of a derivative; of
# a drive's force, with inertia and friction, a good part.
PROPORTIONAL = 0.01
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


def force_faults(
    recording: Recording, velocity: np.ndarray, valid: np.ndarray, clock: Clock
) -> dict[str, float]:
    """Faults of the force by itself: levels, spikes, clipping, overflow, held or filled samples."""
    whole, force = np.asarray(recording.force, float), np.asarray(recording.force, float)[valid]
    levels = len(np.unique(force[:: max(1, len(force) // THINNED)]))
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
    step = np.abs(np.diff(whole)) > ACROSS * np.ptp(force[~alone])
    across = (
        step & clock.linked & fast[1:] & fast[:-1] & (np.sign(velocity[1:] * velocity[:-1]) > 0)
    )
    if np.count_nonzero(across) > LONE:
        spikes = _spikes(whole, step & clock.linked, valid)
        name, count = ("force_spikes", spikes) if spikes.any() else ("force_wraps", across)
        found[name] = int(np.count_nonzero(count))
    found |= _held(force) or _interpolated(force)
    found |= _filler(force, speed[valid])
    return found | ({} if "force_clipped" in found else _frozen(force, velocity[valid]))


def _spikes(force: np.ndarray, step: np.ndarray, valid: np.ndarray) -> np.ndarray:
    """Samples between a jump and the jump back, three at most, where these alone make the range.

    A number that overflows goes on from the other end of its range, and uses all of it.

    **Arguments:** `step`, whether the force jumps from each sample to the next, `(N - 1,)`.
    """
    jumps, change = np.flatnonzero(step).tolist(), np.diff(force)
    spikes = np.zeros(len(force), bool)
    back = -1  # what lies between two spikes is none
    for first, last in itertools.pairwise(jumps):
        if first != back and last - first <= LONE and change[first] * change[last] < 0:
            spikes[first + 1 : last + 1], back = True, last
    rest = force[valid & ~spikes]
    alone = spikes.any() and np.ptp(rest) < 0.5 * np.ptp(force[valid])
    return spikes if alone else np.zeros_like(spikes)


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


def same_as_motion(
    recording: Recording, velocity: np.ndarray, valid: np.ndarray, clock: Clock
) -> dict[str, float]:
    """Whether the force is another signal of the recording, times a constant, plus another."""
    force = np.asarray(recording.force, float)[valid]
    motion = {"velocity": velocity[valid]}
    if recording.position is not None:
        motion["position"] = np.asarray(recording.position, float)[valid]
    for values in motion.values():
        if (left := _left(force, values)) < PROPORTIONAL:
            return {"force_is_motion": left}
    gained = np.stack(gains(np.asarray(recording.force, float), velocity, clock.linked))
    gained = gained[:, np.isfinite(gained).all(axis=0)]
    left = _left(*gained) if gained.shape[1] > PIECE else 1.0
    return {"force_is_acceleration": left} if left < PROPORTIONAL else {}


def gains(
    force: np.ndarray, velocity: np.ndarray, linked: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The mean force over short spans, and what the velocity gains in them, `(…, n)` each, of
    signals `(…, N)`; NaN where a span is broken. A force that only accelerates is proportional to
    that, with no derivative taken.
    """
    count = (force.shape[-1] - 1) // SPAN
    spans = (*force.shape[:-1], count, SPAN)
    whole = linked[..., : count * SPAN].reshape(spans).all(axis=-1)
    middles = (0.5 * (force[..., 1:] + force[..., :-1]))[..., : count * SPAN].reshape(spans)
    ends = velocity[..., : count * SPAN + 1 : SPAN]
    return tuple(np.where(whole, x, np.nan) for x in (middles.mean(axis=-1), np.diff(ends)))


def _left(force: np.ndarray, values: np.ndarray) -> float:
    """The share of the force's variation that a multiple of other values leaves."""
    whole, part = np.std(force), np.std(values)
    if whole == 0 or part == 0:
        return 1.0
    correlation = np.mean((force - force.mean()) * (values - values.mean())) / (whole * part)
    return float(np.sqrt(max(1 - correlation**2, 0.0)))


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
