"""A recorded velocity beside the position's increments: late by a drive's filter, or not.

On the host. Friction changes its sign with the velocity: one that is late by τ has it wrong for τ
after every reversal, and from then on the force as well.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..data.recording import Recording
from .clock import host_continuous, host_interval, is_traced
from .noise import counted_noise, host_white_noise

# Increments that are compared are this many times the noise of what they are taken from: it takes a
# five-hundredth off the lag.
ABOVE_NOISE = 30.0
# Half a sample late is a difference quotient.
QUOTIENT = 0.5
# The same motion shares half of its power, and moves as far but for a quarter.
SHARED, ALIKE = 0.5, 1.25
# Blocks by which the lag's standard error is known to a seventh, and two of those.
BLOCKS, SURE = 24, 2.0
FEWEST = 32


class Increments(NamedTuple):
    """What position and velocity say the axis moved in the same spans, m, `(n,)` each; by how much
    the velocity changed in them, m/s; and the noise of the position, m.
    """

    moved: np.ndarray
    driven: np.ndarray
    changed: np.ndarray
    noise: float

    @classmethod
    def of(cls, recording: Recording) -> "Increments":
        """Over unbroken spans of the fewest samples that stand out of the noise of both."""
        position, velocity = (
            np.asarray(x, float) for x in (recording.position, recording.velocity)
        )
        linked = host_continuous(recording, host_interval(recording))
        ends = position[1:] + position[:-1] + velocity[1:] + velocity[:-1]
        linked = linked & np.isfinite(ends)
        steps = np.where(linked, np.diff(np.asarray(recording.time, float)), 0.0)
        mean = np.where(linked, 0.5 * (velocity[1:] + velocity[:-1]), 0.0)
        place, driven, speed = (
            np.concatenate([[0], np.cumsum(np.where(linked, each, 0.0))])
            for each in (np.diff(position), mean * steps, np.diff(velocity))
        )
        noise, span = counted_noise(position[np.asarray(recording.mask)]), 4
        rough = host_white_noise(np.where(np.isfinite(velocity), velocity, 0.0), linked)
        floors = (place, ABOVE_NOISE * noise), (speed, ABOVE_NOISE * rough)
        while span < len(place) // 16 and any(
            float(np.std(each[span:] - each[:-span])) < floor for each, floor in floors
        ):
            span *= 2
        moved, driven, changed = (each[span:] - each[:-span] for each in (place, driven, speed))
        return cls(moved, driven, changed, noise)


def lag_of_velocity(recording: Recording, increments: Increments | None = None) -> float:
    """By how much the recorded velocity is late beside the position, s; zero where it is not.

    Zero too where that is no more than a difference quotient or chance makes, where the two are not
    the same motion, or where the position is too coarse to know better. `increments`: those of the
    recording, where they are known.
    """
    position, velocity = recording.position, recording.velocity
    if position is None or velocity is None or recording.position_every != 1:
        return 0.0
    moved, driven, changed, noise = increments or Increments.of(recording)
    power, both = float(moved @ moved), float(moved @ driven)
    if len(moved) < FEWEST or both <= 0 or both**2 < SHARED * power * float(driven @ driven):
        return 0.0
    gain = power / both
    if not 1 / ALIKE < gain < ALIKE:
        return 0.0
    # x(t − τ) − x(t) is −τ v(t), of which an increment is −τ Δv.
    ends = np.arange(BLOCKS) * len(moved) // BLOCKS
    ours = np.add.reduceat((moved - driven) * changed, ends)
    theirs = np.add.reduceat(changed**2, ends)
    whole = float(theirs.sum())
    if whole <= 0:
        return 0.0
    lag = float(ours.sum()) / whole
    error = float(np.linalg.norm(ours - lag * theirs)) / whole
    late = lag - SURE * error > QUOTIENT * host_interval(recording)
    return lag if late and lag * float(np.std(changed)) > noise else 0.0


def with_timely_velocity(recording: Recording) -> Recording:
    """The recording with a velocity that is late beside the position taken earlier.

    By whole samples, so that its noise stays as white as it was, and what is too fast for a
    derivative of the position stays in it. The last samples of every unbroken piece repeat the last
    that is known. As it is inside `jax.jit`, where the values are not known.
    """
    if is_traced(recording) or (lag := lag_of_velocity(recording)) == 0:
        return recording
    typical = host_interval(recording)
    velocity = np.array(recording.velocity)
    ends = np.flatnonzero(np.append(~host_continuous(recording, typical), True))
    last = ends[np.searchsorted(ends, np.arange(len(velocity)))]
    source = np.minimum(np.arange(len(velocity)) + round(lag / typical), last)
    return dataclasses.replace(recording, velocity=velocity[source])
