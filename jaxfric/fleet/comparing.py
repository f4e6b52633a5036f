"""What stands out of a fleet: axes unlike the others, and axes that change between recordings."""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from ..checks import LARGE
from ..terms.friction import STRIBECK_VELOCITY
from .files import File
from .journal import Row

# A chance below this, corrected for everything tried, is told.
LEVEL = 0.05
# Fewer recordings say little about what is usual, or whether a slope is one.
FEWEST = 5
FEWEST_OF_AXIS = 4
# Standard deviation over median absolute deviation, of a normal distribution; and how many values
# of n the median absolute deviation is worth (its efficiency beside the standard deviation;
# Rousseeuw & Croux 1993).
DEVIATIONS = 1.4826
EFFICIENCY = 0.37
FORCE_ERROR = "filtered_force_error"

Numbers = Float[np.ndarray, " n"]


class Usual(NamedTuple):
    """A quantity over a group: its median, robust standard deviation, unit, and how many values.

    `ratio`, whether the deviation is one of the logarithm.
    """

    group: str
    name: str
    unit: str
    recordings: int
    median: float
    deviation: float
    ratio: bool


class Outlier(NamedTuple):
    """A recording unlike the others: deviations from the median, and the chance of one so far in
    any of the quantities tried.
    """

    path: str
    name: str
    value: float
    unit: str
    deviations: float
    chance: float
    usual: Usual


class Drift(NamedTuple):
    """A parameter of an axis against the order of its recordings, or days where paths are dated.

    `line`: its value at the first of `places` and its slope; `chance` that any of the slopes tried
    is as far from zero by itself.
    """

    axis: str
    name: str
    unit: str
    per: str
    places: Numbers
    values: Numbers
    errors: Numbers
    line: tuple[float, float]
    slope_error: float
    chance: float


class Summary(NamedTuple):
    """What is usual in a fleet, and what is not; `tried`, how many outliers and drifts; `most`, how
    many recordings the axis has that has most, zero where no axes are named.
    """

    usual: tuple[Usual, ...]
    outliers: tuple[Outlier, ...]
    drifts: tuple[Drift, ...]
    tried: tuple[int, int]
    most: int = 0


class _Values(NamedTuple):
    """A quantity of the recordings of one group that have it."""

    name: str
    unit: str
    files: list[File]
    values: Numbers
    errors: Numbers


def compare(files: Sequence[File], rows: Mapping[str, Row]) -> Summary:
    """Outliers and drifts of the recordings whose result is successful and sound."""
    fine = [f for f in files if sound(rows[f.path])]
    usual, outliers, tried = _outliers(_gathered(fine, rows, lambda file: file.group))
    axes = _gathered([f for f in fine if f.axis], rows, lambda file: file.axis)
    drifts = [_drift(axis, v) for axis, v in axes if len(v.files) >= FEWEST_OF_AXIS]
    chances = corrected(np.array([drift.chance for drift in drifts]))
    drifts = [d._replace(chance=float(c)) for d, c in zip(drifts, chances, strict=True)]
    drifts.sort(key=lambda drift: drift.chance)
    most = max((len(v.files) for _, v in axes), default=0)
    return Summary(usual, outliers, tuple(drifts), (tried, len(drifts)), most)


def sound(row: Row) -> bool:
    """Whether a row says what its axis is like: successful, with most of the force explained, and
    no friction negative beyond its interval.
    """
    warnings = (row.get("warnings") or "").split(", ")
    return (
        row["result"] == "successful"
        and not {"large_error", "negative_parameter"} & set(warnings)
        and not (row[FORCE_ERROR] or 0.0) > LARGE
    )


def _gathered(files, rows, of) -> list[tuple[str, _Values]]:
    """The values of every quantity by group (or axis) and unit."""
    found: dict[tuple[str, str, str], list] = {}
    for file in files:
        row = rows[file.path]
        for name, entry in row["parameters"].items():
            if entry["value"] is not None and entry["standard_error"] is not None:
                place = found.setdefault((of(file), name, entry["unit"]), [])
                place.append((file, entry["value"], entry["standard_error"]))
        if row[FORCE_ERROR]:
            found.setdefault((of(file), FORCE_ERROR, "1"), []).append((file, row[FORCE_ERROR], 0))
    return [
        (group, _Values(name, unit, [e[0] for e in entries], *_arrays(entries)))
        for (group, name, unit), entries in found.items()
    ]


def _arrays(entries) -> tuple[Numbers, Numbers]:
    return tuple(np.array([entry[i] for entry in entries], float) for i in (1, 2))


def _outliers(gathered: Iterable[tuple[str, _Values]]):
    """What is usual, the outliers, and how many values were tried."""
    usual, told = [], []
    for group, v in gathered:
        values, errors = v.values, v.errors
        # Of these the bounds are a ratio, and so is their scatter.
        by_ratio = STRIBECK_VELOCITY.name, FORCE_ERROR
        ratio = v.name.startswith(by_ratio) and bool(np.all(values > 0))
        if ratio:
            values, errors = np.log(values), errors / values
        median = float(np.median(values))
        deviation = DEVIATIONS * float(np.median(np.abs(values - median)))
        middle = float(np.exp(median)) if ratio else median
        usual.append(Usual(group, v.name, v.unit, len(v.files), middle, deviation, ratio))
        if len(v.files) >= FEWEST:
            told.append((v, usual[-1], *_unusual(values, errors, median, deviation)))
    chances = np.concatenate([entry[-1] for entry in told]) if told else np.zeros(0)
    chance = iter(corrected(chances))
    outliers = [
        Outlier(file.path, v.name, float(value), v.unit, float(z), float(p), one)
        for v, one, deviations, _ in told
        for file, value, z, p in zip(v.files, v.values, deviations, chance, strict=False)
        if p < LEVEL
    ]
    outliers.sort(key=lambda outlier: (outlier.chance, -abs(outlier.deviations)))
    return tuple(usual), tuple(outliers), chances.size


def _unusual(values: Numbers, errors: Numbers, median: float, deviation: float):
    """Deviations from the median in robust standard deviations, and the chance of each.

    The scatter contains the usual standard error; a value that is known less well may be that much
    further away. The chance is Student's, with the degrees of freedom that the scatter's own
    estimate has.
    """
    more = np.maximum(errors**2 - np.median(errors) ** 2, 0.0)
    scale = np.sqrt(deviation**2 + more)
    away = values - median
    deviations = away / np.where(scale > 0, scale, np.where(away == 0, 1.0, np.abs(away) * 1e-9))
    return deviations, two_sided(deviations, EFFICIENCY * (values.size - 1))


def _drift(axis: str, v: _Values) -> Drift:
    dates = [file.date for file in v.files]
    dated = None not in dates and len(set(dates)) > 2
    places = np.array(dates, float) if dated else np.arange(len(dates), dtype=float)
    order = np.argsort(places, kind="stable")
    places = places[order] - places.min()
    values, errors = v.values[order], v.errors[order]
    line, error = slope(places, values, errors)
    degrees = values.size - 2
    ratio = line[1] / error if error > 0 else np.inf * np.sign(line[1])
    chance = two_sided(np.array([ratio]), degrees)[0] if line[1] else 1.0
    per = "day" if dated else "recording"
    return Drift(axis, v.name, v.unit, per, places, values, errors, line, error, float(chance))


def slope(places: Numbers, values: Numbers, errors: Numbers) -> tuple[tuple[float, float], float]:
    """A straight line by weighted least squares, and the standard error of its slope.

    Recordings of one axis scatter more than each by itself knows (temperature, load, lubrication):
    their variance beyond the standard errors is estimated by moments, and the slope's error is
    that of Knapp & Hartung ("Improved tests for a random effects meta-regression with a single
    covariate", Statistics in Medicine 22, 2003), from the scatter about the line, for Student's t
    of n − 2 degrees of freedom. No recording counts more than the usual one does.
    """
    known = bool(np.all(errors > 0))
    square = np.maximum(errors, np.median(errors)) ** 2 if known else np.ones_like(errors)
    between = _between(places, values, square) if known else 0.0
    weight = 1 / (square + between)
    level, rise, variance, left, _ = _line(places, values, weight)
    factor = float(np.sum(weight * left**2)) / (values.size - 2)
    return (level, rise), float(np.sqrt(variance * factor))


def _between(places: Numbers, values: Numbers, square: Numbers) -> float:
    """The variance between recordings beyond their own, by moments (DerSimonian & Laird 1986)."""
    weight = 1 / square
    *_, left, leverage = _line(places, values, weight)
    excess = np.sum(weight * left**2) - (values.size - 2)
    return max(0.0, float(excess / np.sum(weight * (1 - leverage))))


def _line(places: Numbers, values: Numbers, weight: Numbers):
    """Level at place zero, slope, the slope's variance, what is left, and each value's leverage."""
    total = weight.sum()
    centre = (weight @ places) / total
    away = places - centre
    squares = weight @ away**2
    rise = float((weight * away) @ values / squares)
    level = float((weight @ values) / total - rise * centre)
    leverage = weight / total + weight * away**2 / squares
    return level, rise, float(1 / squares), values - level - rise * places, leverage


def two_sided(t: Numbers, degrees: float) -> Numbers:
    """The chance of a Student's t at least so far from zero (Abramowitz & Stegun 26.7.1)."""
    square = np.minimum(np.asarray(t, float) ** 2, 1e300)
    share = np.asarray(degrees / (degrees + square))
    half = np.full_like(share, 0.5)
    found = jax.scipy.special.betainc(np.full_like(share, degrees / 2), half, share)
    return np.asarray(found, float)


def corrected(chances: Numbers) -> Numbers:
    """Chances raised for their number (Holm 1979): of all that are nothing, one in any fleet."""
    order = np.argsort(chances, kind="stable")
    factors = np.arange(chances.size, 0, -1)
    raised = np.empty_like(chances, dtype=float)
    raised[order] = np.minimum(np.maximum.accumulate(chances[order] * factors), 1.0)
    return raised
