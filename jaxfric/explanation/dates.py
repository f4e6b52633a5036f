"""When a change took place: as far as the rows tell one moment from another."""

import numpy as np

from ..identification.moments import between
from ..identification.uncertainty import Estimate
from ..terms.effects import traits
from .baseline import refitted
from .evidence import Evidence
from .findings import Findings, Solution

# The 95 % quantile of χ² with one degree of freedom.
ALIKE = 3.84
# From half a kernel on, by half as much again each time: over a record in some twenty steps.
FIRST, FURTHER = 0.5, 1.5


def dated(parameters: dict[str, Estimate], moment: str, evidence: Evidence) -> dict[str, Estimate]:
    """Parameters with the error of a time that may be anywhere between two rows, s."""
    own = parameters[moment]
    times = np.asarray(evidence.motion.time)[evidence.centre]
    after = int(np.clip(np.searchsorted(times, own.value), 1, len(times) - 1))
    anywhere = between(times[after - 1], times[after], evidence.reach)
    error = np.hypot(own.standard_error, anywhere)
    return parameters | {moment: own._replace(standard_error=np.float64(error))}


def spanning(
    parameters: dict[str, Estimate], findings: Findings, number: int
) -> dict[str, Estimate]:
    """Parameters with intervals of the times that hold every time which leaves as much.

    The energy over the moment of a change is no parabola: while the axis rests, or hardly
    accelerates after its inertia has changed, any moment does. By the profile of the likelihood,
    for as many independent values as the rows hold.
    """
    solution, further = findings.examined_in(number), 0.0
    effect = solution.selection.selected[number].effect
    for name in filter(None, (effect.moment, effect.lasting)):
        if name in parameters:
            further += _further(solution, number, name)  # what lasts has two ends
            parameters = parameters | {name: _reaching(parameters[name], further)}
    return parameters


def anytime(findings: Findings, number: int) -> bool:
    """Whether a change may have taken place at any moment of the recording: it is none, then."""
    solution = findings.examined_in(number)
    moment = solution.selection.selected[number].effect.moment
    duration = solution.problem.evidence.limits.duration
    return bool(moment) and _further(solution, number, moment) >= duration


def _further(solution: Solution, number: int, name: str) -> float:
    """How much earlier or later, s, a time leaves no more; zero where half a kernel does."""
    evidence, furthest = solution.problem.evidence, 0.0
    first, most = FIRST * evidence.reach, evidence.limits.duration
    for side in (-1.0, 1.0):
        step = first
        while step < most and _as_good(solution, number, name, side * step):
            step *= FURTHER
        furthest = max(furthest, step if step > first else 0.0)
    return min(furthest, most)


def _reaching(own: Estimate, further: float) -> Estimate:
    """An estimate whose interval holds what is so far away; where no row told of it, that alone."""
    known, times = float(own.standard_error), own._replace(standard_error=np.float64(1.0))
    there = further / float(times.half_width())
    if not there > 0 or there < known < np.inf:
        return own
    return own._replace(standard_error=np.float64(there))


def _as_good(solution: Solution, number: int, name: str, later: float) -> bool:
    """Whether the change as much later, s, leaves no more than chance; another end stays."""
    selection = solution.selection
    index, last = selection.term_index(number), selection.last
    term = last.terms[index]
    names = [p.name for p in term.nonlinear]
    beta = last.betas[index].copy()
    beta[names.index(name)] += later
    ends = traits(term).lasting
    if ends in names and name != ends:
        beta[names.index(ends)] -= later
    if ends in names and beta[names.index(ends)] <= 0:
        return False
    betas = (*last.betas[:index], beta, *last.betas[index + 1 :])
    moved = refitted(
        solution.problem.evidence, last._replace(betas=betas), selection.given, selection.free, 0
    )
    return selection.remaining.size * np.log(moved.energy / last.energy) < ALIKE
