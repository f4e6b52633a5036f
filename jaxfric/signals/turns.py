"""The velocity where an axis turns: whether the position knows it better than a column does.

A filter takes most off where the acceleration jumps, as it does with the friction at every turn,
and it is there that friction has its bump. On the host.
"""

from typing import NamedTuple

import numpy as np

from ..data.excerpt import excerpt
from ..data.recording import Recording
from .choosing import choose, known_position
from .clock import host_continuous, host_interval, is_traced
from .derivatives import derivative
from .polynomial import HALF_WIDTHS, Choice, weights

# Slip is faster than four standard deviations of the noise.
DEVIATIONS = 4.0
# Blocks by which a standard error is known to a seventh, and three of those.
BLOCKS, SURE = 24, 3.0
# The same motion: a filter leaves the size of a velocity within a few hundredths, and a twentieth
# of its power at the most.
GAIN, SHARED = 1.05, 0.95


class Derivable(NamedTuple):
    """The local polynomial that derives a recorded velocity anew from the position; `off`, m/s: by
    how much the recorded one errs at the turns, root mean square, where that is surely more; else
    NaN.
    """

    choice: Choice
    off: float

    @property
    def better(self) -> bool:
        """Whether the position surely knows the velocity better at the turns."""
        return not np.isnan(self.off)


def derivable(recording: Recording) -> Derivable | None:
    """How the position would derive the velocity that is recorded too, and whether better.

    Both are compared with narrower derivatives v_n. With the derivative v_c, its weights k_c and
    the position's noise σ, the recorded velocity v errs more where

        E (v - v_n)² > E (v_c - v_n)² + 2 σ² k_c·k_n,

    an estimate without bias of the difference of their risks (as Mallows 1973, Some comments on
    C_p). It has to be so for sure beside half of the width, and beside the narrowest, whose noise
    is large, on the whole: half of it may swallow a ripple that the column holds. Another scale of
    the column, and a lag, are no errors at the turns, and left out of v - v_n.

    **Returns:** `None` inside `jax.jit`, where either signal is missing, where the position is not
    known at every sample, or where the two are not the same motion.
    """
    velocity = recording.velocity
    if is_traced(recording) or velocity is None or recording.position_every != 1:
        return None
    log = excerpt(recording)
    if not known_position(log):
        return None
    choice = choose(log)
    width, step = choice.half_width, host_interval(log)
    position, recorded = (np.asarray(x, float) for x in (log.position, log.velocity))
    derived = derivative(log, position, width, choice.degree)
    inner = _inner(log, step, width) & np.isfinite(recorded)
    if not _same_motion(recorded[inner], derived[inner]):
        return None
    shape, noise = weights(width, choice.degree), (choice.noise / step) ** 2
    slips = np.abs(derived) > DEVIATIONS * np.sqrt(noise * float(shape @ shape))
    turns = inner & _near_ends(slips, width)
    if np.count_nonzero(turns) < 2 * BLOCKS:
        return Derivable(choice, float("nan"))
    columns = np.stack([derived, np.gradient(derived)], axis=1)[turns]

    def more(pilot: int) -> np.ndarray:
        """By how much the squared error of the recorded velocity is larger, in each block."""
        degree = min(choice.degree, 2 * pilot)
        narrow = derivative(log, position, pilot, degree)[turns]
        off = recorded[turns] - narrow
        off = off - columns @ np.linalg.lstsq(columns, off)[0]
        shared = noise * float(shape @ weights(pilot, degree, reach=width))
        larger = off**2 - (derived[turns] - narrow) ** 2 - 2 * shared
        return np.array([np.mean(part) for part in np.array_split(larger, BLOCKS)])

    beside = more(max(width // 2, HALF_WIDTHS[0]))
    sure = np.mean(beside) > SURE * np.std(beside, ddof=1) / np.sqrt(BLOCKS)
    better = sure and np.mean(more(HALF_WIDTHS[0])) > 0
    return Derivable(choice, float(np.sqrt(np.mean(beside))) if better else float("nan"))


def _inner(log: Recording, step: float, reach: int) -> np.ndarray:
    """The samples that have so many valid neighbours on each side, `(N,)`."""
    broken = np.flatnonzero(~host_continuous(log, step)) + 1
    edges = np.concatenate([[0], broken, [log.num_samples]])
    number = np.arange(log.num_samples)
    piece = np.searchsorted(edges, number, side="right") - 1
    return (number - edges[piece] >= reach) & (edges[piece + 1] - number > reach)


def _same_motion(recorded: np.ndarray, derived: np.ndarray) -> bool:
    """Whether the two differ by no more than a filter makes."""
    both, own, other = recorded @ derived, derived @ derived, recorded @ recorded
    alike = own / GAIN < both < own * GAIN
    return bool(alike and both**2 > SHARED * own * other)


def _near_ends(slips: np.ndarray, reach: int) -> np.ndarray:
    """The samples within so many of one where slip begins or ends, `(N,)`."""
    ends = np.flatnonzero(slips[1:] != slips[:-1]) + 1
    steps = np.zeros(len(slips) + 1, int)
    np.add.at(steps, np.maximum(ends - reach, 0), 1)
    np.add.at(steps, np.minimum(ends + reach + 1, len(slips)), -1)
    return np.cumsum(steps)[:-1] > 0
