"""A position for a recording of velocity alone: its integral."""

import dataclasses

import jax.numpy as jnp
import numpy as np

from ..data.recording import Recording, row_of
from .clock import host_continuous, host_interval, is_traced


def placed(recording: Recording) -> Recording:
    """The recording with the integral of its velocity as its position, where it has none.

    By trapezoids, from zero at the first sample; `position_every` is 0 then. On the host: inside
    `jax.jit` the recording stays as it is. So does one with a gap or several segments, behind which
    the position is not known, one without a valid sample, and a batch with such a row. Signals of
    shape `(N,)` or `(B, N)`.
    """
    if recording.position is not None or is_traced(recording):
        return recording
    if recording.time.ndim == 2:
        rows = [placed(row_of(recording, i)).position for i in range(len(recording.time))]
        if any(row is None for row in rows):
            return recording
        return dataclasses.replace(recording, position=jnp.stack(rows), position_every=0)
    velocity = np.asarray(recording.velocity)
    valid = np.asarray(recording.mask) & np.isfinite(velocity)
    time, segment = np.asarray(recording.time, float), np.asarray(recording.segment)
    known = dataclasses.replace(
        recording, time=time[valid], force=time[valid], velocity=velocity[valid],
        mask=None, segment=segment[valid], channels={},
    )  # fmt: skip
    step = host_interval(known)
    if not np.isfinite(step) or not host_continuous(known, step).all():
        return recording
    speed = velocity[valid].astype(float)
    steps = 0.5 * (speed[1:] + speed[:-1]) * np.diff(time[valid])
    moved = np.append(0, np.cumsum(steps))
    position = np.interp(np.arange(len(time)), np.flatnonzero(valid), moved)
    return dataclasses.replace(
        recording, position=jnp.asarray(position.astype(velocity.dtype)), position_every=0
    )
