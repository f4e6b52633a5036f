"""Which physics the residual calls for: the winner of a contest joins, and all are refitted."""

import copy
from collections.abc import Callable, Hashable, Sequence
from typing import NamedTuple

import jax
import numpy as np

from ..data.recording import Recording
from ..models import Model
from ..terms.effect import Effect
from .candidates import Candidate, CandidateSet
from .contest import RIVAL, Contest, Finalist, Trial, contest
from .evidence import Evidence
from .intervals import left_out
from .motion import Motion
from .plausible import machines, nil
from .predictions import with_predictions
from .problem import BETWEEN, WideKernels
from .regression import Fit, fast, fit, without
from .significance import DRAWS, LEVEL, blocks

# A term is believed if it accounts for this much of the mean-square residual, too: below it, the
# amplitude is under a sixth of the residual's, where held forces, counts and smoothed velocities
# leave their own traces.
LEAST_SHARE = 0.03
LATER_SHARE = 0.05
MOST_TERMS = 4
# What comes after stronger terms must also be this part of what the base left, or most of what
# they leave: no term has quite the shape of what it stands for, and a tenth of its amplitude may
# stay. No law has the shape of that remainder either, so that it takes the smaller part of it: a
# third is more than what the remainder of one law, another shape, shares with another law.
# Below a hundredth of the amplitude no force is known to follow its law.
OF_BASE, LEAST_OF_BASE = 0.01, 1e-4
MOST = 1 / 3


class Taken(NamedTuple):
    """A term that was taken, its rivals, and its p-value.

    `rephased`: whether on the held-out recording its waves only fit with another phase;
    `confirmed`: whether that recording bears it out, `None` where it cannot say.
    """

    trial: Trial
    rivals: tuple[str, ...]
    p_value: float
    rephased: bool = False
    confirmed: bool | None = None


class Named(NamedTuple):
    """The terms that the residual calls for, on top of the base.

    `base` and `last`: the fits before and after; `taken`, in the order of discovery; `left`, the
    contest for what remains; `smoothed`: what kernel and sampling make of the time by which the
    force is late, where it is, s; `start`: what rows without reversals had shown, where these reach
    across them; `given`: the base with its own values, where these are kept, but for `free`,
    numbers of its parameters; `undone`: puts back the force of a recording, where it acts late.
    """

    base: Fit
    last: Fit
    taken: list[Taken]
    left: Contest
    smoothed: float = 0.0
    start: "Named | None" = None
    given: Model | None = None
    free: tuple[int, ...] = ()
    undone: Callable[[Recording], Motion] | None = None

    @property
    def names(self) -> frozenset[str]:
        """The effects that were found."""
        return frozenset(taken.trial.candidate.effect.name for taken in self.taken)

    def term_index(self, number: int) -> int:
        """The index, among all terms of the fit, of the selected term of that number."""
        return len(self.last.terms) - len(self.taken) + number

    @property
    def rephased(self) -> frozenset[int]:
        """Indices of the terms that need another phase on the held-out recording."""
        taken = enumerate(self.taken)
        return frozenset(self.term_index(number) for number, each in taken if each.rephased)


def search(
    evidence: Evidence,
    base: Fit,
    field: CandidateSet,
    wider: WideKernels = (None, None),
    seed: int = 0,
    start: Named | None = None,
) -> Named:
    """Add terms while they are believed; after each, drop those that have become idle.

    **Arguments:** `field`: the candidates; `wider`: the recording through wider kernels, where
    terms that act on derivatives of the force must show alike; `start`: what the rows without
    reversals have shown, where these reach across them. Then only what acts there is looked for:
    all else has been, where nothing of that hides it.
    """
    now, taken, kept = base, list[Taken](), 0
    refused = set[Hashable]()
    evidence = with_predictions(evidence, now)
    if start is not None:
        # The base would bend its curve to what acts at reversals; without them it did not.
        now, taken = _elsewhere(start)
        now = fit(now.terms, with_predictions(evidence, now), now.betas, 0)
        evidence = with_predictions(evidence, now)
        kept = len(taken)
    visited = set[Hashable]()
    while True:
        round_ = contest(evidence, now, field, seed, lambda e: start is None or e.at_reversals)
        open_ = [f for f in round_.finalists if _form(f.trial.candidate) not in refused]
        round_ = machines(round_._replace(finalists=open_), now, evidence)
        best = _believed(round_, now, evidence, wider, base, taken)
        # Two terms that make each other idle would take turns for ever.
        names = *sorted(t.trial.candidate.effect.name for t in taken), len(refused)
        if best is None or len(taken) >= MOST_TERMS or names in visited:
            if start is not None and len(taken) == kept:
                # Nothing there has a name, and the base fits these rows as well as it can.
                betas = (base.betas[0], *now.betas[1:])
                now = fit(now.terms, evidence, betas, 6) if taken else base
            # What went again leaves the base as it was, not as it was refitted on the way.
            return Named(base, now if taken else base, taken, round_, start=start)
        visited.add(names)
        best, rivals = _rivals(_plainer(best, round_), round_, now, evidence)
        trial = _own(best.trial)
        taken.append(Taken(trial, rivals, best.p_value))
        terms = (*now.terms, trial.candidate.term)
        now = fit(terms, evidence, best.betas)
        evidence = with_predictions(evidence, now)
        now = fit(terms, evidence, now.betas, 4)
        now, taken = _pruned(evidence, now, taken, round_.size)
        for number in nil(now, len(taken), evidence, wider[1]):
            refused.add(_form(taken[number].trial.candidate))
            now = without(now, evidence, len(now.terms) - len(taken) + number)
            taken = [t for i, t in enumerate(taken) if i != number]


def _form(candidate: Candidate) -> Hashable:
    """The form of its law."""
    return jax.tree.structure(candidate.term)


def _own(trial: Trial) -> Trial:
    """The trial with a term of its own: two waves of one candidate are two terms."""
    term = copy.copy(trial.candidate.term)
    return trial._replace(candidate=trial.candidate._replace(term=term))


# Of the idealisations of a reversal none is right to the last tenth of its score, and a law of
# three nonlinear parameters finds that tenth in any of them: then the one with fewer is meant.
NO_EVIDENCE = 0.9


def _plainer(best: Finalist, round_: Contest) -> Finalist:
    """The best, or an idealisation of the same with fewer parameters that does nearly as well."""

    def meant(other: Finalist) -> bool:
        effect = other.trial.candidate.effect
        known = effect.at_reversals and not effect.sharp and other.p_value <= LEVEL
        fewer = len(other.betas[-1]) < len(best.betas[-1])
        return known and fewer and other.score >= NO_EVIDENCE * best.score

    if not best.trial.candidate.effect.at_reversals:
        return best
    return next((other for other in round_.finalists if meant(other)), best)


# Nor one whose force is the same but for 5 %: what noise, which is never quite as assumed, makes of
# the rest decides between them.
ALIKE = 0.95


def _rivals(
    best: Finalist, round_: Contest, now: Fit, evidence
) -> tuple[Finalist, tuple[str, ...]]:
    """The effects that cannot be told from the best; a line in position goes before one in time.

    At constant speed the two are one and the same, and a machine has more pitches than clocks.
    """
    basis, force = now.basis(), _force(best, evidence)
    force = force - basis @ (basis.T @ force)
    alike = []
    for other in round_.finalists:
        if other.trial.candidate.effect.name == best.trial.candidate.effect.name:
            continue
        theirs = _force(other, evidence)
        theirs = theirs - basis @ (basis.T @ theirs)
        size = np.linalg.norm(force) * np.linalg.norm(theirs)
        same = size > 0 and abs(force @ theirs) > ALIKE * size
        # What a term leaves that is but the first order of its effect is no evidence: neither
        # against the effects that it is known to be confused with nor, where it is the other one,
        # against itself. If they are believed at all.
        effect, rival = best.trial.candidate.effect, other.trial.candidate.effect
        rough = effect.first_order or rival.first_order
        excused = rough and rival.name in effect.confusable_with
        half = now.energy - other.energy >= 0.5 * (now.energy - best.energy)
        believed = other.p_value <= LEVEL and half
        if same or other.score > best.score - RIVAL or (excused and believed):
            alike.append((other, same))
    names = [f.trial.candidate.effect.name for f, _ in alike]
    own = best.trial.candidate.effect.name
    twin = [f for f, same in alike if same and _line(f, "position")]
    if _line(best, "time") and twin and twin[0].p_value <= LEVEL:
        best = twin[0]
        instead = best.trial.candidate.effect.name
        names = [own, *(name for name in names if name != instead)]
    return best, tuple(dict.fromkeys(names))


def _line(finalist: Finalist, coordinate: str) -> bool:
    """Whether it is a wave over a coordinate alone."""
    lines = finalist.trial.candidate.lines
    return lines is not None and lines.coordinate == coordinate and not lines.sided


def _force(finalist: Finalist, evidence) -> np.ndarray:
    columns = evidence.columns(finalist.trial.candidate.term, finalist.betas[-1][None])[0]
    return columns @ finalist.alpha


# The linearity of a good torque or current sensor, relative: a force below it, with respect to the
# force's root mean square, cannot be told from the sensor whatever its p-value.
LINEARITY = 2e-3


# Sharp terms hold the very noise that they are judged by: none of the draws may be as good.
RAREST = 1.5 / (1 + DRAWS)


# Isolated pushes besides another effect are mostly where that effect switches, and terms on the
# force's own derivatives take what a strong effect leaves through the kernel; a load behind a gap
# is one of them, with three numbers of its own: effects with the trait `leftover`.
EASY_OF_BASE = 0.05
# Idealisations of what happens about a reversal (one spring, friction without a dip on the load):
# half of the amplitude of one is no evidence for another of them, or for pushes there.
REVERSAL_OF_BASE = 0.25
# None of these floors is for what takes three quarters of what is left: what an idealisation leaves
# is not of one law's shape; on machines with one effect a second name took two thirds at most.
NEARLY_ALL = 0.75


def _believed(
    round_: Contest, now: Fit, evidence, wider, base: Fit, taken: list[Taken]
) -> Finalist | None:
    least = LATER_SHARE if taken else LEAST_SHARE
    force = float(evidence.force @ evidence.force)
    before = [t.trial.candidate.effect for t in taken]
    for finalist in round_.finalists:
        gained = now.energy - finalist.energy
        candidate = finalist.trial.candidate
        effect = candidate.effect
        floor = LINEARITY**2 * force
        enough = gained >= max(max(least, candidate.least) * now.energy, floor)
        if effect.ubiquitous:
            enough &= gained >= fast(now) ** 2 * len(now.residual)
        if taken:
            enough &= gained >= least_gain(effect, before, base.energy, now.energy)
            enough &= not _again(finalist, taken)
        level = RAREST if effect.sharp else LEVEL
        if not (finalist.score > 0 and finalist.p_value <= level and enough):
            continue
        if (effect.sharp or candidate.term.swings) and not _confirmed(finalist, now, wider, least):
            continue
        return finalist
    return None


def least_gain(
    effect: Effect,
    before: Sequence[Effect],
    base: float,
    left: float,
    floor: float = LEAST_OF_BASE,
) -> float:
    """The energy that a term after others must account for, N².

    **Arguments:** `before`: the effects taken already; `base` and `left`: the energy that the base
    left, and that they leave; `floor`: the least part of the base's.
    """
    again = any(earlier.at_reversals for earlier in before)
    if again and (effect.at_reversals or effect.isolated):
        return min(REVERSAL_OF_BASE * base, NEARLY_ALL * left)
    if effect.leftover:
        return min(EASY_OF_BASE * base, NEARLY_ALL * left)
    return max(floor * base, min(OF_BASE * base, MOST * left))


def _again(finalist: Finalist, taken: list[Taken]) -> bool:
    """Whether the effect has been taken already; of waves there may be several."""
    own = finalist.trial.candidate
    several = own.lines is not None or own.effect.several
    return not several and any(t.trial.candidate.effect.name == own.effect.name for t in taken)


# What noise of the encoder makes, by the controller's answer, is a quarter of the rest at most.
HALF = 0.5


def _confirmed(finalist: Finalist, now: Fit, wider: WideKernels, least: float) -> bool:
    """Whether a term is the same through a kernel of twice the width.

    There the noise of the derivatives is down by 2⁵ to 2⁷ in power, the physics hardly. But a load
    may swing above that kernel's band. What takes most of what is left is not the noise of the
    encoder to which the controller answers, a quarter of it at most on machines with nothing
    concealed; then a kernel a third wider will do.
    """
    between, wide = wider
    if wide is None or _alike(finalist, now, wide, 2.0, least):
        return True
    term = finalist.trial.candidate.term
    most = now.energy - finalist.energy >= HALF * now.energy
    loud = term.swings and most and between is not None
    return loud and _alike(finalist, now, between, BETWEEN, least)


def _alike(finalist: Finalist, now: Fit, wide: Evidence, factor: float, least: float) -> bool:
    """Whether a term has the same size, within a factor, through a kernel as much wider.

    Of a column of noise what the rest cannot imitate changes by more, of one of physics it does
    not.
    """
    less = fit(now.terms, with_predictions(wide, now), now.betas, 4)
    seen = with_predictions(wide, less)
    # At the β of the narrow kernel: where the wide one leaves little, it would find another.
    term, beta, basis = finalist.trial.candidate.term, finalist.betas[-1], less.basis()
    there = fit([term], seen, [beta], 0, basis)
    ratio = np.linalg.norm(there.part(0)) / max(
        float(np.linalg.norm(there.columns @ finalist.alpha)), 1e-300
    )
    positive = bool(np.all(there.alphas[0] > 0))
    enough = less.energy - there.energy >= least * less.energy
    return positive and 1 / factor < ratio < factor and enough


def _elsewhere(found: Named) -> tuple[Fit, list[Taken]]:
    """What was found but for what acts at reversals."""
    start = len(found.last.terms) - len(found.taken)
    mine = [t.trial.candidate.effect for t in found.taken]
    kept = [i for i, effect in enumerate(mine) if not effect.at_reversals]
    last = found.last.only([*range(start), *(start + i for i in kept)])
    return last, [found.taken[i] for i in kept]


def _pruned(evidence, now, taken, size):
    """Without terms that the newest one, or the base refitted beside it, has made idle.

    Idle is, too, what does not help to predict blocks that it was not fitted to; of a force of one
    moment no other block knows.
    """
    start = len(now.terms) - len(taken)
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    for place in reversed(range(start, len(now.terms))):
        less = without(now, evidence, place)
        gain, trial = 1 - now.energy / less.energy, taken[place - start].trial
        idle = trial.score(gain, size) <= 0 or gain < LEAST_SHARE
        if not trial.candidate.effect.momentary:
            idle |= left_out(now, place, block) >= less.energy
        if idle:
            now = less
            taken = [t for i, t in enumerate(taken) if i != place - start]
    return now, taken
