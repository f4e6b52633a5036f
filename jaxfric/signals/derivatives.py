"""Derivatives of a recorded signal by local polynomials, on the host."""

import numpy as np

from ..data.excerpt import MOST
from ..data.recording import Recording
from .polynomial import BLOCKS, DEGREES, HALF_WIDTHS, weights
from .sampled import SampledSignal, local

# Samples in one piece of work on an irregular clock: its windows stay within some 30 MB.
PIECE = 2**21


def derivative(
    recording: Recording,
    signal: np.ndarray,
    half_width: int,
    degree: int = DEGREES[0],
    order: int = 1,
    step: float | None = None,
) -> np.ndarray:
    """Zero-phase smoothing derivative of a signal by local polynomials, shape `(N,)`.

    At every sample a polynomial is fitted to the valid samples of its segment nearer than the
    half-width, weighted by (1 − τ²)⁴. Where the clock is even that is a convolution.

    **Arguments:** `signal`, `(N,)`; `half_width`, in samples of the typical interval; `degree` of
    the polynomial; `order`, 1 or 2; `step`, the typical interval, s, by default
    the recording's.

    **Returns:** the signal's unit per s (per s²); zero where too few samples are near.
    """
    log = SampledSignal.of(recording, signal, step)
    block = next((b for b in (1, *BLOCKS) if half_width <= b * HALF_WIDTHS[-1]), BLOCKS[-1])
    if block == 1:
        return _piecewise(log, half_width, degree, order)
    return _in_blocks(log, block, half_width, degree, order)


def part_of(recording: Recording, own: slice, reach: int) -> slice:
    """The samples `own` of a recording and as many on either side, of which the derivatives are
    those of the whole: what is averaged in blocks is so from the start of each segment.
    """
    stop, first = min(own.stop + reach, recording.num_samples), own.start - reach + BLOCKS[-1]
    if first <= 0:
        return slice(0, stop)
    mask, segment = np.asarray(recording.mask), np.asarray(recording.segment)
    begins = int(np.searchsorted(segment, segment[first]))
    over = np.count_nonzero(mask[begins:first]) % BLOCKS[-1]
    while over:
        first -= 1
        over -= int(mask[first])
    return slice(first, stop)


def _piecewise(log: SampledSignal, half_width: int, degree: int, order: int) -> np.ndarray:
    """[`_everywhere`][], of a long record in pieces that reach into their neighbours."""
    count, reach = len(log.signal), half_width + 1
    if count <= MOST:
        return _everywhere(log, half_width, degree, order)
    out = np.empty(count)
    for start in range(0, count, MOST):
        first, stop = max(0, start - reach), min(start + MOST, count)
        found = _everywhere(log.part(first, stop + reach), half_width, degree, order)
        out[start:stop] = found[start - first : stop - first]
    return out


def _everywhere(log: SampledSignal, half_width: int, degree: int, order: int) -> np.ndarray:
    whole = log.whole(half_width)
    out = np.zeros(len(log.signal))
    if len(whole):
        level = np.mean(log.signal[log.valid])
        shape = weights(half_width, degree, order) / log.step**order
        out[whole] = np.convolve(log.signal - level, shape[::-1], "valid")[whole - half_width]
    others = np.ones(len(out), bool)
    others[whole] = False
    index = np.flatnonzero(others & log.valid)
    for piece in np.array_split(index, max(1, -(-len(index) * (2 * half_width + 1) // PIECE))):
        at, shape = local(log, piece, half_width, degree, order)
        out[piece] = np.sum(shape * (log.signal[at] - log.signal[piece][:, None]), axis=1)
    return out


def _in_blocks(
    log: SampledSignal, block: int, half_width: int, degree: int, order: int
) -> np.ndarray:
    """The derivative of the means of blocks, which hold all that so wide a polynomial lets pass,
    and between them a straight line.
    """
    every = bool(log.valid.all())
    inside = slice(None) if every else log.valid
    segment = log.segment[inside]
    borders = [0, *(np.flatnonzero(np.diff(segment)) + 1).tolist(), len(segment)]
    spans = [slice(*pair) for pair in zip(borders[:-1], borders[1:], strict=True)]
    starts = [np.arange(own.start, own.stop, block) for own in spans]
    start = np.concatenate(starts)
    count = np.diff(start, append=len(segment))
    time, signal = (np.add.reduceat(x[inside], start) / count for x in (log.time, log.signal))
    coarse = SampledSignal.on(
        time, signal, np.ones(len(time), bool), segment[start], block * log.step
    )
    found = _piecewise(coarse, -(-half_width // block), degree, order)
    out = np.zeros(len(log.signal))
    at = log.time[inside]
    slopes, done = out if every else np.empty(len(at)), 0
    for own, blocks in zip(spans, starts, strict=True):
        its = slice(done, done + len(blocks))
        for first in range(own.start, own.stop, MOST):
            piece = slice(first, min(first + MOST, own.stop))
            slopes[piece] = _straight(at[piece], time[its], found[its])
        done += len(blocks)
    if not every:
        out[inside] = slopes
    return out


def _straight(at: np.ndarray, places: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Linear interpolation that goes on straight beyond the ends."""
    if len(places) < 2:
        return np.full(len(at), values[0])
    left = np.clip(np.searchsorted(places, at) - 1, 0, len(places) - 2)
    slope = (values[left + 1] - values[left]) / (places[left + 1] - places[left])
    return values[left] + slope * (at - places[left])
