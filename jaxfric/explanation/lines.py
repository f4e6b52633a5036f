"""Waves over position or time as columns, and the frequencies that resolve every line."""

from typing import NamedTuple

import numpy as np

from .evidence import Evidence

# Four frequencies a resolution cell (one over the range): the peak then lies within an eighth of a
# cell of one of them, where the loss is under 3 % of its power.
OVERSAMPLING = 4
# Bounds the cost on very long records: 512 periods in the range.
MOST_LINES = 2048


class Lines(NamedTuple):
    """Waves over a coordinate at the rows, without the nodes: sine and cosine, damped.

    Over a kernel the coordinate is taken as a straight line; averaging then multiplies a wave by
    the kernel's Fourier transform at 2πf·rate·reach. `coordinate`: "position" or "time";
    `inverse`: whether the parameter is a period; `sided`: times the direction; `harmonics`.
    """

    coordinate: str
    inverse: bool
    sided: bool = False
    harmonics: int = 1

    def columns(self, evidence: Evidence, parameters: np.ndarray) -> np.ndarray:
        """Columns at each frequency or period, `(G, J, 2 harmonics)`."""
        frequency = 1 / parameters if self.inverse else parameters
        value = np.asarray(getattr(evidence.motion, self.coordinate))[evidence.centre]
        value = value - value.mean()
        rate = np.asarray(evidence.motion.velocity)[evidence.centre]
        rate = rate if self.coordinate == "position" else np.ones_like(rate)
        swept = np.abs(2 * np.pi * evidence.reach * rate).astype(np.float32)
        side = evidence.side.astype(np.float32) if self.sided else np.float32(1)
        columns = np.empty((len(parameters), 2 * self.harmonics, len(value)), np.float32)
        for n in range(1, self.harmonics + 1):
            for some in range(0, len(parameters), AT_ONCE):
                waves = n * frequency[some : some + AT_ONCE, None]
                turned = angle(waves * value)
                at = np.minimum(waves.astype(np.float32) * (20 * swept) + 0.5, len(_GAINS) - 1)
                gain = _GAINS[at.astype(np.int32)] * side
                out = columns[some : some + AT_ONCE, 2 * n - 2 : 2 * n]
                np.multiply(gain, np.sin(turned), out=out[:, 0])
                np.multiply(gain, np.cos(turned), out=out[:, 1])
        return columns.transpose(0, 2, 1)


# Waves whose numbers stay in the cache while they are worked on.
AT_ONCE = 8


def angle(turns: np.ndarray) -> np.ndarray:
    """Turns as angles, without whole turns, so that single precision is enough for their sines."""
    return np.float32(2 * np.pi) * (turns - np.round(turns)).astype(np.float32)


def _transform():
    """∫ φ(τ) cos(zτ) dτ / ∫ φ dτ of the kernel φ = (1 − τ²)⁴, for z up to 30 (below 1e-4 there)."""
    tau = np.linspace(-1.0, 1.0, 1001)
    weight = (1 - tau**2) ** 4
    turns = np.linspace(0.0, 30.0, 601)
    gains = np.cos(turns[:, None] * tau[None, :]) @ weight / np.sum(weight)
    gains[-1] = 0.0
    return gains.astype(np.float32)


# Tabulated in steps of 1/20, half of which shifts a gain by less than 0.006.
_GAINS = _transform()


def line_frequencies(evidence: Evidence, coordinate: str) -> np.ndarray:
    """Equally spaced frequencies that resolve every line of a coordinate.

    From one period in the range (one and a half in time: fewer are a drift) to where a wave at
    the slow quartile of the speed has half a period in the kernel: shorter ones are averaged away.
    """
    limits = evidence.limits
    top = 0.5 / evidence.reach
    if coordinate == "time":
        span, low = limits.duration, 1.5 / limits.duration
    else:
        span = limits.high - limits.low
        speed = np.abs(np.asarray(evidence.motion.velocity)[evidence.centre])
        low, top = 1.0 / span, top / np.quantile(speed, 0.25)
    top = max(top, 2 * low)
    count = int(np.clip(np.ceil(OVERSAMPLING * span * (top - low)), 16, MOST_LINES))
    return np.linspace(low, min(top, low + count / (OVERSAMPLING * span)), count)
