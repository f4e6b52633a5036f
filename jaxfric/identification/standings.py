"""Held-out errors of all named models from one set of rows: sums of squares, fold by fold.

The rows of the weak form are made once. What a model needs of them are sums of products of its
columns over each fold; those of all other folds are a difference. So a model costs small linear
systems over its grid, on the host, and nothing is compiled for it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np

from .. import programs, signals
from ..data.recording import Recording, uniform
from .projections import WeakForm

# Grid points along a Stribeck velocity, a tenth apart over a ratio of 100: half a step costs some
# (5 %)² of what the bump explains, far below what folds differ by.
POINTS = 48
# The generalised shape has a second parameter and so fewer points along the first.
FEWER, EXPONENTS = 24, (0.5, 1.0, 1.5, 2.0)
# Beside columns of norm one: what is spanned by others gets no part, nothing else changes.
RIDGE = 1e-11

# Half-width of the kernel, samples, where the noise allows it. Kernels that hold a reversal are
# left out, and with them the slow motion beside it, where a bump shows: so the least that averages.
NARROWEST = 4

SHAPES = {
    "gaussian": lambda x: np.exp(-(x**2)),
    "lorentzian": lambda x: 1 / (1 + x**2),
    "exponential": lambda x: np.exp(-x),
}


class Regression(NamedTuple):
    """Rows in slip: the force, N, `(J,)`; inertia's column; direction, 1 or −1; viscous column,
    m/s; fold; and `average`, kernel weights and first samples, to make rows of other columns.
    """

    force: np.ndarray
    inertia: np.ndarray
    direction: np.ndarray
    velocity: np.ndarray
    fold: np.ndarray
    weights: np.ndarray
    first: np.ndarray
    speed: np.ndarray
    slowest: float
    fastest: float

    def rows(self, columns: np.ndarray) -> np.ndarray:
        """Kernel averages of functions of the samples, `(N, p)` to `(J, p)`."""
        total = np.zeros((self.first.size, columns.shape[1]))
        for offset, weight in enumerate(self.weights):
            total += weight[:, None] * columns[self.first + offset]
        return total


class Standing(NamedTuple):
    """A model's held-out mean squares, N², `(F,)`, the force's `(F,)`, its number of parameters,
    and its friction over `speeds` from all folds, N, forward and backward, `(2, K)`.
    """

    parameters: int
    held_out: np.ndarray
    size: np.ndarray
    curve: np.ndarray


@programs.compiled
def _projected(recording: Recording, width: int):
    limits = signals.scales(recording)
    rows = WeakForm(width).rows(recording, limits)
    ones = recording.velocity[:, None]
    inertia = rows.project(0 * ones, ones)[:, 0]
    made = (rows.target, inertia, rows.positive, rows.negative, rows._filter.average)
    return (*made, limits.slowest, limits.fastest)


def regression(recording: Recording, stretch: np.ndarray) -> Regression:
    """The rows of a prepared recording whose kernels lie in one stretch of a fold.

    **Arguments:** `stretch`, of each sample, `(N,)`; a fold's number is `stretch` modulo folds,
    which the caller applies.
    """
    width = signals.kernel_half_width(recording, NARROWEST)
    padded = uniform(recording)
    found = [np.asarray(x, float) for x in _projected(padded, width)]
    target, inertia, positive, negative, average, slowest, fastest = found
    first = np.arange(target.size) * max(1, width // 2)
    last = np.minimum(first + 2 * width, stretch.size - 1)
    inside = first + 2 * width < stretch.size
    whole = inside & (stretch[np.minimum(first, stretch.size - 1)] == stretch[last])
    used = whole & (positive + negative > 0)
    velocity = np.nan_to_num(np.asarray(recording.velocity, float))
    log = Regression(
        target[used], inertia[used], np.where(positive > 0, 1.0, -1.0)[used], np.empty(0),
        stretch[first[used]], average[:, used], first[used], velocity, float(slowest),
        float(fastest),
    )  # fmt: skip
    return log._replace(velocity=log.rows(velocity[:, None])[:, 0])


def bumps(log: Regression, shape: str) -> np.ndarray:
    """The bump's rows over its grid, `(J, G)`, and its values over speeds by [`curve_speeds`][]."""
    speed = np.maximum(np.abs(log.speed), 1e-300)
    return log.rows(_shapes(log, shape, speed))


def _shapes(log: Regression, shape: str, speed: np.ndarray) -> np.ndarray:
    """The shape at speeds, one column a grid point, `(N, G)`."""
    # A narrower bump leaves no trace in the rows: fitted, it could be of any size.
    low = max(log.slowest, 0.5 * recorded(log))
    high = max(0.5 * log.fastest, 2 * low)
    if shape != "generalised":
        betas = np.geomspace(low, high, POINTS)
        return SHAPES[shape](speed[:, None] / betas[None, :])
    betas = np.geomspace(low, high, FEWER)
    power = [np.exp(-((speed[:, None] / betas[None, :]) ** d)) for d in EXPONENTS]
    return np.concatenate(power, axis=1)


def curve_speeds(log: Regression) -> np.ndarray:
    """Speeds to compare curves at, m/s: from a tenth of the slowest slip to the fastest."""
    return np.geomspace(0.1 * log.slowest, log.fastest, 200)


def standing(log: Regression, shape: str | None, symmetric: bool, folds: int) -> Standing:
    """Fit on all folds but one, at each point of the grid, and judged on that one."""
    grid = np.zeros((log.force.size, 1)) if shape is None else bumps(log, shape)
    sides = [np.ones(log.force.size, bool)]
    if not symmetric:
        sides = [log.direction > 0, log.direction < 0]
    parts = [_moments(log, grid, side, symmetric, folds) for side in sides]
    sums = parts[0] if symmetric else _joined(*parts)
    total = [x.sum(axis=0) for x in sums]
    held, size = [], []
    for k in range(folds):
        alpha, _ = _best([t - x[k] for t, x in zip(total, sums, strict=True)])
        count = max(int(np.sum(log.fold % folds == k)), 1)
        held.append(_left([x[k] for x in sums], alpha) / count)
        size.append(sums[2][k] / count)
    alpha, place = _best(total)
    curve = _curve(log, shape, symmetric, alpha, place, grid.shape[1])
    own = 0 if shape is None else 3 if shape == "generalised" else 2
    parameters = 4 + own if symmetric else 5 + 2 * own
    return Standing(parameters, np.array(held), np.array(size), curve)


def _moments(log: Regression, grid: np.ndarray, side: np.ndarray, symmetric: bool, folds: int):
    """D, `(F, G, p, p)`, h, `(F, G, p)`, and Σu², `(F,)`, of a direction or of both.

    The columns: inertia, Coulomb, viscous, bump; of both directions an offset as well.
    """
    way = log.direction if symmetric else np.ones(log.force.size)
    sign = log.direction[:, None]
    fixed = [log.inertia, way * (1 if symmetric else log.direction), log.velocity]
    fixed += [np.ones(log.force.size)] if symmetric else []
    plain = np.stack(fixed, axis=1)
    bump = grid * sign
    count = plain.shape[1] + 1
    squares = np.zeros((folds, grid.shape[1], count, count))
    loads = np.zeros((folds, grid.shape[1], count))
    force = np.zeros(folds)
    for k in range(folds):
        here = side & (log.fold % folds == k)
        a, b, u = plain[here], bump[here], log.force[here]
        squares[k, :, :-1, :-1] = a.T @ a
        cross = (a.T @ b).T
        squares[k, :, :-1, -1] = squares[k, :, -1, :-1] = cross
        squares[k, :, -1, -1] = np.sum(b * b, axis=0)
        loads[k, :, :-1], loads[k, :, -1] = a.T @ u, b.T @ u
        force[k] = u @ u
    return squares, loads, force


def _joined(one, other):
    """Two directions with one inertia, over all pairs of their grid points."""
    (a, h, u), (b, j, w) = one, other
    folds, first, count = h.shape
    second, size = j.shape[1], 2 * count - 1
    squares = np.zeros((folds, first, second, size, size))
    loads = np.zeros((folds, first, second, size))
    mine, theirs = np.r_[0:count], np.r_[0, count:size]
    squares[..., mine[:, None], mine] += a[:, :, None]
    squares[..., theirs[:, None], theirs] += b[:, None]
    loads[..., mine] += h[:, :, None]
    loads[..., theirs] += j[:, None]
    shape = (folds, first * second)
    return squares.reshape(*shape, size, size), loads.reshape(*shape, size), u + w


def _best(sums) -> tuple[np.ndarray, int]:
    """The parameters at the grid point of the least cost (17), and the point."""
    squares, loads, force = sums
    norm = np.sqrt(np.maximum(np.diagonal(squares, axis1=-2, axis2=-1), 1e-300))
    scaled = squares / (norm[..., :, None] * norm[..., None, :])
    scaled = scaled + RIDGE * np.eye(scaled.shape[-1])
    solved = np.linalg.solve(scaled, (loads / norm)[..., None])[..., 0] / norm
    cost = force - np.sum(solved * loads, axis=-1)
    place = int(np.argmin(cost))
    return np.concatenate([solved[place], [place]]), place


def _left(sums, found: np.ndarray) -> float:
    squares, loads, force = sums
    alpha, place = found[:-1], int(found[-1])
    left = force - 2 * alpha @ loads[place] + alpha @ squares[place] @ alpha
    return float(max(left, 0.0))


def _curve(log, shape, symmetric, found, place, count) -> np.ndarray:
    """The friction forward and backward over [`curve_speeds`][], N, `(2, K)`."""
    speed, alpha = curve_speeds(log), found[:-1]
    values = np.zeros((speed.size, 1)) if shape is None else _shapes(log, shape, speed)
    if symmetric:
        plain = alpha[1] + alpha[2] * speed + alpha[4] * values[:, place]
        return np.stack([plain + alpha[3], -plain + alpha[3]])
    forward, backward = alpha[1:4], alpha[4:7]
    one, other = divmod(place, count)
    return np.stack([
        forward[0] + forward[1] * speed + forward[2] * values[:, one],
        -backward[0] - backward[1] * speed - backward[2] * values[:, other],
    ])  # fmt: skip


def recorded(log: Regression) -> float:
    """The slowest speed that the rows hold, m/s: of a hundred rows one is slower."""
    return float(np.quantile(np.abs(log.velocity), 0.01)) if log.velocity.size else np.nan


def all_of(
    recording: Recording, stretches: np.ndarray, names: Sequence[str], folds: int
) -> tuple[dict[str, Standing], Regression]:
    """The standings of named models on a prepared recording, and the rows."""
    log = regression(jax.tree.map(np.asarray, recording), stretches)
    found = {}
    for name in names:
        stem = name.removeprefix("symmetric-")
        shape = None if stem == "coulomb-viscous" else stem
        found[name] = standing(log, shape, stem != name, folds)
    return found, log
