"""How well the parameters of a fit are known, from blocks of its residual."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..identification.uncertainty import student_quantile
from .evidence import Evidence
from .least_squares import orthonormal
from .regression import Fit, fit

# Of a variance that one or two blocks tell, the spread over the other blocks tells something too.
LEAST_DEGREES = 2.0


class Spread(NamedTuple):
    """How well a fit's parameters are known, `P` of them, affine ones first, from `B` blocks.

    - `covariance`: `(P, P)`; infinite where not visible.
    - `back`: from the `r` coordinates of the whitened design matrix to the parameters, `(P, r)`.
    - `grams`: G, of each block's whitened rows, `(B, r, r)`; `freed`: (I − 0.95 G)⁻¹ of each.
    - `pooled`: the part of a unit variance that the blocks' own scores do not tell, `(r, r)`.
    """

    covariance: Float[np.ndarray, "P P"]
    back: Float[np.ndarray, "P r"]
    grams: Float[np.ndarray, "B r r"]
    freed: Float[np.ndarray, "B r r"]
    pooled: Float[np.ndarray, "r r"]

    def degrees_of_freedom(self, weights: Float[np.ndarray, "K P"]) -> Float[np.ndarray, " K"]:
        """Degrees of freedom of the variance of sums of parameters, `(K,)`, two at least.

        A variance from a few blocks that hold all there is of a parameter is itself uncertain. It
        is compared with a chi-square of its mean and variance (Satterthwaite 1946), for rows of
        equal and independent noise (Bell & McCaffrey 2002): (tr V)²/tr V², V the covariance of the
        blocks' scores. To what is pooled each block contributes one.
        """
        sums = np.asarray(weights) @ self.back
        away = np.einsum("bij,kj->kbi", self.freed, sums)
        pulled = np.einsum("bij,kbj->kbi", self.grams, away)
        own = np.einsum("kbi,kbi->kb", away, pulled)
        spread = -pulled @ np.swapaxes(pulled, 1, 2)
        at = np.arange(own.shape[1])
        spread[:, at, at] += own
        pooled = np.sum(sums @ self.pooled * sums, axis=1)
        trace = np.einsum("kbb->k", spread) + pooled
        power = np.sum(spread**2, axis=(1, 2)) + pooled**2 / own.shape[1]
        known = np.divide(trace**2, power, out=np.zeros_like(trace), where=power > 0)
        return np.maximum(known, LEAST_DEGREES)

    def errors(self, weights: Float[np.ndarray, "K P"]) -> Float[np.ndarray, " K"]:
        """Standard errors of sums of parameters, `(K,)`; infinite where not visible."""
        weights = np.asarray(weights)
        seen = np.any(weights != 0, axis=0)
        if not np.isfinite(np.diagonal(self.covariance)[seen]).all():
            return np.full(len(weights), np.inf)
        matrix = np.where(np.isfinite(self.covariance), self.covariance, 0.0)
        return np.sqrt(np.maximum(np.sum(weights @ matrix * weights, axis=1), 0.0))

    def half_widths(self, weights: Float[np.ndarray, "K P"]) -> Float[np.ndarray, " K"]:
        """Half the 95 % intervals of sums of parameters, `(K,)`; infinite where not visible."""
        levels = [student_quantile(0.975, each) for each in self.degrees_of_freedom(weights)]
        return np.asarray(levels) * self.errors(weights)


def spread(current: Fit, block: np.ndarray) -> Spread:
    """How well all parameters of a fit are known.

    The covariance is the sandwich of block scores, each block freed of its own pull on the fit: the
    delete-one-block jackknife (CR3 of Bell & McCaffrey 2002), as in
    [`jaxfric.identification.uncertainty`][]. A block that holds nearly all there is of a parameter
    fits it to its own noise and has no score left: what the scores lack of the variance that rows
    of equal noise have is added, with the noise that all scores have.

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
    count, starts = white.shape[1], np.flatnonzero(np.diff(block, prepend=-1))
    scores = np.add.reduceat(white * current.residual[:, None], starts, axis=0)
    grams = np.stack([
        white[a:b].T @ white[a:b]
        for a, b in zip(starts, [*starts[1:], len(block)], strict=True)
    ])  # fmt: skip
    freed = np.linalg.inv(np.eye(count) - 0.95 * grams)
    own = grams - grams @ grams  # of the scores, in units of the noise's power
    lacking, turns = np.linalg.eigh(np.eye(count) - np.sum(freed @ own @ freed, axis=0))
    pooled = turns * np.maximum(lacking, 0.0) @ turns.T
    told = np.trace(own, axis1=1, axis2=2).sum()
    noise = np.sum(scores**2) / told if told > 0 else 0.0
    votes = back @ np.einsum("bij,bj->ib", freed, scores)
    matrix = votes @ votes.T + noise * back @ pooled @ back.T
    matrix[hidden | (size == 0)] = np.inf
    matrix[:, hidden | (size == 0)] = np.inf
    return Spread(matrix, back, grams, freed, pooled)


# Each leaves out every fourth block, so that all parts of the motion stay in the others.
FOLDS = 4


def left_out_again(current: Fit, evidence: Evidence, block: np.ndarray) -> float:
    """The energy of the residual, N², each quarter of the blocks by the other three, fitted again.

    When a load strikes its flank is nothing that a small change of its parameters changes a little:
    beside one block more of them the linear [`left_out`][] had it anywhere.
    """
    power = 0.0
    for fold in range(FOLDS):
        out = block % FOLDS == fold
        other = fit(current.terms, evidence.only(~out), current.betas, 4)
        columns = [
            evidence.columns(term, beta[None])[0]
            for term, beta in zip(other.terms, other.betas, strict=True)
        ]
        rest = evidence.target - np.concatenate(columns, axis=1) @ np.concatenate(other.alphas)
        power += float(np.sum(rest[out] ** 2))
    return power


def left_out(current: Fit, number: int, block: np.ndarray) -> float:
    """The energy of the residual, N², each block by the term as fitted to all the other blocks.

    To first order in the term's own parameters, (I − H_b)⁻¹ r_b (Allen 1974's PRESS, by blocks);
    those of the other terms stay as all blocks say. Each block's pull on the fit is bounded as in
    [`spread`][]. Of a law that is far from straight in its parameters [`left_out_again`][] says it.

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
