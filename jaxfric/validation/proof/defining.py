"""The proof by physical definition: what carries over from one to another."""

from collections.abc import Sequence
from typing import Any

from ..concealed.definitions import DEVELOPMENT, SCORED, half_of
from .counting import rate
from .scoring import Score


def of_definition(scores: Sequence[Score]) -> list[tuple[str, str, str, list[Score]]]:
    """Cases with one definition: half, what it is of, its name, the cases."""
    groups: dict[tuple[str, str, str], list[Score]] = {}
    for s in scores:
        if len(s.definitions) == 1 and s.kind in ("healthy", "single"):
            of, name = s.definitions[0]
            groups.setdefault((half_of(of, name), of, name), []).append(s)
    return [(*key, some) for key, some in sorted(groups.items())]


def by_definition(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """A row for each definition, and for each half: cases, exact, in class, verdicts."""
    groups = of_definition(scores)
    rows = [
        {"half": half, "of": of, "definition": name, **_counts(some)}
        for half, of, name, some in groups
    ]
    for half in (DEVELOPMENT, SCORED):
        for kind in ("healthy", "single"):
            some = [s for h, _, _, part in groups for s in part if h == half and s.kind == kind]
            if some:
                rows.append({"half": half, "of": kind, "definition": "all", **_counts(some)})
    return rows


def _counts(some: Sequence[Score]) -> dict[str, Any]:
    said = sorted({s.verdict or "no answer" for s in some})
    return {
        "cases": len(some),
        "exact": sum(s.exact for s in some),
        "within": sum(s.exact if s.kind == "healthy" else s.within for s in some),
        "shows": rate(some, lambda s: s.shows).hits,
        "verdicts": {v: sum((s.verdict or "no answer") == v for s in some) for v in said},
        "otherwise": sorted({n for s in some if not s.exact for n in s.named}),
    }
