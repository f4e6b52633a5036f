"""What an explanation returns: the verdict, where, the findings, before and after, the model."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from html import escape
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..data.provenance import versions
from ..identification import tabulate
from ..identification.uncertainty import Estimate
from ..looks import drawing, html, text
from ..models import Model
from . import pictures

SCHEMA = "jaxfric.explanation/1"

VERDICTS = {
    "consistent": "Nothing is missing: what the model leaves is no more than noise.",
    "explained": "The named physics accounts for what the model leaves out.",
    "partly_explained": "Named physics accounts for a part; structure is left, or terms overlap.",
    "unexplained": "Something is missing that no effect of the library accounts for.",
}

# The same where the baseline is another recording.
CHANGES = {
    "consistent": "Nothing differs between the two recordings beyond the noise.",
    "explained": "What is named accounts for the difference between the two recordings.",
    "partly_explained": "What is named accounts for a part of the difference between the two "
    "recordings; more is left.",
    "unexplained": "The two recordings differ by something that no effect of the library "
    "accounts for.",
}

# Pictures in a notebook and in a window: what fits on a screen.
SKETCHED, DRAWN = 4, 6

# Instead of a verdict's words, where what was measured contradicts itself.
DOUBTED = "Until that is put right, nothing is named."


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
      held-out recording bears it out, `None` where it is not asked; `instead`: to each wrong value
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


@dataclasses.dataclass(frozen=True)
class Explanation:
    """Why a model and a recording differ.

    - `verdict`: "consistent", "explained", "partly_explained" or "unexplained".
    - `where`: coordinates on which the baseline's residual has structure, the strongest first.
    - `findings`: the missing physics, the strongest first; `not_confirmed`: what this recording
      shows and the held-out one does not bear out, which is not in the model. The held-out
      recording says nothing else: all is looked for and fitted without it.
    - `fit`: force errors before and after, on the recording and on the held-out one.
    - `not_visible`: the smallest size of each other effect that this recording would have shown.
    - `model`: baseline and found terms, for predict, simulate and export.
    - `baseline`: the baseline with its parameters; `baseline_parameters` with standard errors.
    - `recording`, `holdout`: file and its SHA-256, samples, duration and rate of each.
    - `curves`: what pictures are drawn from.
    - `warnings`: what makes the answer doubtful, each with `name`, `text` and whether it is
      `severe`: then what would be said beside it is certain to be wrong.
    - `holdout_model`: the model as it stands on the held-out recording: `model`, but for waves at
      their phase there and without what belongs to a moment (`fit["holdout_adjusted"]` says which).
    - `sanity`: what was looked at before any physics where the baseline is a simulator, a row each
      with `check`, whether it is `wrong`, `value` and `text`.

    `fit["force_error"]` is `jf.predict(model, recording)` and a subtraction, as `force_error` in
    `jaxfric.simulation.prediction`; `fit["filtered_force_error"]` the same through the kernel by
    which effects are looked for, `width` its half-width, s.
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
    holdout: dict[str, Any] | None = None
    curves: dict[str, Any] = dataclasses.field(default_factory=dict, repr=False)
    warnings: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    holdout_model: Model | None = None
    sanity: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    not_confirmed: list[Finding] = dataclasses.field(default_factory=list)

    def to_dict(self) -> dict[str, Any]:
        """The explanation as plain data (schema `jaxfric.explanation/1`)."""
        return {**self._told(), "model": self.model.to_dict(), **self._elsewhere()}

    def _told(self) -> dict[str, Any]:
        """The document without models."""
        return {
            "schema": SCHEMA,
            "recording": self.recording,
            "baseline": {
                "name": self.baseline_name,
                "parameters": _estimates(self.baseline_parameters),
            },
            "verdict": self.verdict,
            "warnings": self.warnings,
            **({"sanity": self.sanity} if self.sanity else {}),
            "summary": self.summary,
            "where": self.where,
            "findings": _findings(self.findings),
            "not_confirmed": _findings(self.not_confirmed),
            "fit": self.fit,
            "not_visible": self.not_visible,
            "holdout": self.holdout,
            "versions": versions(),
        }

    def __repr__(self) -> str:
        return text.attempt(
            lambda: text.text(tabulate.explained(self._told())),
            lambda: f"Explanation(verdict={self.verdict!r})",
        )

    def _repr_html_(self) -> str:
        return text.attempt(
            lambda: html.html(tabulate.explained(self._told()), html.png(self._sketch)),
            lambda: f"<pre>{escape(repr(self))}</pre>",
        )

    def _sketch(self, figure) -> None:
        names = pictures.there(self.curves)[:SKETCHED]
        figure.set_size_inches(9, 0.4 + 2.8 * -(-len(names) // 2))
        pictures.draw(self.curves, names, pictures.grid(figure, len(names)))

    def plot(self, *names: str, ax=None):
        """Pictures of where the baseline errs, before and after, by matplotlib.

        **Arguments:** `names`, by default the first six there are, of "where" (the mean residual
        over the coordinate where its structure is strongest; "where 2" over the next), "force" and
        "residual" over time, "friction", and "holdout", the residual of the held-out recording;
        `ax`, matplotlib's axes to draw on, one for each name; a single one without a name gets the
        first.

        **Returns:** the axes, an array of as many as names; a single one for a single name or `ax`.

        **Raises:** `ValueError` for a name there is not, or without matplotlib.
        """
        known = pictures.there(self.curves)
        alone = ax is not None and np.ndim(ax) == 0
        names = names or tuple(known[: 1 if alone else DRAWN])
        if ax is None and len(names) != 1:
            size = 9, 0.4 + 2.8 * -(-len(names) // 2)
            panels = pictures.grid(drawing.figure(*size), len(names))
        else:
            panels = drawing.panels(ax, len(names), 4)
        pictures.draw(self.curves, names, panels)
        return panels[0] if alone or len(names) == 1 else panels

    def _elsewhere(self) -> dict[str, Any]:
        """The model of the held-out figures, where that is not the saved one."""
        if self.holdout_model is None or not _adjusted(self.fit):
            return {}
        return {"holdout_model": self.holdout_model.to_dict()}

    @property
    def summary(self) -> str:
        """The verdict in words: what is certain to be wrong first, then the force errors."""
        severe = [each["text"] for each in self.warnings if each["severe"]]
        other = [each["text"] for each in self.warnings if each["name"] == "not_better"]
        words = CHANGES if self.baseline_name.startswith("recording") else VERDICTS
        verdict = DOUBTED if severe and not self.findings else words[self.verdict]
        refuted = [_not_confirmed(self.not_confirmed)] if self.not_confirmed else []
        said = [*severe, verdict, *other, *refuted, _errors(self.fit, bool(self.findings))]
        return " ".join([*said, *_not_determined(self.fit)])


def _not_confirmed(findings: Sequence[Finding]) -> str:
    names = dict.fromkeys(finding.effect.replace("_", " ") for finding in findings)
    return (
        f"What looks like {' and '.join(names)} here is not borne out by the held-out recording, "
        "and is left out of the model."
    )


def _errors(fit: Mapping[str, Any], found: bool) -> str:
    """The force errors, and what of them is noise."""

    def said(error: Mapping[str, float]) -> str:
        after = f" before, {error['after']:.2%} after" if found else ""
        return f"{error['before']:.2%}{after}"

    text = f"Force error {said(fit['force_error'])}"
    if held := fit.get("holdout_force_error"):
        text += f"; on the held-out recording{_adjusted(fit)} {said(held)}"
    if (floor := fit.get("noise_floor")) is not None and math.isfinite(floor):
        text += f"; {floor:.2%} is what noise alone makes"
    return f"{text}.{_by_sample(fit)}"


# A third of the force, a tenth of its power.
LARGE = 0.3


def _by_sample(fit: Mapping[str, Any]) -> str:
    """What most of a large error is that no filter leaves: noise, or friction beside standstill."""
    if "filtered_force_error" not in fit:
        return ""
    whole, filtered = fit["force_error"]["after"], fit["filtered_force_error"]["after"]
    if not whole > LARGE or filtered > 0.5 * whole:
        return ""
    if (floor := fit.get("noise_floor")) is not None and floor**2 > 0.5 * whole**2:
        what = "the noise of the acceleration"
    else:
        what = "left beside standstill and reversals, for which the values are no good"
    return f" Sample by sample most of it is {what}: {filtered:.2%} is left through a filter."


def _adjusted(fit: Mapping[str, Any]) -> str:
    """Which findings the held-out figures take otherwise than the saved model has them."""
    adjusted = fit.get("holdout_adjusted") or {}
    parts = [
        f"{' and '.join(name.replace('_', ' ') for name in adjusted[key])} {how}"
        for key, how in (("rephased", "at another phase"), ("left_out", "left out"))
        if adjusted.get(key)
    ]
    return f" ({', '.join(parts)})" * bool(parts)


def _not_determined(fit: Mapping[str, Any]) -> list[str]:
    """That other values hold on the held-out recording, or none that this one determines."""
    refitted = fit.get("filtered_holdout_refitted_error")
    if refitted is None or fit["filtered_holdout_force_error"]["after"] <= ELSEWHERE * refitted:
        return []
    through = f"{fit['filtered_holdout_force_error']['after']:.2%}"
    text = (
        f"But through the search's filter {through} of the held-out force is left, and "
        f"{refitted:.2%} where the model is fitted to it: "
    )
    if values := fit.get("holdout_values"):
        there = ", ".join(_differs(name, **value) for name, value in values.items())
        return [
            f"{text}there {there}. Either the machine changed in between, or no model of this kind "
            "holds for both motions."
        ]
    return [
        f"{text}this recording does not determine the values that hold there. Identify on one that "
        "moves like both."
    ]


def _differs(name: str, here: float, there: float, standard_error: float, unit: str) -> str:
    digits = max(0, 1 - math.floor(math.log10(2 * standard_error)))
    unit = f" {unit}" if unit not in ("", "1") else ""
    return f"{name} is {there:.{digits}f} instead of {here:.{digits}f}{unit}"


# Other values of the same model leave less than half of a held-out recording's error, a quarter of
# its power: then most of it is not physics that the model lacks.
ELSEWHERE = 2.0


def _findings(findings: Sequence[Finding]) -> list[dict[str, Any]]:
    return [
        {**finding._asdict(), "parameters": _estimates(finding.parameters)}
        | {"confusable_with": list(finding.confusable_with)}
        | {"instead": {name: list(others) for name, others in finding.instead.items()}}
        for finding in findings
    ]


def _estimates(parameters: Mapping[str, Estimate | Moved]) -> dict[str, Any]:
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
