"""The compact set of nonlinear parameters, as a unit cube."""

from collections.abc import Sequence

import numpy as np

from ..identification.grids import features, resolution, to_unit
from ..terms.base import AbstractTerm
from ..terms.sample import Scales

# Steps for derivatives, of a coordinate from 0 to 1: within one the energy is a straight line. Of a
# wave with five hundred cycles over the record, whose coordinate spans e⁷, the phase at the end
# moves by 2π · 500 · 7 times as much.
STEP, OF_WAVES = 1e-4, 1e-7
# Points along a parameter of which the energy is smooth; and most points along a period.
GRID, MOST = 24, 1 << 12


class Space:
    """The compact set of the nonlinear parameters of some terms, in coordinates from 0 to 1."""

    def __init__(self, terms: Sequence[AbstractTerm], limits: Scales):
        limits = Scales(*map(np.asarray, limits))
        boxes = [_box(term, limits) for term in terms]
        self.limits = limits
        self.counts = [len(term.nonlinear) for term in terms]
        self.parameters = parameters = [p for term in terms for p in term.nonlinear]
        self.log = np.array([p.logarithmic for p in parameters], bool)
        self.step = np.array([OF_WAVES if p.repeats else STEP for p in parameters])
        box = np.concatenate(boxes, axis=1)
        self.low = np.where(self.log, np.log(np.where(self.log, box[0], 1.0)), box[0])
        self.high = np.where(self.log, np.log(np.where(self.log, box[1], 1.0)), box[1])
        self.high = np.maximum(self.high, self.low + 1e-9 * (1 + np.abs(self.low)))

    def beta(self, point: np.ndarray) -> np.ndarray:
        """Parameters at coordinates, `(..., d)`."""
        raw = self.low + point * (self.high - self.low)
        return np.where(self.log, np.exp(np.where(self.log, raw, 0.0)), raw)

    def point(self, beta: np.ndarray) -> np.ndarray:
        """Coordinates of parameters, moved inside the set."""
        raw = np.where(self.log, np.log(np.where(self.log, beta, 1.0)), beta)
        return np.clip((raw - self.low) / (self.high - self.low), 0.0, 1.0)

    def grid(self, number: int) -> np.ndarray:
        """Coordinates at which one parameter is looked for, `(G,)`: of a period as near to each
        other as two minima are.
        """
        parameter = self.parameters[number]
        how = resolution(parameter)
        if how.over is None:
            return (np.arange(GRID) + 0.5) / GRID
        low, high = self.beta(np.outer([0.0, 1.0], np.ones(len(self.low))))[:, number]
        count = int(np.clip(how.per * features(how, self.limits, low, high), GRID, MOST))
        return np.asarray(to_unit(np.linspace(0.0, 1.0, count), parameter, low, high))

    def rate(self, point: np.ndarray) -> np.ndarray:
        """Derivatives of the parameters by their coordinates."""
        span = self.high - self.low
        return np.where(self.log, self.beta(point) * span, span)

    def split(self, beta: np.ndarray) -> list[np.ndarray]:
        """The vector of all parameters as one vector for each term."""
        ends = np.cumsum(self.counts)
        return [beta[..., e - c : e] for e, c in zip(ends, self.counts, strict=True)]


def _box(term, limits):
    pairs = [tuple(float(x) for x in p.bounds(limits)) for p in term.nonlinear]
    return np.array(pairs, float).reshape(-1, 2).T
