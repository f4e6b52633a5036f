"""Which physics the residual calls for: candidates compete, the winner joins, all are refitted."""

from typing import NamedTuple

import numpy as np

from ..terms import DisturbancePulses
from ..terms.base import AbstractTerm
from .candidates import Candidate, Field, scaled
from .chance import DRAWS, LEVEL, Judge, adjusted, blocks, thresholds
from .evidence import Evidence
from .predictions import with_predictions
from .pulses import pulses
from .regression import Fit, fit

# A term is believed if it accounts for this much of the mean-square residual, too: below it, the
# amplitude is under a sixth of the residual's, where held forces, counts and smoothed velocities
# leave their own traces.
LEAST_SHARE = 0.03
LATER_SHARE = 0.05
MOST_TERMS = 4
# Candidates refined beyond the grid: refining gains little over neighbouring grid points.
FINALISTS = 8


class Trial(NamedTuple):
    """A candidate with its place on the grid, and how it did there.

    `gain`: R²; `chance`: the mean of it by chance; `dimension`: how many of its columns are new;
    `threshold`: the R² that would have been believed; `fresh`: the part of the term's force, in
    amplitude, that the model cannot imitate.
    """

    candidate: Candidate
    beta: np.ndarray
    gain: float
    chance: float
    dimension: int
    p_value: float
    threshold: float
    fresh: float

    def score(self, gain: float, size: float) -> float:
        """Half the log-likelihood ratio, less the price of the parameters (Schwarz 1978)."""
        price = self.dimension + len(self.beta)
        return -0.5 * size * np.log1p(-min(gain, 1 - 1e-12)) - 0.5 * price * np.log(max(size, 2))


class Finalist(NamedTuple):
    """A candidate refined: its score and p-value, the energy left, and where.

    `betas`: of the whole model, the candidate's last; `alpha`: the candidate's.
    """

    score: float
    trial: Trial
    p_value: float
    energy: float
    betas: tuple[np.ndarray, ...]
    alpha: np.ndarray


class Contest(NamedTuple):
    """One round: every candidate on the grid, and the finalists refitted with the whole model.

    `size`: how many independent values the residual is worth.
    """

    trials: list[Trial]
    finalists: list[Finalist]
    size: float


def contest(evidence: Evidence, now: Fit, field: Field, seed: int = 0) -> Contest:
    """Let every candidate compete for the residual of a fit; `evidence` with its predictions."""
    seen = evidence
    block = blocks(seen.elapsed[seen.centre], seen.reach)
    judge = Judge(now, block, seed)
    scans = [
        judge(field.columns(i, seen), candidate.effect.positive)
        for i, candidate in enumerate(field.candidates)
    ]
    drawn = np.array([s.drawn for s in scans])
    p_values = adjusted(np.array([s.gain[s.best] for s in scans]), drawn)
    least = thresholds(drawn, LEVEL)
    trials = [
        _trial(judge, c, field.columns(i, seen), scan, float(p), float(limit))
        for i, (c, scan, p, limit) in enumerate(
            zip(field.candidates, scans, p_values, least, strict=True)
        )
    ]
    known = any(isinstance(term, DisturbancePulses) for term in now.terms)
    for candidate in [] if known else pulses(seen, now):
        raw = scaled(candidate.columns(seen))
        # Signs of blocks say nothing about single events: what stands out has been tested.
        trials.append(_trial(judge, candidate, raw, judge(raw), 1 / (1 + DRAWS), np.inf))
    trials = [t for t in trials if t.dimension]
    size = float(np.median([t.dimension / t.chance for t in trials]))
    trials.sort(key=lambda t: -t.score(t.gain, size))
    return Contest(trials, _finals(seen, now, trials, size), size)


def _trial(judge, candidate, raw, scan, p_value, limit) -> Trial:
    best = scan.best
    own = raw[best : best + 1]
    inside = np.einsum("gkj,glj->gkl", own, judge.fresh(own)[0])
    fresh = np.sqrt(np.sum(inside**2) / max(float(np.sum(own**2)), 1e-30))
    return Trial(
        candidate, candidate.betas[best], float(scan.gain[best]), float(scan.chance[best]),
        int(scan.dimension[best]), p_value, limit, float(fresh),
    )  # fmt: skip


def _finals(seen: Evidence, now: Fit, trials: list[Trial], size: float) -> list[Finalist]:
    done, basis = [], now.basis()
    bent = any(t.p_value <= LEVEL and t.candidate.term.coordinates <= _SPEED for t in trials)
    # A sharp term may not be confirmed, and must not keep the next best from being looked at.
    blunt = [t for t in trials if t.candidate.effect.name not in SHARP]
    leader = (blunt or trials)[0]
    enough = 0.5 * leader.score(leader.gain, size) - RIVAL
    for number, trial in enumerate(trials):
        found = None
        if number < FINALISTS and trial.score(trial.gain, size) >= enough:
            found = _refined(seen, now, trial, basis)
        if bent and _imitated(trial, now):
            again = _afresh(seen, now, trial)
            found = again if found is None or again.energy < found.energy else found
        if found is None or not _sensible(trial, found.alpha):
            continue
        gain = 1 - found.energy / now.energy
        p_value = LEVEL if gain > trial.threshold else 1.0
        p_value = min(trial.p_value, p_value)
        done.append(found._replace(score=trial.score(gain, size), p_value=p_value))
    return sorted(done, key=lambda finalist: -finalist.score)


def _sensible(trial: Trial, alpha: np.ndarray) -> bool:
    """Whether magnitudes are positive, and the first of several harmonics is no bystander.

    A wave whose fundamental is under a quarter of its strongest harmonic is that harmonic's.
    """
    if trial.candidate.effect.positive and np.any(alpha < 0):
        return False
    if trial.candidate.lines is None or len(alpha) == 2:
        return True
    size = np.hypot(alpha[::2], alpha[1::2])
    return bool(size[0] >= 0.25 * size.max())


def _refined(seen, now, trial, basis) -> Finalist:
    """The candidate refined, the rest of the model fitted along to first order."""
    found = fit([trial.candidate.term], seen, [trial.beta], 8, basis)
    betas = (*now.betas, found.betas[0])
    return Finalist(0.0, trial, 1.0, found.energy, betas, found.alphas[0])


_SPEED = frozenset({"velocity"})


def _imitated(trial: Trial, now: Fit) -> bool:
    """Whether the base may have bent its own curve in velocity to what the candidate is."""
    velocity = trial.candidate.term.coordinates <= _SPEED and len(trial.beta) < 2
    return velocity and bool(now.terms[0].nonlinear)


def _afresh(seen, now, trial) -> Finalist:
    """The whole model with the candidate, the base's nonlinear parameters looked for anew."""
    terms = (*now.terms, trial.candidate.term)
    found = fit(terms, seen, [None, *now.betas[1:], trial.beta], 8)
    return Finalist(0.0, trial, 1.0, found.energy, found.betas, found.alphas[-1])


class Taken(NamedTuple):
    """A term that was taken, its rivals, and its p-value.

    `rephased`: whether on the held-out recording its waves only fit with another phase.
    """

    trial: Trial
    rivals: tuple[str, ...]
    p_value: float
    rephased: bool = False


class Named(NamedTuple):
    """The terms that the residual calls for, on top of the base.

    `base` and `last`: the fits before and after; `taken`, in the order of discovery; `left`, the
    contest for what remains.
    """

    base: Fit
    last: Fit
    taken: list[Taken]
    left: Contest

    @property
    def rephased(self) -> frozenset[int]:
        """Numbers of the terms that need another phase on the held-out recording."""
        start = len(self.last.terms) - len(self.taken)
        return frozenset(start + i for i, taken in enumerate(self.taken) if taken.rephased)


def search(
    evidence: Evidence,
    base: Fit,
    structure: AbstractTerm,
    wide: Evidence | None = None,
    seed: int = 0,
) -> Named:
    """Add terms while they are believed; after each, drop those that have become idle.

    **Arguments:** `wide`: the recording through a kernel of twice the width, where terms that act
    on derivatives of the force must show alike.
    """
    now = base
    taken: list[Taken] = []
    evidence = with_predictions(evidence, now)
    field = Field(evidence, structure)
    visited: set[tuple[str, ...]] = set()
    while True:
        round_ = contest(evidence, now, field, seed)
        best = _believed(round_, now, evidence, wide, base, taken)
        # Two terms that make each other idle would take turns for ever.
        names = tuple(sorted(t.trial.candidate.effect.name for t in taken))
        if best is None or len(taken) >= MOST_TERMS or names in visited:
            return Named(base, now, taken, round_)
        visited.add(names)
        best, rivals = _rivals(best, round_, now, evidence)
        taken.append(Taken(best.trial, rivals, best.p_value))
        terms = (*now.terms, best.trial.candidate.term)
        now = fit(terms, evidence, best.betas)
        evidence = with_predictions(evidence, now)
        now = fit(terms, evidence, now.betas, 4)
        now, taken = _pruned(evidence, now, taken, round_.size)


# A rival whose score is this close cannot be told apart: odds of e⁵, 150 to 1 (Kass & Raftery
# 1995 call ten on twice this scale very strong).
RIVAL = 5.0
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
        # A term that is but the first order of its effect leaves a rest that is no evidence
        # against the effects that it is known to be confused with, if they are believed at all.
        effect = best.trial.candidate.effect
        excused = effect.first_order and other.trial.candidate.effect.name in effect.confusable_with
        half = now.energy - other.energy >= 0.5 * (now.energy - best.energy)
        believed = other.p_value <= LEVEL and half
        if same or other.score > best.score - RIVAL or (excused and believed):
            alike.append((other, same))
    names = [f.trial.candidate.effect.name for f, _ in alike]
    own = best.trial.candidate.effect.name
    twin = [f for f, same in alike if same and f.trial.candidate.effect.name == "cogging"]
    if own == "periodic_disturbance" and twin and twin[0].p_value <= LEVEL:
        best = twin[0]
        names = [own, *(name for name in names if name != "cogging")]
    return best, tuple(dict.fromkeys(names))


def _force(finalist: Finalist, evidence) -> np.ndarray:
    columns = evidence.columns(finalist.trial.candidate.term, finalist.betas[-1][None])[0]
    return columns @ finalist.alpha


# Effects whose columns hold a derivative of the acceleration: what the encoder's noise makes of
# that is the same noise that the controller answered, so that it explains force without physics.
SHARP = frozenset({"transport_delay", "actuator_lag", "compliance", "frictional_lag"})
# The linearity of a good torque or current sensor, relative: a force below it, with respect to the
# force's root mean square, cannot be told from the sensor whatever its p-value.
LINEARITY = 2e-3


# What comes after stronger terms must also be this part of what the base left: no term has quite
# the shape of what it stands for, and a twentieth of its amplitude may stay; a tenth where the term
# is but the first order of its effect.
OF_BASE = 0.002
OF_BASE_ROUGH = 0.01
# Isolated pushes besides another effect are mostly where that effect switches, and sharp terms take
# what a strong effect leaves through the kernel.
EASY_OF_BASE = 0.05


def _believed(round_: Contest, now: Fit, evidence, wide, base: Fit, taken: list[Taken]):
    least = LATER_SHARE if taken else LEAST_SHARE
    rough = any(t.trial.candidate.effect.first_order for t in taken)
    floor = LINEARITY**2 * float(evidence.target @ evidence.target)
    for finalist in round_.finalists:
        gained = now.energy - finalist.energy
        enough = gained >= max(least * now.energy, floor)
        if taken:
            name = finalist.trial.candidate.effect.name
            easy = name in SHARP or name == "disturbance_pulses"
            part = EASY_OF_BASE if easy else OF_BASE_ROUGH if rough else OF_BASE
            enough &= gained >= part * base.energy
            again = finalist.trial.candidate.lines is None and any(
                isinstance(finalist.trial.candidate.term, type(term)) for term in now.terms[1:]
            )
            enough &= not again
        if not (finalist.score > 0 and finalist.p_value <= LEVEL and enough):
            continue
        sharp = finalist.trial.candidate.effect.name in SHARP
        if sharp and not _confirmed(finalist, now, wide, least):
            continue
        return finalist
    return None


def _confirmed(finalist: Finalist, now: Fit, wide: Evidence | None, least: float) -> bool:
    """Whether a term is the same through a kernel of twice the width.

    There the noise of the derivatives is down by 2⁵ to 2⁷ in power, the physics hardly: of a column
    of noise what the rest cannot imitate changes by more than half, of one of physics it does not.
    """
    if wide is None:
        return True
    less = fit(now.terms, with_predictions(wide, now), now.betas, 4)
    seen = with_predictions(wide, less)
    terms = (*now.terms, finalist.trial.candidate.term)
    more = fit(terms, seen, (*less.betas, finalist.betas[-1]), 6)
    term, basis = finalist.trial.candidate.term, less.basis()
    forces = []
    for beta, alpha in ((more.betas[-1], more.alphas[-1]), (finalist.betas[-1], finalist.alpha)):
        force = seen.columns(term, beta[None])[0] @ alpha
        forces.append(float(np.linalg.norm(force - basis @ (basis.T @ force))))
    ratio = forces[0] / max(forces[1], 1e-300)
    positive = bool(np.all(more.alphas[-1] > 0))
    return positive and 0.5 < ratio < 2 and less.energy - more.energy >= least * less.energy


def _pruned(evidence, now, taken, size):
    """Without the earlier terms that the newest one has made idle."""
    start = len(now.terms) - len(taken)
    for place in reversed(range(start, len(now.terms) - 1)):
        keep = [i for i in range(len(now.terms)) if i != place]
        less = fit([now.terms[i] for i in keep], evidence, [now.betas[i] for i in keep], 6)
        gain = 1 - now.energy / less.energy
        if taken[place - start].trial.score(gain, size) <= 0 or gain < LEAST_SHARE:
            now = less
            taken = [t for i, t in enumerate(taken) if i != place - start]
    return now, taken
