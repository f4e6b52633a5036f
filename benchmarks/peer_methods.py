"""Simpler methods, each on the rows that `explain` works on: what is left of a baseline's force.

`base`, `(J, b)`, `columns`, `(J, k)`, and `target`, `(J,)`, are rows; a method that selects returns
the numbers of its columns, the strongest first.
"""

import warnings

import numpy as np

from jaxfric.explanation.nodes import NODES

MOST = 30
THRESHOLD = 0.1
# Bootstraps of the ensemble, as pysindy's example has them.
MODELS = 20
# Rows that a Gaussian process is fitted to: its cost is cubic.
PROCESS_ROWS = 400


def freed(base, columns, target):
    """Columns and target without what the baseline can express of them."""
    basis = np.linalg.qr(base)[0]
    return columns - basis @ (basis.T @ columns), target - basis @ (basis.T @ target)


def stepwise(base, columns, target):
    """Numbers of the columns that BIC selects one after the other, behind the baseline's."""
    count = len(target) * 3 / (2 * NODES)  # every third node has a row of 2 NODES of them
    rest, left = freed(base, columns, target)
    size, taken = np.linalg.norm(rest, axis=0), []
    for _ in range(MOST):
        norm = np.linalg.norm(rest, axis=0)
        # What the columns before leave of it is rounding.
        gain = np.where(norm > 1e-6 * size, left @ rest / np.maximum(norm, 1e-300), 0.0)
        best, energy = int(np.argmax(np.abs(gain))), left @ left
        if -count * np.log1p(-min(gain[best] ** 2 / energy, 1 - 1e-12)) < np.log(count):
            break
        taken.append(best)
        unit = rest[:, best] / norm[best]
        left, rest = left - unit * gain[best], rest - np.outer(unit, unit @ rest)
    return taken


def _unit(base, columns, target):
    """The freed columns and target with unit root mean square each."""
    rest, left = freed(base, columns, target)
    scale = np.maximum(np.linalg.norm(rest, axis=0), 1e-300)
    return rest / scale * len(left) ** 0.5, left / np.linalg.norm(left) * len(left) ** 0.5


def stlsq(base, columns, target):
    """Numbers of the columns whose coefficients stay over the threshold."""
    rest, left = _unit(base, columns, target)
    kept = np.arange(columns.shape[1])
    while kept.size:
        weights = np.linalg.lstsq(rest[:, kept], left, rcond=None)[0]
        large = np.abs(weights) > THRESHOLD
        if large.all():
            return kept[np.argsort(-np.abs(weights))].tolist()
        kept = kept[large]
    return []


def pysindy(base, columns, target):
    """Numbers of the columns that pysindy keeps: its STLSQ, ridge at its default, bagged."""
    import pysindy as ps

    rest, left = _unit(base, columns, target)
    optimizer = ps.EnsembleOptimizer(
        ps.STLSQ(threshold=THRESHOLD, alpha=0.05), bagging=True, n_models=MODELS
    )
    np.random.seed(0)  # it draws its bags from numpy's global generator
    model = ps.SINDy(optimizer=optimizer, feature_library=ps.IdentityLibrary())
    with warnings.catch_warnings():  # that it kept nothing is an answer
        warnings.simplefilter("ignore")
        model.fit(rest, t=1.0, x_dot=left[:, None])
    weights = np.ravel(model.coefficients())
    kept = np.flatnonzero(np.abs(weights) > THRESHOLD)
    return kept[np.argsort(-np.abs(weights[kept]))].tolist()


def signals(evidence, predicted):
    """What a residual could depend on, at the rows, `(J, 6)`: x, v, a, t, direction, force."""
    motion = evidence.motion
    x, v, t = (np.asarray(a) for a in (motion.position, motion.velocity, motion.time))
    a = evidence.project(np.zeros_like(v), v)
    rows = [evidence.project(s) for s in (x, v, t)]
    return np.stack([*rows[:2], a, rows[2], evidence.side, predicted], axis=1)


def trees(seen, left, held):
    """What gradient-boosted trees, at scikit-learn's defaults, predict of the residual."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    return HistGradientBoostingRegressor(random_state=0).fit(seen, left).predict(held)


def process(seen, left, held):
    """What a Gaussian process predicts of the residual; each signal with a length of its own."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    middle, scale = seen.mean(axis=0), np.maximum(seen.std(axis=0), 1e-300)
    size = max(float(np.std(left)), 1e-300)
    rng = np.random.default_rng(0)
    some = rng.permutation(len(left))[:PROCESS_ROWS]
    kernel = ConstantKernel(1.0) * RBF(np.ones(seen.shape[1]), (1e-2, 1e3)) + WhiteKernel(0.1)
    fitted = GaussianProcessRegressor(kernel, random_state=0)
    with warnings.catch_warnings():  # a signal that does not matter has its length on the border
        warnings.simplefilter("ignore")
        fitted.fit((seen[some] - middle) / scale, left[some] / size)
    return size * fitted.predict((held - middle) / scale)


SELECTING = {"stepwise": stepwise, "stlsq": stlsq, "pysindy": pysindy}
PREDICTING = {"boosted trees": trees, "Gaussian process": process}
# Method to the package that it needs.
NEEDS = {"pysindy": "pysindy", "boosted trees": "sklearn", "Gaussian process": "sklearn"}
