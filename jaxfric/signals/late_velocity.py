"""A recorded velocity beside the position's increments: late by a drive's filter, or not.

On the host. Friction changes its sign with the velocity: one that is late by τ has it wrong for τ
after every reversal, and from then on the force as well.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..data.excerpt import excerpt
from ..data.recording import Recording
from .choosing import choose
from .clock import host_continuous, host_interval, is_traced
from .derivatives import derivative
from .noise import counted_noise, host_white_noise

# Increments that are compared are this many times the noise of what they are taken from: it takes a
# five-hundredth off the lag.
ABOVE_NOISE = 30.0
# Half a sample late is a difference quotient.
QUOTIENT = 0.5
# The same motion shares half of its power, and moves as far but for a quarter: more is no filter's
# doing.
SHARED, ALIKE = 0.5, 1.25
# Blocks by which the lag's standard error is known to a seventh, and two of those; fewer increments
# than that make no blocks.
BLOCKS, SURE = 24, 2.0
FEWEST = 32
# A lag of an eighth of the motion's period is known to a tenth at once: four times are enough.
ROUNDS = 4


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
    the same motion, or where the position is too coarse to know better. To first order in the lag,
    and what is left once it has been undone. `increments`: those of the recording, where they are
    known.
    """
    position, velocity = recording.position, recording.velocity
    if position is None or velocity is None or recording.position_every != 1:
        return 0.0
    typical = host_interval(recording)
    whole = 0
    left = lag = _first_order(increments or Increments.of(recording), typical)
    for _ in range(ROUNDS):
        if left == 0:
            break
        whole = round(lag / typical)
        left = _first_order(Increments.of(_earlier(recording, whole)), typical)
        lag = lag if left == 0 else whole * typical + left
    return lag


def _first_order(increments: Increments, typical: float) -> float:
    """The lag that increments show, s, from x(t − τ) − x(t) = −τ v(t), whose increment is −τ Δv."""
    moved, driven, changed, noise = increments
    power, both = float(moved @ moved), float(moved @ driven)
    if len(moved) < FEWEST or both <= 0 or both**2 < SHARED * power * float(driven @ driven):
        return 0.0
    if not 1 / ALIKE < power / both < ALIKE:
        return 0.0
    ends = np.arange(BLOCKS) * len(moved) // BLOCKS
    ours = np.add.reduceat((moved - driven) * changed, ends)
    theirs = np.add.reduceat(changed**2, ends)
    whole = float(theirs.sum())
    if whole <= 0:
        return 0.0
    lag = float(ours.sum()) / whole
    error = float(np.linalg.norm(ours - lag * theirs)) / whole
    late = lag - SURE * error > QUOTIENT * typical
    return lag if late and lag * float(np.std(changed)) > noise else 0.0


def with_timely_velocity(recording: Recording) -> Recording:
    """The recording with a velocity that is late beside the position corrected by it.

    Taken earlier by whole samples, and added to it the derivative of what the position says more:
    what is slow enough for that derivative comes from the position, which no filter has made
    smaller, and what is too fast for it stays as it was recorded (a complementary filter; Higgins
    1975). As it is inside `jax.jit`, where the values are not known.
    """
    # Of a long recording a part says it, in bounded time and memory.
    if is_traced(recording) or (lag := lag_of_velocity(excerpt(recording))) == 0:
        return recording
    earlier = _earlier(recording, round(lag / host_interval(recording)))
    more = _said_more(earlier)
    choice = choose(earlier, more)
    slope = derivative(earlier, more, choice.half_width, choice.degree)
    velocity = earlier.velocity + slope.astype(earlier.velocity.dtype)
    return dataclasses.replace(earlier, velocity=velocity)


def _said_more(recording: Recording) -> np.ndarray:
    """By how much the position is ahead of the integrated velocity, m, `(N,)`; across a gap as
    before it.
    """
    position, velocity = (
        np.nan_to_num(np.asarray(x, float)) for x in (recording.position, recording.velocity)
    )
    linked = host_continuous(recording, host_interval(recording))
    steps = np.diff(np.asarray(recording.time, float))
    # The trapezoid and its error by the bend about it, which a fast wave has some per cent of.
    bend = np.pad(np.diff(velocity, 2), 1, mode="edge")
    mean = 0.5 * (velocity[1:] + velocity[:-1]) - (bend[1:] + bend[:-1]) / 24
    ahead = np.where(linked, np.diff(position) - mean * steps, 0.0)
    return np.concatenate([[0.0], np.cumsum(ahead)])


def _earlier(recording: Recording, samples: int) -> Recording:
    """With the velocity so much earlier; at the end of every unbroken piece, where it is not known,
    the samples are not valid.
    """
    velocity = np.asarray(recording.velocity)
    linked = host_continuous(recording, host_interval(recording))
    ends = np.flatnonzero(np.append(~linked, True))
    every = np.arange(len(velocity))
    end = ends[np.searchsorted(ends, every)]
    source = np.clip(every + samples, 0, end)
    known = np.asarray(recording.mask) & (every + samples <= end)
    return dataclasses.replace(recording, velocity=velocity[source], mask=known)
