"""Where the baseline and the findings leave structure in the residual, and what of it counts."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..terms.effects import EFFECTS
from . import threads
from .acceptance import LATER_SHARE, LEAST_SHARE, LINEARITY, OF_BASE
from .bins import unit
from .evidence import Evidence
from .finding import Finding
from .improvement import UNSEEN, Improved
from .locate import ACCELERATED, Structure, locate, repeated, without_line
from .mismatch import Mismatch
from .predictions import with_predictions
from .problem import PERSISTS, Problem
from .regression import Fit, fast, fit
from .significance import LEVEL

# Part of what is left, below which a coordinate is not where it is.
HALF = 0.5


class Shown(NamedTuple):
    """Where a residual has structure that counts, and where it has most, counting or not."""

    counts: list[Structure]
    most: list[Structure]


def before_and_after(
    better: Improved, wrong: Mismatch | None, seed: int
) -> tuple[Shown, list[Structure]]:
    """Where the baseline's residual has structure, and where that of the findings has."""
    problem = better.findings.problem
    undelayed, selection = better.findings.undelayed
    force = float(np.sqrt(np.mean(problem.evidence.force**2)))
    fits = [(better.first, problem, LEAST_SHARE, LINEARITY * force)]
    if better.findings.selection.selected or wrong is not None:
        mismatch = float(np.sqrt(better.first.energy / len(better.first.residual)))
        remainder = OF_BASE**0.5 * mismatch  # of laws that have not quite the shape of their effect
        fits.append((selection.last, undelayed, LATER_SHARE, max(LINEARITY * force, remainder)))
    before, *after = threads.each(lambda one: _shown(*one, seed), fits)
    return before, after[0].counts if after else []


def _shown(current: Fit, problem: Problem, share: float, size: float, seed: int) -> Shown:
    """The structure of a fit's residual that a wider kernel and the held-out recording show too.

    From so large a `share` of what is left, and of that `size`, N.
    """
    located = locate(with_predictions(problem.evidence, current), current, seed)
    found = significant(located, share, size)
    found = in_others(found, current, problem.wide, seed)
    if any(s.coordinate in ACCELERATED for s in found):
        found = in_others(found, current, problem.rougher(), seed)
    return Shown(lasting(found, current, problem, seed), located[:1])


def significant(found: list[Structure], share: float, size: float) -> list[Structure]:
    """The structure that counts: by p-value, by its share of what is left, and by its size, N."""
    return [s for s in found if s.p_value <= LEVEL and s.share >= share and s.size >= size]


def in_others(
    found: list[Structure], current: Fit, others: Evidence | None, seed: int
) -> list[Structure]:
    """Without structure that other rows do not show, or show much smaller: through a kernel of
    twice the width, or with a velocity that is smoothed over less.

    Tested are curves that hold the acceleration, whose noise is in the residual too: by the loop's
    answer to the encoder, and in the torque of another simulator, which is its inertia times the
    recorded acceleration.
    """
    if others is None or not any(s.coordinate in ACCELERATED for s in found):
        return found
    again = fit(current.terms, with_predictions(others, current), current.betas, 4)
    located = locate(with_predictions(others, again), again, seed, lines=False)
    there = {s.coordinate: s for s in located if s.p_value <= LEVEL and s.share >= LEAST_SHARE}

    def lasts(each: Structure) -> bool:
        same = there.get(each.coordinate)
        return same is not None and same.size >= PERSISTS * each.size

    return [s for s in found if s.coordinate not in ACCELERATED or lasts(s)]


def lasting(
    found: list[Structure], current: Fit, problem: Problem, seed: int = 0
) -> list[Structure]:
    """The structure that the held-out recording shows too, and that is no slow part of the noise.

    Every axis has a load that wanders: a slow one that is no larger than what differs from row to
    row is the same noise. So is a line in time of that size which no law was found for.
    """

    def wanders(each: Structure) -> bool:
        if each.coordinate == "time_lines":
            return each.size <= fast(without_line(current, problem.evidence, each))
        return each.coordinate == "time" and each.size <= fast(current)

    found = [each for each in found if not wanders(each)]
    if problem.held is None:
        return found
    return repeated(found, current, with_predictions(problem.held, current), seed)


def that_matter(
    found: list[Structure], current: Fit, left: float, counted: float
) -> list[Structure]:
    """The structure of a fit's residual that is a reason for a verdict, though it has no name.

    It is none where it is smaller than what differs from row to row, and the force error by samples
    would be less by under a hundredth of itself without it, or no more of that than answers the
    counts: then what is left is no more than noise makes. `left` of the force at the samples, and
    `counted`, what of that answers the counts of the position, N, root mean square each.
    """
    unseen = max(left * float(np.sqrt(1 - (1 - UNSEEN) ** 2)), counted)
    noise = fast(current)
    return [each for each in found if each.size > min(noise, unseen)]


def documents(
    found: list[Structure],
    findings: list[Finding],
    first: Fit,
    units: Mapping[str, str],
    shared: frozenset[str],
) -> list[dict[str, Any]]:
    """The document's `where`: structure, and where findings act that no free curve shows.

    `shared`: coordinates over which the other recording leaves structure as well.
    """
    return with_findings([document(s, units, shared) for s in found], findings, first)


def strongest(
    found: Shown, units: Mapping[str, str], shared: frozenset[str]
) -> list[dict[str, Any]]:
    """The document's `where` of what has no name and no structure that counts."""
    said = []
    for each in found.most:
        place = document(each, units, shared)
        weak = "little of it, and " if each.share < HALF else ""
        chance = "no more than chance makes" if each.p_value > LEVEL else "the most that there is"
        said.append(place | {"detail": f"{place['detail']} ({weak}{chance})".lstrip()})
    return said


def with_findings(
    where: list[dict[str, Any]], findings: list[Finding], first: Fit
) -> list[dict[str, Any]]:
    """With the coordinates of findings that no free curve shows: they act at a few rows, say.

    What takes nothing off the rows beside the other findings says nothing of where they err.
    """
    for finding in findings:
        own = [name.removesuffix("_lines") for name in EFFECTS[finding.effect].coordinates]
        if not own or finding.share <= 0 or any(each["coordinate"] in own for each in where):
            continue
        power = finding.share * first.energy / len(first.residual)
        each = {
            "coordinate": own[0],
            "share": finding.share,
            "size": float(np.sqrt(power)),
            "p_value": finding.p_value,
            "detail": f"by {finding.effect.replace('_', ' ')}",
        }
        where = [*where, each]
    return where


def document(
    found: Structure, units: Mapping[str, str], shared: frozenset[str] = frozenset()
) -> dict[str, Any]:
    """One coordinate's structure, with the strongest point of its curve in words."""
    detail, its = "", unit(found.coordinate, units)
    if found.coordinate == "position_lines":
        detail = f"period {1 / found.peak:.4g} {its}"
    elif found.coordinate == "time_lines":
        detail = f"{found.peak:.4g} Hz"
    elif found.coordinate == "force_rate":
        late = float(found.curve[1][0])
        # As the findings say it: a force that acts early is one that is recorded late.
        said = "the force acts" if late > 0 else "the recorded force is"
        detail = f"{said} {abs(late):.2g} s late"
    elif len(found.curve[0]):
        at, height = found.curve
        peak = int(np.argmax(np.abs(height)))
        detail = f"strongest at {at[peak]:.3g} {its}".rstrip()
    if found.coordinate in shared:
        detail += ", as in the other recording"
    return {
        "coordinate": found.coordinate.removesuffix("_lines"),
        "share": found.share,
        "size": found.size,
        "p_value": found.p_value,
        "detail": detail,
    }
