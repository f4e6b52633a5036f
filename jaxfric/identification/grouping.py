"""A batch in groups of rows that one program serves, so that each says what it says alone."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ..data.recording import SHORTEST

# Fewer rows are solved one by one: a program of one row compiles in a third of the time and serves
# the next group of few rows as well.
MANY = 8


def length(mask: np.ndarray) -> int:
    """The power of two that holds a row's valid samples, but no more than there are: intervals
    count blocks of rows, and a short recording beside a long one would have few.
    """
    last = int(np.max(np.flatnonzero(mask), initial=0))
    return min(max(SHORTEST, 1 << last.bit_length()), len(mask))


def shortened(values: Any, samples: int) -> Any:
    """A pytree of signals without what they are padded with."""
    return jax.tree.map(lambda x: x[..., :samples], values)


def grouped(keys: Sequence[Any], solve: Callable[[np.ndarray, Any], Any]) -> Any:
    """What `solve` finds of the rows of each key together, in the order of the rows.

    **Arguments:** `keys`, one of each row; `solve` takes the numbers of some rows and their key,
    and returns a pytree with a leading axis. Of several groups each of many rows is filled up to a
    power of two by its last row: few sizes, few programs.
    """
    distinct = sorted(set(keys))
    if len(distinct) == 1:
        return solve(np.arange(len(keys)), distinct[0])
    members: list[np.ndarray] = []
    for key in distinct:
        own = np.array([i for i, other in enumerate(keys) if other == key])
        members += [own] if len(own) >= MANY else np.split(own, len(own))
    parts = [solve(_filled(own), keys[own[0]]) for own in members]
    order = np.argsort(np.concatenate(members))

    def in_order(*values):
        own = [np.asarray(x)[: len(rows)] for x, rows in zip(values, members, strict=True)]
        return jnp.asarray(np.concatenate(own)[order])

    return jax.tree.map(in_order, *parts)


def replaced(found: Any, rows: np.ndarray, others: Any) -> Any:
    """The rows of a pytree with a leading axis, some of them by others."""

    def put(mine, theirs):
        mine = np.array(mine)
        mine[rows] = np.asarray(theirs)
        return jnp.asarray(mine)

    return jax.tree.map(put, found, others)


def _filled(rows: np.ndarray) -> np.ndarray:
    full = 1 << (len(rows) - 1).bit_length()
    return np.append(rows, np.repeat(rows[-1:], full - len(rows)))
