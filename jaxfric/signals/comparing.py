"""Which tells the motion better, the position or a velocity that is recorded beside it.

On the host. A drive's velocity has been through a filter, or is a quotient of counts; the position
may be coarse. Both are compared with narrower derivatives of the position, which err by their noise
alone.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..data.excerpt import excerpt
from ..data.recording import Recording
from .choosing import choose
from .clock import host_continuous, host_interval, is_traced
from .derivatives import derivative
from .polynomial import HALF_WIDTHS, Choice, weights

# A derived velocity is off by a hundredth of its size at the most. The estimate of the error is too
# small as a rule, by √2, since no bias is seen of what changes faster than the kernel.
UNCERTAIN = 0.01 / 2**0.5
# Slip is faster than four standard deviations of the noise.
DEVIATIONS = 4.0
# Blocks by which a standard error is known to a seventh, and three of those.
BLOCKS, SURE = 24, 3.0
# The same motion: a filter leaves the size of a velocity within a few hundredths, and takes a
# twentieth of its power at the most.
GAIN, SHARED = 1.05, 0.95


class Derivable(NamedTuple):
    """The local polynomial that derives a recorded velocity anew from the position, and whether
    that is `fine`, within a hundredth of its size; `off`, m/s: by how much the recorded one errs at
    the turns, root mean square, where that is surely more; else NaN.
    """

    choice: Choice
    fine: bool
    off: float

    @property
    def better(self) -> bool:
        """Whether the position surely knows the velocity better at the turns."""
        return not np.isnan(self.off)


def derivable(recording: Recording) -> Derivable | None:
    """How the position would derive the velocity that is recorded too, and whether better where
    the axis turns.

    A filter takes most off where the acceleration jumps, as it does with the friction at every
    turn, and it is there that friction has its bump. Another scale of the column, and a lag, are no
    errors there, and left out.

    **Returns:** `None` inside `jax.jit`, where either signal is missing, where the position is not
    known at every sample, or where the two are not the same motion.
    """
    velocity = recording.velocity
    if is_traced(recording) or velocity is None:
        return None
    log = excerpt(recording)
    if not _known_position(log):
        return None
    choice = choose(log)
    recorded = np.asarray(log.velocity, float)
    derived = derivative(log, np.asarray(log.position), choice.half_width, choice.degree)
    inner = _inner(log, choice.half_width) & np.isfinite(recorded)
    if not _same_motion(recorded[inner], derived[inner]):
        return None
    fine = choice.error <= UNCERTAIN * float(np.sqrt(np.mean(derived[inner] ** 2)))
    shape = weights(choice.half_width, choice.degree)
    noise = choice.noise / host_interval(log) * float(np.linalg.norm(shape))
    turns = inner & _near_ends(np.abs(derived) > DEVIATIONS * noise, choice.half_width)
    if np.count_nonzero(turns) < 2 * BLOCKS:
        return Derivable(choice, fine, float("nan"))
    columns = np.stack([derived, np.gradient(derived)], axis=1)[turns]

    def moved(off: np.ndarray) -> np.ndarray:
        return off - columns @ np.linalg.lstsq(columns, off)[0]

    off = _errs_more(log, recorded, derived, choice, 1, turns, moved)
    return Derivable(choice, fine, float("nan") if off is None else off)


def of_acceleration(recording: Recording, slope: Choice | None = None) -> tuple[Choice, ...]:
    """The local polynomials by which the acceleration is taken, m/s², one after the other.

    That which is best for a recorded velocity; or two for the position, where no velocity is
    recorded or its derivative surely errs more than the position's second one: of the first
    derivative (`slope`, if known), and then the wider of those that are best for the first and the
    second. A position that is not known at every sample is none to derive from.
    """
    own = None
    log = excerpt(recording)
    if log.velocity is not None:
        own = choose(log, np.asarray(log.velocity))
        if not _known_position(log):
            return (own,)
    twice = choose(log, order=2)
    if own is not None:
        rate = derivative(log, np.asarray(log.velocity), own.half_width, own.degree)
        second = derivative(log, np.asarray(log.position), twice.half_width, twice.degree, 2)
        inner = _inner(log, max(own.half_width, twice.half_width)) & np.isfinite(rate)
        if np.count_nonzero(inner) < 2 * BLOCKS:
            return (own,)
        if _errs_more(log, rate, second, twice, 2, inner) is None:
            return (own,)
    slope = choose(log) if slope is None else slope
    return slope, max(slope, twice, key=lambda each: each.half_width)


def _errs_more(
    log: Recording,
    own: np.ndarray,
    derived: np.ndarray,
    choice: Choice,
    order: int,
    where: np.ndarray,
    left: Callable[[np.ndarray], np.ndarray] = lambda off: off,
) -> float | None:
    """By how much `own`, `(N,)`, errs in the samples `where`, root mean square, if surely more than
    what the position's derivative of that `order` does by the polynomial `choice`; else `None`.

    With a narrower derivative x_n of weights k_n, the chosen one x_c of weights k_c and the
    position's noise σ, a signal x errs more where

        E (x - x_n)² > E (x_c - x_n)² + 2 σ² k_c·k_n,

    an estimate without bias of the difference of their risks (as in Mallows 1973, Some comments on
    C_p). It has to be so for sure beside half of the width, and on the whole beside a quarter,
    whose noise is large: half of it may swallow a ripple that x holds. `left`: what counts of
    x - x_n.
    """
    noise = (choice.noise / host_interval(log) ** order) ** 2
    shape = weights(choice.half_width, choice.degree, order)

    def more(pilot: int) -> np.ndarray:
        degree = min(choice.degree, 2 * pilot)
        narrow = derivative(log, np.asarray(log.position), pilot, degree, order)[where]
        off, apart = left(own[where] - narrow), derived[where] - narrow
        shared = noise * float(shape @ weights(pilot, degree, order, choice.half_width))
        larger = off**2 - apart**2 - 2 * shared
        return np.array([np.mean(part) for part in np.array_split(larger, BLOCKS)])

    half, quarter = (more(max(choice.half_width // part, HALF_WIDTHS[0])) for part in (2, 4))
    sure = np.mean(half) > SURE * np.std(half, ddof=1) / np.sqrt(BLOCKS)
    return float(np.sqrt(np.mean(half))) if sure and np.mean(quarter) > 0 else None


def _known_position(recording: Recording) -> bool:
    """Whether the position is known at every valid sample."""
    position = recording.position
    if position is None or recording.position_every != 1:
        return False
    return bool(np.isfinite(np.asarray(position)[np.asarray(recording.mask)]).all())


def _inner(log: Recording, reach: int) -> np.ndarray:
    """The samples that have so many valid neighbours on each side, `(N,)`."""
    broken = np.flatnonzero(~host_continuous(log, host_interval(log))) + 1
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
