"""Means of rows in bins along a coordinate, for pictures."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..identification.uncertainty import Estimate
from .evidence import Evidence
from .locate import coordinates
from .predictions import rate
from .quantities import quantity

BINS = 48
_UNITS = {
    "time": "s",
    "time_since_reversal": "s",
    "position": "{position}",
    "velocity": "{position}/s",
    "distance_since_reversal": "{position}",
    "acceleration": "{position}/s²",
    "predicted_force": "{force}",
    "force_rate": "{force}/s",
    "neighbour": "{position}/s",
}


def unit(coordinate: str, units: Mapping[str, str]) -> str:
    """The unit of a coordinate; empty for a signal whose unit nobody gave (load, temperature)."""
    stem = coordinate.removesuffix("_lines").partition("_by_")[0]
    return _UNITS.get(stem, "").format(**units)


class Axis(NamedTuple):
    """A coordinate at the rows, `(J,)`: its label and unit, its values, and a factor.

    Of a residual in step with something else (direction, velocity, acceleration) the pictures show
    its size where that has its root mean square; `beside` is that, in parts of it.
    """

    label: str
    unit: str
    value: np.ndarray
    beside: np.ndarray


def axis(name: str, seen: Evidence, units: Mapping[str, str], period: float | None = None) -> Axis:
    """A coordinate of [`coordinates`][], folded at `period` where one is given."""
    its = unit(name, units)
    if name.endswith("_lines"):
        stem = name.removesuffix("_lines")
        value = np.asarray(getattr(seen.motion, stem))[seen.centre]
        factor = np.ones_like(value)
    else:
        nodes, _, kind = coordinates(seen)[name]
        value = (rate(seen, nodes) if kind == "rate" else nodes)[seen.centre]
        stem, factor = name, _beside(name, seen)
    label = stem.replace("_", " ")
    if period is not None:
        value = np.mod(value, period)
        label = f"{label.partition(' by ')[0]}, folded at {quantity(Estimate(period, 0.0, its))}"
    return Axis(label, its, value, factor)


def _beside(name: str, seen: Evidence) -> np.ndarray:
    """What a residual over that coordinate is in step with, in parts of its root mean square."""
    velocity = np.asarray(seen.motion.velocity)
    if name.endswith("_by_velocity"):
        values = velocity[seen.centre]
    elif name.endswith("_by_acceleration"):
        values = rate(seen, velocity)[seen.centre]
    else:
        sided = name.endswith("_by_direction") or "since" in name
        values = seen.side if sided else np.ones(len(seen.centre))
    return values / np.sqrt(np.mean(values**2))


class Bins:
    """Rows sorted into bins that hold as many each; those of a single row are left out."""

    def __init__(self, along: Axis):
        value, self._beside = along.value, along.beside
        edges = np.quantile(value, np.linspace(0, 1, BINS + 1))
        self._bin = np.clip(np.searchsorted(edges, value, side="right") - 1, 0, BINS - 1)
        count = np.bincount(self._bin, minlength=BINS)
        weight = np.bincount(self._bin, self._beside**2, BINS)
        self.full = (count > 1) & (weight > 0)
        self._count = np.where(self.full, count, 1)
        self._weight = np.where(self.full, weight, 1.0)
        self.at = (np.bincount(self._bin, value, BINS) / self._count)[self.full]

    def mean(self, values: np.ndarray) -> np.ndarray:
        """The mean of rows, `(J,)`, in each bin, `(B,)`, beside the factor."""
        return (np.bincount(self._bin, self._beside * values, BINS) / self._weight)[self.full]

    def error(self, values: np.ndarray) -> np.ndarray:
        """The standard error of the mean of rows that scatter independently, `(B,)`."""
        mean = np.zeros(BINS)
        mean[self.full] = self.mean(values)
        apart = values - self._beside * mean[self._bin]
        sums = np.bincount(self._bin, (self._beside * apart) ** 2, BINS)
        grown = self._count / np.maximum(self._count - 1, 1)
        return (np.sqrt(sums * grown) / self._weight)[self.full]
