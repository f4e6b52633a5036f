"""By how much a force is late, as the rows of many fits show it, and which fits are suspect."""

from typing import NamedTuple

import jax
import numpy as np

from .design import HALF, Design

# Parts of a record that its errors are summed over.
PARTS = 16
# A force that is held acts half a sample after its stamp, and a cycle of the controller later it
# acts one and a half; what is beyond is another matter. Student's t of 15 degrees of freedom is
# below 4 in 99.9 % of the cases.
STAMPED, SURE = 1.5, 4.0
# Singular values below this share of the largest are rounding. Of a triangle whose diagonal varies
# by less than PLAIN none is.
RANK, PLAIN = 1e-10, 1e-6
# Rows that are made triangular at once, and numbers of a design that are looked at together.
PIECE, TOGETHER = 256, 2**17


class Lateness(NamedTuple):
    """By how much a recorded force is late, s (early below zero): u(t + τ) = u + τ du/dt.

    `error`, s, of the time, by parts of the record; `gain`, the energy, N², that it would remove;
    `shape`, that of the slope, N²/s².
    """

    time: float
    error: float
    gain: float
    shape: float

    @property
    def told(self) -> bool:
        """Whether it is told from none."""
        return SURE * self.error < abs(self.time)

    def sure(self, interval: float) -> bool:
        """Whether it is told from none, and what a hold or a cycle of a controller makes.

        `interval` between the samples, s.
        """
        return self.told and abs(self.time) <= STAMPED * interval


class Look(NamedTuple):
    """The [`Lateness`][] that the rows of a fit show, `None` where they cannot; `gain`: whether one
    of the positive force alone may explain what is left.
    """

    late: Lateness | None
    gain: bool


def lateness(design: Design) -> Lateness | None:
    """The [`Lateness`][] that the rows of a fit show; `None` where they cannot.

    Of less than a row. What the parameters imitate of it is no part of the estimate.
    """
    return looks(jax.tree.map(lambda x: np.asarray(x)[None], design))[0].late


def looks(designs: Design) -> list[Look]:
    """The [`Look`][] of each fit of a batch, a leading axis `B` on all of the rows."""
    columns = np.asarray(designs.columns)
    most = max(1, TOGETHER // max(1, columns[0].size))
    found: list[Look] = []
    for start in range(0, len(columns), most):
        part = jax.tree.map(lambda x, at=start: np.asarray(x, float)[at : at + most], designs)
        found += _looks(part)
    return found


def _looks(designs: Design) -> list[Look]:
    found = [Look(None, True)] * len(designs.time)
    used = designs.weight > 0
    last = used.shape[1] - 1 - np.argmax(used[:, ::-1], axis=1)  # beyond is padding
    backward = (np.diff(designs.time, axis=1) <= 0) & (np.arange(used.shape[1] - 1) < last[:, None])
    columns = np.where(used[:, :, None], designs.columns, 0.0)
    good = np.count_nonzero(used, axis=1) >= PARTS
    good &= ~backward.any(axis=1) & np.isfinite(columns).all(axis=(1, 2))
    index = np.flatnonzero(good)
    if not len(index):
        return found
    columns, used = columns[index], used[index]
    designs = jax.tree.map(lambda x: x[index], designs)
    slope = np.where(used, _slopes(designs, last[index]), 0.0)
    target, left = (np.where(used, x, 0.0) for x in (designs.target, designs.left))
    positive = np.maximum(target - left, 0.0)
    size = np.max(np.abs(columns), axis=1)
    size[size == 0] = 1.0
    values = np.stack([slope, positive], axis=2)
    table = triangle(np.concatenate([columns / size[:, None, :], values], axis=2))
    shares, plain = _least(table[:, :, :-2], table[:, :, -2:])
    shares /= size[:, :, None]
    own, other = np.moveaxis(values - columns @ shares, 2, 0)
    gain = ~plain | (
        _dots(other, left) ** 2 > 0.99 * HALF * _dots(left, left) * _dots(other, other)
    )
    powers, shapes, parts = _dots(own, own), _dots(slope, slope), _dots(own, left)
    for i, at in enumerate(index):
        late = None
        if powers[i] > 1e-6 * shapes[i]:
            time = -parts[i] / powers[i]
            rest = (own[i] * (left[i] + time * own[i]))[used[i]]
            sums = np.add.reduceat(rest, np.arange(PARTS) * len(rest) // PARTS)
            error = float(np.sqrt(sums @ sums)) / powers[i]
            late = Lateness(time, error, parts[i] ** 2 / powers[i], shapes[i])
        found[at] = Look(late, bool(gain[i]))
    return found


def _slopes(designs: Design, last: np.ndarray) -> np.ndarray:
    """The slope of the force up to the last row, `(B, J)`, as `numpy.gradient`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        step = np.diff(designs.time, axis=1)
        rise = np.diff(designs.target, axis=1) / step
        inner = (rise[:, :-1] * step[:, 1:] + rise[:, 1:] * step[:, :-1]) / (
            step[:, :-1] + step[:, 1:]
        )
    slope = np.concatenate([rise[:, :1], inner, rise[:, -1:]], axis=1)
    rows = np.arange(len(last))
    slope[rows, last] = rise[rows, last - 1]
    return slope


def _dots(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.einsum("bj,bj->b", one, other)


def triangle(matrix: np.ndarray) -> np.ndarray:
    """The triangular factor of each matrix, `(B, J, K)`; of tall ones by pieces in the cache, so
    small that LAPACK begins no threads for them.
    """
    count, rows, width = matrix.shape
    while rows > PIECE >= 2 * width:
        matrix = np.pad(matrix, ((0, 0), (0, -rows % PIECE), (0, 0)))
        pieces = matrix.reshape(count, -1, PIECE, width)
        matrix = np.asarray(np.linalg.qr(pieces, mode="r")).reshape(count, -1, width)
        rows = matrix.shape[1]
    return np.asarray(np.linalg.qr(matrix, mode="r"))


def _least(matrix: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The shortest least-squares solutions, `(B, p, k)`, and where no column is spanned."""
    basis, upper = np.linalg.qr(matrix)
    pivots = np.abs(np.diagonal(upper, axis1=1, axis2=2))
    plain = pivots.min(axis=1, initial=np.inf) > PLAIN * pivots.max(axis=1, initial=0.0)
    plain &= upper.shape[1] == upper.shape[2]
    found = np.zeros((len(matrix), matrix.shape[2], right.shape[2]))
    turned = np.swapaxes(basis[plain], 1, 2) @ right[plain]
    found[plain] = np.linalg.solve(upper[plain], turned)
    if not plain.all():
        found[~plain] = np.linalg.pinv(matrix[~plain], rcond=RANK) @ right[~plain]
    return found, plain
