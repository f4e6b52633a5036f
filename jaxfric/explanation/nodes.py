"""Nodes: local means of a recording, a sixth of the kernel apart, and their weights in rows."""

import dataclasses

import jax.numpy as jnp
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
from ..terms.sample import Scales
from .motion import moves, padded_length

# Nodes in half a kernel: the trapezoidal rule on them errs by the kernel's spectrum at 2π·6/h,
# which is below 1e-4 of its peak. A wider kernel on the same nodes has more of them.
NODES = 6
# Rows are half a kernel apart, so many nodes: neighbours share a fifth of their weight, and nothing
# is lost.
STRIDE = 3


def stride(half: int) -> int:
    """Nodes from row to row of a kernel with so many nodes in its half."""
    return STRIDE * half // NODES


def node_signals(
    recording: Recording, limits: Scales, step: int, delay: float, smoothed: float
) -> dict:
    """Local means of every signal, `step` samples apart, with the run that each node lies in, and
    whether its force is `compared`: what has a memory goes on where a simulator's says nothing.

    `smoothed`: by how much the velocity has been, in samples², see `signals.smoothing`.
    """
    time, mask = np.asarray(recording.time, float), moves(recording)
    silent = mask & ~np.asarray(recording.mask)
    linked = signals.host_continuous(dataclasses.replace(recording, mask=mask), limits.interval)
    run = np.pad(np.cumsum(~linked), (1, 0))
    steps = np.where(linked, np.diff(time), limits.interval)
    series = {
        "time": time,
        "force": np.asarray(recording.force, float),
        "velocity": np.asarray(recording.velocity, float),
        "elapsed": np.pad(np.cumsum(steps), (1, 0)),
    }
    if recording.position is not None:
        series["position"] = np.asarray(recording.position, float)
    channels = {k: v for k, v in recording.channels.items() if k != KNOWN_MASKED}
    series |= {f"channel {k}": np.asarray(v, float) for k, v in channels.items()}
    if delay:
        series["force"] = at_other_times(
            recording, series["force"], lambda force: _later(time, force, run, delay)
        )
    centres = np.arange(0, len(time), step)
    offsets = np.arange(-(step - 1), step)
    at = np.clip(centres[:, None] + offsets[None, :], 0, len(time) - 1)
    near = mask[at] & (run[at] == run[centres][:, None])
    near &= centres[:, None] + offsets[None, :] == at
    weight = np.where(near, (step - np.abs(offsets))[None, :], 0.0)
    total = weight.sum(axis=1)
    weight /= np.where(total > 0, total, 1.0)[:, None]
    means = {
        name: np.einsum("ij,ij->i", weight, np.where(near, values[at], 0.0))
        for name, values in series.items()
    }
    label = np.where(total > 0, run[centres], -1 - np.arange(len(centres)))
    # Terms are functions of the motion at an instant, not of its mean: the curvature that the
    # triangle of weights took off (its variance is a sixth of the squared spacing) is put back,
    # and the columns' weights take it off again, so that force and columns are averaged alike. So
    # is what the derivative took off the velocity, which would look like a load on a spring.
    inner = np.flatnonzero((label[1:-1] == label[:-2]) & (label[1:-1] == label[2:])) + 1
    known = KNOWN_FORCE, KNOWN_FRICTION, KNOWN_REST, KNOWN_FEEDBACK
    forces = {"force", *(f"channel {n}" for n in known)}
    for name in set(means) - forces - {"time", "elapsed"}:
        values = means[name]
        bend = values[inner + 1] - 2 * values[inner] + values[inner - 1]
        means[name] = values.copy()
        derived = name == "velocity" or name.endswith("momentum")
        lost = 1 / 12 + (smoothed / step**2 if derived else 0.0)
        means[name][inner] -= lost * bend
    return means | {"run": label, "compared": ~np.any(near & silent[at], axis=1)}


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
        return jnp.asarray(np.pad(values, (0, length - count), mode="edge"))

    position = pad(parts["position"]) if "position" in parts else None
    channels = {k[8:]: pad(v) for k, v in parts.items() if k.startswith("channel ")}
    labels = np.unique(parts["run"], return_inverse=True)[1].astype(np.int32)
    segment = jnp.asarray(np.pad(labels, (0, length - count), mode="edge"))
    return Recording(
        pad(parts["time"]), pad(parts["force"]), position, pad(parts["velocity"]),
        segment=segment, channels=channels, num_segments=1, units=recording.units,
    )  # fmt: skip
