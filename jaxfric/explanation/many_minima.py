"""The search for laws whose energy has many minima: loads that are stepped along the motion.

A load that flies through a gap strikes a flank sooner or later by a little of any parameter. So β
is scattered over all of its set, then about the best of these and of the grid over a step of the
grid, then over half of that, and so on. Where the same law was tried beside the same terms already,
for a force taken a little later, what was found then is where this begins.
"""

import jax
import numpy as np

from ..terms.effect import scattered
from .burdens import largest
from .candidates import Candidate, CandidateSet, coarse
from .evidence import Evidence
from .least_squares import orthonormal
from .regression import Fit, fast, fit, gains

# So many about each of the best, so often; and so many points of the grid are refined.
AROUND, BEST, ROUNDS, NEAR = 63, 3, 4, 2
# How often it is then looked along the valley of the best one.
ALONG = 3
# Of those scattered over the whole set, how many are looked at again.
WORTH = 64
# The part of the energy that what is found among thousands has to remove: the threshold of the grid
# is not theirs.
BEYOND_CHANCE = 0.5


def noise(current: Fit) -> float:
    """The energy of what a fit leaves that no law removes, N², by [`fast`][]."""
    return len(current.residual) * fast(current) ** 2


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
    term = candidate.term
    left = seen.target - basis @ (basis.T @ seen.target)

    def gained(betas: np.ndarray) -> np.ndarray:
        """The energy that the law removes, N², with no more of a load than the machine has."""
        most = largest(term, betas, current)
        betas = coarse(term, betas)
        if not np.isfinite(most).all():
            return gains(term, seen, betas, basis)
        own = seen.columns(term, betas)[:, :, 0]
        own = own - (own @ basis) @ basis.T
        along, square = own @ left, np.einsum("gj,gj->g", own, own)
        size = np.clip(along / np.where(square > 0, square, 1.0), 0.0, most)
        return size * (2 * along - size * square)

    def within(found: Fit) -> bool:
        most = largest(term, np.stack(found.betas), current)
        return bool(np.all(found.alphas[0] <= most))

    def refined(some: np.ndarray) -> list[Fit]:
        return [fit([term], seen, [beta], 8, basis) for beta in np.unique(some, axis=0)]

    def best_of(some: np.ndarray, count: int) -> np.ndarray:
        return some[np.argsort(-gained(some), kind="stable")[:count]]

    near = refined(best_of(starts, NEAR))
    near = [each for each in near if within(each)] or near
    best_near = min(near, key=lambda each: each.energy)
    if noise(current) > (1 - BEYOND_CHANCE) * current.energy:
        return best_near  # of noise nothing can be removed
    kept, form = field.kept_betas, candidate.form
    here = form, *map(jax.tree.structure, current.terms)
    best, rounds = kept.get(here), range(ROUNDS - 1, ROUNDS)
    if best is None:
        best, rounds = starts, range(ROUNDS)
        wide = kept[form] if form in kept else field.scattered(candidate, seen)
        if len(wide):
            wide = best_of(wide, WORTH)
            kept[form] = wide
            best = np.concatenate([starts, wide[: 2 * BEST]])
    values = [np.log(np.unique(each)) for each in candidate.betas.T]
    step = np.array([np.max(np.diff(each), initial=0.0) for each in values])
    scatter = 2 * scattered(AROUND, len(step)) - 1
    for number in rounds:
        spread = np.exp(scatter * step / 2**number)
        tried = np.concatenate([best, *(each * spread for each in best)])
        best = best_of(tried, BEST)
    kept[here] = best
    far = [each for each in refined(best) if within(each)]
    far = far or [fit([term], seen, [best[0]], 0, basis)]
    found = min(far, key=lambda each: each.energy)
    for number in range(ALONG):
        again = refined(best_of(_along(found, AROUND, 0.5**number), 1))
        found = min((found, *filter(within, again)), key=lambda each: each.energy)
    if found.energy > (1 - BEYOND_CHANCE) * current.energy:
        return best_near
    return min((found, best_near), key=lambda each: (not within(each), each.energy))


def _along(found: Fit, count: int, part: float) -> np.ndarray:
    """β scattered along the valley of a fit's energy, `(count, d)`: by a part of the way over which
    the energy would double, were it a parabola.
    """
    beta = found.betas[0]
    basis = orthonormal(found.columns)
    slopes = found.slopes * beta
    slopes = slopes - basis @ (basis.T @ slopes)
    values, ways = np.linalg.eigh(slopes.T @ slopes)
    # No further than the parameter itself.
    reach = np.sqrt(found.energy / np.maximum(values, found.energy))
    return beta * np.exp((2 * scattered(count, len(beta)) - 1) * part * reach @ ways.T)
