"""Which tells the motion better, the position or a velocity that is recorded beside it.

On the host. A drive's velocity has been through a filter, or is a quotient of counts; the position
may be coarse.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ..data.excerpt import excerpt
from ..data.recording import Recording
from .choosing import choose
from .clock import host_continuous, host_interval, is_traced
from .derivatives import derivative
from .noise import SLIP_DEVIATIONS
from .polynomial import HALF_WIDTHS, Choice, weights

# A derived velocity is off by a hundredth of its size at the most. The estimate of the error is too
# small as a rule, by √2, since no bias is seen of what changes faster than the kernel.
HUNDREDTH = 0.01
UNCERTAIN = HUNDREDTH / 2**0.5
# Blocks by which a standard error is known to a seventh, and three of those.
BLOCKS, SURE = 24, 3.0
# The same motion: a filter leaves the size of a velocity within a few hundredths, and takes a
# twentieth of its power at the most.
GAIN, SHARED = 1.05, 0.95

# The position is taken where its acceleration is expected to err by a tenth: the noise of counts,
# and of a velocity that a drive has filtered, is not white, so that either estimate may be three
# times off. With a fifth, the width for a servo's counts took away its ripple at speed.
BETTER = 0.1


class Derivable(NamedTuple):
    """The local polynomial that derives a recorded velocity anew from the position.

    `fine`: whether that errs by less than a hundredth, and the recorded one is as near to it;
    `off`, m/s: by how much the recorded one errs at the turns, root mean square, where that is
    surely more than a derivative of twice the width does; else NaN; `doubtful`: whether it surely
    errs more than the derivative itself does.
    """

    choice: Choice
    fine: bool
    off: float = float("nan")
    doubtful: bool = False

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
    inner = _inner(log, _reach(choice)) & np.isfinite(recorded)
    if not _same_motion(recorded[inner], derived[inner]):
        return None
    size, apart = (np.sqrt(np.mean(x[inner] ** 2)) for x in (derived, recorded - derived))
    fine = bool(choice.error <= UNCERTAIN * size and apart <= HUNDREDTH * size)
    shape = weights(choice.half_width, choice.degree)
    noise = choice.noise / host_interval(log) * float(np.linalg.norm(shape))
    turns = inner & _near_ends(np.abs(derived) > SLIP_DEVIATIONS * noise, choice.half_width)
    if np.count_nonzero(turns) < 2 * BLOCKS:
        return Derivable(choice, fine)
    columns = np.stack([derived, np.gradient(derived)], axis=1)[turns]

    def moved(off: np.ndarray) -> np.ndarray:
        return off - columns @ np.linalg.lstsq(columns, off)[0]

    off = _errs_more(log, choice, turns, moved)
    if off is not None:
        return Derivable(choice, fine, off)
    doubtful = _errs_more(log, choice, turns, moved, times=2) is not None
    return Derivable(choice, fine, doubtful=doubtful)


def of_acceleration(recording: Recording) -> tuple[Choice, ...]:
    """The local polynomials by which the acceleration is taken, m/s², one after the other.

    That which is best for a recorded velocity; or two for the position, where no velocity is
    recorded or the position is expected to err by less than [`BETTER`][] of it: of the first
    derivative, and then the wider of those that are best for the first and the second. A position
    that is not known at every sample is none to derive from.
    """
    own = None
    if recording.velocity is not None:
        own = choose(recording, np.asarray(recording.velocity))
        if not _known_position(recording):
            return (own,)
    twice = choose(recording, order=2)
    if own is not None and not twice.error < BETTER * own.error:
        return (own,)
    slope = choose(recording)
    return slope, max(slope, twice, key=lambda each: each.half_width)


def _errs_more(
    log: Recording,
    choice: Choice,
    where: np.ndarray,
    left: Callable[[np.ndarray], np.ndarray],
    times: int = 4,
) -> float | None:
    """By how much the recorded velocity errs in the samples `where`, root mean square, if surely
    more than a wide derivative of the position of the degree of `choice`; else `None`.

    With a narrow derivative v_n of weights k_n, the wide one v_w of weights k_w and the position's
    noise σ, the recorded velocity v errs more where

        E (v - v_n)² > E (v_w - v_n)² + 2 σ² k_w·k_n,

    an estimate of the difference of their risks (as in Mallows 1973, Some comments on C_p), without
    bias as far as v_n has none: beside one `times` as wide it has little. It has to be so for sure
    beside half of the width that was chosen, and on the whole beside a quarter, whose noise is
    large: half of it may swallow a ripple that v holds. `left`: what counts of v - v_n.
    """
    degree = choice.degree
    least = max(HALF_WIDTHS[0], degree // 2)
    pilots = [max(choice.half_width // part, least) for part in (2, 4)]
    reach = times * pilots[0]
    noise = (choice.noise / host_interval(log)) ** 2
    position, shape = np.asarray(log.position), weights(reach, degree)
    own, wide = np.asarray(log.velocity, float)[where], derivative(log, position, reach, degree)

    def more(pilot: int) -> np.ndarray:
        narrow = derivative(log, position, pilot, degree)[where]
        off, apart = left(own - narrow), wide[where] - narrow
        shared = noise * float(shape @ weights(pilot, degree, reach=reach))
        larger = off**2 - apart**2 - 2 * shared
        return np.array([np.mean(part) for part in np.array_split(larger, BLOCKS)])

    half, quarter = map(more, pilots)
    sure = np.mean(half) > SURE * np.std(half, ddof=1) / np.sqrt(BLOCKS)
    return float(np.sqrt(np.mean(half))) if sure and np.mean(quarter) > 0 else None


def _reach(choice: Choice) -> int:
    """The half-width of the widest derivative that is compared with."""
    return 2 * max(choice.half_width, 2 * HALF_WIDTHS[0], choice.degree)


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
