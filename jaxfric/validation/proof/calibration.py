"""Whether findings are true as often as they are sure of themselves."""

from collections.abc import Callable, Sequence
from typing import Any

from . import counting as counted
from .counting import Rate
from .scoring import Belief, Score

# Edges of the bins of p, and of the part of the residual that a finding removes.
P_EDGES = (0.0, 1e-3, 3e-3, 1e-2, 3e-2, 1.0)
SHARE_EDGES = (0.0, 0.01, 0.03, 0.1, 0.3, float("inf"))


def beliefs(scores: Sequence[Score]) -> list[Belief]:
    """Of all cases whose truth has a name: nothing that is said of the others could be right."""
    return [belief for s in scores if s.kind != "outside" for belief in s.beliefs]


def reliability(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """Findings by how sure they are: how many there are, how many true, how many within the class.

    By p-value, by part of the residual removed, by what the held-out recording says, and by whether
    other names are declared confusable.
    """
    found = beliefs(scores)
    rows = [
        *_bins("p", found, P_EDGES, lambda b: b.p, "{:g}"),
        *_bins("share of the residual", found, SHARE_EDGES, lambda b: b.share, "{:.0%}"),
    ]
    rows += [
        _row(f"held-out recording: {text}", [b for b in found if b.confirmed is value])
        for value, text in ((True, "confirmed"), (None, "cannot say"), (False, "not confirmed"))
    ]
    rows += [
        _row("one name", [b for b in found if not b.alike]),
        _row("other names declared", [b for b in found if b.alike]),
        _row("all", found),
    ]
    return [row for row in rows if row["findings"]]


def _bins(
    what: str,
    found: Sequence[Belief],
    edges: Sequence[float],
    value: Callable[[Belief], float | None],
    form: str,
) -> list[dict[str, Any]]:
    """A row for each bin, its upper edge inside it; what has no value has no row."""
    rows = []
    for low, high in zip(edges[:-1], edges[1:], strict=True):
        inside = [b for b in found if (v := value(b)) is not None and low < max(v, 1e-300) <= high]
        end = f"up to {form.format(high)}" if high < float("inf") else f"over {form.format(low)}"
        mean = sum(value(b) or 0.0 for b in inside) / len(inside) if inside else None
        rows.append(_row(f"{what} {end}", inside) | {"mean": mean})
    return rows


def _row(text: str, some: Sequence[Belief]) -> dict[str, Any]:
    return {
        "findings": len(some),
        "of": text,
        "true": sum(b.true for b in some),
        "within": sum(b.within for b in some),
    }


def coverage(scores: Sequence[Score]) -> list[dict[str, Any]]:
    """How often the 95 % intervals of rightly named effects held the truth, by effect."""
    known = counted.parameters(scores)
    names = sorted({p.effect for p in known})
    rows = [_covered(name, [p for p in known if p.effect == name]) for name in names]
    return [row for row in (*rows, _covered("all", known)) if row["intervals"]]


def _covered(name: str, some) -> dict[str, Any]:
    held: Rate = counted.covered(some)
    error = counted.middle(p.error for p in some)
    return {"effect": name, "intervals": held.total, "held": held.hits, "median_error": error}
