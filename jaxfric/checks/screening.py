"""Which recordings of a batch can have a fault at all, by cheap bounds over many rows at once.

What a check looks for needs something that a few passes over all rows show: a value that comes
often, a sample far beyond the others. Where that is missing the check finds nothing, and it is not
run. A bound may pass a row in which nothing is found, never hold back one in which something is.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..data.cleaning.lone import BEYOND, LONE, beyond_usual
from .force import (
    ACROSS,
    CLIPPED,
    DRAWN,
    FAR,
    FROZEN,
    LEVELS,
    OFTEN,
    PROPORTIONAL,
    STRAIGHT,
    THINNED,
    gains,
)
from .lengths import CYCLE, PIECE, SPAN
from .motion import FASTEST, MOVING, ONE_SPEED, RARE

# Numbers of the signals that are looked at together: 1 MB each.
TOGETHER = 2**17
# The bounds are rounded otherwise than the checks.
ROUNDING = 1 + 1e-9


class Suspect(NamedTuple):
    """Which rows each group of checks has to look at, `(B,)` each."""

    pace: np.ndarray
    speed: np.ndarray
    force: np.ndarray
    copied: np.ndarray


class Rows(NamedTuple):
    """Signals of a batch on the host: `velocity`, `force` and, if recorded, `position`, `(B, N)`;
    samples in the `mask`, and `valid` ones of it, finite in force and velocity; whether sample i
    and i + 1 are `linked`, `(B, N - 1)`.
    """

    velocity: np.ndarray
    force: np.ndarray
    position: np.ndarray | None
    mask: np.ndarray
    valid: np.ndarray
    linked: np.ndarray

    def some(self, index: np.ndarray) -> "Rows":
        """Some of the rows."""
        return Rows(*(None if each is None else each[index] for each in self))

    def packed(self, signal: np.ndarray) -> np.ndarray:
        """The valid samples of rows that have equally many, `(B, n)`."""
        return signal if self.valid.all() else signal[self.valid].reshape(len(signal), -1)


def suspects(rows: Rows, unit: str) -> Suspect:
    """Which rows the checks have to look at; `unit` of the position."""
    found = Suspect(*np.ones((len(Suspect._fields), len(rows.force)), bool))
    for index in _alike(rows.valid):
        some = rows.some(index)
        speed = np.sort(np.abs(some.packed(some.velocity)), axis=1)
        top = _quantile(speed, 0.98)
        found.pace[index] = _pace(some)
        found.speed[index] = _speed(some, speed[:, -1], top, FASTEST.get(unit, np.inf))
        found.force[index] = _force(some, top)
        found.copied[index] = _copied(some)
    return found


def _alike(valid: np.ndarray) -> Iterator[np.ndarray]:
    """Rows with equally many valid samples, as many at once as stay in the cache."""
    counts = np.count_nonzero(valid, axis=1)
    most = max(1, TOGETHER // max(1, valid.shape[1]))
    for count in np.unique(counts[counts > 2 * PIECE]):
        index = np.flatnonzero(counts == count)
        yield from (index[i : i + most] for i in range(0, len(index), most))


def _quantile(ordered: np.ndarray, share: float) -> np.ndarray:
    """A quantile of rows in order, `(B, n)`, as `numpy.quantile`."""
    place = share * (ordered.shape[1] - 1)
    low = int(place)
    below, above = ordered[:, low], ordered[:, min(low + 1, ordered.shape[1] - 1)]
    part = place - low
    step = above - below
    return above - step * (1 - part) if part >= 0.5 else below + step * part


def _pace(rows: Rows) -> np.ndarray:
    """A broken clock, few samples a cycle, or a bend of the velocity beyond its top speed."""
    velocity, known = rows.velocity, np.isfinite(rows.velocity)
    step = np.diff(velocity, axis=1)
    linked = rows.linked & known[:, 1:] & known[:, :-1]
    power, size = _power(step, linked), _power(velocity, rows.mask & known)
    coarse = (2 * np.pi) ** 2 * size < ROUNDING * CYCLE**2 * power
    bend = np.fmax.reduce(np.abs(np.diff(step, axis=1)), axis=1, initial=0.0)
    # A quantile of 98 % below the bend has at least as few samples beyond.
    beyond = np.count_nonzero(np.abs(velocity) >= bend[:, None], axis=1)
    count = np.count_nonzero(~np.isnan(velocity), axis=1) - 1
    pieces = [np.count_nonzero(x, axis=1) for x in (rows.mask, rows.linked)]
    broken = pieces[0] - pieces[1] > 1
    return broken | coarse | (beyond <= count - np.floor(0.98 * count))


def _power(values: np.ndarray, used: np.ndarray) -> np.ndarray:
    """The mean square of the values of each row that are used, `(B,)`."""
    values = values if used.all() else np.where(used, values, 0.0)
    count = np.count_nonzero(used, axis=1)
    return np.einsum("bn,bn->b", values, values) / np.maximum(count, 1)


def _speed(rows: Rows, fastest: np.ndarray, top: np.ndarray, most: float) -> np.ndarray:
    """Too fast for any drive, or one direction or one speed only."""
    moving = MOVING * top[:, None]
    ways = [np.count_nonzero(rows.valid & (s * rows.velocity > moving), axis=1) for s in (1, -1)]
    one_way = np.min(ways, axis=0) < RARE * ROUNDING * np.sum(ways, axis=0)
    count = rows.valid.shape[1] // SPAN
    spans = (len(top), count, SPAN)
    whole, values = (x[:, : count * SPAN].reshape(spans) for x in (rows.valid, rows.velocity))
    means = np.abs(values.mean(axis=2))
    means = np.sort(np.where(whole.all(axis=2) & (means > moving), means, np.inf), axis=1)
    number = np.count_nonzero(np.isfinite(means), axis=1)
    last = np.maximum(number - 1, 0)
    # The values next to the quantiles of 10 and 90 %, on their inner sides.
    low, high = (np.ceil(0.1 * last).astype(int), np.floor(0.9 * last).astype(int))
    every = np.arange(len(top))
    alike = means[every, high] < ROUNDING * ONE_SPEED * means[every, low]
    return (fastest > most) | one_way | (alike & (number > LONE))


def _force(rows: Rows, top: np.ndarray) -> np.ndarray:
    """A value that comes often, samples far beyond the others, jumps, or straight parts."""
    force = rows.packed(rows.force)
    count = force.shape[1]
    ordered = np.sort(force, axis=1)
    span = ordered[:, -1] - ordered[:, 0]
    # Of so few values one comes as often as their mean.
    often = min(max(CLIPPED * count, OFTEN), FROZEN * count, min(count, THINNED) / LEVELS)
    often = max(1, int(often))
    repeated = np.any(ordered[:, often - 1 :] == ordered[:, : count - often + 1], axis=1)
    # One of the two ends holds half of them.
    ends = max(LONE, int(0.5 * CLIPPED * count))
    flat = np.minimum(ordered[:, -1] - ordered[:, -ends], ordered[:, ends - 1] - ordered[:, 0])
    far = _far(ordered)
    step = np.abs(np.diff(rows.force, axis=1)) > ACROSS * span[:, None]
    row, at = np.nonzero(step & rows.linked)
    before, after = rows.velocity[row, at], rows.velocity[row, at + 1]
    fast = np.minimum(np.abs(before), np.abs(after)) > FAR * top[row]
    across = np.bincount(row[fast & (before * after > 0)], minlength=len(force))
    change = np.diff(force, axis=1)
    held = np.count_nonzero(change, axis=1) - 1
    bend = np.abs(np.diff(change, axis=1))
    corner = bend > STRAIGHT * np.max(bend, axis=1, initial=0.0)[:, None]
    straight = np.count_nonzero(corner[:, 1:] & ~corner[:, :-1], axis=1) + corner[:, 0] - 1
    return (
        repeated
        | (flat <= 1e-9 * ROUNDING * span)
        | far
        | (across > LONE)
        # Half of the values last for two samples, or half of the straight parts for four.
        | ((held > PIECE) & (1.5 * held <= count))
        | ((straight > PIECE) & (0.5 * (DRAWN + 2) * straight <= count))
    )


def _far(ordered: np.ndarray) -> np.ndarray:
    """Whether a sample of rows in order is far beyond the others: see [`lone`][]."""
    count = ordered.shape[1]
    most = 1 + beyond_usual(count)
    middle = 0.5 * (ordered[:, (count - 1) // 2] + ordered[:, count // 2])
    ends = np.concatenate([ordered[:, :most], ordered[:, -most:]], axis=1) - middle[:, None]
    size = np.sort(np.abs(ends), axis=1)
    usual = size[:, -most]
    return (usual > 0) & (size[:, -1] * ROUNDING > BEYOND * usual)


def _copied(rows: Rows) -> np.ndarray:
    """Whether the force follows another signal, or what the velocity gains."""
    force = rows.packed(rows.force)
    signals = [rows.velocity] if rows.position is None else [rows.velocity, rows.position]
    found = [_follows(force, rows.packed(signal)) for signal in signals]
    return np.any([*found, _follows(*gains(rows.force, rows.velocity, rows.linked))], axis=0)


def _follows(force: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Whether a multiple of the values leaves next to nothing of the force; NaN is left out."""
    used = np.isfinite(force) & np.isfinite(values)
    count = np.maximum(np.count_nonzero(used, axis=1), 1)
    ours, theirs = (
        np.where(used, x - (np.sum(x, axis=1, where=used) / count)[:, None], 0.0)
        for x in (force, values)
    )
    powers = [np.einsum("bn,bn->b", x, x) for x in (ours, theirs)]
    product, shared = powers[0] * powers[1], np.einsum("bn,bn->b", ours, theirs)
    # What does not vary leaves nothing to tell it by: also a suspect.
    return product - shared**2 <= 1.01 * PROPORTIONAL**2 * product
