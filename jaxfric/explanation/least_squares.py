"""Linear least squares of columns of any size, of full rank or not."""

import numpy as np

# A column of which less than this remains beside the others is not independent of them.
RANK = 1e-8


def orthonormal(columns: np.ndarray, basis: np.ndarray | None = None) -> np.ndarray:
    """Orthonormal columns that span what `columns` add to `basis`, `(J, r)`."""
    size = np.sqrt(np.sum(columns**2, axis=0))
    columns = columns[:, size > 0] / size[size > 0]
    if basis is not None and basis.shape[1]:
        columns = columns - basis @ (basis.T @ columns)
        columns = columns - basis @ (basis.T @ columns)
    if not columns.shape[1]:
        return columns
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, values > RANK]


def solve(columns: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Least-squares coefficients, of least norm (in units of the columns) where not unique."""
    size = np.sqrt(np.sum(columns**2, axis=0))
    size = np.where(size > 0, size, 1.0)
    return np.linalg.lstsq(columns / size, target, rcond=RANK)[0] / size


def bounded(
    columns: np.ndarray, target: np.ndarray, bumps: np.ndarray, dry: np.ndarray, peak: float
) -> np.ndarray:
    """As [`solve`][], bumps of friction being no larger than `peak`, and no bump taking more than
    the dry friction that there is: friction does not drive.

    `bumps` and `dry`, `(p,)`: what each column is beside zero speed, as a bump of friction or as
    dry friction, zero for others. Below zero it is of a law that takes friction away: that adds
    none, and may take all of the other bumps, too, which take none beside it.

    An axis that moved was held by no more friction than the largest force there was. Between
    reversals a filter sees next to nothing of a narrow bump and would take any height for it. But
    friction at rest is up to twice that in slip, so also twice that at the slowest rows: of a bump
    that is seen there with the part c of its height h, h + d ≤ 2 (c h + d) beside the dry friction
    d, which of one that is seen by half is no limit.
    """
    taking = bumps < 0
    high = np.where(bumps != 0, peak, np.inf)
    low = np.where((bumps != 0) & taking.any(), 0.0, -high)
    alpha = _within(columns, target, low, high)
    tied = np.zeros(len(alpha))
    unseen = 1 - 2 * np.max(np.abs(columns), axis=0, initial=0.0)
    tails = (bumps > 0) & (unseen > 0)
    most = 1 / np.where(tails, unseen, 1.0)
    # Of what a bump is tied to each column gives its part, `(p, p)`.
    levels = np.where(taking[:, None], dry + np.maximum(bumps, 0.0), dry)

    def beyond() -> np.ndarray:
        there = levels @ alpha
        over = np.where(tails & (alpha > most * there), most, 0.0)
        over = np.where((bumps > 0) & (alpha < -there), -1.0, over)
        over = np.where(taking & (alpha > there), 1.0, over)
        return np.where(tied == 0, over, 0.0)

    # A force with the wrong sign is for others to tell.
    while dry @ alpha > 0 and (more := beyond()).any():
        tied += more
        free = tied == 0
        joined = columns[:, free] + columns @ (tied[:, None] * levels[:, free])
        alpha[free] = _within(joined, target, low[free], high[free])
        alpha[~free] = tied[~free] * (levels[:, free][~free] @ alpha[free])
    return alpha


def _within(columns, target, low, high) -> np.ndarray:
    """Least squares, coefficients beyond their limits held there."""
    alpha = solve(columns, target)
    held = np.zeros(len(alpha), bool)
    while (beyond := ~held & ((alpha < low) | (alpha > high))).any():
        held |= beyond
        alpha = np.where(held, np.clip(alpha, low, high), 0.0)
        alpha[~held] = solve(columns[:, ~held], target - columns @ alpha)
    return alpha
