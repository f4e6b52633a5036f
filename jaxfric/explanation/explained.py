"""What an explanation returns: the verdict, where, the findings, before and after, the model."""

import dataclasses
from html import escape
from typing import Any

import numpy as np

from ..data.provenance import versions
from ..identification import tabulate
from ..identification.uncertainty import Estimate
from ..looks import drawing, html, text
from ..models import Model
from . import pictures, wording
from .finding import Finding, estimates_document, findings_document

SCHEMA = "jaxfric.explanation/1"

# Pictures in a notebook and in a window: what fits on a screen.
SKETCHED, DRAWN = 4, 6


@dataclasses.dataclass(frozen=True)
class Explanation:
    """Why a model and a recording differ.

    - `verdict`: "consistent", "explained", "partly_explained" or "unexplained".
    - `where`: coordinates on which the baseline's residual has structure, the strongest first.
    - `findings`: the missing physics, the strongest first; `not_confirmed`: what this recording
      shows and the held-out one does not confirm, or, with `confirmed` as `None`, what its rows
      show and makes the model worse sample by sample; it is not in the model. The held-out
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
      their phase there, without what belongs to a moment, and as after a change that was before
      it (`fit["holdout_adjusted"]` says which).
    - `sanity`: what was looked at before any physics where the baseline is a simulator, a row each
      with `check`, whether it is `wrong`, `value` and `text`.

    `fit["force_error"]` is `jf.predict(model, recording)` and a subtraction, as `force_error` in
    `jaxfric.simulation.errors`; `fit["filtered_force_error"]` the same through the kernel by
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
        return {**self._document(), "model": self.model.to_dict(), **self._elsewhere()}

    def _document(self) -> dict[str, Any]:
        """The document without models."""
        return {
            "schema": SCHEMA,
            "recording": self.recording,
            "baseline": {
                "name": self.baseline_name,
                "parameters": estimates_document(self.baseline_parameters),
            },
            "verdict": self.verdict,
            "warnings": self.warnings,
            **({"sanity": self.sanity} if self.sanity else {}),
            "summary": self.summary,
            "where": self.where,
            "findings": findings_document(self.findings),
            "not_confirmed": findings_document(self.not_confirmed),
            "fit": self.fit,
            "not_visible": self.not_visible,
            "holdout": self.holdout,
            "versions": versions(),
        }

    def __repr__(self) -> str:
        return text.attempt(
            lambda: text.text(tabulate.explained(self._document())),
            lambda: f"Explanation(verdict={self.verdict!r})",
        )

    def _repr_html_(self) -> str:
        return text.attempt(
            lambda: html.html(tabulate.explained(self._document()), html.png(self._sketch)),
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
        if self.holdout_model is None or not wording.adjusted(self.fit):
            return {}
        return {"holdout_model": self.holdout_model.to_dict()}

    @property
    def summary(self) -> str:
        """The verdict in words: what is certain to be wrong first, then the force errors."""
        return wording.summary(
            self.verdict, self.baseline_name, self.findings, self.not_confirmed, self.fit,
            self.warnings,
        )  # fmt: skip
