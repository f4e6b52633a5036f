"""Whether what a model leaves is a function of where the axis is and how fast."""

import numpy as np

from .fitted import HALF, Design

# Of so many rows each is compared with all others.
MOST = 1500
# Rows share samples with so many neighbours on either side; in fewer than ten such stretches the
# same place and speed hardly come again.
NEAR, FEWEST = 3, 30


def hides(
    design: Design,
    time: np.ndarray,
    position: np.ndarray | None,
    mask: np.ndarray,
    alpha: np.ndarray,
    sure: list[int],
) -> bool:
    """Whether what is left may be a good part of a parameter.

    It is a function of position and velocity, in half of its power at least: physics that the model
    lacks, no noise. And it is half as large at least as what the parameter adds to what all others
    explain: the bias of a parameter is the part of the missing force along that column.

    **Arguments:** `design`, J rows, the first p columns those of the parameters `alpha`, `(p,)`;
    `time`, s, `position`, m, or none, and `mask`, `(N,)`; `sure`, numbers of the parameters that
    are told from zero.
    """
    rows = np.flatnonzero(design.weight > 0)
    columns, left = design.columns[rows, : len(alpha)], design.left[rows]
    size = np.linalg.norm(columns, axis=0)
    if (
        position is None
        or len(rows) < FEWEST
        or not sure
        or not np.all(np.isfinite(columns))
        or not size.all()
    ):
        return False
    basis = columns / size
    # Of a column that the others do not explain: by the diagonal of the inverse.
    own = 1 / np.sqrt(np.maximum(np.diag(np.linalg.pinv(basis.T @ basis)), 1.0))
    least = np.min(np.abs(alpha[sure]) * (size * own)[sure])
    return bool(
        np.linalg.norm(left) > HALF * least
        and repeats(left, _state(design.time[rows], time[mask], position[mask])) > HALF
    )


def _state(moments: np.ndarray, time: np.ndarray, position: np.ndarray) -> np.ndarray:
    """Position and velocity at the rows' moments, each in parts of its spread, `(J, 2)`."""
    step = np.median(np.diff(moments))
    known = np.isfinite(position)
    place, before, after = (
        np.interp(moments + shift, time[known], position[known]) for shift in (0, -step, step)
    )
    state = np.stack([place, after - before], axis=1)
    return (state - state.mean(axis=0)) / np.maximum(state.std(axis=0), 1e-300)


def repeats(left: np.ndarray, state: np.ndarray) -> float:
    """The share of the power of `left`, `(J,)`, that is a function of the `state`, `(J, d)`.

    By the nearest other row in the state that shares no samples: noise is another one there, what
    is a function is the same (the idea of the delta test, Pi & Peterson 1994).
    """
    some = np.arange(0, len(left), -(-len(left) // MOST))
    near = state[some, None] - state[None, some]
    distance = np.sum(near**2, axis=2)
    distance[np.abs(some[:, None] - some[None]) <= NEAR] = np.inf
    mate = some[np.argmin(distance, axis=1)]
    return float(left[some] @ left[mate]) / max(float(left[some] @ left[some]), 1e-300)
