"""One round of the contest: every candidate on the grid, the best refined with the whole model."""

from collections.abc import Callable, Hashable

import numpy as np

from ..terms.effect import Effect
from .acceptance import RAREST
from .candidates import CandidateSet, at_frequencies, scaled, tones
from .evidence import Evidence
from .many_minima import BEYOND_CHANCE, noise, promise
from .outstanding import outstanding
from .refining import afresh, changes, harmonics_of, imitated, of_speed, overtone, refined, sensible
from .regression import Fit
from .scanning import between, scanned
from .significance import DRAWS, LEVEL, MOSTLY, BlockBootstrap, thresholds, witnesses
from .spectral_lines import fast_tone
from .threads import each
from .trials import RIVAL, Contest, Finalist, Trial, trial_of

# Candidates refined beyond the grid: refining gains little over neighbouring grid points.
FINALISTS = 8
# Refining multiplies a candidate's gain by less than this: neighbouring points of a grid differ by
# far less than a peak's height. (The most that was seen is 1.8, of a law of three parameters.)
REFINED = 2.0


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
        trial_of(candidate, scan, float(p), float(limit))
        for candidate, scan, p, limit in zip(candidates, scans, p_values, least, strict=True)
    ]
    fast = fast_tone(seen, current)
    loud = [c for effect, term in tones(seen) for c in at_frequencies(effect, term, fast)]
    for candidate in [*outstanding(seen, current), *loud]:
        # Signs of blocks say nothing about single events, nor about a line among thousands: what
        # stands out has been tested.
        scan = bootstrap(scaled(candidate.columns(seen)))
        trials.append(trial_of(candidate, scan, 1 / (1 + DRAWS), np.inf))
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
        """The p-value of what was found beside its grid."""
        candidate = found.trial.candidate
        number = next((i for i, each in enumerate(candidates) if each is candidate), None)
        if number is None:  # no grid
            return found.trial.p_value
        [grid] = field.columns([candidate], seen)
        own = scaled(seen.columns(candidate.term, found.betas[-1][None]))
        columns = np.concatenate([grid, own])
        return between(bootstrap, scans, number, columns, candidate.effect.positive)

    finalists = _finals(seen, current, field, eligible, size, within_reach, refused, retested)
    return Contest(trials, finalists, size, unseen, current.energy)


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
    bent = any(t.p_value <= LEVEL and of_speed(t) for t in trials)
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
            fits.append(refined(seen, current, field, trial, basis))
        if bent and imitated(trial, current):
            fits += afresh(seen, current, trial)
        # The base's bump upside down is near to a law of the other sign.
        fits = [each for each in fits if sensible(trial, each.alpha)] or fits
        found = min(fits, key=lambda each: each.energy, default=None)
        harmonics = None if found is None else harmonics_of(found, seen, basis)
        if harmonics is not None and harmonics[0] < 0.25 * harmonics.max():
            trial = overtone(trial, found, int(np.argmax(harmonics)))
            found = refined(seen, current, field, trial, basis)
        return assessed(found)

    def assessed(found: Finalist | None) -> Finalist | None:
        if found is None or not (sensible(found.trial, found.alpha) and changes(found, seen)):
            return None
        trial, gain = found.trial, 1 - found.energy / current.energy
        p_value = LEVEL if gain > trial.threshold else 1.0
        p_value = min(trial.p_value, p_value)
        # A law whose peak is narrower than the grid's steps: a load in a gap, a light ring that is
        # swept through. The grid's best point leaves much more than noise.
        if p_value > RAREST and gain >= MOSTLY:
            p_value = min(p_value, retested(found))
        return found._replace(score=trial.score(gain, size), p_value=p_value)

    # What takes longest comes first, so that no thread waits for another at the end.
    ordered = sorted(enumerate(trials), key=lambda pair: not pair[1].candidate.term.stepped)
    done = [found for found in each(final, ordered) if found is not None]
    least = min((found.energy for found in done), default=current.energy)
    if (1 - BEYOND_CHANCE) * least > noise(current):
        tried = {id(found.trial) for found in done}
        left = (t for t in trials if t.effect.scatter and t.candidate.term.stepped)
        for trial in (t for t in left if id(t) not in tried):
            # The grid may show none of the minima of such a law. It has to promise half of what the
            # best of the others removes, as these had to.
            most = promise(trial.candidate, seen, current, field, basis)
            if most < 0.5 * (current.energy - least):
                continue
            found = assessed(refined(seen, current, field, trial, basis))
            if found is not None and found.energy < (1 - BEYOND_CHANCE) * least:
                done.append(found)
    return sorted(done, key=lambda finalist: -finalist.score)
