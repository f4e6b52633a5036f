"""Variable projection on the host: a sum of terms fitted to the rows of one recording.

min over β of min over α of |y − G(β) α|², the affine α in closed form, β by Levenberg-Marquardt
with Kaufman's Jacobian (Golub & Pereyra 1973; Kaufman 1975), inside the compact set. The same
principle as [`jaxfric.identification`][], for the many short-lived sums that explaining tries:
nothing is compiled but each term once.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from ..terms.base import AbstractTerm, changed_columns
from .evidence import Evidence
from .friction_at_rest import beside_rest
from .least_squares import bounded, orthonormal
from .parameter_space import GRID, Space

ITERATIONS = 20
# Columns of a grid that are in memory at once.
TOGETHER = 512
# Steps tried from one point, and by how much one of them may raise the damping.
TRIALS, STEEPEST = 6, 64.0
# Parts of the energy: a refinement ends with a step that gains less than `ENOUGH`, half a
# thousandth of the amplitude of what is left, and tries none that should gain less than `NOTHING`.
ENOUGH, NOTHING = 1e-6, 1e-9


class Fit(NamedTuple):
    """Terms with their parameters on some rows.

    `betas`, one vector for each term; `alphas` likewise; `columns` `(J, p)`, `slopes` `(J, d)`,
    the derivatives of the fitted force by β; `residual` `(J,)`, N; `energy`, its square sum.
    """

    terms: tuple[AbstractTerm, ...]
    betas: tuple[np.ndarray, ...]
    alphas: tuple[np.ndarray, ...]
    columns: np.ndarray
    slopes: np.ndarray
    residual: np.ndarray
    energy: float

    @property
    def jacobian(self) -> np.ndarray:
        """Derivatives by all parameters, affine ones first, `(J, p + d)`."""
        return np.concatenate([self.columns, self.slopes], axis=1)

    def basis(self) -> np.ndarray:
        """An orthonormal basis of the Jacobian's span, `(J, r)`."""
        return orthonormal(self.jacobian)

    def only(self, index: Sequence[int]) -> "Fit":
        """The terms of those indices with their parameters; whatever else is still of them all."""
        terms, betas, alphas = (
            tuple(values[i] for i in index) for values in (self.terms, self.betas, self.alphas)
        )
        return self._replace(terms=terms, betas=betas, alphas=alphas)

    def indices(self, number: int) -> list[int]:
        """Columns of the Jacobian that belong to a term, affine parameters first."""
        affine = np.cumsum([0, *(len(a) for a in self.alphas)])
        searched = affine[-1] + np.cumsum([0, *(len(b) for b in self.betas)])
        pairs = (ends[number : number + 2] for ends in (affine, searched))
        return [i for start, stop in pairs for i in range(start, stop)]

    def part(self, number: int) -> np.ndarray:
        """The force of one of the terms, `(J,)`."""
        ends = np.cumsum([0, *(len(a) for a in self.alphas)])
        return self.columns[:, ends[number] : ends[number + 1]] @ self.alphas[number]


def fast(current: Fit) -> float:
    """The root mean square, N, of what a fit leaves and what differs from row to row.

    Rows four apart share no samples; their difference is noise and what changes faster than the
    kernel (von Neumann 1941).
    """
    differences = current.residual[4:] - current.residual[:-4]
    return float(np.median(np.abs(differences)) / 0.6745 / np.sqrt(2))


class Beside:
    """Evidence with the span of some columns taken out of target and columns alike."""

    def __init__(self, evidence: Evidence, basis: np.ndarray):
        self.basis, self.evidence, self.limits = basis, evidence, evidence.limits
        self.peak, self.both_ways = evidence.peak, False  # what is beside has friction too
        self.target = evidence.target - basis @ (basis.T @ evidence.target)

    def columns(self, term: AbstractTerm, betas: np.ndarray) -> np.ndarray:
        """Rows of a term's columns without that span."""
        rows = self.evidence.columns(term, betas)
        return rows - self.basis @ (self.basis.T @ rows)


class Remembered:
    """Rows that remember columns: in a step most terms stay where they are."""

    def __init__(self, rows: "Evidence | Beside"):
        self.rows, self.limits, self.target = rows, rows.limits, rows.target
        self.peak, self.both_ways = rows.peak, rows.both_ways
        self._known: dict[tuple[int, bytes], np.ndarray] = {}

    def columns(self, term: AbstractTerm, betas: np.ndarray) -> np.ndarray:
        """Rows of a term's columns at many β, `(G, d)` to `(G, J, p)`."""
        keys = [(id(term), beta.tobytes()) for beta in betas]
        new = [i for i, key in enumerate(keys) if key not in self._known]
        if len(new) > GRID // 2:  # a grid is seen once
            return self.rows.columns(term, betas)
        if new:
            fresh = self.rows.columns(term, betas[new])
            self._known |= {keys[i]: columns for i, columns in zip(new, fresh, strict=True)}
        return np.stack([self._known[key] for key in keys])


def fit(
    terms: Sequence[AbstractTerm],
    evidence: Evidence,
    start: Sequence[np.ndarray | None] | None = None,
    iterations: int = ITERATIONS,
    beside: np.ndarray | None = None,
) -> Fit:
    """The sum of terms that fits the rows best.

    **Arguments:** `terms`; `evidence`; `start`, β of each term to begin from, of which NaN is
    looked for on a grid (`None`: all); `beside`, an orthonormal basis of further columns that are
    fitted along, `(J, r)`: then the result's columns and residual are what those leave.
    """
    terms = tuple(terms)
    rows = Remembered(evidence if beside is None else Beside(evidence, beside))
    space = Space(terms, rows.limits)
    if not sum(space.counts):
        return _at(terms, rows, space, np.zeros(0), derivatives=True)
    given = start if start is not None else [None] * len(terms)
    pairs = zip(given, space.counts, strict=True)
    known = np.concatenate([np.full(count, np.nan) if b is None else b for b, count in pairs])
    sought = np.isnan(known)
    point = space.point(np.where(sought, space.beta(np.full(len(known), 0.5)), known))
    if sought.any():
        point = _scan(terms, rows, space, point, np.flatnonzero(sought))
    return _refine(terms, rows, space, point, iterations)


def gains(
    term: AbstractTerm,
    evidence: "Evidence | Beside | Remembered",
    betas: np.ndarray,
    basis: np.ndarray,
) -> np.ndarray:
    """The energy that a term removes at many β beside an orthonormal basis, N², `(G,)`."""
    left = evidence.target - basis @ (basis.T @ evidence.target)
    parts = (betas[i : i + TOGETHER] for i in range(0, len(betas), TOGETHER))
    own = [
        orthonormal(rows, basis).T @ left for some in parts for rows in evidence.columns(term, some)
    ]
    return np.array([np.sum(each**2) for each in own])


def without_shapes(term: AbstractTerm, beta: np.ndarray) -> np.ndarray:
    """β of a term, `(d,)`, with NaN for what [`fit`][] is to look for anew: all but the periods of
    waves, which nothing beside them changes.
    """
    return np.where([parameter.repeats for parameter in term.nonlinear], beta, np.nan)


def freed(current: Fit, free: Iterable[int]) -> Fit:
    """A fit of whose base only some values were fitted; what stayed has no error."""
    moved, columns, slopes = set(free), current.columns.copy(), current.slopes.copy()
    count, searched = len(current.alphas[0]), len(current.betas[0])
    columns[:, [i for i in range(count) if i not in moved]] = 0.0
    slopes[:, [i for i in range(searched) if count + i not in moved]] = 0.0
    return current._replace(columns=columns, slopes=slopes)


def at_shapes(current: Fit) -> Fit:
    """A fit whose terms but the base have their shapes, β, given: the error of a size is its own.

    A size that grows as its shape nears a limit, as of an exponential that nears a straight line,
    may be anything together with it, though its force is sure.
    """
    slopes, base = current.slopes.copy(), len(current.betas[0])
    slopes[:, base:] = 0.0
    return current._replace(slopes=slopes)


def without(current: Fit, evidence: Evidence, number: int) -> Fit:
    """A fit done again without one of its terms."""
    keep = [i for i in range(len(current.terms)) if i != number]
    return fit([current.terms[i] for i in keep], evidence, [current.betas[i] for i in keep], 6)


def _at(terms, evidence, space, point, derivatives=False) -> Fit:
    """The fit at given coordinates of β; with the derivatives by the coordinates' β."""
    betas = space.split(space.beta(point))
    beyond = point + space.step > 1.0
    shifted = space.split(space.beta(point + np.where(beyond, -space.step, space.step)))
    columns, moved = [], []
    for number, term in enumerate(terms):
        own, changed = betas[number], changed_columns(term)
        groups = _apart(changed) if derivatives else []
        grid = [own]
        for group in groups:
            grid.append(own.copy())
            grid[-1][group] = shifted[number][group]
        rows = evidence.columns(term, np.stack(grid))
        columns.append(rows[0])
        moved += [
            (number, changed[i], (rows[1 + at] - rows[0])[:, changed[i]] / (grid[1 + at] - own)[i])
            for i in range(len(own))
            for at, group in enumerate(groups)
            if i in group
        ]
    whole = np.concatenate(columns, axis=1)
    alpha = bounded(whole, evidence.target, *beside_rest(terms, evidence.both_ways), evidence.peak)
    residual = evidence.target - whole @ alpha
    ends = np.cumsum([0, *(c.shape[1] for c in columns)])
    alphas = tuple(alpha[a:b] for a, b in zip(ends[:-1], ends[1:], strict=True))
    slopes = [change @ alphas[number][those] for number, those, change in moved]
    jacobian = np.stack(slopes, axis=1) if slopes else np.zeros((len(residual), 0))
    return Fit(terms, tuple(betas), alphas, whole, jacobian, residual, float(residual @ residual))


def _apart(changed: Sequence[range]) -> list[list[int]]:
    """Nonlinear parameters in groups that change no column in common: moved at once, each one's
    part is seen by itself (Curtis, Powell & Reid 1974).
    """
    groups: list[list[int]] = []
    for i, own in enumerate(changed):
        for group in groups:
            if not any(set(own) & set(changed[j]) for j in group):
                group.append(i)
                break
        else:
            groups.append([i])
    return groups


def _scan(terms, evidence, space, point, free):
    """Coordinates found one after the other, each by a grid with the others held, twice over."""
    owner = np.repeat(np.arange(len(terms)), space.counts)
    done: dict[int, np.ndarray] = {}  # where the others were held at a parameter's last scan
    for _ in range(2 if len(free) > 1 else 1):
        for i in free:
            others_at = np.delete(point, i)
            if i in done and np.array_equal(done[i], others_at):
                continue
            done[i] = others_at
            number = owner[i]
            grid = space.grid(i)
            tried = np.repeat(point[None, :], len(grid), axis=0)
            tried[:, i] = grid
            betas = space.split(space.beta(tried))[number]
            others = [
                evidence.columns(t, b[None])[0]
                for n, (t, b) in enumerate(zip(terms, space.split(space.beta(point)), strict=True))
                if n != number
            ]
            fixed = orthonormal(np.concatenate([*others, np.zeros((len(evidence.target), 0))], 1))
            point = point.copy()
            point[i] = grid[int(np.argmax(gains(terms[number], evidence, betas, fixed)))]
    return point


def _refine(terms, evidence, space, point, iterations):
    """Levenberg-Marquardt with Kaufman's Jacobian, inside the set.

    Beside a large residual Gauss-Newton takes the energy for less curved than it is: the curvature
    that a step has met, relative to that, less one is the damping of the next.
    """
    damping, best = 1e-3, _at(terms, evidence, space, point, derivatives=True)
    for _ in range(iterations):
        basis = orthonormal(best.columns)
        width = space.rate(point)
        slopes = best.slopes * width
        slopes = slopes - basis @ (basis.T @ slopes)
        gram, pull = slopes.T @ slopes, slopes.T @ best.residual
        size = np.diag(gram).copy()
        size[size <= 0] = 1.0
        # A coordinate at its limit that is pulled outwards stays there.
        stuck = ((point <= 0) & (pull < 0)) | ((point >= 1) & (pull > 0))
        moving = ~stuck
        if not moving.any():
            break
        for _ in range(TRIALS):
            step = np.zeros_like(point)
            matrix = gram[np.ix_(moving, moving)] + damping * np.diag(size[moving])
            step[moving] = np.linalg.lstsq(matrix, pull[moving], rcond=None)[0]
            # A fifth of the set at most: Gauss-Newton knows no more than the neighbourhood.
            step *= min(1.0, 0.2 / max(np.max(np.abs(step)), 1e-300))
            trial_point = np.clip(point + step, 0.0, 1.0)
            within, step = step, trial_point - point
            bend, fall = float(step @ gram @ step), 2 * float(pull @ step)
            if fall - bend < NOTHING * best.energy:
                if np.array_equal(step, within):
                    return best
                damping *= 8  # the part of a step inside the set may lead upwards
                continue
            trial = _at(terms, evidence, space, trial_point, derivatives=True)
            beyond = (trial.energy - best.energy + fall) / max(bend, 1e-300) - 1
            if trial.energy < best.energy:
                break
            steepest = STEEPEST * max(damping, 1.0)
            damping = beyond if beyond < steepest else steepest
        else:
            break
        gained = best.energy - trial.energy
        damping = max(beyond, damping / 8, 1e-9)
        best, point = trial, trial_point
        if gained < ENOUGH * best.energy:
            break
    return best
