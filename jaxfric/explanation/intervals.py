"""Covariance of the parameters of a fit, from blocks of its residual."""

import numpy as np

from .regression import Fit


def covariance(now: Fit, block: np.ndarray) -> np.ndarray:
    """Covariance of all parameters, affine ones first, `(P, P)`; infinite where not visible.

    The sandwich of block scores, each block freed of its own pull on the fit: the delete-one-block
    jackknife (CR3 of Bell & McCaffrey 2002), as in [`jaxfric.identification.uncertainty`][].

    **Arguments:** `block`, the number of each row's block, `(J,)`.
    """
    jacobian = now.jacobian
    size = np.sqrt(np.sum(jacobian**2, axis=0))
    scaled = jacobian / np.where(size > 0, size, 1.0)
    left, values, right = np.linalg.svd(scaled, full_matrices=False)
    seen = values > 1e-7 * max(values.max(initial=0.0), 1e-300)
    white = left[:, seen]
    back = (right[seen].T / values[seen]) / np.where(size > 0, size, 1.0)[:, None]
    hidden = np.sqrt(np.sum(right[~seen] ** 2, axis=0)) > 1e-3
    starts = np.flatnonzero(np.diff(block, prepend=-1))
    scores = np.add.reduceat(white * now.residual[:, None], starts, axis=0)
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


def left_out(now: Fit, block: np.ndarray) -> float:
    """The energy that each block is left with, N², by a fit to all the other blocks.

    To first order in all parameters, (I − H_b)⁻¹ r_b (Allen 1974's PRESS, by blocks), each block's
    pull on the fit bounded as in [`covariance`][].

    **Arguments:** `block`, the number of each row's block, `(J,)`.
    """
    basis = now.basis()
    starts = np.flatnonzero(np.diff(block, prepend=-1))
    power = 0.0
    for a, b in zip(starts, [*starts[1:], len(block)], strict=True):
        own, left = basis[a:b], now.residual[a:b]
        pull = np.eye(own.shape[1]) - 0.95 * own.T @ own
        power += float(np.sum((left + own @ np.linalg.solve(pull, own.T @ left)) ** 2))
    return power
