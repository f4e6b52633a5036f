"""Findings that were put right before the search, in front of what was found in what is left."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

from ...identification.uncertainty import Estimate
from ..explained import Explanation
from ..finding import Finding

# With a finding before it, a verdict claims what that leaves.
_VERDICTS = {"consistent": "explained", "unexplained": "partly_explained"}


def with_preceding(
    found: Explanation, first: Sequence[Finding], left: float, before: Mapping[str, float]
) -> Explanation:
    """An explanation of what was put right, with the findings by which it was.

    **Arguments:** `left`: the part of the baseline's mean-square residual that they leave, which
    the shares of the other findings are of; `before`: by name of the figure in `fit`, the
    baseline's error before anything was put right.
    """
    others = [f._replace(share=f.share * left) for f in found.findings]
    pictures = [None] * len(first) + list(found.curves.get("findings", ()))
    errors = {name: found.fit[name] | {"before": error} for name, error in before.items()}
    return dataclasses.replace(
        found,
        findings=[*first, *others],
        curves=found.curves | {"findings": pictures},
        verdict=_VERDICTS.get(found.verdict, found.verdict),
        fit=found.fit | errors,
    )


def p_value(value: Estimate) -> float:
    """That a value is zero, by its standard error and a normal distribution."""
    return math.erfc(abs(float(value.value) / float(value.standard_error)) / math.sqrt(2))
