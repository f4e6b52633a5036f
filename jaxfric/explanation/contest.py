"""One round of the contest: every candidate on the grid, the best refined with the whole model."""

import dataclasses
from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

import numpy as np

from ..terms.effect import Effect, inside
from .candidates import Candidate, CandidateSet, at_frequencies, scaled, tones
from .evidence import Evidence
from .many_minima import BEYOND_CHANCE, among_many, noise, promise
from .outstanding import outstanding
from .regression import Fit, fit, gains, without_shapes
from .scanning import between, scanned
from .significance import DRAWS, LEVEL, MOSTLY, NEW, BlockBootstrap, Scan, thresholds, witnesses
from .spectral_lines import fast_tone
from .threads import each

# A rival whose score is this close cannot be told apart: odds of e⁵, 150 to 1 (Kass & Raftery
# 1995 call ten on twice this scale very strong).
RIVAL = 5.0
# Candidates refined beyond the grid: refining gains little over neighbouring grid points.
FINALISTS = 8
# Refining multiplies a candidate's gain by less than this: neighbouring points of a grid differ by
# far less than a peak's height. (The most that was seen is 1.8, of a law of three parameters.)
REFINED = 2.0
# Of what would have been seen is said what holds for so many of the shapes that were tried.
MANY = 0.9


class Trial(NamedTuple):
    """A candidate at the best point of its grid, and how it did there.

    `gain`: R²; `null_mean`: its mean over the draws; `dimension`: how many of its columns are new;
    `threshold`: the R² from which it is significant; `new_part`: the part of the term's force, in
    amplitude, that the model cannot imitate, at all but a tenth of the grid; `others`: further
    local optima of the grid; `least`: the part of what is left that it must take.
    """

    candidate: Candidate
    beta: np.ndarray
    gain: float
    null_mean: float
    dimension: int
    p_value: float
    threshold: float
    new_part: float
    others: tuple[np.ndarray, ...] = ()
    least: float = 0.0

    @property
    def effect(self) -> Effect:
        """The effect of the term."""
        return self.candidate.effect

    def score(self, gain: float, size: float) -> float:
        """Half the log-likelihood ratio, less the price of the parameters (Schwarz 1978).

        What the residual has suggested, the moments of pushes, was looked for like a parameter.
        """
        price = self.dimension + len(self.beta) + self.candidate.term.chosen
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

    @property
    def effect(self) -> Effect:
        """The effect of the candidate."""
        return self.trial.effect


class Contest(NamedTuple):
    """One round: every candidate on the grid, and the finalists refitted with the whole model.

    `size`: how many independent values the residual is worth; `unseen`: effects of which the model
    imitates a law as a whole, so that this motion does not show it; `energy`: what the model leaves
    that they compete beside, N².
    """

    trials: list[Trial]
    finalists: list[Finalist]
    size: float
    unseen: frozenset[str] = frozenset()
    energy: float = 0.0


def contest(
    evidence: Evidence,
    current: Fit,
    field: CandidateSet,
    seed: int = 0,
    among: Callable[[Effect], bool] = lambda effect: True,
    needed: Callable[[Trial], float] = lambda trial: 0.0,
    refused: frozenset[Hashable] = frozenset(),
) -> Contest:
    """Let every candidate compete for the residual of a fit; `evidence` with its predictions.

    `among`: whether an effect may be among the finalists; `needed`: the energy, N², that a
    trial's candidate must remove to be of use. Where none comes near it there are no finalists.
    `refused`: forms of laws that may not win, and so keep no other from being looked at.
    """
    seen = evidence
    bootstrap = BlockBootstrap(current, witnesses(seen), seed)

    candidates = field.candidates
    scans, p_values = scanned(bootstrap, field, seen)
    least = thresholds(np.array([s.drawn for s in scans]), LEVEL)
    trials = [
        _trial(candidate, scan, float(p), float(limit))
        for candidate, scan, p, limit in zip(candidates, scans, p_values, least, strict=True)
    ]
    fast = fast_tone(seen, current)
    loud = [c for effect, term in tones(seen) for c in at_frequencies(effect, term, fast)]
    for candidate in [*outstanding(seen, current), *loud]:
        # Signs of blocks say nothing about single events, nor about a line among thousands: what
        # stands out has been tested.
        scan = bootstrap(scaled(candidate.columns(seen)))
        trials.append(_trial(candidate, scan, 1 / (1 + DRAWS), np.inf))
    unseen = frozenset(t.effect.name for t in trials if not t.dimension)
    trials = [t for t in trials if t.dimension]
    size = float(np.median([t.dimension / t.null_mean for t in trials]))
    trials.sort(key=lambda t: -t.score(t.gain, size))
    eligible = [t for t in trials if among(t.effect)]
    # Where the base is at a limit of its set, leaving that removes something by itself.
    beside = current.energy - bootstrap.scale**2
    most = [beside + REFINED * t.gain * bootstrap.scale**2 for t in eligible]
    within_reach = any(gain >= needed(t) for t, gain in zip(eligible, most, strict=True))

    def retested(found: Finalist) -> float:
        """The p-value of a load that is stepped, found beside its grid."""
        candidate = found.trial.candidate
        number = next(i for i, each in enumerate(candidates) if each is candidate)
        [grid] = field.columns([candidate], seen)
        own = scaled(seen.columns(candidate.term, found.betas[-1][None]))
        columns = np.concatenate([grid, own])
        return between(bootstrap, scans, number, columns, candidate.effect.positive)

    finalists = _finals(seen, current, field, eligible, size, within_reach, refused, retested)
    return Contest(trials, finalists, size, unseen, current.energy)


def _trial(candidate: Candidate, scan: Scan, p_value: float, limit: float) -> Trial:
    best = scan.best
    return Trial(
        candidate, candidate.betas[best], float(scan.gain[best]), float(scan.null_mean[best]),
        int(scan.dimension[best]), p_value, limit, _most(scan.new_part),
        _optima(candidate.betas, scan.gain),
        float(np.broadcast_to(candidate.least, len(candidate.betas))[best]),
    )  # fmt: skip


def _most(new_part: np.ndarray) -> float:
    """What nearly all shapes that act at all have more of; zero where none does."""
    acting = new_part[np.isfinite(new_part)]
    return float(np.quantile(acting, 1 - MANY)) if acting.size else 0.0


# Further local optima of a grid from which a law is refined, of at least half the best one's R².
FURTHER, NEARLY = 3, 0.5


def _optima(betas: np.ndarray, gain: np.ndarray) -> tuple[np.ndarray, ...]:
    """The best local optima of a grid `(G, d)` over several parameters, but for the very best.

    None of their neighbours, one step away in some or all parameters, is better. A grid over one
    parameter resolves it: its best point is next to the optimum.
    """
    if betas.shape[1] < 2:
        return ()
    steps = np.stack([np.unique(each, return_inverse=True)[1] for each in betas.T], axis=1)
    found: list[np.ndarray] = []
    for number in np.argsort(-gain, kind="stable")[1:]:
        near = np.all(np.abs(steps - steps[number]) <= 1, axis=1)
        if len(found) == FURTHER or gain[number] <= NEARLY * gain.max():
            break
        if gain[number] >= gain[near].max():
            found.append(betas[number])
    return tuple(found)


def _finals(
    seen: Evidence,
    current: Fit,
    field: CandidateSet,
    trials: list[Trial],
    size: float,
    within_reach: bool,
    refused: frozenset[Hashable],
    retested: Callable[[Finalist], float],
) -> list[Finalist]:
    bent = any(t.p_value <= LEVEL and t.candidate.term.coordinates <= _SPEED for t in trials)
    if not (bent or within_reach):
        return []
    basis = current.basis()
    # A sharp term may not be confirmed, and must not keep the next best from being looked at.
    blunt = [t for t in trials if not t.effect.sharp and t.candidate.form not in refused]
    leader = (blunt or trials)[0]
    enough = 0.5 * leader.score(leader.gain, size) - RIVAL

    def final(numbered: tuple[int, Trial]) -> Finalist | None:
        number, trial = numbered
        fits = []
        if number < FINALISTS and trial.score(trial.gain, size) >= enough:
            fits.append(_refined(seen, current, field, trial, basis))
        if bent and imitated(trial, current):
            fits += _afresh(seen, current, trial)
        # The base's bump upside down is near to a law of the other sign.
        fits = [each for each in fits if _sensible(trial, each.alpha)] or fits
        found = min(fits, key=lambda each: each.energy, default=None)
        harmonics = None if found is None else _harmonics(found, seen, basis)
        if harmonics is not None and harmonics[0] < 0.25 * harmonics.max():
            trial = _overtone(trial, found, int(np.argmax(harmonics)))
            found = _refined(seen, current, field, trial, basis)
        return assessed(found)

    def assessed(found: Finalist | None) -> Finalist | None:
        if found is None or not (_sensible(found.trial, found.alpha) and _changed(found, seen)):
            return None
        trial, gain = found.trial, 1 - found.energy / current.energy
        p_value = LEVEL if gain > trial.threshold else 1.0
        p_value = min(trial.p_value, p_value)
        if p_value > LEVEL and gain >= MOSTLY and trial.candidate.term.stepped:
            p_value = retested(found)
        return found._replace(score=trial.score(gain, size), p_value=p_value)

    # What takes longest comes first, so that no thread waits for another at the end.
    ordered = sorted(enumerate(trials), key=lambda pair: not pair[1].candidate.term.stepped)
    done = [found for found in each(final, ordered) if found is not None]
    # The grid may show none of the minima of a law of many.
    least = min((found.energy for found in done), default=current.energy)
    if (1 - BEYOND_CHANCE) * least > noise(current):
        tried = {id(found.trial) for found in done}
        left = [t for t in trials if t.effect.scatter and t.candidate.term.stepped]
        for trial in [each for each in left if id(each) not in tried]:
            # Half of what the best of the others removes, as of these.
            most = promise(trial.candidate, seen, current, field, basis)
            if most < 0.5 * (current.energy - least):
                continue
            found = assessed(_refined(seen, current, field, trial, basis))
            if found is not None and found.energy < (1 - BEYOND_CHANCE) * least:
                done.append(found)
    return sorted(done, key=lambda finalist: -finalist.score)


def _sensible(trial: Trial, alpha: np.ndarray) -> bool:
    """Whether magnitudes are positive."""
    return not (trial.effect.positive and np.any(alpha < 0))


# Of the rows at either end, as of the record: one level would rest on too few samples.
FIRST_ROWS = 0.02


def _changed(found: Finalist, seen: Evidence) -> bool:
    """Whether there are rows before and after a change: else it is no change."""
    effect, term = found.effect, found.trial.candidate.term
    if not effect.moment or effect.lasting:
        return True
    names = [p.name for p in term.nonlinear]
    moment = found.betas[-1][names.index(effect.moment)]
    before = np.mean(np.asarray(seen.motion.time)[seen.centre] < moment)
    return bool(FIRST_ROWS <= before <= 1 - FIRST_ROWS)


def _harmonics(found: Finalist, seen: Evidence, basis: np.ndarray) -> np.ndarray | None:
    """The sizes of a wave's several harmonics, N, `(H,)`; `None` for other laws.

    Of a harmonic that the model has already, as one of a wave of twice the period, no size is
    known; it counts as none.
    """
    candidate, alpha = found.trial.candidate, found.alpha
    if candidate.lines is None or len(alpha) == 2:
        return None
    rows = seen.columns(candidate.term, found.betas[-1][None])[0]
    own = rows - basis @ (basis.T @ rows)
    new = np.sum(own**2, axis=0) > NEW**2 * np.sum(rows**2, axis=0)
    alpha = np.where(new, alpha, 0.0)
    return np.hypot(alpha[::2], alpha[1::2])


def _overtone(trial: Trial, found: Finalist, number: int) -> Trial:
    """One harmonic as a wave of its own, to be believed from the threshold of them all.

    It may be finer than what is scanned for, and stand out only at the slowest rows.
    """
    candidate = trial.candidate
    beta = found.betas[-1] / (1 + number)
    lines = candidate.lines._replace(harmonics=1)
    several: Any = candidate.term
    term = dataclasses.replace(several, harmonics=1)
    alone = candidate._replace(term=term, betas=beta[None], lines=lines)
    return trial._replace(candidate=alone, beta=beta, dimension=2, p_value=1.0)


def _refined(seen, current, field: CandidateSet, trial, basis) -> Finalist:
    """The candidate refined, the rest of the model fitted along to first order."""
    term, starts = trial.candidate.term, (trial.beta, *trial.others)
    between = _between(trial)
    if len(between):
        starts = (between[int(np.argmax(gains(term, seen, between, basis)))],)
    if term.stepped:
        found = among_many(trial.candidate, np.stack(starts), seen, current, field, basis)
    else:
        fits = (fit([term], seen, [beta], 8, basis) for beta in starts)
        found = min(fits, key=lambda each: each.energy)
    betas = (*current.betas, found.betas[0])
    return Finalist(0.0, trial, 1.0, found.energy, betas, found.alphas[0])


# Points of a finer grid between the neighbours of a grid point, an eighth of its step apart: of 192
# moments in a record of 192 kernels, the fewest, these are nearer than a kernel reaches.
FINER = 17


def _between(trial: Trial) -> np.ndarray:
    """A finer grid about the grid point of a law of one parameter, `(F, 1)`; else none.

    What a moment leaves is no parabola but a wedge, with steps of its own at every node: a
    refinement from the grid point may stay where it is. A wave's grid resolves it.
    """
    candidate = trial.candidate
    if candidate.lines is not None or candidate.betas.shape[1] != 1 or len(candidate.betas) < 2:
        return np.zeros((0, 1))
    grid = np.unique(candidate.betas)
    at = int(np.searchsorted(grid, trial.beta[0]))
    low, high = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
    return np.union1d(np.linspace(low, high, FINER), trial.beta)[:, None]


_SPEED = frozenset({"velocity"})


def imitated(trial: Trial, current: Fit) -> bool:
    """Whether the base may have bent its own curve in velocity to what the candidate is."""
    return trial.candidate.term.coordinates <= _SPEED and bool(current.terms[0].nonlinear)


def _afresh(seen, current, trial) -> list[Finalist]:
    """The whole model with the candidate, the base's nonlinear parameters looked for anew beside
    the candidate as its grid has it, and the candidate's beside the base's in the middle.
    """
    base = current.terms[0]
    anew = without_shapes(base, current.betas[0])
    middle = inside(base, seen.limits, np.full(len(base.nonlinear), 0.5))
    starts: list[tuple[np.ndarray, np.ndarray | None]] = [(anew, trial.beta)]
    if len(trial.beta):
        starts.append((np.where(np.isnan(anew), middle, anew), None))
    terms, others = (*current.terms, trial.candidate.term), current.betas[1:]
    fits = (fit(terms, seen, [first, *others, last], 8) for first, last in starts)
    return [Finalist(0.0, trial, 1.0, each.energy, each.betas, each.alphas[-1]) for each in fits]
