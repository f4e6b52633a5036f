"""The search for laws whose energy has many minima: loads that are stepped along the motion.

A load that flies through a gap strikes a flank sooner or later by a little of any parameter. So β
is scattered over all of its set, then about the best of these and of the grid over a step of the
grid, then over half of that, and so on. Where the same law was tried beside the same terms already,
for a force taken a little later, what was found then is where this begins.
"""

from typing import NamedTuple

import jax
import numpy as np

from ..terms.base import AbstractTerm
from ..terms.effect import inside, scattered
from .burdens import largest
from .candidates import Candidate, CandidateSet, coarse
from .evidence import Evidence
from .least_squares import orthonormal
from .regression import Fit, fast, fit, gains

# So many about each of the best, so often; and so many points of the grid are refined. With six
# parameters: on twelve machines half as many lost a sixteenth of the energy of one, and with it its
# name; four times as many over the whole set were no better on all.
AROUND, BEST, ROUNDS, NEAR = 127, 4, 5, 2
# How often it is then looked along the valley of the best one, and steps of each refinement: more
# of either lowered the energy, but took seconds.
ALONG, STEPS = 3, 5
# Nodes of which all this asks, where there are half as many again: some two thousand rows, hundreds
# for each parameter, and each of them steps the load.
LONGEST, SPARE = 1 << 13, 1.5
# Of those scattered over the whole set, how many are looked at again.
WORTH = 64
# The part of the energy that what is found among thousands has to remove: the threshold of the grid
# is not theirs.
BEYOND_CHANCE = 0.5


def noise(current: Fit) -> float:
    """The energy of what a fit leaves that no law removes, N², by [`fast`][]."""
    return len(current.residual) * fast(current) ** 2


class _Stretch(NamedTuple):
    """The stretch of a motion in which a fit leaves most: its rows, what is left of them beside the
    basis there, N, `(J,)`, and the energy of the whole by that of the stretch.
    """

    seen: Evidence
    basis: np.ndarray
    left: np.ndarray
    whole: float

    def gained(self, term: AbstractTerm, betas: np.ndarray, current: Fit) -> np.ndarray:
        """The energy, N², `(G,)`, that a law removes there, with no more of a load than the
        machine has.
        """
        if not len(betas):
            return np.zeros(0)
        most = largest(term, betas, current)
        betas = coarse(term, betas)
        if not np.isfinite(most).all():
            return gains(term, self.seen, betas, self.basis)
        own = np.nan_to_num(self.seen.columns(term, betas)[:, :, 0], posinf=0.0, neginf=0.0)
        own = own - (own @ self.basis) @ self.basis.T
        along, square = own @ self.left, np.einsum("gj,gj->g", own, own)
        size = np.clip(along / np.where(square > 0, square, 1.0), 0.0, most)
        return size * (2 * along - size * square)


def _stretch(seen: Evidence, basis: np.ndarray) -> _Stretch:
    left = seen.target - basis @ (basis.T @ seen.target)
    if seen.nodes <= SPARE * LONGEST:
        return _Stretch(seen, basis, left, 1.0)
    power = np.cumsum(np.bincount(seen.centre, left**2, seen.nodes + 1))
    first = int(np.argmax(power[LONGEST:] - power[:-LONGEST]))
    part, inside = seen.stretch(first, LONGEST)
    basis = orthonormal(basis[inside])
    here = part.target - basis @ (basis.T @ part.target)
    return _Stretch(part, basis, here, float(left @ left) / max(float(here @ here), 1e-300))


def promise(
    candidate: Candidate, seen: Evidence, current: Fit, field: CandidateSet, basis: np.ndarray
) -> float:
    """The most energy, N², that a law removes at any β scattered over its set."""
    rows = _stretch(seen, basis)
    wide = _wide(candidate, rows, current, field)
    return rows.whole * float(np.max(rows.gained(candidate.term, wide, current), initial=0.0))


def _wide(candidate: Candidate, rows: _Stretch, current: Fit, field: CandidateSet) -> np.ndarray:
    """The best of the β that are scattered over a law's set, `(W, d)`; the first time, for the rows
    and the fit that it is, for all that follow.
    """
    kept, form = field.kept_betas, candidate.form
    if form not in kept:
        every = field.scattered(candidate, rows.seen)
        worth = np.argsort(-rows.gained(candidate.term, every, current), kind="stable")
        kept[form] = every[worth[:WORTH]]
    return kept[form]


def among_many(
    candidate: Candidate,
    starts: np.ndarray,
    seen: Evidence,
    current: Fit,
    field: CandidateSet,
    basis: np.ndarray,
) -> Fit:
    """A law that is stepped along the motion beside the basis, `(J, r)`, of a fit.

    Its load is a part of the machine. `starts`: the best β of its grid, `(S, d)`.
    """
    term, rows = candidate.term, _stretch(seen, basis)

    def within(found: Fit) -> bool:
        most = largest(term, np.stack(found.betas), current)
        return bool(np.all(found.alphas[0] <= most))

    def refined(some: np.ndarray) -> list[Fit]:
        every = np.unique(some, axis=0)
        return [fit([term], rows.seen, [beta], STEPS, rows.basis) for beta in every]

    def best_of(some: np.ndarray, count: int) -> np.ndarray:
        return some[np.argsort(-rows.gained(term, some, current), kind="stable")[:count]]

    def of_all(found: Fit) -> Fit:
        return found if rows.seen is seen else fit([term], seen, found.betas, STEPS, basis)

    def less(one: Fit) -> tuple[bool, float]:
        return not within(one), one.energy

    near = min(refined(best_of(starts, NEAR)), key=less)
    if noise(current) > (1 - BEYOND_CHANCE) * current.energy:
        return of_all(near)  # of noise nothing can be removed
    kept = field.kept_betas
    here = candidate.form, *map(jax.tree.structure, current.terms)
    best, rounds = kept.get(here), range(ROUNDS - 1, ROUNDS)
    if best is None:
        wide, rounds = _wide(candidate, rows, current, field), range(ROUNDS)
        best = np.concatenate([starts, best_of(wide, 2 * BEST)])
    scale = _Scale.of(term, seen)
    scatter = (2 * scattered(AROUND, candidate.betas.shape[1]) - 1) * scale.steps(candidate.betas)
    for number in rounds:
        around = [scale.moved(each, scatter / 2**number) for each in best]
        best = best_of(np.concatenate([best, *around]), BEST)
    far = [each for each in refined(best) if within(each)]
    found = min(far or [fit([term], rows.seen, [best[0]], 0, rows.basis)], key=less)
    part, enough = 1.0, (1 - BEYOND_CHANCE) * float(rows.left @ rows.left)
    for _ in range(ALONG if found.energy < enough else 0):
        [again] = refined(best_of(_along(found, scale, AROUND, part), 1))
        better = less(again) < less(found)
        found, part = (again, part) if better else (found, part / 2)
    kept[here] = np.concatenate([found.betas[0][None], best])[:BEST]
    if less(near) <= less(found):
        return of_all(near)
    found = of_all(found)
    return found if found.energy <= (1 - BEYOND_CHANCE) * current.energy else of_all(near)


class _Scale(NamedTuple):
    """What β is moved by: a factor of e, or of a parameter that is no ratio an eighth of its set.

    `ratio`, `(d,)`, which are ratios; `unit`, `(d,)`, of the others.
    """

    ratio: np.ndarray
    unit: np.ndarray

    @classmethod
    def of(cls, term: AbstractTerm, rows: Evidence) -> "_Scale":
        low, high = inside(term, rows.limits, np.outer([0.0, 1.0], np.ones(len(term.nonlinear))))
        return cls(np.array([p.logarithmic for p in term.nonlinear], bool), (high - low) / 8)

    def steps(self, grid: np.ndarray) -> np.ndarray:
        """The widest step of a grid, `(d,)`; one where it has one value."""
        found = []
        for values, ratio, unit in zip(grid.T, self.ratio, self.unit, strict=True):
            each = np.unique(values)
            gaps = np.diff(np.log(each)) if ratio else np.diff(each) / unit
            found.append(np.max(gaps, initial=0.0) or 1.0)
        return np.array(found)

    def moved(self, beta: np.ndarray, by: np.ndarray) -> np.ndarray:
        """β moved by so many of these, `(count, d)`."""
        return np.where(self.ratio, beta * np.exp(by * self.ratio), beta + by * self.unit)

    def rates(self, beta: np.ndarray) -> np.ndarray:
        """How fast β changes, `(d,)`."""
        return np.where(self.ratio, beta, self.unit)


def _along(found: Fit, scale: _Scale, count: int, part: float) -> np.ndarray:
    """β scattered along the valley of a fit's energy, `(count, d)`: by a part of the way over which
    the energy would double, were it a parabola.
    """
    beta = found.betas[0]
    basis = orthonormal(found.columns)
    slopes = found.slopes * scale.rates(beta)
    slopes = slopes - basis @ (basis.T @ slopes)
    values, ways = np.linalg.eigh(slopes.T @ slopes)
    # No further than the parameter itself.
    reach = np.sqrt(found.energy / np.maximum(values, found.energy))
    return scale.moved(beta, (2 * scattered(count, len(beta)) - 1) * part * reach @ ways.T)
