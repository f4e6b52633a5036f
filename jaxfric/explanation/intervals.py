"""Covariance of the parameters of a fit, from blocks of its residual."""

import numpy as np

from .least_squares import orthonormal
from .regression import Fit


def covariance(current: Fit, block: np.ndarray) -> np.ndarray:
    """Covariance of all parameters, affine ones first, `(P, P)`; infinite where not visible.

    The sandwich of block scores, each block freed of its own pull on the fit: the delete-one-block
    jackknife (CR3 of Bell & McCaffrey 2002), as in [`jaxfric.identification.uncertainty`][].

    **Arguments:** `block`, the number of each row's block, `(J,)`.
    """
    jacobian = current.jacobian
    size = np.sqrt(np.sum(jacobian**2, axis=0))
    scaled = jacobian / np.where(size > 0, size, 1.0)
    basis, values, right = np.linalg.svd(scaled, full_matrices=False)
    seen = values > 1e-7 * max(values.max(initial=0.0), 1e-300)
    white = basis[:, seen]
    back = (right[seen].T / values[seen]) / np.where(size > 0, size, 1.0)[:, None]
    hidden = np.sqrt(np.sum(right[~seen] ** 2, axis=0)) > 1e-3
    starts = np.flatnonzero(np.diff(block, prepend=-1))
    scores = np.add.reduceat(white * current.residual[:, None], starts, axis=0)
    count = white.shape[1]
    grams = np.stack([
        white[a:b].T @ white[a:b]
        for a, b in zip(starts, [*starts[1:], len(block)], strict=True)
    ])  # fmt: skip
    free = np.linalg.solve(np.eye(count) - 0.95 * grams, scores[..., None])[..., 0]
    spread = back @ free.T
    matrix = spread @ spread.T
    matrix[hidden | (size == 0)] = np.inf
    matrix[:, hidden | (size == 0)] = np.inf
    return matrix


def left_out(current: Fit, number: int, block: np.ndarray) -> float:
    """The energy of the residual, N², each block by the term as fitted to all the other blocks.

    To first order in the term's own parameters, (I − H_b)⁻¹ r_b (Allen 1974's PRESS, by blocks);
    those of the other terms stay as all blocks say. Each block's pull on the fit is bounded as in
    [`covariance`][].

    **Arguments:** `number` of the term; `block`, the number of each row's block, `(J,)`.
    """
    mine = np.zeros(current.jacobian.shape[1], bool)
    mine[current.indices(number)] = True
    basis = orthonormal(current.jacobian[:, mine], orthonormal(current.jacobian[:, ~mine]))
    starts = np.flatnonzero(np.diff(block, prepend=-1))
    power = 0.0
    for a, b in zip(starts, [*starts[1:], len(block)], strict=True):
        own, residual = basis[a:b], current.residual[a:b]
        pull = np.eye(own.shape[1]) - 0.95 * own.T @ own
        power += float(np.sum((residual + own @ np.linalg.solve(pull, own.T @ residual)) ** 2))
    return power
