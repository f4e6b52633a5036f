"""Faults that the signals of a recording show by themselves, on the host."""

import numpy as np

from .. import signals
from ..data.recording import Recording
from .clock import clock_of
from .force import force_faults, same_as_motion
from .kinds import places
from .lone import PIECE
from .motion import (
    clock_faults,
    coarse,
    compared,
    derivative_faults,
    jumps,
    position_faults,
    speed_faults,
)


def recorded(recording: Recording, ready: signals.Ready | None = None) -> np.ndarray:
    """The numbers of the faults of a recording, `(W,)`, as [`kinds`][] orders them; NaN for none.

    Signals of shape `(N,)`, as they were read: with the velocity that was recorded, or none.
    `ready`: the same prepared, where that has been done.
    """
    found: dict[str, float] = {}
    valid = np.asarray(recording.mask) & np.isfinite(np.asarray(recording.force, float))
    if np.count_nonzero(valid) <= 2 * PIECE:
        return places(found)
    clock = clock_of(recording)
    found |= clock_faults(recording, clock)
    if recording.position is not None:
        found |= position_faults(recording, clock)
        if recording.velocity is not None:
            found |= compared(recording, clock)
    if ready is None:
        kept = recording.velocity is not None and "velocity_late" not in found
        ready = signals.Ready(recording, None) if kept else signals.Ready.of(recording)
    choice, velocity = ready.choice, np.asarray(ready.recording.velocity, float)
    valid &= np.isfinite(velocity)
    if choice is not None:
        found |= derivative_faults(choice, velocity[valid])
    else:
        found |= coarse(recording, velocity, clock)
    if choice is None and (spikes := jumps(recording, velocity, clock)) > 0:
        found["velocity_spikes"] = spikes
    found |= speed_faults(velocity, valid, recording.unit_names["position"])
    found |= force_faults(recording, velocity, valid, clock)
    if "no_motion" not in found:
        found |= same_as_motion(recording, velocity, valid, clock)
    return places(found)
