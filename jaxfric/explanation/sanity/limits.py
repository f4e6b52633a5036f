"""A hard limit of force: the recorded command asks for more than arrives, u_real = clip(u, ±U)."""

import dataclasses

import numpy as np

from ... import signals
from ...data.recording import Recording
from ...identification.uncertainty import Estimate
from ...signals.noise import host_white_noise
from ...simulation.errors import in_motion
from ...simulation.prediction import Prepared
from ...terms import KNOWN_FORCE
from ..least_squares import solve
from ..significance import FEWEST

# Of the mismatch in the samples that ask for more: what a clip leaves of it, and of all of it; and
# the part of the excess that arrives. A soft knee leaves more, and gives more.
LEAVES, LEAVES_IN_ALL = 0.25, 0.5
# A machine that is at its limit most of the time does not do what it is told.
MOST = 0.5
LEVELS = 200
# Of what wrong values leave, what a clip has to: where friction is most of the force, a wrong level
# of it, in one direction or both, is near a clip.
HALVED = 0.5
# What is needed beyond the level is one value: it spreads by less than a quarter of its distance
# from what is needed below. At a stop, with a friction that is most of the force, or where a load
# that the simulator lacks asks for the command, that is as near.
SPREAD = 0.25


def hard_limit(recording: Recording) -> Estimate | None:
    """The force U beyond which no more arrives, N, of a recording with its simulator's force
    beside it; `None` where the command and what the motion needed do not part so.
    """
    command = np.asarray(recording.force, float)
    prepared = Prepared.of(recording)
    moving = in_motion(recording, prepared=prepared) & np.isfinite(command)
    known = np.asarray(recording.channels[KNOWN_FORCE], float)[moving]
    speed = np.asarray(prepared.recording.velocity, float)[: len(command)][moving]
    return limit_of(command[moving], known, speed, recording.unit_names["force"])


def cut(size: np.ndarray, needed: np.ndarray) -> tuple[float, float]:
    """The level at which a command's size `(M,)` is cut off to be nearest to what was needed, and
    what that leaves of the mismatch.
    """
    levels = np.quantile(size, np.linspace(1 - MOST, 1, LEVELS + 1))[:-1]
    left = np.array([np.sum((np.minimum(size, level) - needed) ** 2) for level in levels])
    best = int(np.argmin(left))
    return float(levels[best]), float(left[best] / max(np.sum((size - needed) ** 2), 1e-300))


def limit_of(
    command: np.ndarray, known: np.ndarray, speed: np.ndarray, unit: str
) -> Estimate | None:
    """The limit by the command, what the motion needed, N, and the velocity, `(M,)` each."""
    size, needed = np.abs(command), np.sign(command) * known
    mismatch = (size - needed) ** 2
    level, left = cut(size, needed)
    beyond = size > level
    if np.count_nonzero(beyond) < FEWEST or not left < LEAVES_IN_ALL:
        return None
    level = float(np.mean(needed[beyond]))  # what arrived there
    beyond = size > level
    if np.mean(beyond) > MOST:
        return None
    # What moved the axis was no more than the limit at any time.
    if np.sum(np.maximum(needed - level, 0) ** 2) > LEAVES * np.sum((size[beyond] - level) ** 2):
        return None
    inside = np.sum((level - needed[beyond]) ** 2)
    if not inside < LEAVES * np.sum(mismatch[beyond]):
        return None
    if not one_value(needed, beyond):
        return None
    if not left * mismatch.sum() < HALVED * _by_values(command, known, speed):
        return None
    excess = size[beyond] - np.mean(size[beyond])
    part = float(excess @ needed[beyond]) / max(float(excess @ excess), 1e-300)
    if abs(part) > LEAVES:
        return None
    visits = np.flatnonzero(np.diff(beyond.astype(int), prepend=0) == 1)
    error = float(np.std(needed[beyond])) / np.sqrt(max(len(visits), 1))
    return Estimate(np.float64(level), np.float64(error), unit)


def one_value(needed: np.ndarray, beyond: np.ndarray) -> bool:
    """Whether what the motion needed, N, is one value `beyond` a level, `(M,)` both."""
    away = needed[~beyond] - np.mean(needed[beyond])
    return bool(np.std(needed[beyond]) < SPREAD * np.sqrt(np.mean(away**2)))


def _by_values(command: np.ndarray, known: np.ndarray, speed: np.ndarray) -> float:
    """What a gain, friction and a constant of other values leave of the mismatch, N².

    They may change with time, by a parabola: where friction is most of the force and falls while
    the machine warms, what it needs seems to be one value, too.
    """
    columns = np.stack([known, np.sign(speed), speed, np.ones_like(speed)], axis=1)
    time = np.linspace(-1, 1, len(speed))[:, None]
    columns = np.concatenate([columns, time * columns, time**2 * columns], axis=1)
    rest = command - known
    rest = rest - columns @ solve(columns, rest)
    return float(rest @ rest)


def arrived(recording: Recording, limit: Estimate | None) -> Recording:
    """The recording with the force that arrived."""
    if limit is None:
        return recording
    top = float(limit.value)
    force = np.clip(np.asarray(recording.force), -top, top)
    return dataclasses.replace(recording, force=force)


def noisy(recording: Recording, limit: Estimate) -> bool:
    """Whether the noise of the recorded force alone reaches as far beyond a limit.

    Of a force that is flat, as dry friction is, noise of any size asks for more at half of the
    samples, by its own root mean square; of twice that a fourth of the power is noise.
    """
    force = np.asarray(recording.force, float)
    valid = np.asarray(recording.mask) & np.isfinite(force)
    excess = np.abs(force[valid]) - float(limit.value)
    excess = excess[excess > 0]
    together = signals.host_continuous(recording, signals.host_interval(recording))
    noise = host_white_noise(np.where(np.isfinite(force), force, 0.0), together)
    return bool(np.sum(excess**2) < (2 * noise) ** 2 * len(excess))


def beyond(recording: Recording, limit: Estimate) -> int:
    """How many samples ask for more."""
    force = np.abs(np.asarray(recording.force, float))
    return int(np.count_nonzero((force > float(limit.value)) & np.asarray(recording.mask)))
