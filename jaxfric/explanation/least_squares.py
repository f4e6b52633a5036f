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
    """As [`solve`][], `bumps` of friction being no larger than `peak`, and no bump taking more than
    the dry friction that there is, `dry` @ alpha: friction does not drive.

    An axis that moved was held by no more friction than the largest force there was. Between
    reversals a filter sees next to nothing of a narrow bump and would take any height for it. But
    friction at rest is up to twice that in slip, so also twice that at the slowest rows: of a bump
    that is seen there with the part c of its height h, h + d ≤ 2 (c h + d) beside the dry friction
    d, which of one that is seen by half is no limit.
    """
    alpha = _within(columns, target, bumps, peak)
    tied = np.zeros(len(alpha))
    if dry @ alpha <= 0:  # a force with the wrong sign is for others to tell
        return alpha
    unseen = 1 - 2 * np.max(np.abs(columns), axis=0, initial=0.0)
    tails = bumps & (unseen > 0)
    most = 1 / np.where(tails, unseen, 1.0)

    def beyond() -> np.ndarray:
        there = dry @ alpha
        high = np.where(tails & (alpha > most * there), most, 0.0)
        over = np.where(bumps & (alpha < -there), -1.0, high)
        return np.where(tied == 0, over, 0.0)

    while (more := beyond()).any():
        tied += more
        free = tied == 0
        joined = columns[:, free] + np.outer(columns @ tied, dry[free])
        alpha[free] = _within(joined, target, bumps[free], peak)
        alpha[~free] = tied[~free] * (dry @ alpha)
    return alpha


def _within(columns, target, bumps, peak) -> np.ndarray:
    alpha = solve(columns, target)
    held = np.zeros(len(alpha), bool)
    while (beyond := bumps & ~held & (np.abs(alpha) > peak)).any():
        held |= beyond
        alpha = np.where(held, np.clip(alpha, -peak, peak), 0.0)
        alpha[~held] = solve(columns[:, ~held], target - columns @ alpha)
    return alpha
