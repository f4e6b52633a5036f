"""One effect that a baseline lacks, as it is reported."""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..identification.uncertainty import Estimate


class Moved(NamedTuple):
    """A parameter of the baseline whose value is wrong: before, and as estimated.

    `before_error`: the standard error of the value before, where that is known.
    """

    before: float
    estimate: Estimate
    before_error: float = 0.0

    @property
    def value(self) -> Any:
        """The value that it has."""
        return self.estimate.value

    @property
    def standard_error(self) -> Any:
        """The standard error of that value."""
        return self.estimate.standard_error

    @property
    def unit(self) -> str:
        """The unit of both values."""
        return self.estimate.unit

    def half_width(self, level: float = 0.95) -> Any:
        """Half the confidence interval of the value that it has."""
        return self.estimate.half_width(level)

    def interval(self, level: float = 0.95) -> tuple[Any, Any]:
        """The confidence interval of the value that it has."""
        return self.estimate.interval(level)

    @property
    def may_be_none(self) -> bool:
        """Whether the interval of the change holds zero: the value may be what it was."""
        low, high = map(float, self.change.interval())
        return not (low > 0 or high < 0)

    @property
    def change(self) -> Estimate:
        """What the value is more than before, with the error of both."""
        error = math.hypot(float(self.standard_error), self.before_error)
        more = self.value - self.before
        return self.estimate._replace(value=more, standard_error=np.float64(error))

    def to_dict(self) -> dict[str, Any]:
        """Both values as plain data; the error before where it is known."""
        now = self.estimate.to_dict()
        moved = {"from": float(self.before), "to": now.pop("value"), **now}
        own = float(self.before_error)
        return moved | ({"from_standard_error": own} if 0 < own < math.inf else {})


class Finding(NamedTuple):
    """One effect that the baseline lacks.

    - `effect`: its public name; `equation`; `sentence`: in words.
    - `confusable_with`: effects that this recording cannot tell from it; `separate_by`: the
      experiment that would.
    - `parameters`: by name, each with value, standard error and unit. Of what varies slowly along
      the stroke also by how much it is more than in the middle (`at_low_end`, `at_first_quarter`,
      `at_third_quarter`, `at_high_end`); of warming by how much more at the end of the record than
      at its start (`over_record`); of a load that wanders how far it moves (`range_over_record`);
      of wrong values that are one factor that (`force_factor`).
    - `share`: part of the baseline's mean-square residual that it removes; `holdout_share`: the
      same on the held-out recording, `None` without one or where the effect is of the moment.
    - `p_value`: paid for by the number of terms tried.
    - `attribute`: the simulator's own name for it, where there is one; `confirmed`: whether the
      held-out recording confirms it, `None` where it is not tested; `instead`: to each wrong value
      by name, others that this motion cannot tell from it; `untold`: a simulator's values that are
      fitted with the others, but may be as they were, or are such as nothing can have; `recurs`:
      of what is not confirmed, whether the held-out recording shows it too, though the model with
      its values from here is worse there.
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
    untold: tuple[str, ...] = ()
    recurs: bool = False


def findings_document(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    """Findings as plain data."""
    return [
        {**finding._asdict(), "parameters": estimates_document(finding.parameters)}
        | {"confusable_with": list(finding.confusable_with)}
        | {"instead": {name: list(others) for name, others in finding.instead.items()}}
        | {"untold": list(finding.untold)}
        for finding in findings
    ]


def estimates_document(parameters: Mapping[str, Estimate | Moved]) -> dict[str, Any]:
    """Parameters as plain data."""
    return {name: estimate.to_dict() for name, estimate in parameters.items()}
