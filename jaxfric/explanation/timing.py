"""A dead time or a lag: the same to first order, told apart by undoing each exactly.

A column T dû/dt cannot tell u = f(t + τ) from u = f + T df/dt. But the recorded force can be put
back: taken τ earlier, or passed through the lag 1/(1 + T s). The one that leaves less is the
better account, with what noise of the force it takes away on its own added again. A time as long as
the kernel is wide shows in no column; undoing it does.
"""

import dataclasses
import functools
from typing import NamedTuple

import numpy as np

from ..data.recording import Recording
from ..terms import KNOWN_FEEDBACK as FEEDBACK
from ..terms.effect import Effect
from ..terms.effects import EFFECTS, traits
from .acceptance import least_gain
from .candidates import Candidate
from .evidence import gather
from .findings import Findings, Solution
from .motion import Motion, motion_of
from .predictions import with_predictions
from .problem import Problem
from .regression import Fit, fast, fit, without
from .rivals import NO_EVIDENCE
from .selection import SelectedTerm, Selection
from .significance import BLOCKS, LEVEL, agreement
from .trials import RIVAL, Trial

# Steps, from the first-order estimate, which may be off by its own second order, to times between
# which the least energy lies; and parabolas from there on, until the time is this well known.
STRIDE, STRIDES = 1.3, 12
PARABOLAS, CLOSE = 4, 3e-3


class LateForce(NamedTuple):
    """A force that is late: its time, s, and the effect that it is.

    `selected`: the term, under its right name; `time_error`: the error of the time by smoothing and
    sampling, s.
    """

    time: float
    effect: Effect
    selected: SelectedTerm
    time_error: float

    def undone(self, recording: Recording | Motion) -> Motion:
        """The motion of a recording with its force where it belongs."""
        return _undone(motion_of(recording), self.effect, self.time)


def late(recording: Motion, problem: Problem, found: Selection) -> LateForce | None:
    """The delay or lag among the findings under its right name, where there is one."""
    index = [i for i, term in enumerate(found.last.terms) if traits(term).late]
    if len(index) != 1 or index[0] < found.term_index(0):
        return None
    guess = float(found.last.alphas[index[0]][0])
    if guess <= 0:
        return None
    undoing = _Undoing(recording, problem, found.last)
    return _told_apart(
        undoing, guess, found.selected[index[0] - found.term_index(0)], found.remaining.size
    )


# Undoing a delay or lag that is there takes most of what is left; what merely resembles one, as the
# bend of a force at its switches does, shares with many others.
MOST_LATE = 0.5


def overlooked(
    recording: Motion, problem: Problem, found: Selection, seed: int = 0
) -> LateForce | None:
    """A delay or lag beside the findings that is too long for its first order to show.

    Times are doubled from one sampling period on until undoing them does more harm than good, which
    is at once where nothing is late. What is found is tested by the blocks, with random signs of
    what it changes in each of them, and has to show through a kernel of twice the width too.
    """
    if any(traits(term).late for term in found.last.terms):
        return None
    undoing = _Undoing(recording, problem, found.last)
    before = undoing.rest(None, 0.0)
    power, limits = before @ before, problem.evidence.limits
    tried: list[tuple[Effect, float, np.ndarray]] = []
    harmful = set[bool]()
    for effect in (each for each in EFFECTS.values() if each.late):
        if effect.logged in harmful:
            continue
        first, time = len(tried), limits.interval
        while time < limits.duration / BLOCKS:
            tried.append((effect, time, undoing.rest(effect, time)))
            if tried[-1][2] @ tried[-1][2] > power:
                break
            time *= 2
        if len(tried) == first + 1:  # harm at once, and to first order a lag is a delay
            harmful.add(effect.logged)
    if len(harmful) == 2:
        return None
    effect, time, rest = min(tried, key=lambda each: each[2] @ each[2])
    gain, wide = float(1 - rest @ rest / power), problem.wide
    if gain < MOST_LATE or (wide and undoing.gain(effect, time, wide.width) < MOST_LATE):
        return None
    p_value = agreement(np.stack([before**2 - each[2] ** 2 for each in tried]), problem.block, seed)
    if p_value > LEVEL:
        return None
    candidate = _candidate(effect)
    trial = Trial(candidate, np.zeros(0), gain, 0.0, 1, p_value, np.inf, 1.0)
    return _told_apart(undoing, time, SelectedTerm(trial, (), p_value), found.remaining.size)


class _Undoing:
    """A recording whose delay or lag is undone, and the terms that then explain it."""

    def __init__(self, recording: Recording | Motion, problem: Problem, known: Fit):
        self.motion, self.problem, self.known = motion_of(recording), problem, known
        pairs = zip(known.terms, known.betas, strict=True)
        self.terms, self.betas = zip(*(p for p in pairs if not traits(p[0]).late), strict=True)
        count = self.motion.recording.num_samples
        self.noise = _of_commands(self.motion.forced(np.random.default_rng(0).normal(size=count)))
        self.hiss = functools.cache(self._hiss)
        narrow = self.hiss(None, 0.0, problem.evidence.width)
        self.power = fast(known) ** 2 / narrow  # of the force's noise, in the time domain, N²

    def _hiss(self, effect: Effect | None, time: float, width: int) -> float:
        """What white noise of the force leaves in a row, in parts of its power."""
        noise = _undone(self.noise, effect, time)
        # Of the noise alone: a simulator's force, which the target is without, is none of it.
        rows = gather(noise, width, reversals=self.problem.reversals).force
        return float(np.mean(rows**2))

    def rest(self, effect: Effect | None, time: float, width: int | None = None) -> np.ndarray:
        """What the refitted terms leave once the time of an effect is undone, N, `(J,)`.

        A lag undone takes noise away, too, which says nothing for it: what there is of noise in the
        rest counts as if it were untouched. What else is in the rest is left by both ways alike.
        What a filter undone adds counts: of a long one all that is slow would seem to be noise.
        """
        problem, width = self.problem, width or self.problem.evidence.width
        rows = gather(_undone(self.motion, effect, time), width, problem.delay, problem.reversals)
        current = fit(self.terms, with_predictions(rows, self.known), self.betas, 3)
        before, after = self.hiss(None, 0.0, width), self.hiss(effect, time, width)
        left = float(np.mean(current.residual**2))
        noisy = min(self.power * after / left, 1.0) if left > 0 else 1.0
        return current.residual * float(np.sqrt(1 + noisy * max(before / after - 1, 0.0)))

    def gain(self, effect: Effect, time: float, width: int) -> float:
        """The part of the energy that undoing a time takes away."""
        before, after = self.rest(None, 0.0, width), self.rest(effect, time, width)
        return float(1 - after @ after / (before @ before))

    def least(self, effect: Effect, guess: float, width: int | None = None) -> tuple[float, float]:
        """The least energy over times, from a guess downhill, and the time there."""

        @functools.cache
        def energy(time: float) -> float:
            rest = self.rest(effect, time, width)
            return float(rest @ rest)

        low, best, high = guess / STRIDE, guess, guess * STRIDE
        for _ in range(STRIDES):
            if energy(low) < min(energy(best), energy(high)):
                low, best, high = low / STRIDE, low, best
            elif energy(high) < energy(best):
                low, best, high = best, high, high * STRIDE
            else:
                break
        for _ in range(PARABOLAS):
            times = np.array([low, best, high])
            time = _vertex(times, np.array([energy(each) for each in times]))
            if not low < time < high or abs(time - best) < CLOSE * best:
                break
            better = energy(time) < energy(best)
            if time < best:
                low, best, high = (low, time, best) if better else (time, best, high)
            else:
                low, best, high = (best, time, high) if better else (low, best, time)
        return energy(best), best


def _vertex(times: np.ndarray, heights: np.ndarray) -> float:
    """Where a parabola through three points is lowest; NaN where it is nowhere."""
    middle, spread = times[1], times[2] - times[0]
    square, slope, _ = np.polyfit((times - middle) / spread, heights / heights[1], 2)
    return float(middle - 0.5 * spread * slope / square) if square > 0 else float("nan")


def _told_apart(undoing: _Undoing, guess: float, selected: SelectedTerm, size: float) -> LateForce:
    """A delay or a lag of about `guess`, s, whichever leaves less of `size` independent values.

    Several lags in a row are neither: both take nearly all of it then, and either may be meant. So
    may a lag of second order, whose corner is above what the recording excites.
    """
    problem = undoing.problem
    ways = alike(selected.effect)
    least = {effect.name: undoing.least(effect, guess) for effect in ways}
    best = EFFECTS[min(least, key=lambda name: least[name][0])]
    energy, time = least.pop(best.name)
    others = {name: 0.5 * size * np.log(left / energy) for name, (left, _) in least.items()}
    as_it_is = undoing.rest(None, 0.0)
    score = 0.5 * size * np.log(float(as_it_is @ as_it_is) / energy)
    nearly = max(RIVAL, (1 - NO_EVIDENCE) * score)
    near = [name for name, gap in others.items() if gap < nearly]
    for each in [EFFECTS[name] for name in others if name not in near]:
        forms = [dataclasses.replace(each, undone=form) for form in each.also_undone]
        left = min((undoing.least(form, time)[0] for form in forms), default=np.inf)
        if 0.5 * size * np.log(left / energy) < nearly:
            near.append(each.name)
    rivals = (*near, *(r for r in selected.rivals if r != best.name and r not in others))
    wide = time
    if problem.wide is not None:
        wide = undoing.least(best, time, 2 * problem.evidence.width)[1]
    # Smoothing errs with the square of the width, so a third of what doubling it changes is left
    # (Richardson 1911); and nobody wrote down when in its period a sample of the force was taken.
    time_error = float(np.hypot((wide - time) / 3, problem.evidence.limits.interval / np.sqrt(12)))
    trial = selected.trial._replace(candidate=_candidate(best))
    return LateForce(time, best, selected._replace(trial=trial, rivals=rivals), time_error)


def alike(late: Effect) -> list[Effect]:
    """The effects that are the same to first order: the force acts late, or is recorded late."""
    return [each for each in EFFECTS.values() if each.late and each.logged == late.logged]


def _candidate(effect: Effect) -> Candidate:
    return Candidate(effect, effect.laws[0](), np.zeros((1, 0)))


def with_late_force(found: Solution, undelayed: Solution, late: LateForce) -> Findings:
    """The findings: what was selected once the force was put back, and the delay or lag itself.

    What the findings leave is what the problem `undelayed` leaves, as a column for the delay keeps
    its second order.
    """
    undelayed = _worth_it(undelayed, late, found.selection.base)
    others, known = undelayed.selection, late.selected.trial.candidate
    evidence = with_predictions(found.problem.evidence, others.last)
    none = np.zeros(0)
    current = fit((*others.last.terms, known.term), evidence, [*others.last.betas, none], 6)
    # To first order the rest is only nearly itself.
    current = current._replace(
        alphas=(*others.last.alphas, np.array([late.time])), betas=(*others.last.betas, none)
    )
    selection = found.selection._replace(
        last=current,
        selected=[*others.selected, late.selected],
        remaining=others.remaining,
        time_error=late.time_error,
        undone=late.undone,
    )
    return Findings(Solution(found.problem, selection), undelayed)


def _worth_it(undelayed: Solution, late: LateForce, base: Fit) -> Solution:
    """The terms selected beside an undone delay or lag, without another such, that remove enough.

    As for any later term, but that an undone delay leaves nothing of its own.
    """
    problem, selection = undelayed
    others = [t for t in selection.selected if not t.effect.late]
    index = [i for i, term in enumerate(selection.last.terms) if not traits(term).late]
    seen = with_predictions(problem.evidence, selection.last)
    terms, betas = ([values[i] for i in index] for values in selection.last[:2])
    current = fit(terms, seen, betas, 6)
    for number in reversed(range(len(others))):
        less = without(current, seen, len(current.terms) - len(others) + number)
        effects = [t.effect for t in (late.selected, *others[: number + 1])]
        least = least_gain(effects[-1], effects[:-1], base.energy, less.energy, 0.0)
        if less.energy - current.energy < least:
            current, others = less, [t for i, t in enumerate(others) if i != number]
    return Solution(problem, selection._replace(last=current, selected=others))


def _of_commands(motion: Motion) -> Motion:
    """The motion without a servo's feedback: all of its force is what the command makes."""
    channels = {k: v for k, v in motion.recording.channels.items() if k != FEEDBACK}
    return motion._replace(recording=dataclasses.replace(motion.recording, channels=channels))


def _undone(motion: Motion, effect: Effect | None, time: float) -> Motion:
    """The motion with the force where it belongs; as it is, for no effect."""
    if effect is None or effect.undone is None:
        return motion
    return motion.forced(effect.undone(motion.recording, time).force)
