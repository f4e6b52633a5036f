"""What the pictures of an explanation are drawn from, as plain lists."""

from typing import Any

import numpy as np

from ..models import Model
from ..terms import KNOWN_FORCE
from .bins import Axis, Bins, axis
from .evidence import Evidence
from .improvement import Improved
from .locate import Structure
from .predictions import with_predictions
from .regression import Fit
from .verification import residual

# More points than a screen has columns show nothing more.
MOST_POINTS = 3000
# A step between rows of more than so many usual ones is a gap: rest, a reversal, another segment.
GAP = 2.5
# A direction with fewer rows was not seen.
FEWEST = 20


def curves(found: list[Structure], better: Improved, models: tuple[Model, Model]) -> dict[str, Any]:
    """Mismatch map, force over time on both recordings, and friction, before and after.

    **Arguments:** `found`: the baseline's structure to show; `better`: what is reported; `models`,
    before and after.
    """
    problem, selection = better.findings.recorded
    evidence, before, after = problem.evidence, better.first, selection.last
    units = evidence.motion.unit_names
    seen = with_predictions(evidence, after)
    drawn = {
        "units": dict(units),
        "map": [_mapped(each, before, after, seen, units) for each in found],
        "time": _series(evidence, before, after),
        "friction": _friction(models, evidence, after),
    }
    if problem.held is not None:
        drawn["holdout"] = _series(problem.held, before, after, selection.rephased)
    return drawn


def _mapped(found: Structure, before: Fit, after: Fit, seen: Evidence, units) -> dict[str, Any]:
    """Mean residual in bins along one coordinate; a line is folded onto one period."""
    lined = found.coordinate.endswith("_lines")
    along = axis(found.coordinate, seen, units, 1 / found.peak if lined else None)
    bins = Bins(along)
    return {
        "name": found.coordinate,
        "coordinate": along.label,
        "unit": along.unit,
        "at": bins.at.tolist(),
        "before": bins.mean(before.residual).tolist(),
        "after": bins.mean(after.residual).tolist(),
        "error": bins.error(before.residual).tolist(),
    }


def _series(evidence: Evidence, before: Fit, after: Fit, rephased=frozenset()) -> dict[str, Any]:
    """Force over time without interruptions; where rows are missing stands `None`."""
    step = max(1, -(-len(evidence.target) // MOST_POINTS))
    time = evidence.elapsed[evidence.centre]
    series = {
        "time": time,
        "measured": evidence.force,
        "before": evidence.force - residual(before, evidence),
        "after": evidence.force - residual(after, evidence, rephased),
    }
    shown = {name: values[::step] for name, values in series.items()}
    steps = np.diff(shown["time"])
    gaps = 1 + np.flatnonzero(steps > GAP * np.median(steps)) if len(steps) else np.zeros(0, int)
    middle = shown["time"][gaps - 1] + 0.5 * steps[gaps - 1] if len(gaps) else np.zeros(0)
    lists = {
        name: np.insert(values, gaps, middle if name == "time" else np.nan).tolist()
        for name, values in shown.items()
    }
    return {
        name: [None if value != value else value for value in values]
        for name, values in lists.items()
    }


def _friction(models: tuple[Model, Model], evidence: Evidence, after: Fit) -> dict[str, Any]:
    """Friction curves over the speeds that were seen, each direction by itself.

    What is measured of it is the improved model's friction and what that leaves of the force.
    """
    speeds = np.asarray(evidence.motion.velocity)[evidence.centre]
    parts, at, measured, error = [], [], [], []
    slip = np.asarray(models[1].friction(speeds))
    for side in (-1, 1):
        rows = (evidence.side == side) & (speeds * side > 0)
        if np.count_nonzero(rows) < FEWEST:
            continue
        low, high = np.quantile(side * speeds[rows], [0.01, 1.0])
        parts.append(np.sort(side * np.geomspace(low, high, 120)))
        bins = Bins(Axis("velocity", "", speeds[rows], np.ones(np.count_nonzero(rows))))
        residual = after.residual[rows]
        at += bins.at.tolist()
        measured += bins.mean(slip[rows] + residual).tolist()
        error += bins.error(residual).tolist()
    velocity = np.concatenate(parts) if parts else np.zeros(0)
    curves = (np.asarray(model.friction(velocity)).tolist() for model in models)
    before, after_ = ([v if np.isfinite(v) else None for v in curve] for curve in curves)
    return {
        "velocity": velocity.tolist(),
        "before": before,
        "after": after_,
        "at": at,
        "measured": measured,
        "error": error,
        # Of a simulator's force the models hold what is added to it, and that is no friction curve.
        "corrects": KNOWN_FORCE in models[0].term.coordinates,
    }
