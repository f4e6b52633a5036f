"""A recording whose velocity has been derived, once for all the rows that are made of it."""

import dataclasses
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .. import signals
from ..data.recording import Recording, pad
from ..terms import KNOWN_MASKED
from .repeats import repeated_after


class Motion(NamedTuple):
    """A recording whose velocity has been derived, once for all the rows that are made of it.

    `recording`: as it was read, `(N,)`; `padded`: with its velocity and without channels, of one of
    few lengths, so that few programs are compiled; `smoothed`: by how much that velocity has been,
    in samples², see `signals.smoothing`; `repeats`: the time, s, after which it repeats itself to a
    count, or zero; `polynomial`: the half-width, in samples, of the local polynomial that the
    velocity is derived by, zero where it is recorded.
    """

    recording: Recording
    padded: Recording
    smoothed: float
    repeats: float = 0.0
    polynomial: int = 0

    def on_host(self) -> Recording:
        """The recording with its velocity, without channels, as arrays of numpy, `(N,)`."""
        count = self.recording.num_samples
        return jax.tree.map(lambda values: np.asarray(values)[:count], self.padded)

    def forced(self, force: Any) -> "Motion":
        """The same motion with another force, N, `(N,)`."""
        values = np.asarray(force)
        extra = self.padded.num_samples - len(values)
        longer = dataclasses.replace(self.padded, force=np.pad(values, (0, extra), mode="edge"))
        other = dataclasses.replace(self.recording, force=jnp.asarray(force))
        return self._replace(recording=other, padded=longer)


def motion_of(recording: "Recording | Motion") -> Motion:
    """The motion of a recording by its position, where it has one.

    A recorded velocity is late by its filter, which would look like a delay of the force. A
    position that is its integral says nothing else.
    """
    if isinstance(recording, Motion):
        return recording
    return derived(from_position(recording))


def from_position(recording: Recording) -> Recording:
    """A recording without its velocity, where it has a position to derive one from."""
    if recording.position is None or recording.position_every == 0:
        return recording
    return dataclasses.replace(recording, velocity=None)


def derived(recording: Recording, narrower: float = 1.0) -> Motion:
    """The motion of a recording by its velocity, where it has one; else by a local polynomial of
    the width that tells it best, or of so much of that.
    """
    # The name and the number of segments would be compiled in, and so would names of channels.
    bare = dataclasses.replace(
        recording, source="", sha256="", num_segments=1, position_every=1, channels={},
        mask=moves(recording),
    )  # fmt: skip
    padded = pad(bare, padded_length(recording.num_samples))
    smoothed, polynomial = 0.0, 0
    if padded.velocity is None:
        choice = signals.choose(padded)
        polynomial = max(1, round(narrower * choice.half_width))
        choice = choice._replace(half_width=polynomial)
        padded, smoothed = signals.prepare(padded, choice), signals.smoothing(choice)
    mask = np.zeros(padded.num_samples, bool)
    mask[: recording.num_samples] = np.asarray(recording.mask)
    padded = dataclasses.replace(padded, mask=mask)
    return Motion(recording, padded, smoothed, repeated_after(recording), polynomial)


def moves(recording: Recording) -> np.ndarray:
    """Where the motion is known, `(N,)`: also where a simulator's force alone says nothing."""
    mask, masked = np.asarray(recording.mask), recording.channels.get(KNOWN_MASKED)
    return mask if masked is None else mask | (np.asarray(masked) > 0)


def padded_length(count: int) -> int:
    """The next power of two, or three quarters of it, so that few programs are compiled."""
    octave = max(256, 1 << (count - 1).bit_length())
    return octave if count > octave * 3 // 4 else octave * 3 // 4
