"""The fewest columns that account for what is left."""

import itertools
import math
from collections.abc import Iterable

import numpy as np

from .least_squares import RANK

# More wrong values than this are another machine.
MOST_WRONG = 5
# The normal quantile of 1 % shared among twenty parameters.
SURE = 3.5
# No column has quite the shape of its force, and a tenth of its amplitude may be something else.
# Values that move against each other and explain less than that of the largest move, as all of them
# against the gain, say no more than that a shape is wrong.
SHAPE = 0.1


def fewest(own: np.ndarray, residual: np.ndarray, block: np.ndarray, enough: float) -> list[int]:
    """Numbers of the fewest columns that leave what all of them leave, N², but for `enough`.

    Of every size the best subset; none of whose columns is within its interval of nothing, and
    which do not only cancel each other. Where more than `MOST_WRONG` are needed, it is another
    machine, and all of them.
    """
    size = np.linalg.norm(own, axis=0)
    used = np.flatnonzero(size > 0)
    columns = own[:, used] / size[used]
    gram, pull = columns.T @ columns, columns.T @ residual
    most = _removed(gram, pull, range(len(used)))
    found: tuple[int, ...] = ()
    better = found
    parts, taken = np.zeros(len(used)), 0.0
    for count in range(1, min(len(used), MOST_WRONG) + 1):
        if most - taken < enough:
            break
        better = _best(gram, pull, count, better)
        inverse = np.linalg.pinv(columns[:, better], rcond=RANK)
        other = np.zeros(len(used))
        other[list(better)] = inverse @ residual
        # One value may hide what two say: an offset and a stiffness about another place, say.
        if not _sure(columns @ other, inverse, other[list(better)], residual, block):
            continue
        more = _removed(gram, pull, better) - taken
        if more < (SHAPE * np.max(np.abs(other - parts))) ** 2:
            break
        found, parts, taken = better, other, taken + more
    if len(found) == MOST_WRONG and most - taken >= enough:
        return used.tolist()
    return [int(used[i]) for i in found]


# Of more subsets than this the best is looked for among those that hold the best of one fewer.
MOST_SUBSETS = 100_000
# Beside a diagonal of one; of columns that differ by less the sum is not told from one of them.
RIDGE = 1e-12


def _best(gram: np.ndarray, pull: np.ndarray, count: int, before: tuple[int, ...]):
    """The subset of that many columns that takes most off the energy."""
    number = range(len(pull))
    if math.comb(len(pull), count) <= MOST_SUBSETS:
        subsets = np.array(list(itertools.combinations(number, count)))
    else:
        tried = [[*some, *more] for r in (1, 2) if r <= count
                for some in itertools.combinations(before, count - r)
                for more in itertools.combinations(sorted(set(number) - set(some)), r)]  # fmt: skip
        subsets = np.unique(np.sort(np.array(tried)), axis=0)
    inner = gram[subsets[:, :, None], subsets[:, None, :]] + RIDGE * np.eye(count)
    outer = pull[subsets]
    gains = np.einsum("sk,sk->s", outer, np.linalg.solve(inner, outer[..., None])[..., 0])
    return tuple(int(i) for i in subsets[int(np.argmax(gains))])


def _removed(gram: np.ndarray, pull: np.ndarray, some: Iterable[int]) -> float:
    """By how much some of the columns lower the energy of the residual."""
    index = list(some)
    if not index:
        return 0.0
    solved = np.linalg.lstsq(gram[np.ix_(index, index)], pull[index], rcond=RANK**2)[0]
    return float(solved @ pull[index])


def _sure(fitted: np.ndarray, inverse: np.ndarray, parts: np.ndarray, residual, block) -> bool:
    """Whether each column's part is beyond noise like what all of them leave, by blocks."""
    noise = residual - fitted
    count = int(block[-1]) + 1
    sums = np.stack([np.bincount(block, row * noise, count) for row in inverse])
    return bool(np.all(np.abs(parts) > SURE * np.sqrt(np.sum(sums**2, axis=1))))
