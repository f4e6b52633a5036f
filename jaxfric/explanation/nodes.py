"""Nodes: local means of a recording, a sixth of the kernel apart, and their weights in rows."""

import dataclasses
from typing import NamedTuple

import jax
import numpy as np

from .. import signals
from ..data.recording import Recording
from ..data.shifting import shifted
from ..terms import (
    KNOWN_FEEDBACK,
    KNOWN_FORCE,
    KNOWN_FRICTION,
    KNOWN_MASKED,
    KNOWN_REST,
    at_other_times,
)
from .motion import Motion, moves, padded_length

# Nodes in half a kernel: the trapezoidal rule on them errs by the kernel's spectrum at 2π·6/h,
# which is below 1e-4 of its peak. A wider kernel on the same nodes has more of them.
NODES = 6
# Rows are half a kernel apart, so many nodes: neighbours share a fifth of their weight, and nothing
# is lost.
STRIDE = 3


def stride(half: int) -> int:
    """Nodes from row to row of a kernel with so many nodes in its half."""
    return STRIDE * half // NODES


class Means(NamedTuple):
    """How signals become local means, `step` samples apart: by triangles twice as wide.

    - `fading`, `rising`: the weights of the samples from each node on in its mean and in the next
      one's, `(M, step)`; `known`: which samples count, `(N,)`.
    - `run`: the run that each sample lies in, `(N,)`, and each node, `label` `(M,)`, one of its own
      where there is no sample; `inner`: which nodes have both neighbours in their run, `(M - 2,)`.
    - `compared`: whether all that a node is made of has a force to compare; what has a memory goes
      on where a simulator's says nothing.
    - `smoothed`: by how much the velocity has been, in squared steps, see `signals.smoothing`.
    """

    step: int
    fading: np.ndarray
    rising: np.ndarray
    known: np.ndarray
    run: np.ndarray
    label: np.ndarray
    inner: np.ndarray
    compared: np.ndarray
    smoothed: float

    @classmethod
    def of(cls, motion: Motion, interval: float, step: int) -> "Means":
        """Those of a motion; `interval` of its samples, s."""
        recording = motion.on_host()
        mask = moves(motion.recording)
        linked = signals.host_continuous(dataclasses.replace(recording, mask=mask), interval)
        run = np.pad(np.cumsum(~linked), (1, 0))
        first = run[::step]
        count = len(first)
        samples, valid = _blocks(run, count, step), _blocks(mask, count, step)
        near = valid & (samples == first[:, None])
        after = np.zeros_like(valid)
        after[:-1] = valid[:-1] & (samples[:-1] == first[1:, None])
        fading, rising = near * np.arange(step, 0.0, -1.0), after * np.arange(0.0, step)
        total = fading.sum(axis=1) + _before(rising.sum(axis=1))
        label = np.where(total > 0, first, -1 - np.arange(count))
        size = np.where(total > 0, total, 1.0)
        silent = _blocks(mask & ~np.asarray(recording.mask), count, step)
        here, next_ = (((part > 0) & silent).any(axis=1) for part in (fading, rising))
        fading /= size[:, None]
        rising[:-1] /= size[1:, None]
        inner = (label[1:-1] == label[:-2]) & (label[1:-1] == label[2:])
        compared = ~(here | _before(next_))
        smoothed = motion.smoothed / step**2
        return cls(step, fading, rising, mask, run, label, inner, compared, smoothed)

    def plain(self, values: np.ndarray) -> np.ndarray:
        """The means of a signal, `(N,)` to `(M,)`."""
        blocks = _blocks(np.where(self.known, values, 0.0), *self.fading.shape)
        after = np.einsum("ms,ms->m", blocks, self.rising)
        return np.einsum("ms,ms->m", blocks, self.fading) + _before(after)

    def instant(self, values: np.ndarray, derived: bool = False) -> np.ndarray:
        """A signal of the motion as it is at the nodes, `(N,)` to `(M,)`.

        Terms are functions of the motion at an instant, not of its mean: the curvature that the
        triangle of weights took off (its variance is a sixth of the squared spacing) is put back,
        and the columns' weights take it off again, so that force and columns are averaged alike. So
        is what the derivative took off a `derived` one, which would look like a load on a spring.
        """
        found = self.plain(values)
        lost = 1 / 12 + (self.smoothed if derived else 0.0)
        found[1:-1] -= np.where(self.inner, lost * np.diff(found, 2), 0.0)
        return found


def _blocks(values: np.ndarray, count: int, step: int) -> np.ndarray:
    """Samples from each node to the next, `(N,)` to `(M, step)`; none beyond the end."""
    whole = np.zeros(count * step, values.dtype)
    whole[: len(values)] = values
    return whole.reshape(count, step)


def _before(values: np.ndarray) -> np.ndarray:
    """What each node has of the one before it, `(M,)`."""
    return np.concatenate([np.zeros(1, values.dtype), values[:-1]])


def node_signals(motion: Motion, means: Means, interval: float, delay: float) -> dict:
    """Local means of every signal, with the run that each node lies in, and whether its force is
    `compared`; `interval` of samples, s; `delay`, s, by which the force is taken later.
    """
    recording, velocity = motion.recording, np.asarray(motion.on_host().velocity, float)
    time, force = np.asarray(recording.time, float), np.asarray(recording.force, float)
    steps = np.where(np.diff(means.run) == 0, np.diff(time), interval)
    if delay:
        force = at_other_times(
            recording, force, lambda force: _later(time, force, means.run, delay)
        )
    found = {
        "time": means.plain(time),
        "force": means.plain(force),
        "velocity": means.instant(velocity, derived=True),
        "elapsed": means.plain(np.pad(np.cumsum(steps), (1, 0))),
    }
    if recording.position is not None:
        found["position"] = means.instant(np.asarray(recording.position, float))
    for name, signal in recording.channels.items():
        values = np.asarray(signal, float)
        if name in (KNOWN_FORCE, KNOWN_FRICTION, KNOWN_REST, KNOWN_FEEDBACK):
            found[f"channel {name}"] = means.plain(values)
        elif name != KNOWN_MASKED:
            found[f"channel {name}"] = means.instant(values, name.endswith("momentum"))
    return found | {"run": means.label, "compared": means.compared}


def _later(time, force, run, delay):
    """The force `delay` later, s: u(t + delay), inside each run; across them on an even clock."""
    if np.all(np.diff(time) > 0):
        return np.interp(time + delay, time, force)
    return shifted(time, force, run, delay)


def windows(parts: dict, reach: float, half: int = NODES) -> tuple[np.ndarray, ...]:
    """Nodes of the rows, `half` of them on either side of every third one (of every sixth where
    there are twelve), whether they lie in one run and are compared, and their weights.
    """
    middle = np.arange(half, len(parts["time"]) - half, stride(half))
    index = middle[:, None] + np.arange(-half, half + 1)[None, :]
    whole = parts["run"][index[:, 0]] == parts["run"][index[:, -1]]
    even = np.arange(-half, half + 1) * reach / half
    offset = parts["time"][index] - parts["time"][index[:, half]][:, None]
    offset = np.where(whole[:, None], offset, even[None, :])
    slope = signals.kernel_slope(offset / reach)
    average, slope = signals.kernel_weights(
        signals.kernel(offset / reach).T, slope.T, np.sum(slope * offset, axis=1)
    )
    whole &= parts["compared"][index].all(axis=1)
    return index, whole, np.ascontiguousarray(average.T), np.ascontiguousarray(slope.T)


def averaged(weights: np.ndarray) -> np.ndarray:
    """The weights of a triangle's mean around each node, by its second moment."""
    bend = np.zeros_like(weights)
    bend[:, 1:-1] = weights[:, 2:] - 2 * weights[:, 1:-1] + weights[:, :-2]
    bend[:, 0], bend[:, -1] = weights[:, 1], weights[:, -2]
    return weights + bend / 12


def padded(parts: dict, recording: Recording) -> Recording:
    """The nodes as a recording, lengthened as `padded_length` says."""
    count = len(parts["time"])
    length = padded_length(count)

    def pad(values):
        return np.concatenate([values, np.full(length - count, values[-1])])

    channels = {k[8:]: pad(v) for k, v in parts.items() if k.startswith("channel ")}
    labels = np.unique(parts["run"], return_inverse=True)[1].astype(np.int32)
    names = ("time", "force", "velocity", "position")
    series = {name: pad(parts[name]) for name in names if name in parts}
    # In one go: each by itself takes twice as long.
    at = jax.device_put(series | {"segment": pad(labels), "channels": channels})
    return Recording(**at, num_segments=1, units=recording.units)
