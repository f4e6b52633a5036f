"""One kind of mistake: what a person, a logger or a drive does to a healthy log."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from .logs import Log


class Mistake(NamedTuple):
    """A mistake and what is fair to expect of who meets it.

    - `apply(log, rng, other)`: the wrong log; `other` is a log of another axis of the same
      machine. The severity is drawn.
    - `family`: what it belongs to in the report.
    - `velocity`: `True` where the log must have a velocity column beside the position, `False`
      where it must not, `None` where either will do.
    - `rescaling`: every signal is scaled as if the units were others. Nothing states them, so that
      no contradiction is left and only the magnitude could tell; or the names do, and the values
      are in these units.
    - `effects`: names under which an explanation may rightly find it.
    - `held_out`: applied to the held-out log alone.
    """

    apply: Callable[[Log, Generator, Log], Log]
    family: str
    velocity: bool | None = None
    rescaling: bool = False
    effects: frozenset[str] = frozenset()
    held_out: bool = False

    @property
    def name(self) -> str:
        """In words."""
        return self.apply.__name__.replace("_", " ").strip()


def some(rng: Generator, low: float, high: float, count: int) -> slice:
    """A stretch of a share of the rows between `low` and `high`, well inside the log."""
    length = int(rng.uniform(low, high) * count)
    start = int(rng.integers(count // 20, max(count - length - count // 20, count // 20 + 1)))
    return slice(start, start + length)


def changed(x: np.ndarray, where, value) -> np.ndarray:
    """A copy with other values somewhere."""
    x = np.array(x, float)
    x[where] = value
    return x
