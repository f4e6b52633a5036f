"""Spectral lines over position or time: their columns, and the frequencies to try.

A grid of frequencies that resolves every line of a long record takes as many columns as there are
rows. So a tone faster than those on the grid is found by the strongest line of the residual's
spectrum: an ordinate of noise over the mean of its neighbours has an exponential distribution
(Fisher 1929).
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..signals import kernel
from ..terms.effect import RECURS, SIDE
from .evidence import Evidence
from .regression import Fit
from .significance import LEVEL

# Four frequencies a resolution cell (one over the range): the peak then lies within an eighth of a
# cell of one of them, where the loss is under 3 % of its power.
OVERSAMPLING = 4
# Bounds the cost on very long records: 512 periods in the range.
MOST_LINES = 2048


class SpectralLines(NamedTuple):
    """Waves over a coordinate at the rows, without the nodes: sine and cosine, damped.

    Over a kernel the coordinate is taken as a straight line; averaging then multiplies a wave by
    the kernel's Fourier transform at 2πf·rate·reach. `coordinate`: "position" or "time";
    `inverse`: whether the parameter is a period; `factor`: what they are multiplied by, a channel,
    in the middle of a row, or `SIDE`, the direction; `harmonics`.
    """

    coordinate: str
    inverse: bool
    factor: str = ""
    harmonics: int = 1

    def columns(self, evidence: Evidence, parameters: np.ndarray) -> np.ndarray:
        """Columns at each frequency or period, `(G, J, 2 harmonics)`."""
        frequency = 1 / parameters if self.inverse else parameters
        value = np.asarray(getattr(evidence.motion, self.coordinate))[evidence.centre]
        value = value - value.mean()
        rate = np.asarray(evidence.motion.velocity)[evidence.centre]
        rate = rate if self.coordinate == "position" else np.ones_like(rate)
        swept = np.abs(2 * np.pi * evidence.reach * rate).astype(np.float32)
        factor = self._factor(evidence)
        columns = np.empty((len(parameters), 2 * self.harmonics, len(value)), np.float32)
        for n in range(1, self.harmonics + 1):
            for some in range(0, len(parameters), AT_ONCE):
                waves = n * frequency[some : some + AT_ONCE, None]
                turned = angle(waves * value)
                at = np.minimum(waves.astype(np.float32) * (20 * swept) + 0.5, len(_GAINS) - 1)
                gain = _GAINS[at.astype(np.int32)] * factor
                out = columns[some : some + AT_ONCE, 2 * n - 2 : 2 * n]
                np.multiply(gain, np.sin(turned), out=out[:, 0])
                np.multiply(gain, np.cos(turned), out=out[:, 1])
        return columns.transpose(0, 2, 1)

    def _factor(self, evidence: Evidence):
        if not self.factor:
            return np.float32(1)
        if self.factor == SIDE:
            return evidence.side.astype(np.float32)
        values = np.asarray(evidence.motion.channels[self.factor])[evidence.centre]
        return (values / max(float(np.max(np.abs(values))), 1e-300)).astype(np.float32)


# Waves whose numbers stay in the cache while they are worked on.
AT_ONCE = 8


def angle(turns: np.ndarray) -> np.ndarray:
    """Turns as angles, without whole turns, so that single precision is enough for their sines."""
    return np.float32(2 * np.pi) * (turns - np.round(turns)).astype(np.float32)


def _transform():
    """∫ φ(τ) cos(zτ) dτ / ∫ φ dτ of the kernel φ = (1 − τ²)⁴, for z up to 30 (below 1e-4 there)."""
    tau = np.linspace(-1.0, 1.0, 1001)
    weight = kernel(tau)
    turns = np.linspace(0.0, 30.0, 601)
    gains = np.cos(turns[:, None] * tau[None, :]) @ weight / np.sum(weight)
    gains[-1] = 0.0
    return gains.astype(np.float32)


# Tabulated in steps of 1/20, half of which shifts a gain by less than 0.006.
_GAINS = _transform()


def line_frequencies(evidence: Evidence, coordinate: str) -> np.ndarray:
    """Equally spaced frequencies that resolve every line of a coordinate.

    From one period in the range (two in time: fewer are a drift) to where a wave at
    the slow quartile of the speed has half a period in the kernel: shorter ones are averaged away.
    """
    limits = evidence.limits
    top = 0.5 / evidence.reach
    if coordinate == "time":
        span, low = limits.duration, RECURS / limits.duration
    else:
        span = limits.high - limits.low
        speed = np.abs(np.asarray(evidence.motion.velocity)[evidence.centre])
        low, top = 1.0 / span, top / np.quantile(speed, 0.25)
    top = max(top, 2 * low)
    count = int(np.clip(np.ceil(OVERSAMPLING * span * (top - low)), 16, MOST_LINES))
    return np.linspace(low, min(top, low + count / (OVERSAMPLING * span)), count)


# Part of the motion's variance in a tone's resolution cell from which the tone is the motion's own:
# an unrelated one holds two of some thousand values.
OWN = 0.05
# What the motion drives is in all of its tones or, where it is one wave, in that and its multiples.
# A law may favour a tone by three times in amplitude (a square by two), nine times in power, beside
# what the motion has of it. A force that has more of one has a clock of its own.
ITSELF, FAVOUR = 0.5, 9.0
# Resolution cells whose median is the noise about a line: thousands would take in the noise's own
# colour, and of a few the line itself is too many.
NEIGHBOURS = 64
# Of the lines of a motion that repeats there are fewer.
FEWER_NEIGHBOURS = 16
# A record with more gaps than this, as a day between two runs, has a clock but no spectrum.
SPARSE = 16
_NONE = np.zeros(0)


def time_frequencies(evidence: Evidence) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Frequencies, Hz, and the part of what is left that a force at each must take, `(G,)` both.

    First the frequencies that the motion does not contain, then those that it contains but need not
    drive.
    """
    tones = line_frequencies(evidence, "time")
    power = shared(tones, evidence)
    own = power >= OWN
    yield tones[~own], np.zeros(len(tones) - np.count_nonzero(own))
    if power.max() >= ITSELF:
        lowest = int(np.argmax(power >= ITSELF))
        wave = tones[lowest + int(np.argmax(power[lowest : lowest + OVERSAMPLING]))]
        own &= np.abs(tones - wave * np.round(tones / wave)) > OVERSAMPLING * np.diff(tones[:2])
    favoured = FAVOUR * power[own]
    yield tones[own], favoured / (1 - power[own] + favoured)


def shared(tones: np.ndarray, evidence: Evidence) -> np.ndarray:
    """The part of the motion's variance in the cell of each tone: the largest of its signals'."""
    motion, rows = evidence.motion, evidence.centre
    time, velocity = np.asarray(motion.time)[rows], np.asarray(motion.velocity)[rows]
    signals = [velocity, np.abs(velocity), evidence.side]
    if motion.position is not None:
        signals.append(np.asarray(motion.position)[rows])
    series = np.stack([signal - signal.mean() for signal in signals])
    series /= np.maximum(np.linalg.norm(series, axis=1), 1e-300)[:, None]
    power = np.empty(len(tones))
    for some in range(0, len(tones), AT_ONCE):
        turned = angle(tones[some : some + AT_ONCE, None] * (time - time[0]))
        both = (series @ np.stack([np.sin(turned), np.cos(turned)]).transpose(0, 2, 1)) ** 2
        power[some : some + AT_ONCE] = np.max(np.sum(both, axis=0), axis=0) * 2 / len(time)
    return power


def fast_tone(evidence: Evidence, current: Fit) -> np.ndarray:
    """Frequencies about the strongest tone above those scanned for, Hz; none if none stands out.

    By the residual's spectrum, up to where it has a period in the kernel's half. A tone beyond
    looks in the rows like one as much below; the nodes, three times as many, tell. `evidence` with
    the predictions of the fit.
    """
    scanned, top = line_frequencies(evidence, "time")[-1], 1 / evidence.reach
    if not evidence.clock or scanned >= top:
        return _NONE
    time = np.asarray(evidence.motion.time)[evidence.centre]
    cell = np.round((time - time[0]) * 2 * top).astype(int)
    if cell[-1] > SPARSE * len(cell):
        return _NONE
    series = np.zeros(OVERSAMPLING * (int(cell[-1]) + 1))
    series[cell] = current.residual
    tones = np.fft.rfftfreq(len(series), 0.5 / top)
    best = standing_out(tones, np.abs(np.fft.rfft(series)) ** 2, scanned, evidence.repeats)
    if best is None:
        return _NONE
    tone = tones[best]
    if shared(np.array([tone]), evidence)[0] >= OWN:
        return _NONE
    steps = (tones[1] - tones[0]) * np.arange(-2, 3)
    found = max([*(tone + steps), *(2 * top - tone + steps)], key=lambda f: _at_nodes(f, evidence))
    return found + steps[(found + steps > top) == (found > top)]


def standing_out(
    tones: np.ndarray, power: np.ndarray, above: float, repeats: float = 0.0
) -> int | None:
    """The number of the ordinate that stands out most of its neighbours, of tones `above` one, Hz;
    `None` where none does by more than chance.

    Where the motion `repeats` after a time, s, all that it drives has its lines at multiples of one
    frequency, the answers to the roundings of the position too. So these are neighbours of each
    other alone: a line among them has to stand out of the others.
    """
    number = np.arange(int(np.searchsorted(tones, above, "right")), len(tones))
    kinds = [(number, OVERSAMPLING * NEIGHBOURS)]
    if repeats:
        multiple = np.round(tones[number] * repeats)
        away = np.abs(tones[number] - multiple / repeats)
        others = number[away > OVERSAMPLING * (tones[1] - tones[0])]
        order = np.lexsort((away, multiple))
        nearest = order[np.unique(multiple[order], return_index=True)[1]]
        kinds = [(others, OVERSAMPLING * NEIGHBOURS), (number[nearest], FEWER_NEIGHBOURS)]
    ratios = [_ratios(power[some], near) for some, near in kinds]
    total, best, highest = sum(map(len, ratios)), None, 0.0
    for (some, _), ratio in zip(kinds, ratios, strict=True):
        if len(ratio) and ratio.max() > highest:
            best, highest = int(some[np.argmax(ratio)]), float(ratio.max())
    return best if np.exp(-highest) * total <= LEVEL else None


def _ratios(power: np.ndarray, near: int) -> np.ndarray:
    """Ordinates over the mean of the noise in each part of so many; none where there are fewer."""
    parts = len(power) // near
    if not parts:
        return np.zeros(0)
    part = np.minimum(np.arange(len(power)) // near, parts - 1)
    noise = np.median(power[: parts * near].reshape(parts, near), axis=1) / np.log(2)
    return power / np.maximum(noise[part], 1e-300)


def _at_nodes(tone: float, evidence: Evidence) -> float:
    """The power, N², of what a fit predicts too little at the rows' nodes, at a frequency, Hz."""
    motion, near = evidence.motion, (evidence.centre[:, None] + np.arange(-1, 2)).ravel()
    force, predicted = np.asarray(motion.force), np.asarray(motion.channels["predicted_force"])
    left = (force - predicted)[near]
    turned = 2 * np.pi * tone * np.asarray(motion.time)[near]
    return float(np.abs((left - left.mean()) @ np.exp(1j * turned)) ** 2)
