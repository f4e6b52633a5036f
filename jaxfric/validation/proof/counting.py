"""Rates over the scored cases, each with its interval."""

from collections.abc import Callable, Iterable, Sequence
from statistics import NormalDist, median
from typing import Any, NamedTuple

from .scoring import Parameter, Score

# Edges of the bins of power, in parts of the Coulomb level.
EDGES = (0.0, 0.02, 0.05, 0.10, 0.20, float("inf"))
# Levels of size that have a line of their own: text, from, below.
LEVELS = (
    ("10 % or more", 0.10, float("inf")),
    ("5 to 10 %", 0.05, 0.10),
    ("below 5 %", 0.0, 0.05),
)
NONE, FAILED = "none", "no answer"


class Rate(NamedTuple):
    """How many of how many."""

    hits: int
    total: int

    @property
    def share(self) -> float | None:
        """Hits over total; `None` of none."""
        return self.hits / self.total if self.total else None

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of a binomial share (Wilson 1927)."""
        if not self.total:
            return 0.0, 1.0
        z, n, p = NormalDist().inv_cdf(0.975), self.total, self.hits / self.total
        middle, scale = p + z**2 / (2 * n), 1 + z**2 / n
        reach = z * (p * (1 - p) / n + (z / (2 * n)) ** 2) ** 0.5
        return (middle - reach) / scale, (middle + reach) / scale


def rate(scores: Iterable[Score], holds: Callable[[Score], bool | None]) -> Rate:
    """How many cases something holds of, out of those of which it can be said."""
    said = [answer for answer in map(holds, scores) if answer is not None]
    return Rate(sum(map(bool, said)), len(said))


def middle(values: Iterable[float | None]) -> float | None:
    """The median of what is there."""
    there = [value for value in values if value is not None]
    return median(there) if there else None


def of_kind(scores: Sequence[Score], kind: str) -> list[Score]:
    """The cases of one kind; one that went wrong counts, as a miss."""
    return [score for score in scores if score.kind == kind]


def binned(scores: Sequence[Score]) -> list[tuple[str, list[Score]]]:
    """Single effects by size."""
    rows = []
    for low, high in zip(EDGES[:-1], EDGES[1:], strict=True):
        inside = [s for s in of_kind(scores, "single") if s.sizes and low <= s.sizes[0] < high]
        text = f"{low:.0%} to {high:.0%}" if high < EDGES[-1] else f"{low:.0%} or more"
        rows.append((text if low else f"below {high:.0%}", inside))
    return [row for row in rows if row[1]]


def confusion(scores: Sequence[Score]) -> tuple[list[str], list[str], list[list[int]]]:
    """True effect by the one named first; names of rows and columns, and counts.

    Single effects, those outside the library, and healthy machines, which are the row "none"; a
    case that went wrong is in the column "no answer".
    """
    pairs = [
        (s.effects[0] if s.effects else NONE, FAILED if s.error else (*s.named, NONE)[0])
        for s in scores
        if s.kind != "pair"
    ]
    last = {NONE: 1, FAILED: 2}

    # A row beyond the diagonal only where something was drawn, a column only where it was named.
    true = sorted({row for row, _ in pairs}, key=lambda name: (last.get(name, 0), name))
    columns = {name for pair in pairs for name in pair}
    named = sorted(columns, key=lambda name: (last.get(name, 0), name))
    counts = [[pairs.count((row, column)) for column in named] for row in true]
    return true, named, counts


def parameters(scores: Sequence[Score], same: bool = True) -> list[Parameter]:
    """Of rightly named effects: those that mean the same in the machine, or the others."""
    every = (p for s in scores for p in s.parameters if p.effect in s.effects)
    return [p for p in every if p.same == same]


def covered(found: Iterable[Parameter]) -> Rate:
    """How often the 95 % interval held the true value."""
    said = [p.held for p in found if p.held is not None]
    return Rate(sum(said), len(said))


def summary(scores: Sequence[Score]) -> dict[str, Any]:
    """The numbers of the short table: label to a rate, or to a median."""
    healthy, single, pair, outside = (
        of_kind(scores, kind) for kind in ("healthy", "single", "pair", "outside")
    )
    rows: dict[str, Any] = {
        "nothing concealed: called consistent": rate(healthy, lambda s: s.exact),
        "nothing concealed: something named": rate(healthy, lambda s: bool(s.named)),
        "one effect: named exactly": rate(single, lambda s: s.exact),
        "one effect: named first": rate(single, lambda s: s.named[:1] == s.effects),
        "one effect: among the named": rate(single, lambda s: s.among),
        "one effect: named or declared confusable": rate(single, lambda s: s.within),
        "one effect: its place found": rate(single, located),
    }
    for text, low, high in LEVELS:
        some = [s for s in single if s.sizes and low <= s.sizes[0] < high]
        seen = [s for s in some if s.shows]
        rows |= {
            f"one effect, {text}: named exactly": rate(some, lambda s: s.exact),
            f"one effect, {text}: named or declared confusable": rate(some, lambda s: s.within),
            f"one effect, {text}: its place found": rate(some, located),
            f"one effect, {text}, that shows: named exactly": rate(seen, lambda s: s.exact),
            f"one effect, {text}, that shows: named or declared confusable": rate(
                seen, lambda s: s.within
            ),
            f"one effect, {text}: parameters' median relative error": middle(
                p.error for p in parameters(some)
            ),
        }
    return rows | {
        "two effects: both and nothing else": rate(pair, lambda s: s.exact),
        "two effects: both named": rate(pair, lambda s: s.among),
        "two effects: at least one named": rate(pair, lambda s: s.hits > 0),
        "two effects that show: both named": rate([s for s in pair if s.shows], lambda s: s.among),
        "outside the library: not called consistent": rate(
            outside, lambda s: s.error is None and s.verdict != "consistent"
        ),
        "outside the library: not called explained": rate(
            outside, lambda s: s.error is None and s.verdict != "explained"
        ),
        **_whole(scores, [*single, *pair]),
    }


def _whole(scores: Sequence[Score], concealed: Sequence[Score]) -> dict[str, Any]:
    """The numbers that are not of one kind of case only."""
    known, seconds = parameters(scores), [s.seconds for s in scores if s.seconds is not None]
    return {
        "parameters: median relative error": middle(p.error for p in known),
        "parameters: 95 % interval held the truth": covered(known),
        "held-out force error: median part of the oracle's reduction": middle(
            s.reached for s in concealed
        ),
        "held-out velocity error, run forward: median part removed": middle(
            map(quieted, concealed)
        ),
        "seconds a case, median": middle(seconds),
        "seconds a case, longest": max(seconds, default=None),
        "cases that went wrong": rate(scores, lambda s: s.error is not None),
    }


def quieted(score: Score) -> float | None:
    """Part of the velocity error of a forward run that the findings remove."""
    if score.run_before is None or score.run_after is None:
        return None
    return 1 - score.run_after / score.run_before


def located(score: Score) -> bool | None:
    """Whether the place of every effect was found; a case that went wrong is a miss."""
    return False if score.error is not None else score.located
