"""A candidate refined beyond its grid, beside the rest of the model."""

import dataclasses
from typing import Any

import numpy as np

from ..terms.effect import inside
from .candidates import CandidateSet
from .evidence import Evidence
from .many_minima import among_many
from .regression import Fit, fit, gains, without_shapes
from .significance import NEW
from .trials import Finalist, Trial


def sensible(trial: Trial, alpha: np.ndarray) -> bool:
    """Whether magnitudes are positive."""
    return not (trial.effect.positive and np.any(alpha < 0))


# Of the rows at either end, as of the record: one level would rest on too few samples.
FIRST_ROWS = 0.02


def changes(found: Finalist, seen: Evidence) -> bool:
    """Whether there are rows before and after a change: else it is no change."""
    effect, term = found.effect, found.trial.candidate.term
    if not effect.moment or effect.lasting:
        return True
    names = [p.name for p in term.nonlinear]
    moment = found.betas[-1][names.index(effect.moment)]
    before = np.mean(np.asarray(seen.motion.time)[seen.centre] < moment)
    return bool(FIRST_ROWS <= before <= 1 - FIRST_ROWS)


def harmonics_of(found: Finalist, seen: Evidence, basis: np.ndarray) -> np.ndarray | None:
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


def overtone(trial: Trial, found: Finalist, number: int) -> Trial:
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


def refined(
    seen: Evidence, current: Fit, field: CandidateSet, trial: Trial, basis: np.ndarray
) -> Finalist:
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


def of_speed(trial: Trial) -> bool:
    """Whether the candidate is a curve in velocity."""
    return trial.candidate.term.coordinates <= {"velocity"}


def imitated(trial: Trial, current: Fit) -> bool:
    """Whether the base may have bent its own curve in velocity to what the candidate is."""
    return of_speed(trial) and bool(current.terms[0].nonlinear)


def afresh(seen: Evidence, current: Fit, trial: Trial) -> list[Finalist]:
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
