"""What an explanation returns: the verdict, where, the findings, before and after, the model."""

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from ..models import Model
from ..uncertainty import Estimate

SCHEMA = "jaxfric.explanation/1"

VERDICTS = {
    "consistent": "Nothing is missing: what the model leaves is no more than noise.",
    "explained": "The named physics accounts for what the model leaves out.",
    "partly_explained": "Named physics accounts for a part; structure is left, or terms overlap.",
    "unexplained": "Something is missing that no effect of the library accounts for.",
}


class Moved(NamedTuple):
    """A parameter of the baseline whose value is wrong: before, after, standard error, unit."""

    before: float
    value: Any
    standard_error: Any
    unit: str


class Finding(NamedTuple):
    """One effect that the baseline lacks.

    - `effect`: its public name; `equation`; `sentence`: in words.
    - `confusable_with`: effects that this recording cannot tell from it; `separate_by`: the
      experiment that would.
    - `parameters`: by name, each with value, standard error and unit.
    - `share`: part of the baseline's mean-square residual that it removes; `holdout_share`: the
      same on the held-out recording, `None` without one or where the effect is of the moment.
    - `p_value`: paid for by the number of terms tried.
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


@dataclasses.dataclass(frozen=True)
class Explanation:
    """Why a model and a recording differ.

    - `verdict`: "consistent", "explained", "partly_explained" or "unexplained".
    - `where`: coordinates on which the baseline's residual has structure, the strongest first.
    - `findings`: the missing physics, the strongest first.
    - `fit`: force errors before and after, on the recording and on the held-out one.
    - `not_visible`: the smallest size of each other effect that this recording would have shown.
    - `model`: baseline and found terms, for predict, simulate and export.
    - `baseline`: the baseline with its parameters; `baseline_parameters` with standard errors.
    - `curves`: what pictures are drawn from.
    """

    verdict: str
    where: list[dict[str, Any]]
    findings: list[Finding]
    fit: dict[str, Any]
    not_visible: list[dict[str, Any]]
    model: Model
    baseline: Model
    baseline_name: str
    baseline_parameters: dict[str, Estimate]
    recording: dict[str, Any]
    curves: dict[str, Any] = dataclasses.field(default_factory=dict, repr=False)

    def to_dict(self) -> dict[str, Any]:
        """The explanation as plain data (schema `jaxfric.explanation/1`)."""
        return {
            "schema": SCHEMA,
            "recording": self.recording,
            "baseline": {
                "name": self.baseline_name,
                "parameters": _estimates(self.baseline_parameters),
            },
            "verdict": self.verdict,
            "summary": self.summary,
            "where": self.where,
            "findings": [
                {**finding._asdict(), "parameters": _estimates(finding.parameters)}
                | {"confusable_with": list(finding.confusable_with)}
                for finding in self.findings
            ],
            "fit": self.fit,
            "not_visible": self.not_visible,
            "model": self.model.to_dict(),
        }

    @property
    def summary(self) -> str:
        """The verdict in one sentence, with what the fit gains."""
        text, error = VERDICTS[self.verdict], self.fit["force_error"]
        if self.findings:
            text += f" Force error {error['before']:.2%} before, {error['after']:.2%} after"
            held = self.fit.get("holdout_force_error")
            if held:
                text += f"; on the held-out recording {held['before']:.2%} and {held['after']:.2%}"
            text += "."
        other, refitted = self.fit["holdout_force_error"], self.fit["holdout_refitted_error"]
        if refitted is not None and other["before"] > ELSEWHERE * refitted:
            text += (
                f" But the held-out recording is left with {other['before']:.2%} of its force, and "
                f"with {refitted:.2%} where the model is fitted to it: this recording does not "
                "determine the values that hold there. Identify on one that moves like both."
            )
        return text


# Other values of the same model leave less than half of a held-out recording's error, a quarter of
# its power: then most of it is not physics that the model lacks.
ELSEWHERE = 2.0


def _estimates(parameters: Mapping[str, Estimate | Moved]) -> dict[str, Any]:
    return {name: _estimate(estimate) for name, estimate in parameters.items()}


def _estimate(estimate: Estimate | Moved) -> dict[str, Any]:
    error = float(estimate.standard_error)
    rest = {"standard_error": error if math.isfinite(error) else None, "unit": estimate.unit}
    if isinstance(estimate, Moved):
        return {"from": float(estimate.before), "to": float(estimate.value), **rest}
    return {"value": float(estimate.value), **rest}
