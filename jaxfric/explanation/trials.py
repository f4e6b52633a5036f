"""A round of the contest: every candidate as its grid has it, and the best of them refined."""

from typing import NamedTuple

import numpy as np

from ..terms.effect import Effect
from .candidates import Candidate
from .significance import Scan

# A rival whose score is this close cannot be told apart: odds of e⁵, 150 to 1 (Kass & Raftery
# 1995 call ten on twice this scale very strong).
RIVAL = 5.0
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


def trial_of(candidate: Candidate, scan: Scan, p_value: float, limit: float) -> Trial:
    """A candidate as its scan found it; `limit`, the R² from which it is significant."""
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
