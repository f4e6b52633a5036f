"""Whether the axis moves while its friction reverses, or sticks until it breaks away.

Under dry friction it rests from the stop to the break-away, whatever the force does in between,
so that a row of the weak form across a reversal says nothing: its friction is the force itself.
Under presliding it moves with that force, and then such a row is the best witness there is. The
displacement decides, which needs neither a model of the encoder nor one of the controller.
"""

import jax.numpy as jnp
import numpy as np

from ..models import Model
from ..recording import Recording
from .chance import DRAWS, LEVEL
from .evidence import Evidence, lengthened
from .regression import Fit

# Part of the way from one break-away level to the other that counts, on both sides of the middle:
# friction levels, which the base knows to a few parts in a hundred, lie well outside.
BETWEEN = 0.7
# Samples of a reversal in that range, for a slope through them.
LEAST_SAMPLES = 4


def yields(recording: Recording, evidence: Evidence, base: Fit) -> bool:
    """Whether the position follows the force while friction passes from one level to the other.

    In every reversal, the slope of position by force between the break-away levels of the base's
    slip friction: at rest its sign is a coin's, and one that still comes to rest is negative.

    **Arguments:** `recording` with a position, `(N,)`, and its `evidence`; `base`, the fit of the
    baseline.
    """
    if recording.position is None:
        return False
    slopes = _slopes(recording, evidence, base)
    if not len(slopes):
        return False
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(DRAWS, len(slopes)))
    larger = np.count_nonzero(signs @ slopes >= np.sum(slopes))
    return bool((1 + larger) / (1 + DRAWS) <= LEVEL)


def _slopes(recording: Recording, evidence: Evidence, base: Fit) -> np.ndarray:
    """Slope of position by friction force in each reversal, in parts of the force, m."""
    count, slowest = recording.num_samples, evidence.limits.slowest
    prepared = lengthened(recording)
    velocity = np.asarray(prepared.velocity)[:count]
    position, force = np.asarray(recording.position), np.asarray(recording.force)
    segment = np.asarray(recording.segment)
    forward, backward = _levels(base, evidence)
    level = (2 * force - forward - backward) / max(forward - backward, 1e-300)
    slips = np.flatnonzero((np.abs(velocity) > slowest) & np.asarray(recording.mask))
    turns = np.sign(velocity[slips[1:]]) != np.sign(velocity[slips[:-1]])
    turns &= segment[slips[1:]] == segment[slips[:-1]]
    before, after = slips[:-1][turns], slips[1:][turns]
    edges = np.array([0, *((before + after) // 2), count])
    found = []
    for number, (stop, go) in enumerate(zip(before, after, strict=True)):
        # The velocity is smoothed over a kernel at most; half the way to the next turn at most.
        middles = (edges[number : number + 2] + edges[number + 1 : number + 3]) // 2
        first, last = max(stop - evidence.width, middles[0]), min(go + evidence.width, middles[1])
        at = first + _between(level[first:last], np.sign(velocity[stop]) * position[first:last])
        if len(at) < LEAST_SAMPLES or np.ptp(level[at]) < 0.5 * BETWEEN:
            continue
        by = level[at] - np.mean(level[at])
        found.append(by @ position[at] / (by @ by))
    return np.array(found)


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
