"""What of a simulator's new values and forces makes the held-out recording no worse."""

from collections.abc import Callable, Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


def kept(changes: Sequence[T], errors: Callable[[Sequence[T]], Sequence[float]]) -> list[T]:
    """The changes without those that make a held-out recording worse.

    **Arguments:** `changes`; `errors`: the force errors of all joints with some of them.

    Where all of them together are worse than none, that one goes without which the rest is best,
    and so on. Joints are compared by the likelihood of their forces, each with a noise of its own:
    the sum of their errors' logarithms.
    """

    def badness(some: Sequence[T]) -> float:
        return float(np.sum(np.log(np.maximum(errors(some), np.finfo(float).tiny))))

    found = list(changes)
    if not found:
        return found
    none = badness(())
    while found and badness(found) > none:
        found = min(([*found[:i], *found[i + 1 :]] for i in range(len(found))), key=badness)
    return found
