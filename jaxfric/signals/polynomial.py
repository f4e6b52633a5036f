"""Derivatives of a recorded signal by local polynomials, their width chosen from the record itself.

On the host, in numpy: done once a recording, nothing is compiled. Inside `jax.jit` the local
parabola of [`smoothing`][jaxfric.signals.smoothing] takes its place.
"""

from functools import lru_cache
from math import comb
from typing import NamedTuple

import numpy as np

from ..data.excerpt import MOST, cut, excerpt, pieces
from ..data.recording import Recording
from .clock import host_interval
from .kernels import kernel

# Half-widths, in samples, of the ladder: steps of about √2, which change the noise of a derivative
# by √2³ = 2.8. From the third octave on the signal may be averaged in blocks first.
HALF_WIDTHS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
WIDE = (128, 192, 256)
BLOCKS = (3, 9, 27)
# Degrees of the polynomial. A higher one takes less off the motion at the same width: at six
# samples a cycle the narrowest of degree six errs by 1 %, that of degree two by 17 %.
DEGREES = (2, 4, 6)
# Centres at which the candidates are compared: the mean square of 512 values is known to 6 %.
CENTRES = 512
# Counts of an encoder are no white noise where the motion is slow: between two widths they may
# differ by twice what white noise of their size would, that is, four times in power.
COLOURED = 4.0
# A clock whose steps differ by more than this is irregular: what it shifts the samples by, times
# the speed, would be an error of the slope of the same size.
EVEN = 1e-3
# The bias of a degree is at most ten times what the next degree takes off it.
SLOWEST = 0.9
# The mean squares at neighbouring centres are alike, so that risks are known to a quarter; of those
# within it the narrowest takes least off the motion.
ALIKE = 1.25
# Beyond this the square of a number is none.
LARGEST = 1e150
# Centres at least: their mean square is known to a quarter.
FEWEST = 32
# Shorter even stretches say little about the noise: two lengths of an eighth difference.
SHORT = 16
# A sample of less weight than this is none: at 0.95 of the half-width.
NEGLIGIBLE = 8e-5
# Up to so many weights a convolution is as quick by products.
DIRECT = 128
# Samples in one piece of work on an irregular clock: its windows stay within some 30 MB.
PIECE = 2**21


class Choice(NamedTuple):
    """A local polynomial: its degree, its half-width in samples, and the error that it makes.

    `error`: root mean square of bias and noise of the derivative, in its own unit; `bias`: that of
    the bias alone; `noise`: standard deviation of the signal's white noise, in the signal's unit.
    """

    degree: int
    half_width: int
    error: float = float("nan")
    bias: float = float("nan")
    noise: float = float("nan")


def weights(half_width: float, degree: int, order: int = 1, reach: int | None = None) -> np.ndarray:
    """Weights of the derivative at the middle of an even clock of one second, `(2 reach + 1,)`.

    Least squares of a polynomial, weighted by (1 − τ²)⁴ with τ = 1 half a sample beyond the
    half-width (Savitzky & Golay 1964, with a tapered weight). `order`: 1 or 2.
    """
    reach = int(half_width) if reach is None else reach
    tau = np.arange(-reach, reach + 1) / (half_width + 0.5)
    weight = kernel(tau)
    # By symmetry the powers of the other parity have no part in it.
    powers = tau[:, None] ** np.arange(order % 2, degree + 1, 2)
    wanted = np.zeros(powers.shape[1])
    wanted[order // 2] = order  # 1! and 2!
    solved = np.linalg.solve(powers.T @ (weight[:, None] * powers), wanted)
    return weight * (powers @ solved) / (half_width + 0.5) ** order


def white_noise(signal: np.ndarray) -> float:
    """Standard deviation of the white part of a signal, rounding to counts included.

    From the mean magnitude of fourth differences (von Neumann's idea: a smooth signal has none),
    where the signal moves, since at rest an encoder shows no noise. White noise gives the same by
    eighth differences and a staircase 0.6 of it, while a motion of few samples a cycle gives less:
    where it is under half, the motion is what the fourth differences see.
    """
    fourth, eighth = (_by_differences(signal, order) for order in (4, 8))
    size = eighth if eighth < 0.5 * fourth else fourth
    return max(size, _rounding(signal, size))


def _by_differences(signal: np.ndarray, order: int) -> float:
    if len(signal) <= order:
        return 0.0
    magnitude = np.abs(np.diff(signal, order))[signal[order:] != signal[:-order]]
    # E|z| = σ √(2/π); the squared weights of the difference add to C(2n, n).
    mean = np.sum(magnitude) / max(len(magnitude), 1)
    return float(mean * np.sqrt(np.pi / 2 / comb(2 * order, order)))


def _rounding(signal: np.ndarray, seen: float) -> float:
    """The noise of rounding to counts, count/√12, as large as white noise would have to be where
    a count lasts for several samples; zero where the signal is not counted.

    `seen`: the noise by differences. Signals whose steps are multiples of one by construction
    (a ramp of the set-point) have much less of it than counts of that size would make.
    """
    changes = np.flatnonzero(np.diff(signal))
    if len(changes) < SHORT:
        return 0.0
    moved = np.abs(np.diff(signal)[changes])
    count = float(np.min(moved))
    if count < np.finfo(float).eps * float(np.max(moved)):
        return 0.0
    # Of uncounted steps one in a hundred is this near a whole number of counts by chance.
    off = np.abs(moved / count - np.rint(moved / count))
    exact = np.finfo(float).eps * np.max(np.abs(signal)) < 1e-4 * count
    if not exact or seen < 0.3 * count / np.sqrt(12) or np.quantile(off, 0.9) > 5e-3:
        return 0.0
    return count * float(np.sqrt(np.median(np.diff(changes)) / 12))


class _Log(NamedTuple):
    """A signal on its clock, on the host.

    `time`, `signal`, `(N,)`; `valid` samples; `segment`; `step`, the typical interval, s; `even`:
    running count of the places where the clock is not even, `(N,)`; `longest`: samples in the
    longest stretch of one segment.
    """

    time: np.ndarray
    signal: np.ndarray
    valid: np.ndarray
    segment: np.ndarray
    step: float
    even: np.ndarray
    longest: int

    @classmethod
    def of(cls, recording: Recording, signal) -> "_Log":
        time, segment = np.asarray(recording.time, float), np.asarray(recording.segment)
        signal, valid = np.asarray(signal, float), np.asarray(recording.mask)
        return cls.on(time, signal, valid, segment, host_interval(recording))

    @classmethod
    def on(cls, time, signal, valid, segment, step: float) -> "_Log":
        valid = valid & np.isfinite(signal) & np.isfinite(time)
        signal = signal if valid.all() else np.where(valid, signal, 0.0)
        together = valid[1:] & valid[:-1] & (segment[1:] == segment[:-1])
        with np.errstate(invalid="ignore"):
            off = np.diff(time)  # in place: of a long record each copy counts
            off /= step
            off -= 1
            regular = together & (np.abs(off, out=off) <= EVEN)
        even = np.zeros(len(time), np.int32)
        np.cumsum(~regular, dtype=np.int32, out=even[1:])
        longest = int(np.max(np.bincount(segment[valid]), initial=0)) if valid.any() else 0
        return cls(time, signal, valid, segment, step, even, longest)

    def trimmed(self) -> "_Log":
        """The log up to its last valid sample: what it is padded with decides nothing."""
        return self.part(0, int(np.max(np.flatnonzero(self.valid), initial=-1)) + 1)

    def part(self, start: int, stop: int) -> "_Log":
        """The log from one sample to before another."""
        time, signal, valid, segment, even = (
            x[start:stop] for x in (self.time, self.signal, self.valid, self.segment, self.even)
        )
        return _Log(time, signal, valid, segment, self.step, even, self.longest)

    def whole(self, reach: int) -> np.ndarray:
        """The samples with an even clock so many samples each way, as indices."""
        if len(self.time) <= 2 * reach:
            return np.zeros(0, int)
        return np.flatnonzero(self.even[2 * reach :] == self.even[: -2 * reach]) + reach

    def centres(self, reach: int) -> np.ndarray:
        """Some of the [`whole`][] samples, evenly spread over those where the signal moves."""
        whole, near = self.whole(reach), min(reach, 8)
        return _some(whole[self.signal[whole + near] != self.signal[whole - near]])

    def windows(self, centres: np.ndarray, block: int, reach: int) -> np.ndarray:
        """Means of blocks around each centre less its own value, `(M, 2 reach + 1)`."""
        at = centres[:, None] + block * np.arange(-reach, reach + 1)[None, :]
        base = self.signal[centres][:, None]
        if block == 1:
            return self.signal[at] - base
        total = np.concatenate([[0.0], np.cumsum(self.signal - self.signal[centres[0]])])
        low = at - block // 2
        return (total[low + block] - total[low]) / block + self.signal[centres[0]] - base

    def noise(self) -> float:
        """[`white_noise`][] of the longest even stretches; beside a local quartic without any."""
        parts = np.split(self.signal, np.flatnonzero(np.diff(self.even)) + 1)
        parts = [part for part in parts if len(part) >= SHORT]
        if parts:
            sizes = np.array([white_noise(part) for part in parts])
            return float(np.average(sizes, weights=[len(part) for part in parts]))
        index = _some(np.flatnonzero(self.valid))
        if not len(index):
            return 0.0
        at, shape = _local(self, index, 4, 4, 0)
        left = self.signal[index] - np.sum(shape * self.signal[at], axis=1)
        rough = 1 - 2 * shape[:, shape.shape[1] // 2] + np.sum(shape**2, axis=1)
        used = rough > 0.05
        size = np.mean(np.abs(left[used]) / np.sqrt(rough[used])) if used.any() else 0.0
        return float(size * np.sqrt(np.pi / 2))

    def exact_slopes(self, keys, reach: int, order: int):
        """Slopes at some centres of an uneven clock, `(M, C)`, and their noise as in [`_Level`][].

        `None` where no centre has all of its neighbours.
        """
        inside = np.flatnonzero(self.valid)
        inside = inside[(inside >= reach) & (inside < len(self.time) - reach)]
        ends = self.segment[inside - reach] == self.segment[inside + reach]
        index = _some(inside[ends])[:: CENTRES // 128]
        if not len(index):
            return None
        shapes = np.zeros((len(keys), len(index), 2 * reach + 1))
        slopes = np.zeros((len(index), len(keys)))
        for i, (degree, width) in enumerate(keys):
            at, shape = _local(self, index, width, degree, order)
            shapes[i, :, reach - width : reach + width + 1] = shape * self.step**order
            near = self.signal[at] - self.signal[index][:, None]
            slopes[:, i] = np.sum(shape * near, axis=1) * self.step**order
        rough = np.mean(np.sum(shapes**2, axis=2), axis=1)
        return slopes, rough, lambda p: np.mean(np.sum((shapes - shapes[p]) ** 2, axis=2), axis=1)


def _some(index: np.ndarray) -> np.ndarray:
    """So many of the indices as there are [`CENTRES`][], evenly spread."""
    if len(index) <= CENTRES:
        return index
    return index[np.linspace(0, len(index) - 1, CENTRES).round().astype(int)]


def _local(
    log: _Log, index: np.ndarray, half_width: int, degree: int, order: int
) -> tuple[np.ndarray, np.ndarray]:
    """The samples around each index, and the weights of the derivative there on their own clock,
    both `(M, 2 half_width + 1)`.

    Near an end, where one side has less than half of its samples, the degree is less by two: a
    polynomial seen from one side trades its bias for noise. Where fewer samples are near than it
    has coefficients, they decide.
    """
    offset = np.arange(-half_width, half_width + 1)
    wanted = index[:, None] + offset[None, :]
    at = np.clip(wanted, 0, len(log.time) - 1)
    span = (half_width + 0.5) * log.step
    tau = (log.time[at] - log.time[index][:, None]) / span
    near = log.valid[at] & (log.segment[at] == log.segment[index][:, None]) & (at == wanted)
    weight = np.where(near, kernel(tau), 0.0)
    tau = np.where(near, tau, 0.0)
    side = np.minimum(near[:, :half_width].sum(1), near[:, half_width + 1 :].sum(1))
    degrees = np.where(side < half_width / 2, max(2, degree - 2), degree)
    degrees = np.minimum(degrees, np.count_nonzero(weight > NEGLIGIBLE, axis=1) - 1)
    out = np.zeros_like(weight)
    for p in np.unique(degrees[degrees >= order]):
        rows = degrees == p
        out[rows] = _solved(weight[rows], tau[rows], int(p), order) / span**order
    return at, out


def _solved(weight: np.ndarray, tau: np.ndarray, degree: int, order: int) -> np.ndarray:
    """Weights of a derivative at τ = 0 by weighted least squares of a polynomial, row by row."""
    moments, power = [], weight
    for _ in range(2 * degree + 1):
        moments.append(power.sum(axis=1))
        power = power * tau
    matrix = np.stack([np.stack(moments[i : i + degree + 1], 1) for i in range(degree + 1)], 1)
    wanted = np.zeros((len(weight), degree + 1, 1))
    wanted[:, order] = max(1, order)  # 0!, 1!, 2!
    solved = np.linalg.solve(matrix, wanted)[:, :, 0]
    value = np.zeros_like(tau)
    for j in reversed(range(degree + 1)):
        value = value * tau + solved[:, j, None]
    return weight * value


class _Level(NamedTuple):
    """Candidates at common centres: `keys` (degree, half-width in samples), whether each may be
    chosen, the power of the difference to its pilot, by how much its bias exceeds that difference
    (zero where the pilot is of the next degree), and what noise of unit variance has of both: |k|²
    and |k − k_pilot|². All `(C,)`.
    """

    keys: list[tuple[int, int]]
    eligible: np.ndarray
    apart: np.ndarray
    share: np.ndarray
    rough: np.ndarray
    rough_apart: np.ndarray

    def bias(self, noise: float, factor: float) -> np.ndarray:
        """The squared bias of each, beyond `factor` times the power of the noise, `(C,)`."""
        shown = np.maximum(self.apart - factor * noise**2 * self.rough_apart, 0.0)
        share = np.where(self.share > 0, self.share, 1.0)
        # What the next degree still lacks follows from how quickly the degrees approach: at a
        # corner of the velocity hardly, and the difference to the next is but a part of the bias.
        first = np.flatnonzero(self.share == 0)
        for i, here in enumerate(first):
            low, high = (here, first[i + 1]) if i + 1 < len(first) else (first[i - 1], here)
            if low != high and shown[low] > 0:
                share[here] = 1 / (1 - min(np.sqrt(shown[high] / shown[low]), SLOWEST))
        return share**2 * shown


def choose(recording: Recording, signal: np.ndarray | None = None, order: int = 1) -> Choice:
    """The local polynomial whose derivative of a signal is most accurate.

    It minimises an estimate of the mean-square error, bias² + σ² |k|², with k the weights and σ the
    white noise of the signal. The bias of a width shows in the difference to the slope of a pilot
    of half the width (for the narrowest, of the next degree), less the noise of that difference.
    What differs between two narrower widths by more than any noise could is bias of every wider
    one too: two widths that both swallow a motion agree with each other.

    **Arguments:** `signal`, `(N,)`, by default the position; `order` of the derivative, 1 or 2.
    """
    whole = np.asarray(recording.position if signal is None else signal)
    if recording.num_samples > MOST:
        whole = cut(whole, pieces(np.asarray(recording.mask)))
        recording = excerpt(recording)
    log = _Log.of(recording, whole).trimmed()
    noise = min(log.noise(), LARGEST)
    tried: list[tuple[float, float, int, int]] = []
    least = dict.fromkeys(DEGREES, 0.0)  # of the bias² of wider candidates, by degree
    for block, widths in _ladder(log.longest):
        level = _level(log, block, widths, order)
        if level is None:
            continue
        own, sure = (level.bias(noise, factor) for factor in (1.0, COLOURED))
        for i, (degree, width) in enumerate(level.keys):
            if not level.eligible[i]:
                continue
            bias = max(own[i], least[degree])
            least[degree] = max(least[degree], sure[i])
            tried.append((bias + noise**2 * level.rough[i], bias, degree, width))
    if not tried:
        return Choice(DEGREES[0], HALF_WIDTHS[0], noise=noise)
    risk = min(tried)[0]
    narrow = min(trial[3] for trial in tried if trial[0] <= ALIKE * risk)
    risk, bias, degree, width = min(trial for trial in tried if trial[3] == narrow)
    scale = log.step**order
    return Choice(degree, width, float(np.sqrt(risk)) / scale, float(np.sqrt(bias)) / scale, noise)


def _ladder(longest: int) -> list[tuple[int, list[int]]]:
    """Blocks, and half-widths in blocks, for a run of so many samples: an eighth of it at most."""
    most = max(HALF_WIDTHS[0], longest // 8)
    levels = [(1, [k for k in HALF_WIDTHS if k <= most])]
    levels += [(b, [k for k in (64, 96, *WIDE) if k * b <= most]) for b in BLOCKS]
    return [(b, ks) for b, ks in levels if b == 1 or len(ks) > 2]


class _Shapes(NamedTuple):
    """The weights of candidates on an even clock, and what follows from them alone.

    `shapes`, `(K, C)`; `pilot`, the index of each one's pilot; the others as in [`_Level`][].
    """

    keys: list[tuple[int, int]]
    shapes: np.ndarray
    pilot: np.ndarray
    share: np.ndarray
    rough: np.ndarray
    apart: np.ndarray


@lru_cache(maxsize=64)
def _shapes(widths: tuple[int, ...], order: int) -> _Shapes:
    keys = [(d, k) for d in (*DEGREES, DEGREES[-1] + 2) for k in widths if 2 * k >= d]
    shapes = np.stack([weights(k, d, order, max(widths)) for d, k in keys], axis=1)
    moments = [_moment(shape, d, order) for shape, (d, _) in zip(shapes.T, keys, strict=True)]
    pilot = np.array([_pilot(key, keys) for key in keys])
    same = np.array([keys[p][0] == d for p, (d, _) in zip(pilot, keys, strict=True)])
    ratio = np.abs(np.array(moments)[pilot] / np.array(moments))
    share = np.where(same & (ratio < 1), 1 / (1 - np.where(ratio < 1, ratio, 0.0)), 0.0)
    rough, apart = np.sum(shapes**2, axis=0), np.sum((shapes - shapes[:, pilot]) ** 2, axis=0)
    return _Shapes(keys, shapes, pilot, share, rough, apart)


def _level(log: "_Log", block: int, widths: list[int], order: int) -> _Level | None:
    """The candidates of one block size, `None` where no window of the widest is whole."""
    fitting = _fitting(log, block, widths)
    uneven = not fitting
    if block > 1 and not set(fitting) & set(WIDE):
        return None
    widths = fitting or widths
    keys, shapes, pilot, share, rough, apart = _shapes(tuple(widths), order)
    reach = max(widths)
    if not uneven:
        centres = log.centres(block * reach + block // 2)
        slopes = log.windows(centres, block, reach) @ shapes
        # A block's mean has less noise.
        rough, apart = rough / block, apart / block
    else:
        found = log.exact_slopes(keys, reach, order)
        if found is None:
            return None
        slopes, rough, apart = found[0], found[1], found[2](pilot)
    power = np.mean((slopes - slopes[:, pilot]) ** 2, axis=0)
    scale = block**order
    offered = np.array([d <= DEGREES[-1] and (block == 1 or k >= WIDE[0]) for d, k in keys])
    return _Level(
        [(d, k * block) for d, k in keys],
        offered, power / scale**2, share, rough / scale**2, apart / scale**2,
    )  # fmt: skip


def _fitting(log: "_Log", block: int, widths: list[int]) -> list[int]:
    """Those of the widths that most samples have all their neighbours for, between the gaps."""
    half = np.count_nonzero(log.valid) // 2
    for count in range(len(widths), 0, -1):
        reach = block * widths[count - 1] + block // 2
        if len(log.whole(reach)) >= half and len(log.centres(reach)) >= FEWEST:
            return widths[:count]
    return []


def _moment(shape: np.ndarray, degree: int, order: int) -> float:
    """The lowest moment that the weights of that degree do not annul: that of their bias."""
    offset = np.arange(len(shape)) - len(shape) // 2
    return float(shape @ (offset / (len(shape) // 2)) ** (degree + order))


def _pilot(key: tuple[int, int], keys: list[tuple[int, int]]) -> int:
    """The candidate by which the bias of another shows: half as wide, or of the next degree."""
    degree, width = key
    half = [k for d, k in keys if d == degree and 2 * k <= width]
    if half:
        return keys.index((degree, max(half)))
    above = [k for d, k in keys if d == degree + 2]
    return keys.index((degree + 2, min(above))) if above else keys.index(key)


def smoothing(choice: Choice) -> float:
    """By how much a chosen derivative smooths the velocity, in samples².

    The velocity less that times its second difference is what was smoothed, to first order: a
    sixth of the third moment of the weights, which degrees above two annul.
    """
    if choice.degree > DEGREES[0]:
        return 0.0
    offsets = np.arange(-choice.half_width, choice.half_width + 1.0)
    return float(weights(choice.half_width, choice.degree) @ offsets**3) / 6


def derivative(
    recording: Recording,
    signal: np.ndarray,
    half_width: int,
    degree: int = DEGREES[0],
    order: int = 1,
) -> np.ndarray:
    """Zero-phase smoothing derivative of a signal by local polynomials, shape `(N,)`.

    At every sample a polynomial is fitted to the valid samples of its segment nearer than the
    half-width, weighted by (1 − τ²)⁴. Where the clock is even that is a convolution.

    **Arguments:** `signal`, `(N,)`; `half_width`, in samples of the typical interval; `degree` of
    the polynomial; `order`, 1 or 2.

    **Returns:** the signal's unit per s (per s²); zero where too few samples are near.
    """
    log = _Log.of(recording, signal)
    block = next((b for b in (1, *BLOCKS) if half_width <= b * HALF_WIDTHS[-1]), BLOCKS[-1])
    if block == 1:
        return _piecewise(log, half_width, degree, order)
    return _in_blocks(log, block, half_width, degree, order)


def _piecewise(log: _Log, half_width: int, degree: int, order: int) -> np.ndarray:
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


def _everywhere(log: _Log, half_width: int, degree: int, order: int) -> np.ndarray:
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
        at, shape = _local(log, piece, half_width, degree, order)
        out[piece] = np.sum(shape * (log.signal[at] - log.signal[piece][:, None]), axis=1)
    return out


def _in_blocks(log: _Log, block: int, half_width: int, degree: int, order: int) -> np.ndarray:
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
    coarse = _Log.on(time, signal, np.ones(len(time), bool), segment[start], block * log.step)
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
