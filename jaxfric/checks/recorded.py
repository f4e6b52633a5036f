"""Faults that the signals of a recording show by themselves, on the host."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import jax
import numpy as np

from .. import signals
from ..data.recording import Recording, row_of
from .clock import Clock
from .force import force_faults, same_as_motion
from .kinds import none, places
from .lengths import PIECE
from .motion import (
    clock_faults,
    coarse,
    compared,
    derivative_faults,
    jumps,
    position_faults,
    smoothed,
    speed_faults,
    unsteady,
)
from .screening import Rows, Suspect, suspects


def recorded(recording: Recording, ready: signals.Ready | None = None) -> np.ndarray:
    """The numbers of the faults of a recording, `(W,)`, as [`kinds`][] orders them; NaN for none.

    Signals of shape `(N,)`, as they were read: with the velocity that was recorded, or none.
    `ready`: the same prepared, where that has been done.
    """
    batch = jax.tree.map(lambda x: np.asarray(x)[None], recording)
    return recorded_rows(batch, [ready])[0]


def recorded_rows(recordings: Recording, ready: Sequence[signals.Ready | None]) -> np.ndarray:
    """[`recorded`][] of each row of a batch, signals of shape `(B, N)`, `(B, W)`."""
    found = np.tile(none(), (len(ready), 1))
    force, mask = np.asarray(recordings.force, float), np.asarray(recordings.mask)
    valid = mask & np.isfinite(force)
    long = np.flatnonzero(np.count_nonzero(valid, axis=1) > 2 * PIECE)
    if not len(long):
        return found
    intervals = signals.host_intervals(recordings)
    linked = signals.host_continuous(recordings, intervals)
    position = recordings.position
    logs = []
    for i in map(int, long):
        log = _Log(recordings, i, Clock(float(intervals[i]), linked[i]), {}, ready[i])
        logs.append(log.compared() if position is not None or ready[i] is None else log)
    velocity = np.stack([np.asarray(log.ready.recording.velocity, float) for log in logs])
    place = None if position is None else np.asarray(position, float)[long]
    usable = valid[long] & np.isfinite(velocity)
    rows = Rows(velocity, force[long], place, mask[long], usable, linked[long])
    suspect = suspects(rows, recordings.unit_names["position"])
    for k, log in enumerate(logs):
        faults = log.looked_at(velocity[k], usable[k], Suspect(*(each[k] for each in suspect)))
        if faults:
            found[log.number] = places(faults)
    return found


class _Log(NamedTuple):
    """One row of a batch of recordings with its clock, the faults `found` so far, and the row
    prepared, where that has been done.
    """

    batch: Recording
    number: int
    clock: Clock
    found: dict[str, float]
    ready: signals.Ready | None

    @property
    def recording(self) -> Recording:
        return row_of(self.batch, self.number)

    def compared(self) -> Self:
        """With the faults of the position, beside a recorded velocity too, and prepared."""
        recording = self.recording
        found: dict[str, float] = {}
        if recording.position is not None:
            found |= position_faults(recording, self.clock) | unsteady(recording, self.clock)
            if recording.velocity is not None:
                found |= compared(recording, self.clock)
        ready = self.ready
        if ready is None:
            ready = signals.Ready.of(recording)
        if ready.anew is not None:
            found |= smoothed(recording, ready.anew)
        return self._replace(found=found, ready=ready)

    def looked_at(
        self, velocity: np.ndarray, valid: np.ndarray, suspect: Suspect
    ) -> dict[str, float]:
        """All faults, by the checks for which the row is a suspect."""
        choice = self.ready.choice
        if choice is None and not any(suspect):
            return self.found
        recording, clock, found = self.recording, self.clock, dict(self.found)
        found |= clock_faults(recording, clock)
        if choice is not None:
            if "no_motion" not in found:  # else there is no velocity to say anything of
                found |= derivative_faults(choice, velocity[valid])
        elif suspect.pace:
            found |= coarse(recording, velocity, clock)
            if (spikes := jumps(recording, velocity, clock)) > 0:
                found["velocity_spikes"] = spikes
        if suspect.speed:
            found |= speed_faults(velocity, valid, recording.unit_names["position"])
        if suspect.force:
            found |= force_faults(recording, velocity, valid, clock)
        if suspect.copied and "no_motion" not in found:
            found |= same_as_motion(recording, velocity, valid, clock)
        return found
