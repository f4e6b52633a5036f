"""Recordings of one fleet in different units: stated so, or seen in their parameters."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from .. import models
from ..units import Dimension
from .files import File
from .journal import Row

# Usual conversions: prefixes, inches, degrees, percent, minutes, turns of 360. Machines of one
# fleet may well differ by ten, so that smaller ones prove nothing.
FACTORS = {
    "force": (1e3, 1e6, 100.0),
    "position": (1e3, 1e6, 100.0, 25.4, 1 / 0.0254, 180 / math.pi, 360.0, 60.0),
    "time": (1e3, 1e6, 1e9, 60.0),
}
# Two groups lie apart if more than half of the factor is empty between them; their medians agree
# with it within six standard errors (a few recordings know their own scatter badly, and all of
# some ten parameters have to agree), or a tenth, and always to a quarter of the factor's logarithm.
APART = 0.5
SURE = 6.0
CLOSE = 0.1
LEAST = 0.25
# Names of files in a sentence.
SHOWN = 3


def mixed_units(files: Sequence[File], rows: Mapping[str, Row], model: str) -> tuple[str, ...]:
    """Sentences on recordings that state different units, or whose parameters look like it."""
    there = [file for file in files if rows[file.path]["parameters"]]
    if sentence := _stated(there, rows):
        return (sentence,)
    term = models.named(model)
    dimensions = {p.name: p.dimension for p in (*term.affine, *term.nonlinear)}
    sentence = _seen(there, rows, dimensions)
    return (sentence,) if sentence else ()


def _stated(files: Sequence[File], rows: Mapping[str, Row]) -> str | None:
    """The first parameter that has several units."""
    for name in dict.fromkeys(name for file in files for name in rows[file.path]["parameters"]):
        units: dict[str, list[File]] = {}
        for file in files:
            if entry := rows[file.path]["parameters"].get(name):
                units.setdefault(entry["unit"], []).append(file)
        if len(units) > 1:
            parts = [f"{name} is in {unit} in {_listed(some)}" for unit, some in units.items()]
            return (
                f"Warning: the recordings state different units and are compared apart: "
                f"{'; '.join(parts)}. Read those that differ with a factor: --scale ROLE=FACTOR."
            )
    return None


def _seen(files, rows, dimensions: Mapping[str, Dimension]) -> str | None:
    """Two groups of recordings whose parameters all differ as one change of unit would have it."""
    values = _values(files, rows, dimensions)
    for name in values:
        groups = _split(values[name])
        if groups is None:
            continue
        away = {
            (quantity, numbers): _away(values, dimensions, groups, quantity, numbers)
            for quantity, factors in FACTORS.items()
            for factor in factors
            for numbers in (factor, 1 / factor)
        }
        best = min(away, key=away.__getitem__)
        if away[best] < np.inf:
            return _sentence(files, groups, *best, name)
    return None


def _values(files, rows, dimensions) -> dict[str, dict[str, float]]:
    """Logarithms by parameter and path, of those values that are known to better than a half."""
    found: dict[str, dict[str, float]] = {}
    for file in files:
        for name, entry in rows[file.path]["parameters"].items():
            value, error = entry["value"], entry["standard_error"]
            if name in dimensions and value and error is not None and error < 0.5 * abs(value):
                found.setdefault(name, {})[file.path] = math.log(abs(value))
    return {name: some for name, some in found.items() if len(some) > 2}


def _split(values: Mapping[str, float]) -> tuple[set[str], set[str]] | None:
    """The paths below and above the widest gap, if it is wider than each side."""
    ordered = sorted(values, key=values.__getitem__)
    levels = np.array([values[path] for path in ordered])
    gaps = np.diff(levels)
    at = int(np.argmax(gaps))
    if gaps[at] <= max(levels[at] - levels[0], levels[-1] - levels[at + 1]):
        return None
    return set(ordered[: at + 1]), set(ordered[at + 1 :])


def _away(values, dimensions, groups, quantity: str, factor: float) -> float:
    """How far the parameters' changes between the groups are from their powers of the factor.

    Infinite where one of them is not that power within its error.
    """
    total, changed = 0.0, 0
    for name, levels in values.items():
        low, high = (np.array([levels[p] for p in side if p in levels]) for side in groups)
        if not len(low) or not len(high):
            return np.inf
        expected = getattr(dimensions[name], quantity) * math.log(factor)
        away = abs(float(np.median(high) - np.median(low)) - expected)
        if away > min(max(SURE * _error(low, high), CLOSE), LEAST * abs(math.log(factor))):
            return np.inf
        upper, lower = (high, low) if expected > 0 else (low, high)
        if expected and upper.min() - lower.max() < APART * abs(expected):
            return np.inf
        total, changed = total + away, changed + (expected != 0.0)
    return total if changed and len(values) > 1 else np.inf


def _error(low: np.ndarray, high: np.ndarray) -> float:
    """The standard error of the difference of two medians, from the scatter within both sides."""
    square = sum(float(np.sum((side - np.mean(side)) ** 2)) for side in (low, high))
    free = max(len(low) + len(high) - 2, 1)
    # Of a normal variable a median has 1.2533 times the standard error of a mean.
    return 1.2533 * math.sqrt(square / free * (1 / len(low) + 1 / len(high)))


def _sentence(files, groups, quantity: str, factor: float, name: str) -> str:
    """`factor`, what the numbers of the second group are times those of the first."""
    first, second = groups
    fewer = second if len(second) <= len(first) else first
    scale = 1 / factor if fewer is second else factor
    some = [file for file in files if file.path in fewer]
    ratio = max(factor, 1 / factor)
    return (
        f"Warning: {_listed(some)} may be in another unit of {quantity} than the rest: {name} "
        f"and all others differ from theirs as a factor of {ratio:.4g} would have it. If so, read "
        f"them with --scale {quantity}={scale:.6g}."
    )


def _listed(files: Sequence[File]) -> str:
    shown = ", ".join(file.path for file in files[:SHOWN])
    more = f" and {len(files) - SHOWN} more" if len(files) > SHOWN else ""
    return f"{len(files)} recording{'s' if len(files) > 1 else ''} ({shown}{more})"
