"""A signal on its clock, on the host, and local polynomials around its samples."""

from typing import NamedTuple, Self

import numpy as np

from ..data.recording import Recording
from .clock import host_interval
from .kernels import kernel
from .noise import SHORT, counted_noise

# Centres at which the candidates are compared: the mean square of 512 values is known to 6 %.
CENTRES = 512
# Numbers in the windows around the centres of an uneven clock, each with weights of its own.
NUMBERS = 2**16
# A clock whose steps differ by more than this is irregular: what it shifts the samples by, times
# the speed, would be an error of the slope of the same size.
EVEN = 1e-3
# A sample of less weight than this is none: at 0.95 of the half-width.
NEGLIGIBLE = 8e-5


class SampledSignal(NamedTuple):
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
    def of(cls, recording: Recording, signal, step: float | None = None) -> Self:
        """A signal of a recording, `(N,)`; `step`, the typical interval, s, where it is known."""
        time, segment = np.asarray(recording.time, float), np.asarray(recording.segment)
        signal, valid = np.asarray(signal, float), np.asarray(recording.mask)
        step = host_interval(recording) if step is None else step
        return cls.on(time, signal, valid, segment, step)

    @classmethod
    def on(cls, time, signal, valid, segment, step: float) -> Self:
        """A signal by its parts, each `(N,)`."""
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

    def trimmed(self) -> Self:
        """The log up to its last valid sample: what it is padded with decides nothing."""
        return self.part(0, int(np.max(np.flatnonzero(self.valid), initial=-1)) + 1)

    def part(self, start: int, stop: int) -> Self:
        """The log from one sample to before another."""
        time, signal, valid, segment, even = (
            x[start:stop] for x in (self.time, self.signal, self.valid, self.segment, self.even)
        )
        return type(self)(time, signal, valid, segment, self.step, even, self.longest)

    def whole(self, reach: int) -> np.ndarray:
        """The samples with an even clock so many samples each way, as indices."""
        if len(self.time) <= 2 * reach:
            return np.zeros(0, int)
        return np.flatnonzero(self.even[2 * reach :] == self.even[: -2 * reach]) + reach

    def centres(self, reach: int, most: int = CENTRES) -> np.ndarray:
        """Some of the [`whole`][] samples, evenly spread over those where the signal moves."""
        whole, near = self.whole(reach), min(reach, 8)
        return _some(whole[self.signal[whole + near] != self.signal[whole - near]], most)

    def windows(self, centres: np.ndarray, block: int, reach: int) -> np.ndarray:
        """Means of blocks around each centre less its own value, `(M, 2 reach + 1)`."""
        values, low = self.signal, centres - block * reach
        if block > 1:
            total = np.concatenate([[0.0], np.cumsum(values - values[centres[0]])])
            values = (total[block:] - total[:-block]) / block + values[centres[0]]
            low = low - block // 2
        around = np.lib.stride_tricks.sliding_window_view(values, 2 * block * reach + 1)
        return around[low, ::block] - self.signal[centres][:, None]

    def noise(self) -> float:
        """[`counted_noise`][] of the longest even stretches; beside a local quartic without any."""
        borders = np.concatenate([[0], np.flatnonzero(np.diff(self.even)) + 1, [len(self.signal)]])
        long = np.flatnonzero(np.diff(borders) >= SHORT)
        parts = [self.signal[borders[i] : borders[i + 1]] for i in long]
        if parts:
            sizes = np.array([counted_noise(part) for part in parts])
            return float(np.average(sizes, weights=[len(part) for part in parts]))
        index = _some(np.flatnonzero(self.valid))
        if not len(index):
            return 0.0
        at, shape = local(self, index, 4, 4, 0)
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
        index = _some(inside[ends], NUMBERS // (2 * reach + 1))
        if not len(index):
            return None
        shapes = np.zeros((len(keys), len(index), 2 * reach + 1))
        slopes = np.zeros((len(index), len(keys)))
        for i, (degree, width) in enumerate(keys):
            at, shape = local(self, index, width, degree, order)
            shapes[i, :, reach - width : reach + width + 1] = shape * self.step**order
            near = self.signal[at] - self.signal[index][:, None]
            slopes[:, i] = np.sum(shape * near, axis=1) * self.step**order
        rough = np.mean(np.sum(shapes**2, axis=2), axis=1)
        return slopes, rough, lambda p: np.mean(np.sum((shapes - shapes[p]) ** 2, axis=2), axis=1)


def _some(index: np.ndarray, most: int = CENTRES) -> np.ndarray:
    """So many of the indices, evenly spread."""
    if len(index) <= most:
        return index
    return index[np.linspace(0, len(index) - 1, most).round().astype(int)]


def local(
    log: SampledSignal, index: np.ndarray, half_width: int, degree: int, order: int
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
    if not log.step > 0:  # a clock that stands
        return at, np.zeros(at.shape)
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
