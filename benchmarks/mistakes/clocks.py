"""Clocks, rows and runs: stamps of another kind, rows lost or mixed, runs that excite nothing."""

import numpy as np
from numpy.random import Generator

from .logs import Log, log_uniform
from .mistake import Mistake, some


def _step(log: Log) -> float:
    return float(np.median(np.diff(log.columns["time"])))


def _stamped(log: Log) -> Log:
    """Stamps of a logger that trusts its rate: rows that are gone leave no trace."""
    return log.having(time=np.arange(log.size) * _step(log))


def _times(log: Log, factor: float, start: float = 0.0) -> Log:
    return log.having(time=start + factor * log.columns["time"])


def _time_in_milliseconds(log: Log, rng: Generator, other: Log) -> Log:
    return _times(log, 1e3)


def _time_in_microseconds(log: Log, rng: Generator, other: Log) -> Log:
    return _times(log, 1e6)


def _time_as_row_number(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(time=np.arange(log.size, dtype=float))


def _time_alone_in_milliseconds(log: Log, rng: Generator, other: Log) -> Log:
    return _times(log, 1e3)


def _time_alone_as_row_number(log: Log, rng: Generator, other: Log) -> Log:
    return _time_as_row_number(log, rng, other)


def _time_at_another_rate(log: Log, rng: Generator, other: Log) -> Log:
    return _times(log, log_uniform(rng, 1.5, 10.0))


def _epoch(log: Log, factor: float) -> Log:
    """Milliseconds, … since 1970, whole numbers."""
    time = np.round(factor * (1.7e9 + log.columns["time"] - log.columns["time"][0]))
    return log.having(time=time)._replace(text=log.text._replace(digits=19))


def _epoch_in_milliseconds(log: Log, rng: Generator, other: Log) -> Log:
    return _epoch(log, 1e3)


def _epoch_in_microseconds(log: Log, rng: Generator, other: Log) -> Log:
    return _epoch(log, 1e6)


def _epoch_in_nanoseconds(log: Log, rng: Generator, other: Log) -> Log:
    return _epoch(log, 1e9)


def _stamps_rounded(log: Log, rng: Generator, other: Log) -> Log:
    grain = _step(log) * log_uniform(rng, 0.2, 4.0)
    return log.having(time=grain * np.round(log.columns["time"] / grain))


def _stamps_jitter(log: Log, rng: Generator, other: Log) -> Log:
    late = _step(log) * rng.uniform(0.05, 0.45) * rng.uniform(-1, 1, log.size)
    return log.having(time=log.columns["time"] + late)


def _stamps_on_arrival_of_packets(log: Log, rng: Generator, other: Log) -> Log:
    """Samples that arrive together, stamped one shortly after the other."""
    size, time = int(rng.integers(2, 20)), log.columns["time"]
    inside = np.arange(log.size) % size
    arrival = time[np.minimum(np.arange(log.size) - inside + size - 1, log.size - 1)]
    return log.having(time=arrival + inside * 0.01 * _step(log))


def _counter_of_the_clock_overflows(log: Log, rng: Generator, other: Log) -> Log:
    span = float(np.ptp(log.columns["time"]))
    return log.having(time=(log.columns["time"] + rng.uniform(0.1, 0.9) * span) % span)


def _clock_drifts(log: Log, rng: Generator, other: Log) -> Log:
    """By up to a tenth: a timer of software that waits a little too long, and longer by and by."""
    share = np.linspace(0, 1, log.size)
    return log.having(time=log.columns["time"] * (1 + log_uniform(rng, 1e-3, 0.1) * share))


def _rows_lost(log: Log, rng: Generator, other: Log) -> Log:
    return log.rows(np.flatnonzero(rng.random(log.size) > log_uniform(rng, 0.01, 0.5)))


def _rows_lost_without_a_clock(log: Log, rng: Generator, other: Log) -> Log:
    return _stamped(_rows_lost(log, rng, other))


def _blocks_lost_without_a_clock(log: Log, rng: Generator, other: Log) -> Log:
    keep = np.ones(log.size, bool)
    for _ in range(int(rng.integers(1, 8))):
        keep[some(rng, 0.01, 0.08, log.size)] = False
    return _stamped(log.rows(np.flatnonzero(keep)))


def _blocks_twice(log: Log, rng: Generator, other: Log) -> Log:
    where = some(rng, 0.05, 0.3, log.size)
    index = np.arange(log.size)
    log = log.rows(np.concatenate([index[: where.stop], index[where], index[where.stop :]]))
    return _stamped(log) if rng.random() < 0.5 else log


def _rows_in_the_order_of_their_text(log: Log, rng: Generator, other: Log) -> Log:
    """1, 10, 100, 2: a table sorted by its number as text; stamped anew."""
    order = sorted(range(log.size), key=str)
    log = log.rows(np.array(order))
    return _stamped(log) if rng.random() < 0.5 else log


def _rows_backwards(log: Log, rng: Generator, other: Log) -> Log:
    return _stamped(log.rows(np.arange(log.size)[::-1]))


def _joined(log: Log, other: Log, order: np.ndarray) -> Log:
    both = {k: np.concatenate([v, other.columns[k]])[order] for k, v in log.columns.items()}
    return log._replace(columns=both)


def _another_axis_appended(log: Log, rng: Generator, other: Log) -> Log:
    log = _joined(log, other, np.arange(2 * log.size))
    return _stamped(log) if rng.random() < 0.7 else log


def _another_axis_between_the_rows(log: Log, rng: Generator, other: Log) -> Log:
    order = np.arange(2 * log.size).reshape(2, -1).T.ravel()
    log = _joined(log, other, order)
    return _stamped(log) if rng.random() < 0.5 else log


def _too_low_a_rate(log: Log, rng: Generator, other: Log) -> Log:
    """Two to twelve samples are left of the fastest cycle."""
    every = max(2, round(log.cycle / log_uniform(rng, 2.0, 12.0)))
    index = np.arange(0, log.size, every)
    return log.rows(index)._replace(cycle=log.cycle / every)


def _too_low_a_rate_without_velocity(log: Log, rng: Generator, other: Log) -> Log:
    return _too_low_a_rate(log.without_velocity(), rng, other)


def _one_direction_only(log: Log, rng: Generator, other: Log) -> Log:
    speed = np.gradient(log.columns["position"], log.columns["time"])
    return log.rows(np.flatnonzero(speed > 0.02 * log.top))


def _one_speed_only(log: Log, rng: Generator, other: Log) -> Log:
    """To and fro at one speed; only the steady stretches were recorded."""
    t, c = log.columns["time"], log.truth
    way = np.sign(np.sin(2 * np.pi * np.arange(log.size) / (12 * log.cycle)) + 1e-9)
    speed = 0.7 * log.top
    position = np.cumsum(way) * _step(log) * speed
    level = np.where(way > 0, c["coulomb+"] + c["viscous+"] * speed,
                     -c["coulomb-"] - c["viscous-"] * speed)  # fmt: skip
    noise = 0.01 * c["coulomb+"] * rng.normal(size=t.size)
    steady = np.abs(np.convolve(way, np.ones(5) / 5, "same")) > 0.99
    log = log.having(position=position, velocity=None, force=level + noise)
    return log.rows(np.flatnonzero(steady))


def _no_motion(log: Log, rng: Generator, other: Log) -> Log:
    x, t = log.columns["position"], log.columns["time"]
    count = np.ptp(x) * 1e-5
    still = x[0] + count * np.round(0.6 * rng.normal(size=log.size))
    force = 0.5 * log.truth["coulomb+"] + 0.02 * log.truth["coulomb+"] * rng.normal(size=t.size)
    return log.having(position=still, velocity=None, force=force)


def _too_short(log: Log, rng: Generator, other: Log) -> Log:
    return log.rows(np.arange(int(log_uniform(rng, 12, max(log.cycle, 40)))) + log.size // 3)


def _at_fifty_kilohertz(log: Log, rng: Generator, other: Log) -> Log:
    """The clock of a current loop, or 25 times the rate: the same counts many times over."""
    finer = max(2, min(round(50e3 * _step(log)), 25, 120_000 // log.size))
    t = log.columns["time"]
    time = np.linspace(t[0], t[-1], finer * log.size)
    columns = {k: np.interp(time, t, v) for k, v in log.columns.items()}
    count = np.ptp(columns["position"]) / 1e5
    columns["position"] = count * np.round(columns["position"] / count)
    return log.having(**columns)._replace(cycle=log.cycle * finer)


MISTAKES = (
    Mistake(_time_in_milliseconds, "clock", velocity=True),
    Mistake(_time_in_microseconds, "clock", velocity=True),
    Mistake(_time_as_row_number, "clock", velocity=True),
    Mistake(_time_at_another_rate, "clock", velocity=True),
    Mistake(_time_alone_in_milliseconds, "clock", velocity=False, rescaling=True),
    Mistake(_time_alone_as_row_number, "clock", velocity=False, rescaling=True),
    Mistake(_epoch_in_milliseconds, "clock"),
    Mistake(_epoch_in_microseconds, "clock"),
    Mistake(_epoch_in_nanoseconds, "clock"),
    Mistake(_stamps_rounded, "stamps"),
    Mistake(_stamps_jitter, "stamps"),
    Mistake(_stamps_on_arrival_of_packets, "stamps"),
    Mistake(_counter_of_the_clock_overflows, "stamps"),
    Mistake(_clock_drifts, "stamps"),
    Mistake(_rows_lost, "rows"),
    Mistake(_rows_lost_without_a_clock, "rows"),
    Mistake(_blocks_lost_without_a_clock, "rows"),
    Mistake(_blocks_twice, "rows"),
    Mistake(_rows_in_the_order_of_their_text, "rows"),
    Mistake(_rows_backwards, "rows"),
    Mistake(_another_axis_appended, "rows"),
    Mistake(_another_axis_between_the_rows, "rows"),
    Mistake(_too_low_a_rate, "rate", velocity=True),
    Mistake(_too_low_a_rate_without_velocity, "rate", velocity=False),
    Mistake(_at_fifty_kilohertz, "rate", velocity=False),
    Mistake(_one_direction_only, "excitation"),
    Mistake(_one_speed_only, "excitation", velocity=False),
    Mistake(_no_motion, "excitation", velocity=False),
    Mistake(_too_short, "excitation"),
)
