"""Stretches of constant velocity in a recording, on the host."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from .. import signals
from ..data.recording import Recording
from .uncertainty import COSINES

# Half the width of the band that the velocity stays in, as a share of its level: inside it the
# friction is a straight line to (5 %)², whatever its curve, so that the mean force belongs to the
# mean velocity.
BAND = 0.05
# Of a velocity that turns once, half lies between the two crossings of its median; of one that
# passes through the band only what noise makes of its one crossing.
LEAST_BETWEEN = 1 / 3
# What varies in the seventh digit is a set-point or a rounding: its ends are equal.
ROUNDED = 1e-6
# Samples of a stretch: four for each of the cosines that tell how sure its mean is.
FEWEST = 4 * COSINES
# The mean velocity is held where so many neighbouring means, of no sample in common, agree.
MEANS = 4
# The means are taken over the record's duration divided by these.
PARTS = (8, 16, 32, 64)


class Stretch(NamedTuple):
    """A stretch: samples `first` to `last`, mean velocity, m/s, and force, N, with its error.

    `rise`: the slope of a straight line through the velocity, m/s²; `spread`: root mean square of
    the velocity about its mean, as a share of it.
    """

    first: int
    last: int
    seconds: float
    velocity: float
    force: float
    error: float
    rise: float
    spread: float


def steady(log: Recording, force: np.ndarray, slowest: float) -> list[Stretch]:
    """The stretches of constant velocity of a prepared recording on the host.

    The velocity stays in a band of ±5 %, and the stretch goes from its first to its last crossing
    of its median there: equal end velocities, so that the mass has no part in the mean (Lemma 1).
    It lasts longer than the recording's usual acceleration would take to pass the band, so that a
    ramp whose noise crosses the median twice, or the tip between two ramps, is none.

    **Arguments:** `force`, N, `(N,)`; `slowest`, the smallest speed resolved as slip, m/s.
    """
    velocity, time = np.asarray(log.velocity, float), np.asarray(log.time, float)
    linked = signals.host_continuous(log, signals.host_interval(log))
    usual = _acceleration(time, velocity, linked)
    taken = np.zeros(velocity.size, bool)
    found = []
    for first, last in _runs(velocity, linked, slowest, FEWEST):
        ends = _closed(velocity[first : last + 1])
        if ends is None:
            continue
        first, last = first + ends[0], first + ends[1]
        if last - first + 1 < FEWEST or taken[first : last + 1].any():
            continue
        # In a recording of one speed the usual acceleration is noise.
        alone = 2 * (last - first + 1) > velocity.size
        if not alone and _passes(time[first : last + 1], velocity[first : last + 1], usual):
            continue
        taken[first : last + 1] = True
        found.append(_measured(log, force, first, last))
    return sorted(found)


def _passes(time: np.ndarray, velocity: np.ndarray, usual: float) -> bool:
    """Whether the usual acceleration, m/s², would take two thirds of this to pass the band.

    The tip between two ramps takes as long as passing; half as much again is more than a tip.
    """
    return bool((time[-1] - time[0]) * usual <= 1.5 * 2 * BAND * abs(np.median(velocity)))


def _acceleration(time: np.ndarray, velocity: np.ndarray, linked: np.ndarray) -> float:
    """Root mean square of the mean acceleration over the shortest stretch, m/s²."""
    breaks = np.concatenate([[0], np.cumsum(~linked)])
    whole = breaks[FEWEST:] == breaks[:-FEWEST]
    rise, span = velocity[FEWEST:] - velocity[:-FEWEST], time[FEWEST:] - time[:-FEWEST]
    square = np.square(rise[whole] / span[whole])
    return float(np.sqrt(np.nanmean(square))) if np.isfinite(square).any() else 0.0


def unsteady(log: Recording, evaluated: Sequence[Stretch], slowest: float) -> list[Stretch]:
    """Stretches whose mean velocity, or whose set-point's, is held, but not the velocity itself."""
    velocity = np.asarray(log.velocity, float)
    linked = signals.host_continuous(log, signals.host_interval(log))
    time = np.asarray(log.time, float)
    done = np.zeros(velocity.size, bool)
    for stretch in evaluated:
        done[stretch.first : stretch.last + 1] = True
    found = []
    for first, last in _held(log, velocity, linked, 0.1 * slowest):
        inside = slice(first, last + 1)
        if done[inside].mean() < 0.5 and time[last] > time[first]:
            found.append(_measured(log, np.asarray(log.force, float), first, last))
            done[inside] = True
    return found


def _held(log: Recording, velocity, linked, slowest: float) -> Iterator[tuple[int, int]]:
    """First and last sample where the mean velocity or that of the set-point is constant."""
    if "reference" in log.channels:
        wanted, time = np.asarray(log.channels["reference"], float), np.asarray(log.time, float)
        step = np.where(linked & (np.diff(time) > 0), np.diff(time), np.nan)
        aimed = np.append(np.diff(wanted) / step, np.nan)
        usual = _acceleration(time, velocity, linked)
        for first, last in _runs(aimed, linked, slowest, FEWEST):
            inside = slice(first, last + 1)
            turns = _closed(aimed[inside]) is not None
            if turns and not _passes(time[inside], aimed[inside], usual):
                yield first, last
    travel = np.concatenate([[0.0], np.cumsum(np.where(linked, velocity[:-1], 0.0))])
    breaks = np.concatenate([[0], np.cumsum(~linked)])
    for part in PARTS:
        width = velocity.size // part
        if width < FEWEST:
            return
        stride = max(1, width // 8)
        start = np.arange(0, velocity.size - width, stride)
        mean = (travel[start + width] - travel[start]) / width
        whole = breaks[start + width] == breaks[start]
        mean = np.where(whole, mean, np.nan)
        joined = whole[1:] & whole[:-1]
        for first, last in _runs(mean, joined, slowest, (MEANS - 1) * width // stride):
            yield int(start[first]), int(start[last] + width)


def _runs(
    velocity: np.ndarray, linked: np.ndarray, slowest: float, fewest: int
) -> list[tuple[int, int]]:
    """First and last place of runs that stay in one band, the longest first.

    Bands overlap by half, so that what varies by half a band is whole in one of them.
    """
    runs = []
    for sign in (-1.0, 1.0):
        speed = np.where(sign * velocity > 0, sign * velocity, np.nan)
        order = np.argsort(speed)  # NaN last
        rising = speed[order]
        top = np.nanmax(speed, initial=0.0)
        if not top > slowest > 0:
            continue
        low = slowest * (1 + BAND) ** np.arange(int(np.log(top / slowest) / np.log1p(BAND)) + 1)
        begin, end = (np.searchsorted(rising, low * factor) for factor in (1, (1 + BAND) ** 2))
        for first, last in zip(begin, end, strict=True):
            if last - first < fewest:
                continue
            inside = np.sort(order[first:last])
            broken = (np.diff(inside) > 1) | ~linked[inside[:-1]]
            starts = inside[np.concatenate([[True], broken])]
            ends = inside[np.concatenate([broken, [True]])]
            long = ends - starts + 1 >= fewest
            runs += list(zip(starts[long].tolist(), ends[long].tolist(), strict=True))
    return sorted(runs, key=lambda r: r[0] - r[1])


def _closed(velocity: np.ndarray) -> tuple[int, int] | None:
    """The first and the last crossing of the median; `None` where the velocity passes through."""
    above = velocity - np.median(velocity)
    if np.max(np.abs(above)) <= ROUNDED * abs(np.median(velocity)):
        return 0, velocity.size - 1
    crossing = np.flatnonzero((above[1:] * above[:-1] <= 0) & (above[1:] != above[:-1]))
    if crossing.size < 2 or crossing[-1] - crossing[0] < LEAST_BETWEEN * velocity.size:
        return None
    return int(crossing[0]), int(crossing[-1]) + 1


def _measured(log: Recording, force: np.ndarray, first: int, last: int) -> Stretch:
    """Mean velocity and force of a stretch, with the error by slow cosines (`uncertainty`)."""
    inside = slice(first, last + 1)
    time, velocity = np.asarray(log.time, float)[inside], np.asarray(log.velocity, float)[inside]
    values = force[inside]
    count, mean = values.size, float(values.mean())
    place = (np.arange(count) + 0.5) / count
    waves = 2**0.5 * np.cos(np.pi * np.arange(1, COSINES + 1)[:, None] * place[None, :])
    error = float(np.sqrt(np.mean((waves @ (values - mean) / count) ** 2)))
    since = time - time.mean()
    square = float(since @ since)
    level = float(velocity.mean())
    rise = float(since @ velocity) / square if square > 0 else 0.0
    spread = float(velocity.std() / abs(level)) if level else np.inf
    return Stretch(first, last, float(time[-1] - time[0]), level, mean, error, rise, spread)
