"""Pieces of a long recording: what is fitted is fitted to so many samples at most."""

import dataclasses
from collections.abc import Sequence

import jax
import numpy as np

from .recording import Recording

# Four minutes at 1 kHz. The intervals of parameters are then far below what friction changes by in
# an hour, while memory and time would grow with each further sample.
MOST = 1 << 18
# Up to so many times that nothing is cut: a gap costs more than the rest is worth.
SPARE = 1.5
# What drifts over the recording is seen, and each piece holds whole strokes.
PIECES = 16


def excerpt(recording: Recording, most: int = MOST) -> Recording:
    """Sixteen pieces of a recording, evenly spread over its valid samples, each a segment (or as
    many as it holds); a recording of hardly more than `most` samples as it is.

    **Arguments:** `recording`, signals of shape `(N,)`, not traced; `most`, of its samples.
    """
    spread = pieces(np.asarray(recording.mask), most)
    if len(spread) == 1:
        return recording
    some = jax.tree.map(lambda values: cut(np.asarray(values), spread), recording)
    begins = np.zeros(len(some.time), bool)
    begins[np.cumsum([part.stop - part.start for part in spread[:-1]])] = True
    begins[1:] |= np.diff(some.segment) != 0
    segment = np.cumsum(begins, dtype=np.int32)
    return dataclasses.replace(some, segment=segment, num_segments=int(segment[-1]) + 1)


def pieces(mask: np.ndarray, most: int = MOST) -> list[slice]:
    """Where those pieces lie, in order; `mask`: which samples are valid, `(N,)`.

    One, of all samples, where hardly more than `most` of them are left without those at the end
    that are not valid.
    """
    count = len(mask)
    if count and not mask[-1]:  # what a recording is padded with decides nothing
        count = int(np.max(np.flatnonzero(mask), initial=-1)) + 1
    if count <= SPARE * most:
        return [slice(0, len(mask))]
    length = most // PIECES
    starts = np.linspace(0, count - length, PIECES).round().astype(int)
    return [slice(start, start + length) for start in starts.tolist()]


def cut(values: np.ndarray, spread: Sequence[slice]) -> np.ndarray:
    """The values in some pieces, one after the other."""
    return np.concatenate([values[part] for part in spread])
