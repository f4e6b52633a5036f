"""One effect that a baseline lacks, as it is reported."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from ..identification.uncertainty import Estimate


class Moved(NamedTuple):
    """A parameter of the baseline whose value is wrong: before, after, standard error, unit.

    `before_error`: the standard error of the value before, where that is known.
    """

    before: float
    value: Any
    standard_error: Any
    unit: str
    before_error: float = 0.0


class Finding(NamedTuple):
    """One effect that the baseline lacks.

    - `effect`: its public name; `equation`; `sentence`: in words.
    - `confusable_with`: effects that this recording cannot tell from it; `separate_by`: the
      experiment that would.
    - `parameters`: by name, each with value, standard error and unit.
    - `share`: part of the baseline's mean-square residual that it removes; `holdout_share`: the
      same on the held-out recording, `None` without one or where the effect is of the moment.
    - `p_value`: paid for by the number of terms tried.
    - `attribute`: the simulator's own name for it, where there is one; `confirmed`: whether the
      held-out recording confirms it, `None` where it is not tested; `instead`: to each wrong value
      by name, others that this motion cannot tell from it.
    """

    effect: str
    equation: str
    sentence: str
    confusable_with: tuple[str, ...]
    separate_by: str
    parameters: Mapping[str, Estimate | Moved]
    share: float
    holdout_share: float | None
    p_value: float
    attribute: str | None = None
    confirmed: bool | None = None
    instead: Mapping[str, tuple[str, ...]] = MappingProxyType({})


def findings_document(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """Findings as plain data."""
    return [
        {**finding._asdict(), "parameters": estimates_document(finding.parameters)}
        | {"confusable_with": list(finding.confusable_with)}
        | {"instead": {name: list(others) for name, others in finding.instead.items()}}
        for finding in findings
    ]


def estimates_document(parameters: Mapping[str, Estimate | Moved]) -> dict[str, Any]:
    """Parameters as plain data."""
    return {name: _estimate(estimate) for name, estimate in parameters.items()}


def _estimate(estimate: Estimate | Moved) -> dict[str, Any]:
    error = float(estimate.standard_error)
    rest = {"standard_error": error if math.isfinite(error) else None, "unit": estimate.unit}
    if isinstance(estimate, Moved):
        moved = {"from": float(estimate.before), "to": float(estimate.value), **rest}
        own = float(estimate.before_error)
        return moved | ({"from_standard_error": own} if 0 < own < math.inf else {})
    value = float(estimate.value)
    return {"value": value if math.isfinite(value) else None, **rest}
