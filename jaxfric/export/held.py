"""What of the forces beside a simulator's file makes the held-out recording no worse."""

from collections.abc import Callable, Sequence
from typing import TypeVar

T = TypeVar("T")


def kept(changes: Sequence[T], error: Callable[[Sequence[T]], float]) -> list[T]:
    """The changes without those that make a held-out recording worse.

    **Arguments:** `changes`; `error`: the force error with some of them.

    Where all of them together are worse than none, that one goes without which the rest is best,
    and so on.
    """
    found = list(changes)
    if not found:
        return found
    none = error(())
    while found and error(found) > none:
        found = min(([*found[:i], *found[i + 1 :]] for i in range(len(found))), key=error)
    return found
