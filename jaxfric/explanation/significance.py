"""Significance of columns for a residual, by a wild block bootstrap.

With orthonormal columns E, orthogonal to the span of the model, and blocks b of the residual r, the
scores g_b = E_bᵀ r_b are all that is needed: R² = |Σ g_b|²/|r|², and a draw of signs s_b has
|Σ s_b g_b|² in its place (Wu 1986; Shao 2010). Many tests at once are corrected for by the largest
statistic of each draw (Westfall & Young 1993).
"""

from typing import NamedTuple

import numpy as np

from .evidence import Evidence
from .regression import Fit

# Few enough that a slow hidden load stays within a block on most records: shorter blocks take it
# for structure. Enough that the signs have 2²⁴ patterns.
BLOCKS = 24
# Length of a block in half-widths of the kernel, so that neighbours hardly share noise; half of it
# on short records.
BLOCK_LENGTH = 8
# Family-wise level of significance.
LEVEL = 0.01
# Fewer blocks have too few patterns of signs for a p-value of 1 %.
FEWEST = 8
DRAWS = 499
# A column of which the model imitates all but this part, in amplitude, is not new: to be seen at a
# tenth of the force it would have to be five times the force.
NEW = 0.02
# A group that removes half of the residual would, its signs flipped, do nearly as well at the next
# grid point: a tone that begins anew has a frequency close by. Then the remainder is flipped.
MOSTLY = 0.5
# One group without a grid that leaves less than a tenth of the amplitude is no chance either,
# though a block or two hold it all: its signs flipped are then as large as it is.
ALL = 0.99
# Columns that are tested together: they fill the cache and no more.
CHUNK = 64


class Scan(NamedTuple):
    """How well each of many groups of columns explains a residual.

    `gain`: R² of each, `(G,)`; `null_mean`: mean R² of the draws, `(G,)`; `drawn`: the highest R²
    of each draw, `(D,)`; `dimension`: columns of each that are new, `(G,)`; `new_part`: the part of
    each that the model cannot imitate, in amplitude, `(G,)`.
    """

    gain: np.ndarray
    null_mean: np.ndarray
    drawn: np.ndarray
    dimension: np.ndarray
    new_part: np.ndarray

    @property
    def best(self) -> int:
        """The group with the highest gain."""
        return int(np.argmax(self.gain))


class BlockBootstrap:
    """Residual and span of one fit, and the signs by which the residual's blocks are flipped.

    Of a block, by its number in `block`, `(J,)`, several pieces may lie apart.
    """

    def __init__(self, fit: Fit, block: np.ndarray, seed: int = 0):
        basis = fit.basis()
        residual = fit.residual - basis @ (basis.T @ fit.residual)
        # Single precision is ample for ranking, and twice as fast; units cancel in the scale.
        self.scale = float(np.sqrt(residual @ residual))
        self.basis = basis.astype(np.float32)
        self.residual = (residual / self.scale).astype(np.float32)
        starts = np.flatnonzero(np.diff(block, prepend=-1))
        ends = [*starts[1:].tolist(), len(block)]
        self.pieces = [slice(*pair) for pair in zip(starts.tolist(), ends, strict=True)]
        owner, count = block[starts], int(block.max()) + 1
        self.owned = (owner[:, None] == np.arange(count)).astype(np.float32)
        signs = np.random.default_rng(seed).integers(0, 2, (DRAWS, count)) * 2.0 - 1.0
        self.signs = signs.astype(np.float32)

    def __call__(self, raw: np.ndarray, positive: bool = False) -> Scan:
        """Scan groups of columns, `(G, k, J)`; `positive`: single columns by that sign only."""
        scan = self._scan(raw, self.residual, positive)
        if scan.gain[scan.best] < (ALL if len(raw) == 1 else MOSTLY):
            return scan
        return self._by_remainder(scan, raw, positive)

    def beside_structure(self, scan: Scan, raw: np.ndarray, positive: bool = False) -> Scan:
        """The scan of groups in a residual that is known to hold structure.

        If that is the best group's, the flipped residual is no noise for the others either. So its
        remainder is flipped, unless that group's own draws do as well: what happens once, the signs
        leave as it is.
        """
        if len(raw) == 1 or scan.gain[scan.best] >= MOSTLY:
            return scan
        alone = self._scan(raw[scan.best : scan.best + 1], self.residual, positive)
        chance = np.mean(alone.drawn >= alone.gain[0])
        return scan if chance > LEVEL else self._by_remainder(scan, raw, positive)

    def _by_remainder(self, scan: Scan, raw: np.ndarray, positive: bool) -> Scan:
        """With draws of what the best group leaves, scaled to the power of the whole residual."""
        own = self.new_columns(raw[scan.best : scan.best + 1])[0][0]
        left = self.residual - (own @ self.residual) @ own
        left /= np.linalg.norm(left)
        rest = self._scan(raw, left, positive).drawn
        # The remainder beside the right grid point is not noise either: take the lower threshold.
        lower = np.quantile(rest, 1 - LEVEL) < np.quantile(scan.drawn, 1 - LEVEL)
        return scan._replace(drawn=rest) if lower else scan

    def _scan(self, raw, residual, positive) -> Scan:
        size = max(1, CHUNK // raw.shape[1])
        parts = [
            self._chunk(raw[i : i + size], residual, positive) for i in range(0, len(raw), size)
        ]
        gain, null_mean, drawn, dimension, new_part = zip(*parts, strict=True)
        return Scan(
            np.concatenate(gain), np.concatenate(null_mean), np.max(drawn, axis=0),
            np.concatenate(dimension), np.concatenate(new_part),
        )  # fmt: skip

    def _chunk(self, raw, residual, positive):
        own, dimension, new_part = self.new_columns(raw)
        scores, lever = self._by_block(own, residual)
        fitted = scores.sum(axis=2)
        noise = self._unexplained(lever, scores, fitted)
        g, k, b = noise.shape
        drawn = (noise.reshape(g * k, b) @ self.signs.T).reshape(g, k, -1)
        power = np.einsum("gkd,gkd->gd", drawn, drawn)
        if positive and k == 1:
            fitted = np.maximum(fitted, 0.0)
        gain = np.sum(fitted**2, axis=1)
        return gain, power.mean(axis=1), power.max(axis=0), dimension, new_part

    def _by_block(self, own, residual):
        """Scores E_bᵀ r_b, `(G, k, B)`, and leverages E_bᵀ E_b, `(G, B, k, k)`, of each block."""
        groups, k, size = own.shape
        flat = own.reshape(-1, size)
        scores = np.empty((groups * k, len(self.pieces)), own.dtype)
        lever = np.empty((groups, len(self.pieces), k, k), own.dtype)
        for b, rows in enumerate(self.pieces):
            scores[:, b] = flat[:, rows] @ residual[rows]
            part = own[..., rows]
            if k > 2:
                np.matmul(part, part.transpose(0, 2, 1), out=lever[:, b])
                continue
            for i in range(k):
                for j in range(i + 1):
                    lever[:, b, i, j] = lever[:, b, j, i] = np.vecdot(part[:, i], part[:, j])
        if len(self.pieces) > self.owned.shape[1]:
            scores = scores @ self.owned
            lever = np.einsum("gpij,pb->gbij", lever, self.owned, optimize=True)
        return scores.reshape(groups, k, -1), lever

    def _unexplained(self, lever, scores, fitted):
        """Scores of the group's residual, each block without its own influence on the fit.

        (I − H_b)⁻¹ (g_b − H_b a): the delete-one-block jackknife (Bell & McCaffrey 2002). A block
        with half of the leverage has no others to compare with and keeps g_b.
        """
        left = scores.transpose(0, 2, 1) - np.einsum("gbij,gj->gbi", lever, fitted)
        alone = np.trace(lever, axis1=2, axis2=3) > 0.5
        safe = np.where(alone[..., None, None], 0.0, lever)
        matrix = np.eye(lever.shape[2], dtype=lever.dtype) - safe
        # One column is a division, and most groups have one.
        one = matrix.shape[-1] == 1
        free = left / matrix[..., 0] if one else np.linalg.solve(matrix, left[..., None])[..., 0]
        return np.where(alone[:, None], scores, free.transpose(0, 2, 1))

    def new_columns(self, raw: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Orthonormal columns that each group adds, `(G, k, J)`, how many, `(G,)`, and the part of
        the group, in amplitude, that they are, `(G,)`.
        """
        size = np.sqrt(np.vecdot(raw, raw))
        flat = raw.reshape(-1, raw.shape[2])  # one product instead of one for each group
        own = (flat @ self.basis) @ self.basis.T
        own = np.subtract(flat, own, out=own).reshape(raw.shape)
        beside, whole = np.vecdot(own, own).sum(axis=1), np.sum(size**2, axis=1)
        new_part = np.sqrt(beside / np.where(whole > 0, whole, np.nan))
        dimension = np.zeros(len(raw), int)
        for i in range(raw.shape[1]):
            for h in range(i):
                own[:, i] -= own[:, h] * np.vecdot(own[:, h], own[:, i])[:, None]
            left = np.sqrt(np.vecdot(own[:, i], own[:, i]))
            new = left > NEW * size[:, i]
            own[:, i] *= np.where(new, 1 / np.where(new, left, 1.0), 0.0)[:, None]
            dimension += new
        return own, dimension, new_part


def blocks(elapsed: np.ndarray, reach: float) -> np.ndarray:
    """The block of each row: stretches with as many rows each; raises `ValueError` for too few.

    **Arguments:** `elapsed`, s, of each row; `reach`, the kernel's half-width, s.
    """
    count = _enough(len(elapsed))
    if count < FEWEST:
        spacing, needed = 0.5 * reach, 0.5 * FEWEST * BLOCK_LENGTH * reach
        raise ValueError(
            f"{len(elapsed) * spacing:.3g} s of slip are too short to tell structure from chance; "
            f"with this noise that takes {needed:.3g} s. Record longer, or more finely."
        )
    return evenly(len(elapsed), count)


def witnesses(evidence: Evidence) -> np.ndarray:
    """The block of each row, `(J,)`; those of several periods are one where the motion repeats.

    As [`blocks`][] where the motion does not repeat to a count of the encoder, or after too short a
    time for as many blocks as a test needs. Raises `ValueError` as that one does.
    """
    elapsed, period = evidence.elapsed[evidence.centre], evidence.repeats
    block = blocks(elapsed, evidence.reach)
    if not period:
        return block
    count = _enough(len(elapsed) * period / float(elapsed[-1] - elapsed[0]))
    return block if count < FEWEST else (elapsed / period % 1 * count).astype(int) % count


def _enough(rows: float) -> int:
    """How many blocks so many rows, half a half-width of the kernel apart, make."""
    whole = 0.5 * rows / BLOCK_LENGTH
    return int(min(BLOCKS, max(whole, min(2 * whole, FEWEST))))


def evenly(rows: int, count: int) -> np.ndarray:
    """The block of each row, for so many blocks with as many rows each, `(rows,)`."""
    return np.arange(rows) * count // rows


def agreement(changes: np.ndarray, block: np.ndarray, seed: int) -> float:
    """p-value of how much the blocks agree on the best of several models, by random signs.

    **Arguments:** `changes`, by how much each model lowers the squared residual, N², `(T, J)`;
    `block` of each row, `(J,)`; `seed` of the signs.
    """
    count = int(block[-1]) + 1
    sums = np.stack([np.bincount(block, change, count) for change in changes])
    sums /= np.maximum(np.linalg.norm(sums, axis=1), 1e-300)[:, None]
    signs = np.random.default_rng(seed).choice([-1.0, 1.0], size=(DRAWS, count))
    drawn = np.max(signs @ sums.T, axis=1)
    return float((1 + np.sum(drawn >= np.max(sums.sum(axis=1)))) / (1 + DRAWS))


def adjusted(gains: np.ndarray, drawn: np.ndarray) -> np.ndarray:
    """p-values of several statistics, corrected by the largest of each draw, `(C,)`.

    Cube roots make sums of squares nearly normal (Wilson & Hilferty 1931); centred and scaled by
    the draws, curves of any number of knots and the highest of any number of lines compare.

    **Arguments:** `gains`, R² `(C,)`; `drawn`, of each draw `(C, D)`.
    """
    mean, spread, highest = _standard(drawn)
    ours = (np.cbrt(gains) - mean) / np.where(spread > 0, spread, np.inf)
    return (1 + np.sum(highest[None, :] >= ours[:, None], axis=1)) / (1 + drawn.shape[1])


def thresholds(drawn: np.ndarray, level: float) -> np.ndarray:
    """The R² of each statistic from which its adjusted p-value is below `level`, `(C,)`."""
    mean, spread, highest = _standard(drawn)
    return (mean + spread * np.quantile(highest, 1 - level)) ** 3


def _standard(drawn):
    rooted = np.cbrt(drawn)
    mean, spread = rooted.mean(axis=1), rooted.std(axis=1)
    scaled = (rooted - mean[:, None]) / np.where(spread > 0, spread, np.inf)[:, None]
    return mean, spread, np.max(scaled, axis=0)
