"""Each finding over its own coordinate: what is measured of it, and its law with a 95 % band.

What is measured of one term is the force less all the other terms: its component plus the residual
(Larsen & McCleary 1972).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..terms.effects import EFFECTS
from . import verification
from .bins import Axis, Bins, axis
from .evidence import Evidence
from .improvement import Improved
from .intervals import spread
from .locate import coordinates
from .mismatch import Mismatch
from .predictions import with_predictions
from .regression import Fit


def partial_residuals(better: Improved) -> list[dict[str, Any]]:
    """The picture of each finding, in the order of discovery, as plain lists.

    Each holds `coordinate`, `unit`, `at`, and at these places `measured` with its standard error
    `error`, `law` between `low` and `high`, and the mean residual `before` and `after`.
    """
    pictures = []
    for number, selected in enumerate(better.findings.selection.selected):
        problem, selection = better.findings.examined_in(number)
        current, index = selection.last, selection.term_index(number)
        seen = with_predictions(problem.evidence, current)
        law = current.part(index)
        along = _along(selected.effect.name, current, index, seen)
        before = verification.residual(better.first, problem.evidence)
        pictures.append(
            _picture(along, law, current.residual, before)
            | _band(along, law, current, index, problem.block)
        )
    return pictures


def moved(better: Improved, wrong: Mismatch) -> dict[str, Any]:
    """The picture of wrong values: by how much the baseline's force changes with the right ones."""
    problem, selection = better.findings.undelayed
    names = [p.name for p in (*better.first.terms[0].affine, *better.first.terms[0].nonlinear)]
    inertial = any(names[i].startswith("inertia") for i in wrong.moved)
    seen = with_predictions(problem.evidence, selection.last)
    along = axis("acceleration" if inertial else "velocity", seen, seen.motion.unit_names)
    before = verification.residual(better.first, problem.evidence)
    law = selection.last.part(0) - (problem.evidence.target - before)
    return _picture(along, law, selection.last.residual, before)


def _picture(along: Axis, law, residual, before) -> dict[str, Any]:
    bins = Bins(along)
    return {
        "coordinate": along.label,
        "unit": along.unit,
        "at": bins.at.tolist(),
        "measured": bins.mean(law + residual).tolist(),
        "error": bins.error(residual).tolist(),
        "law": bins.mean(law).tolist(),
        "before": bins.mean(before).tolist(),
        "before_error": bins.error(before).tolist(),
        "after": bins.mean(residual).tolist(),
    }


def _band(along: Axis, law, current: Fit, index: int, block: np.ndarray) -> dict[str, Any]:
    """The law's 95 % band, by its term's parameters; none where one is not seen."""
    bins, own = Bins(along), current.indices(index)
    gradient = np.stack([bins.mean(column) for column in current.jacobian[:, own].T], axis=1)
    weights = np.zeros((len(gradient), current.jacobian.shape[1]))
    weights[:, own] = gradient
    half = spread(current, block).half_widths(weights)
    if not np.all(np.isfinite(half)):
        return {}
    middle = bins.mean(law)
    return {"low": (middle - half).tolist(), "high": (middle + half).tolist()}


def _along(effect: str, current: Fit, index: int, seen: Evidence) -> Axis:
    """The coordinate over which an effect shows, a wave's folded at its period."""
    units: Mapping[str, str] = seen.motion.unit_names
    known = coordinates(seen)
    term, beta = current.terms[index], current.betas[index]
    wanted = EFFECTS[effect].coordinates
    name = next((n for n in wanted if n.removesuffix("_lines") in known), "velocity")
    period = _period(term, beta)
    plain = name.removesuffix("_lines")
    if period is not None:
        value = np.asarray(known[plain][0])[seen.centre]
        # What repeats less than twice is shown as it lies.
        if np.ptp(value) < 2 * period:
            period = None
    return axis(plain, seen, units, period)


def _period(term, beta) -> float | None:
    """The period of a wave, in its coordinate; `None` for another term."""
    pairs = zip(term.nonlinear, beta, strict=True)
    periods = (parameter.period(float(value)) for parameter, value in pairs)
    return next((period for period in periods if period is not None), None)
