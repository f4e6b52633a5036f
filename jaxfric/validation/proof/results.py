"""What came out of a proof, as a document."""

from collections.abc import Sequence
from typing import Any

from .calibration import coverage, reliability
from .counting import Rate, summary
from .defining import by_definition
from .scoring import Score


def results(scores: Sequence[Score]) -> dict[str, Any]:
    """The summary, the outcome by definition, and how often findings and intervals are true."""
    rows = {
        label: {"hits": value.hits, "of": value.total} if isinstance(value, Rate) else value
        for label, value in summary(scores).items()
        if not isinstance(value, Rate) or value.total
    }
    return {
        "cases": len(scores),
        "summary": rows,
        "by_definition": by_definition(scores),
        "reliability": reliability(scores),
        "coverage": coverage(scores),
    }
