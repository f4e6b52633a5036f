"""Whether what a model leaves is a function of the velocity or of the force: a wrong law.

The intervals of the parameters hold the noise. A law that misses little may be wrong in its
parameters by much, as a viscous friction that stands in for a quadratic drag. So what is left is
fitted by functions of the velocity and of the force, less what the model can make of them itself,
and each coefficient is compared with its standard error (a lack-of-fit test). The noise of an axis
is far from white: the errors are those of the jackknife over parts of the record (Efron & Stein
1981).
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .design import LINEARITY, Design
from .lateness import PIECE, triangle

# A bump's flank takes an octave of speed. The narrowest of six flanks stands at a thirtieth of the
# top speed; below it hardly any kernel lies wholly in slip of one direction.
OCTAVES = 6
# So many in each direction, and three of the force.
FUNCTIONS = 2 * OCTAVES + 3
# The speeds that the flanks lie between: single rows beyond them would be fitted by one of them.
SLOWEST, FASTEST = 0.02, 0.99
# Parts of a record that are left out one by one. Student's t of 15 degrees of freedom stays below
# 5.5 in all of fifteen functions in 99.9 % of the cases.
PARTS, SURE = 16, 5.5
# As in `uncertainty`: what the fit explains of a part is credited with a sixteenth at least.
PULL = 15 / 16
# Rows of a long recording are thinned to so many: neighbours share half of their samples and more.
MOST = 4096
# Rows for each function and each parameter, as in `fitted`.
ROWS = 10
# A column with less of its own beside those before it is rounding.
OWN = 1e-4


class Misfit(NamedTuple):
    """The most that a model misses, N, and at which velocity, m/s, or force, N; `name`, of the kind
    of fault.
    """

    name: str
    most: float
    at: float


def misfit(design: Design) -> Misfit | None:
    """The larger [`Misfit`][] that the rows of a fit show for sure; `None` where there is none.

    It is told where it is more of the force than the linearity of a sensor.
    """
    rows = np.flatnonzero(np.asarray(design.weight) > 0)
    if design.velocity is None or len(rows) < ROWS * (design.columns.shape[1] + FUNCTIONS):
        return None
    last, rows = rows[-1], rows[:: -(-len(rows) // MOST)]
    several = (design.target, design.left, design.velocity)
    target, left, velocity = (np.asarray(x, float)[rows] for x in several)
    least, known = LINEARITY**2 * float(target @ target), _known(design, rows, last)
    if known is None or not least < float(left @ left) < np.inf:
        return None
    curve, model = flanks(velocity), target - left
    families = [known, curve, _of_force(model, velocity)]
    basis, share, kept = _fitted(np.concatenate(families, axis=1), left)
    moved = _left_out(basis, left, share)
    family = np.repeat([0, 1, 2], [f.shape[1] for f in families])[kept]
    found = []
    for number, name, place in ((1, "curve_missed", velocity), (2, "force_missed", model)):
        own = np.flatnonzero(family == number)
        told = _sure(share[own], moved[:, own])
        if (power := float(told @ told)) > least:
            missed = basis[:, own] @ told
            worst = int(np.argmax(np.abs(missed)))
            found.append((power, Misfit(name, float(np.abs(missed[worst])), float(place[worst]))))
    return max(found)[1] if found else None


def _sure(share: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """The coefficients that are told from zero, `(P,)`, and zero for the others; by how much they
    move without each part, `(PARTS, P)`.
    """
    error = np.sqrt((PARTS - 1) / PARTS * np.sum(moved**2, axis=0))
    # One that few parts tell has an error by chance: none is below what they have together.
    error = np.maximum(error, np.sqrt(np.sum(error**2) / max(1, len(error))))
    return np.where(np.abs(share) > SURE * error, share, 0.0)


def _of_force(force: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """Functions of the force that the model gives, `(J, 3)`: what a dead band takes of it, what a
    gain of its own for each sign does, and friction that grows with the load.
    """
    return np.stack([np.sign(force), np.abs(force), np.sign(velocity) * np.abs(force)], axis=1)


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


def _known(design: Design, rows: np.ndarray, last: int) -> np.ndarray | None:
    """What the model can make, to first order, and what a force that is late by less than a row
    leaves, which is no friction, `(J, P + 1)`; `None` where that cannot be said.
    """
    time = np.asarray(design.time, float)[: last + 1]  # beyond is padding
    if not np.all(np.diff(time) > 0):
        return None
    slope = np.gradient(np.asarray(design.target, float)[: len(time)], time)[rows]
    known = np.concatenate([np.asarray(design.columns, float)[rows], slope[:, None]], axis=1)
    return known if np.isfinite(known).all() else None


def _fitted(columns: np.ndarray, left: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """An orthonormal basis of the columns, one after the other, what each takes of `left`, and
    whose each is the own part.
    """
    size = np.max(np.abs(columns), axis=0)
    there = np.flatnonzero(size > 0)
    columns = columns[:, there] / size[there]
    upper = triangle(np.concatenate([columns, left[:, None]], axis=1)[None])[0]
    own = np.abs(np.diagonal(upper))[:-1]
    kept = np.flatnonzero(own > OWN * np.linalg.norm(upper[:, :-1], axis=0))
    upper = np.asarray(np.linalg.qr(upper[:, [*kept, -1]], mode="r"))
    basis = _pieces(columns[:, kept]) @ np.linalg.inv(upper[:-1, :-1])
    basis = basis.reshape(-1, len(kept))[: len(left)]
    return basis, upper[:-1, -1], there[kept]


def _left_out(basis: np.ndarray, left: np.ndarray, share: np.ndarray) -> np.ndarray:
    """By how much the coefficients move for each part of the rows left out, `(PARTS, P)`."""
    parts, rest = _pieces(basis), _pieces(left[:, None])
    rest = rest - parts @ share[:, None]
    turned = np.swapaxes(parts, 2, 3)
    own, pushed = (np.sum(turned @ x, axis=1) for x in (parts, rest))
    return np.linalg.solve(np.eye(len(share)) - PULL * own, pushed)[:, :, 0]


def _pieces(table: np.ndarray) -> np.ndarray:
    """The rows of each part in pieces, zero beyond them, `(PARTS, pieces, rows, K)`: products of
    so few rows begin no threads, which would wait for each other.
    """
    count = -(-len(table) // (PARTS * PIECE))
    table = np.pad(table, ((0, -len(table) % (PARTS * count)), (0, 0)))
    return table.reshape(PARTS, count, -1, table.shape[1])
