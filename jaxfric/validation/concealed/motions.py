"""Set-points like those of commissioning runs, of four kinds; all start from rest."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.random import Generator


def _unit(x: np.ndarray) -> np.ndarray:
    """Shifted and scaled to fill the interval from 0 to 1."""
    return (x - x.min()) / np.ptp(x)


def _multisine(rng: Generator, time: np.ndarray, period: float) -> np.ndarray:
    """Four to six harmonics whose amplitudes fall as 1/n, so that each has the same speed."""
    orders = np.concatenate([[1], rng.choice(np.arange(2, 6), rng.integers(2, 5), False)])
    detune = rng.uniform(0.93, 1.07, orders.size)  # otherwise every period is the same
    phases = rng.uniform(0, 2 * np.pi, orders.size)
    angles = 2 * np.pi * np.outer(time / period, orders * detune) + phases
    return np.sin(angles) @ (rng.uniform(0.3, 1.0, orders.size) / orders)


def _chirp(rng: Generator, time: np.ndarray, period: float) -> np.ndarray:
    """A sine swept up and down twice over a factor of five in frequency, speed almost constant."""
    sweep = np.sin(2 * np.pi * 2 * time / time[-1] + rng.uniform(0, 2 * np.pi))
    frequency = 5.0 ** (0.5 * sweep) / period
    angle = 2 * np.pi * np.concatenate([[0.0], np.cumsum(frequency[1:] * np.diff(time))])
    return np.sin(angle) * (frequency * period) ** -0.9


def _smooth(x: np.ndarray, width: int) -> np.ndarray:
    """Three moving means of `width` samples after one another, the ends held."""
    for _ in range(3):
        padded = np.concatenate([np.full(width, x[0]), x, np.full(width, x[-1])])
        total = np.cumsum(padded)
        mean = (total[width:] - total[:-width]) / width
        start = (width + 1) // 2
        x = mean[start : start + x.size]
    return x


def _moves(rng: Generator, time: np.ndarray, shortest: float, longest: float, dwell: float):
    """Times, targets and lengths of moves to and fro, each beginning where one ended."""
    now, side, place = 0.05 * longest, 1, 0.5
    while now < time[-1]:
        span = rng.uniform(shortest, longest)
        target = rng.uniform(0.55, 1.0) if side > 0 else rng.uniform(0.0, 0.45)
        yield now, span, place, target
        pause = rng.uniform(0, dwell)
        now, side, place = now + span + pause, -side if rng.random() < 0.9 else side, target


def _trapezoids(rng: Generator, time: np.ndarray, period: float) -> np.ndarray:
    """Moves with trapezoidal velocity, rounded off, and dwells between them."""
    speed = np.zeros_like(time)
    for start, span, place, target in _moves(rng, time, 0.3 * period, 0.6 * period, 0.15 * period):
        ramp = rng.uniform(0.2, 0.4) * span
        inside = np.minimum(time - start, start + span - time) / ramp
        speed += (target - place) / (span - ramp) * np.clip(inside, 0.0, 1.0)
    step = time[1] - time[0]
    speed = _smooth(speed, max(int(0.015 * period / step), 1))
    return np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * step)])


def _steps(rng: Generator, time: np.ndarray, period: float) -> np.ndarray:
    """Jumps to random places, smoothed."""
    x = np.full_like(time, 0.5)
    for start, _, _, target in _moves(rng, time, 0.3 * period, 0.6 * period, 0.1 * period):
        x[time >= start] = target
    return _smooth(x, max(int(0.13 * period / (time[1] - time[0])), 1))


KINDS: Mapping[str, Callable[[Generator, np.ndarray, float], np.ndarray]] = {
    "multisine": _multisine,
    "trapezoids": _trapezoids,
    "chirp": _chirp,
    "steps": _steps,
}


def motion(kind: str, seed: tuple[int, ...], interval: float, count: int, period: float):
    """Position between 0 and 1 and its rate, 1/s, at even times: two arrays `(count,)`.

    `period` s is about that of one way there and back; `seed` is that of the motion alone.
    """
    time = np.arange(count) * interval
    x = KINDS[kind](np.random.default_rng(seed), time, period)
    fade = np.clip(time / (0.5 * period), 0.0, 1.0)
    x = _unit(x[0] + fade**3 * (10 - 15 * fade + 6 * fade**2) * (x - x[0]))
    return x, np.gradient(x, interval)
