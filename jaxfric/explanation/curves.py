"""What the pictures of an explanation are drawn from, as plain lists."""

from typing import Any

import numpy as np

from ..models import Model
from .evidence import Evidence
from .locate import Place, coordinates
from .predictions import with_predictions
from .regression import Fit
from .verification import residual

BINS = 48
# More points than a screen has columns show nothing more.
MOST_POINTS = 3000
_UNITS = {
    "position": "{position}",
    "velocity": "{position}/s",
    "distance_since_reversal": "{position}",
    "acceleration": "{position}/s²",
    "predicted_force": "{force}",
    "force_rate": "{force}",
    "neighbour": "{position}/s",
}


def curves(
    places: list[Place],
    before: Fit,
    after: Fit,
    evidence: Evidence,
    held: Evidence | None,
    units: dict[str, str],
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
    """Mean residual in bins along one coordinate; a line is folded onto one period."""
    name = place.coordinate
    if name.endswith("_lines"):
        stem = name.removesuffix("_lines")
        value = np.asarray(getattr(seen.motion, stem))[seen.centre]
        side = np.ones_like(value)
        period = 1 / place.peak
        value = np.mod(value, period)
        unit = units["position"] if stem == "position" else "s"
        label = f"{stem}, folded at {period:.4g} {unit}"
    else:
        nodes = coordinates(seen)[name][0]
        value, label = nodes[seen.centre], name.replace("_", " ")
        sided = "direction" in name or "since" in name
        side = seen.side if sided else np.ones_like(value)
        stem = name.removesuffix("_by_direction").removesuffix("_by_acceleration")
        unit = _UNITS.get(stem, "s").format(**units)
    edges = np.quantile(value, np.linspace(0, 1, BINS + 1))
    bin_ = np.clip(np.searchsorted(edges, value, side="right") - 1, 0, BINS - 1)
    count = np.bincount(bin_, minlength=BINS)
    full = count > 1
    count = np.where(full, count, 1)

    def mean(values):
        return (np.bincount(bin_, side * values, BINS) / count)[full]

    spread = np.sqrt(np.bincount(bin_, before.residual**2, BINS) / count) / np.sqrt(count)
    return {
        "coordinate": label,
        "unit": unit,
        "at": mean(value / np.where(side == 0, 1.0, side)).tolist(),
        "before": mean(before.residual).tolist(),
        "after": mean(after.residual).tolist(),
        "error": spread[full].tolist(),
    }


def _series(evidence: Evidence, before: Fit, after: Fit, rephased=frozenset()) -> dict[str, Any]:
    step = max(1, -(-len(evidence.target) // MOST_POINTS))
    time = evidence.elapsed[evidence.centre]
    series = {
        "time": time,
        "measured": evidence.target,
        "before": evidence.target - residual(before, evidence),
        "after": evidence.target - residual(after, evidence, rephased),
    }
    return {name: values[::step].tolist() for name, values in series.items()}


def _friction(models: tuple[Model, Model], evidence: Evidence) -> dict[str, Any]:
    top = evidence.limits.fastest
    speed = np.geomspace(evidence.limits.slowest, top, 120)
    velocity = np.concatenate([-speed[::-1], speed])
    before, after = (np.asarray(model.friction(velocity)).tolist() for model in models)
    return {"velocity": velocity.tolist(), "before": before, "after": after}
