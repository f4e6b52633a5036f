"""What the pictures of an explanation are drawn from, as plain lists."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..models import Model
from .evidence import Evidence
from .locate import Place, coordinates
from .predictions import rate, with_predictions
from .regression import Fit
from .verification import residual

BINS = 48
# More points than a screen has columns show nothing more.
MOST_POINTS = 3000
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


def curves(
    places: list[Place],
    before: Fit,
    after: Fit,
    evidence: Evidence,
    held: Evidence | None,
    units: Mapping[str, str],
    models: tuple[Model, Model],
    rephased: frozenset[int] = frozenset(),
) -> dict[str, Any]:
    """Mismatch map, force over time on both recordings, and friction, before and after."""
    seen = with_predictions(evidence, after)
    drawn = {
        "units": dict(units),
        "map": [_mapped(place, before, after, seen, units) for place in places],
        "time": _series(evidence, before, after),
        "friction": _friction(models, evidence),
    }
    if held is not None:
        drawn["holdout"] = _series(held, before, after, rephased)
    return drawn


def _mapped(place: Place, before: Fit, after: Fit, seen: Evidence, units) -> dict[str, Any]:
    """Mean residual in bins along one coordinate; a line is folded onto one period.

    Of a residual in step with something else (direction, velocity, acceleration) its size where
    that has its root mean square.
    """
    name = place.coordinate
    if name.endswith("_lines"):
        stem = name.removesuffix("_lines")
        value = np.asarray(getattr(seen.motion, stem))[seen.centre]
        beside = np.ones_like(value)
        period = 1 / place.peak
        value = np.mod(value, period)
        label = f"{stem}, folded at {period:.4g} {unit(name, units)}"
    else:
        nodes, _, kind = coordinates(seen)[name]
        value = (rate(seen, nodes) if kind == "rate" else nodes)[seen.centre]
        label = name.replace("_", " ")
        beside = _beside(name, seen)
    edges = np.quantile(value, np.linspace(0, 1, BINS + 1))
    bin_ = np.clip(np.searchsorted(edges, value, side="right") - 1, 0, BINS - 1)
    count = np.bincount(bin_, minlength=BINS)
    weight = np.bincount(bin_, beside**2, BINS)
    full = (count > 1) & (weight > 0)
    count, weight = np.where(full, count, 1), np.where(full, weight, 1.0)

    def mean(values):
        return (np.bincount(bin_, beside * values, BINS) / weight)[full]

    spread = np.sqrt(np.bincount(bin_, before.residual**2, BINS) / count / weight)
    return {
        "coordinate": label,
        "unit": unit(name, units),
        "at": (np.bincount(bin_, value, BINS) / count)[full].tolist(),
        "before": mean(before.residual).tolist(),
        "after": mean(after.residual).tolist(),
        "error": spread[full].tolist(),
    }


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


def _series(evidence: Evidence, before: Fit, after: Fit, rephased=frozenset()) -> dict[str, Any]:
    step = max(1, -(-len(evidence.target) // MOST_POINTS))
    time = evidence.elapsed[evidence.centre]
    series = {
        "time": time,
        "measured": evidence.force,
        "before": evidence.force - residual(before, evidence),
        "after": evidence.force - residual(after, evidence, rephased),
    }
    return {name: values[::step].tolist() for name, values in series.items()}


def _friction(models: tuple[Model, Model], evidence: Evidence) -> dict[str, Any]:
    top = evidence.limits.fastest
    speed = np.geomspace(evidence.limits.slowest, top, 120)
    velocity = np.concatenate([-speed[::-1], speed])
    before, after = (np.asarray(model.friction(velocity)).tolist() for model in models)
    return {"velocity": velocity.tolist(), "before": before, "after": after}
