"""Whether the axis moves while its friction reverses, or sticks until it breaks away.

Under dry friction it rests from the stop to the break-away, whatever the force does in between,
so that a row of the weak form across a reversal says nothing: its friction is the force itself.
Under presliding it moves with that force, and then such a row is the best witness there is. The
displacement decides, which needs neither a model of the encoder nor one of the controller. An axis
may creep through zero, too, with a friction that is a steep function of the velocity, as most
simulators have it. What of that is above the slowest speed that is told from rest shows in slip.
"""

from collections.abc import Iterator
from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from ..data.recording import Recording
from ..models import Model
from ..signals.sampled import SampledSignal
from ..terms import Dahl, SmoothCrossing
from .evidence import Evidence
from .motion import Motion, motion_of
from .predictions import with_predictions
from .regression import Fit, fit
from .significance import DRAWS

# Part of the way from one break-away level to the other that counts, on both sides of the middle:
# friction levels, which the base knows to a few parts in a hundred, lie well outside.
BETWEEN = 0.7
# Samples of a reversal in that range, for a slope through them.
LEAST_SAMPLES = 4
# Rounding to counts is a noise of a count over this (Widrow 1956).
COUNT = np.sqrt(12)


def yields(recording: Recording | Motion, evidence: Evidence, base: Fit) -> bool:
    """Whether the position follows the force while friction passes from one level to the other.

    In every reversal, the slope of position by force between the break-away levels of the base's
    slip friction: at rest its sign is a coin's, and one that still comes to rest is negative. An
    axis that yields by less than a count in most of them has no direction there that a row could
    know, however sure the mean of them all is.

    **Arguments:** `recording` with a position, `(N,)`, and its `evidence`; `base`, the fit of the
    baseline.
    """
    motion = motion_of(recording)
    if motion.recording.position is None or motion.recording.position_every == 0:
        return False
    position = np.asarray(motion.recording.position)
    slopes = np.array(
        [_slope(level, position[at]) for at, level in passages(motion, evidence, base)]
    )
    if not len(slopes) or not _one_way(slopes):
        return False
    count = COUNT * SampledSignal.of(motion.recording, position).noise()
    return bool(2 * BETWEEN * np.median(slopes) > count)


class _Crossing(SmoothCrossing):
    """Down to a thousandth of the slowest slip, where it is a jump."""

    nonlinear: ClassVar = (
        SmoothCrossing.nonlinear[0]._replace(bounds=lambda s: (1e-3 * s.slowest, 0.5 * s.fastest)),
    )


def creeps(evidence: Evidence, base: Fit) -> bool:
    """Whether rows across reversals show no more than friction that is steep in the velocity.

    It takes more of what the base leaves there than friction that builds up over a distance does.
    """
    seen = with_predictions(evidence, base)
    crept, elastic = (
        fit((*base.terms, law), seen, (*base.betas, None), 6).energy
        for law in (_Crossing(), Dahl())
    )
    return crept < elastic


def _one_way(slopes: np.ndarray) -> bool:
    """Whether slopes are significantly positive, as they are and by their signs alone.

    Of slopes that are rest and rounding but for one or two, those decide whatever the others do.
    """
    draws = np.random.default_rng(0).choice([-1.0, 1.0], size=(DRAWS, len(slopes)))
    # The test is done up to three times on a recording, and rows across reversals by mistake spoil
    # all that follows: so no draw at all may be as large.
    return all(np.max(draws @ values) < np.sum(values) for values in (slopes, np.sign(slopes)))


def passages(
    recording: Recording | Motion, evidence: Evidence, base: Fit
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Samples of each reversal in which friction passes from one level to the other, and its
    force there in parts of the level, from −1 to 1.
    """
    motion = motion_of(recording)
    recording, width = motion.recording, evidence.width
    beyond = max(recording.position_every, 1) - 1
    count = recording.num_samples
    velocity, segment = np.asarray(motion.padded.velocity)[:count], np.asarray(recording.segment)
    position, force = np.asarray(recording.position), np.asarray(recording.force)
    forward, backward = _levels(base, evidence)
    level = (2 * force - forward - backward) / max(forward - backward, 1e-300)
    fast = np.abs(velocity) > evidence.limits.slowest
    slips = np.flatnonzero(fast & np.asarray(recording.mask))
    turns = np.sign(velocity[slips[1:]]) != np.sign(velocity[slips[:-1]])
    turns &= segment[slips[1:]] == segment[slips[:-1]]
    before, after = slips[:-1][turns], slips[1:][turns]
    edges = np.array([0, *((before + after) // 2), count])
    for number, (stop, go) in enumerate(zip(before, after, strict=True)):
        # The velocity is smoothed over a kernel at most; half the way to the next turn at most.
        middles = (edges[number : number + 2] + edges[number + 1 : number + 3]) // 2
        first, last = max(stop - width, middles[0]), min(go + width, middles[1])
        at = first + _between(level[first:last], np.sign(velocity[stop]) * position[first:last])
        # A curve from update to update moves before the axis does, and after.
        at = at[beyond : len(at) - beyond]
        if len(at) >= LEAST_SAMPLES and np.ptp(level[at]) >= 0.5 * BETWEEN:
            yield at, level[at]


def _slope(by: np.ndarray, values: np.ndarray) -> float:
    by = by - np.mean(by)
    return float(by @ values / (by @ by))


def _between(level: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Samples after the furthest one on the old way, until friction leaves the middle range.

    Without the furthest itself, which noise has lifted: what follows knows nothing of that.
    """
    furthest = int(np.argmax(way))
    inside = np.abs(level) < BETWEEN
    inside[: furthest + 1] = False
    if not inside.any():
        return np.zeros(0, int)
    start = int(np.argmax(inside))
    left = ~inside[start:]
    return np.arange(start, start + int(np.argmax(left)) if left.any() else len(level))


def _levels(base: Fit, evidence: Evidence) -> tuple[float, float]:
    """The least slip friction of the base in either direction, with its constant, N."""
    speed = np.linspace(evidence.limits.slowest, evidence.limits.fastest, 64)
    term = base.terms[0].with_beta(jnp.asarray(base.betas[0]))
    model = Model(term, jnp.asarray(base.alphas[0]))
    forward, backward = (np.asarray(model.friction(jnp.asarray(way * speed))) for way in (1, -1))
    return float(np.min(forward)), float(np.max(backward))
