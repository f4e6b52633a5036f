"""The regression problem of a recording: its rows, force and motion aligned, and the base's fit."""

from collections.abc import Callable
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from ..checks import LINEARITY as LINEARITY
from ..data.recording import Recording
from ..terms import KNOWN_FEEDBACK
from ..terms.base import AbstractTerm
from ..terms.effects import traits
from ..terms.effects.late import TransportDelay
from .candidates import CandidateSet
from .evidence import Evidence, gather
from .fewest import fewest
from .least_squares import orthonormal
from .motion import Motion, derived, motion_of
from .predictions import with_predictions
from .regression import Fit, fit
from .reversals import creeps, yields
from .significance import blocks
from .threads import each

# Least part of the mean-square residual that a term must remove. Below it the amplitude is under a
# sixth of the residual's, where held forces, encoder counts and smoothed velocities leave traces of
# their own.
LEAST_SHARE = 0.03
# Alignments that differ by less than this part of a sample, and explain next to nothing of what is
# left, make no difference worth another search.
ALIGNED = 0.1
# Width of a kernel between the narrow one and one of twice its width, in parts of the narrow one.
BETWEEN = 4 / 3
# Force that acts is as large through a kernel of twice the width. The noise of the acceleration is
# 2⁵ to 2⁷ times weaker there in power; halfway between, on a scale of ratios, tells them apart.
PERSISTS = 2**-1.25
# A local polynomial of this part of the width takes a fifth as much off a motion that it cannot
# follow (a quartic's error goes with the fourth power), and has two to three times the noise.
NARROWER = 2 / 3


class OtherRows(NamedTuple):
    """Rows of the same recording in which a law has to be the same; `None` where too few would be
    left, or where they say nothing else.

    `between`, `wide`: through kernels of 4/3 and of twice the width; `rougher`: with a velocity
    that is smoothed over less, where it is over more than the kernel; made when first asked for.
    """

    between: Evidence | None
    wide: Evidence | None
    rougher: Callable[[], Evidence | None]


class Problem(NamedTuple):
    """The rows of a recording, and the baseline fitted to them.

    - `evidence`: the rows; `wide`, `between`, `rougher`: see `OtherRows`.
    - `base`: the fit of the baseline, whose terms are `structure`.
    - `block`: number of each row's block.
    - `candidate_sets`: the candidates with their columns, for these rows first, then for other
      rows of the same motion.
    - `delay`: how much later the force was taken, s.
    - `in_slip`: where rows reach across reversals, the problem with rows in slip alone.
    - `creeps`: whether these were left out since the axis creeps through zero velocity.
    - `held`: rows of the held-out recording, once everything has been chosen without it.
    - `start`: β from which the baseline is fitted, `(d,)`; `None` where it is looked for.
    """

    evidence: Evidence
    wide: Evidence | None
    between: Evidence | None
    base: Fit
    block: np.ndarray
    structure: AbstractTerm
    candidate_sets: tuple[CandidateSet, ...]
    delay: float
    in_slip: "Problem | None" = None
    creeps: bool = False
    held: Evidence | None = None
    start: np.ndarray | None = None
    rougher: Callable[[], Evidence | None] = lambda: None

    @property
    def reversals(self) -> bool:
        """Whether rows reach across reversals, where the axis moves instead of sticking."""
        return self.in_slip is not None

    @property
    def candidate_set(self) -> CandidateSet:
        """The candidates for these rows, with their columns."""
        return self.candidate_sets[0]

    def close(self) -> None:
        """Begin no more columns of candidates."""
        for candidates in self.candidate_sets:
            candidates.close()

    def forget(self) -> None:
        """Hold no columns of candidates any more."""
        for candidates in self.candidate_sets:
            candidates.forget()

    @property
    def other_rows(self) -> OtherRows:
        """The rows by which a law is confirmed."""
        return OtherRows(self.between, self.wide, self.rougher)


def problem_of(
    recording: Recording | Motion,
    structure: AbstractTerm,
    before: Problem | None = None,
    half_width: int | None = None,
    start: np.ndarray | None = None,
) -> Problem:
    """The regression problem of a recording, force and motion aligned.

    **Arguments:** `before`: a problem of the same motion and baseline, whose columns serve again if
    only the force has been shifted; `half_width` of the kernel, in samples, where the usual one is
    too wide; `start`: β from which the baseline is fitted, where they are known.
    """
    motion = motion_of(recording)
    evidence = gather(motion, half_width)
    if before is not None:
        return _aligned(motion, evidence, structure, before.candidate_sets, before.start)
    candidates = CandidateSet(evidence, structure)
    try:
        problem = _aligned(motion, evidence, structure, (candidates,), start)
    except BaseException:
        candidates.close()
        raise
    if problem.candidate_set is not candidates:
        candidates.close()
        problem = problem._replace(candidate_sets=problem.candidate_sets[:1])
    return problem


def realigned(recording: Recording | Motion, problem: Problem, known: Fit) -> Problem:
    """The problem aligned by another model; itself where that makes no difference."""
    motion, in_slip = motion_of(recording), problem.in_slip or problem
    kernels = in_slip.evidence, in_slip.wide
    later, part = _later(*kernels, in_slip.delay, known)
    near = abs(later - in_slip.delay) <= ALIGNED * in_slip.evidence.limits.interval
    if near and part < LEAST_SHARE:
        return problem
    kernels = _taken_later(motion, *kernels, later)
    evidence, wide, delay = _aligned_by(motion, *kernels, later, known)
    structure, candidate_sets = problem.structure, problem.candidate_sets
    again = _assembled(motion, evidence, wide, structure, known, candidate_sets, delay, False)
    return again._replace(start=problem.start)


def across_reversals(recording: Recording | Motion, problem: Problem) -> Problem:
    """The problem with rows across reversals too; without them where the axis sticks or creeps."""
    motion, width, delay = motion_of(recording), problem.evidence.width, problem.delay
    if not yields(motion, problem.evidence, problem.base):
        return problem
    evidence = gather(motion, width, delay, True)
    if creeps(evidence, fit([problem.structure], evidence, problem.base.betas)):
        return problem._replace(creeps=True)
    wide = _wider(motion, evidence, delay, True)
    structure, base, candidate_sets = problem.structure, problem.base, problem.candidate_sets
    across = _assembled(motion, evidence, wide, structure, base, candidate_sets, delay, True)
    return across._replace(in_slip=problem, start=problem.start)


def with_holdout(problem: Problem, holdout: Recording | Motion) -> Problem:
    """The problem with a held-out recording's rows, by the same kernel, s, and alignment, s."""
    reach = problem.evidence.reach
    held = gather(motion_of(holdout), delay=problem.delay, reversals=problem.reversals, reach=reach)
    return problem._replace(held=held)


def _aligned(motion, evidence: Evidence, structure, candidate_sets, start) -> Problem:
    base = fit([structure], evidence, [start])
    evidence, wide, delay = _aligned_by(motion, evidence, _wider(motion, evidence), 0.0, base)
    found = _assembled(motion, evidence, wide, structure, base, candidate_sets, delay, False)
    return found._replace(start=start)


def _aligned_by(
    motion, evidence: Evidence, wide: Evidence | None, delay: float, known: Fit
) -> tuple[Evidence, Evidence | None, float]:
    """The rows with the force taken later by a delay, s, that the model `known` asks for.

    To first order a delay is a column; the first estimate is good to a fifth of a sample.
    """
    for _ in range(3):
        last = delay
        delay, _ = _later(evidence, wide, delay, known)
        evidence, wide = _taken_later(motion, evidence, wide, delay)
        if abs(delay - last) < 0.5 * ALIGNED * evidence.limits.interval:
            break
    return evidence, wide, delay


def _taken_later(
    motion, evidence: Evidence, wide: Evidence | None, delay: float
) -> tuple[Evidence, Evidence | None]:
    there = gather(motion, evidence.width, delay)
    return there, None if wide is None else gather(motion, wide.width, delay, half=wide.half)


def _later(
    evidence: Evidence, wide: Evidence | None, delay: float, known: Fit
) -> tuple[float, float]:
    """The delay, s, that is left after one more estimate, and the part of the energy that it
    removes; beyond a sample it is to be found, and none of that is removed here.
    """
    sample = evidence.limits.interval
    late, part = _lateness([evidence] if wide is None else [evidence, wide], known)
    delay -= late
    return (-0.5 * sample, 0.0) if abs(delay) > sample else (delay, part)


def _assembled(
    motion, evidence: Evidence, wide, structure, known: Fit, candidate_sets, delay, across
) -> Problem:
    base = fit([structure], evidence, known.betas[:1])
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    ours = next((some for some in candidate_sets if some.serves(evidence)), None)
    ours = ours or CandidateSet(evidence, structure, candidate_sets[0])
    every = (ours, *(some for some in candidate_sets if some is not ours))
    between = _wider(motion, evidence, delay, across, BETWEEN)
    rougher = cache(partial(_rougher, motion, evidence, delay, across))
    return Problem(evidence, wide, between, base, block, structure, every, delay, rougher=rougher)


def _rougher(motion: Motion, narrow: Evidence, delay: float, across: bool) -> Evidence | None:
    """The rows with a velocity that is smoothed over less; `None` where it is recorded, or is
    smoothed over no more than the kernel.
    """
    if motion.polynomial <= narrow.width:
        return None
    try:
        return gather(derived(motion.recording, NARROWER), narrow.width, delay, across)
    except ValueError:
        return None


def _wider(
    recording: Motion, narrow: Evidence, delay=0.0, across=False, factor=2.0
) -> Evidence | None:
    """The recording through a wider kernel on the same nodes, so that what is stepped from node to
    node, as a load in its gap, is the same; `None` if too few rows would be left for a test of
    significance.
    """
    half = round(factor * narrow.half)
    try:
        wide = gather(recording, half * narrow.width // narrow.half, delay, across, half=half)
        blocks(wide.elapsed[wide.centre], wide.reach)
    except ValueError:
        return None
    return wide


def _without_feedback(seen: Evidence) -> Evidence:
    """With the predicted force of the command alone: a servo is on time with the motion."""
    channels = seen.motion.channels
    if KNOWN_FEEDBACK not in channels:
        return seen
    force = channels["predicted_force"] - np.asarray(channels[KNOWN_FEEDBACK], float)
    return seen.with_channels(predicted_force=force)


def _beside_fewest(column: np.ndarray, current: Fit, evidence: Evidence) -> tuple[float, float]:
    """The same of a servo's command, beside the fewest values that have to be others.

    A servo's command follows its position, so that its lateness is nearly damping: beside all
    values it is not known.
    """
    own = np.concatenate([column[:, None], current.columns], axis=1)
    target = current.residual + current.columns @ np.concatenate(current.alphas)
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    enough = LINEARITY**2 * float(evidence.force @ evidence.force)
    others = [i for i in fewest(own, target, block, enough) if i]
    basis = orthonormal(own[:, others])
    alone, left = (x - basis @ (basis.T @ x) for x in (column, target))
    along = float(alone @ left)
    delay = along / max(float(alone @ alone), 1e-300)
    return delay, along * delay / max(float(left @ left), 1e-300)


def _lateness(kernels: list[Evidence], known: Fit) -> tuple[float, float]:
    """How much earlier the force is than belongs to the same instant as the position, s, and the
    part of the energy that this explains.

    A force that is held from sample to sample acts half a sample late; a controller that needs one
    cycle for its computation adds one. Within one sample either way this is a matter of logging and
    no fault; what is beyond is left to be found. Where the two kernels differ, the wider one
    decides, since noise of the encoder moves the narrow one only.
    """
    sample = kernels[0].limits.interval
    index = [i for i, term in enumerate(known.terms) if not traits(term).delays]
    terms, betas = [known.terms[i] for i in index], [known.betas[i] for i in index]

    def late(evidence: Evidence) -> tuple[float, float]:
        seen = with_predictions(evidence, known)
        current = fit(terms, seen, betas, 6)
        seen = _without_feedback(with_predictions(seen, current))
        column = seen.columns(TransportDelay(), np.zeros((1, 0)))[0, :, 0]
        if KNOWN_FEEDBACK in seen.motion.channels:
            return _beside_fewest(column, current, seen)
        basis = current.basis()
        column = column - basis @ (basis.T @ column)
        along = float(column @ current.residual)
        delay = along / max(float(column @ column), 1e-300)
        return delay, along * delay / max(current.energy, 1e-300)

    (narrow, part), *others = each(late, kernels)
    wide = others[0] if others else (narrow, part)
    return (narrow, part) if abs(narrow - wide[0]) < 0.5 * sample else wide
