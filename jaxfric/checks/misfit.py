"""Whether what a model leaves is a function of the velocity: a wrong law of friction.

The intervals of the parameters hold the noise. A law that misses little may be wrong in its
parameters by much, as a viscous friction that stands in for a quadratic drag. So what is left is
fitted by functions of the velocity, less what the model can make of them itself, and each
coefficient is compared with its standard error (a lack-of-fit test). The noise of an axis is far
from white: the errors are those of the jackknife over parts of the record (Efron & Stein 1981).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .design import LINEARITY, Design
from .lateness import triangle

# A bump's flank takes an octave of speed. The narrowest of six flanks stands at a thirtieth of the
# top speed; below it hardly any kernel lies wholly in slip of one direction.
OCTAVES = 6
# The speeds that the flanks lie between: single rows beyond them would be fitted by one of them.
SLOWEST, FASTEST = 0.02, 0.99
# Parts of a record that are left out one by one. Student's t of 15 degrees of freedom stays below
# 5.4 in all of twelve functions in 99.9 % of the cases.
PARTS, SURE = 16, 5.4
# As in `uncertainty`: what the fit explains of a part is credited with a sixteenth at least.
PULL = 15 / 16
# Rows for each function and each parameter, as in `fitted`.
ROWS = 10
# A column with less of its own beside those before it is rounding.
OWN = 1e-4


class Misfit(NamedTuple):
    """The most that a model misses of the friction: `force`, N, at the `velocity`, m/s."""

    force: float
    velocity: float


def misfit(design: Design) -> Misfit | None:
    """The [`Misfit`][] that the rows of a fit show for sure; `None` where there is none.

    It is told where it is more of the force than the linearity of a sensor.
    """
    rows = np.flatnonzero(np.asarray(design.weight) > 0)
    if design.velocity is None or len(rows) < ROWS * (design.columns.shape[1] + 2 * OCTAVES):
        return None
    several = (design.target, design.left, design.velocity)
    target, left, velocity = (np.asarray(x, float)[rows] for x in several)
    least, known = LINEARITY**2 * float(target @ target), _known(design, rows)
    if known is None or not least < float(left @ left) < np.inf:
        return None
    basis, share, beyond = _fitted(known, flanks(velocity), left)
    moved = _left_out(basis, left, share)[:, beyond]
    error = np.sqrt((PARTS - 1) / PARTS * np.sum(moved**2, axis=0))
    # One that few parts tell has an error by chance: none is below what they have together.
    error = np.maximum(error, np.sqrt(np.sum(error**2) / max(1, len(error))))
    sure = np.abs(share[beyond]) > SURE * error
    told = np.where(sure, share[beyond], 0.0)
    if not float(told @ told) > least:
        return None
    missed = basis[:, beyond] @ told
    worst = int(np.argmax(np.abs(missed)))
    return Misfit(float(np.abs(missed[worst])), float(velocity[worst]))


def flanks(velocity: Float[np.ndarray, " J"]) -> Float[np.ndarray, "J F"]:
    """Functions of the velocity from broad to narrow: v₀²/(v₀² + v²), with the sign of the velocity
    and without, of speeds v₀ an octave apart.
    """
    speed = np.abs(velocity)
    slow, fast = np.quantile(speed, [SLOWEST, FASTEST])
    levels = fast * 0.5 ** np.arange(OCTAVES)
    levels = levels[(levels >= slow) & (levels > 0)]
    shape = levels**2 / (levels**2 + speed[:, None] ** 2)
    both = np.stack([np.sign(velocity)[:, None] * shape, shape], axis=2)
    return both.reshape(len(speed), -1)


def _known(design: Design, rows: np.ndarray) -> np.ndarray | None:
    """What the model can make, to first order, and what a force that is late by less than a row
    leaves, which is no friction, `(J, P + 1)`; `None` where that cannot be said.
    """
    time = np.asarray(design.time, float)[: rows[-1] + 1]  # beyond is padding
    if not np.all(np.diff(time) > 0):
        return None
    slope = np.gradient(np.asarray(design.target, float)[: len(time)], time)[rows]
    known = np.concatenate([np.asarray(design.columns, float)[rows], slope[:, None]], axis=1)
    return known if np.isfinite(known).all() else None


def _fitted(
    known: np.ndarray, more: np.ndarray, left: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An orthonormal basis of the columns, the known ones first, what each takes of `left`, and
    which are beyond the known.
    """
    columns = np.concatenate([known, more], axis=1)
    size = np.max(np.abs(columns), axis=0)
    there = np.flatnonzero(size > 0)
    columns = columns[:, there] / size[there]
    upper = triangle(np.concatenate([columns, left[:, None]], axis=1)[None])[0]
    own = np.abs(np.diagonal(upper))[:-1]
    kept = np.flatnonzero(own > OWN * np.linalg.norm(upper[:, :-1], axis=0))
    upper = np.asarray(np.linalg.qr(upper[:, [*kept, -1]], mode="r"))
    basis = columns[:, kept] @ np.linalg.inv(upper[:-1, :-1])
    return basis, upper[:-1, -1], there[kept] >= known.shape[1]


def _left_out(basis: np.ndarray, left: np.ndarray, share: np.ndarray) -> np.ndarray:
    """By how much the coefficients move for each part of the rows left out, `(PARTS, P)`."""
    table = np.concatenate([basis, (left - basis @ share)[:, None]], axis=1)
    parts = np.pad(table, ((0, -len(left) % PARTS), (0, 0))).reshape(PARTS, -1, table.shape[1])
    sums = np.swapaxes(parts[:, :, :-1], 1, 2) @ parts
    own, pushed = sums[:, :, :-1], sums[:, :, -1:]
    return np.linalg.solve(np.eye(len(share)) - PULL * own, pushed)[:, :, 0]
