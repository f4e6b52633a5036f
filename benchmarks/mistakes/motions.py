"""Set-points of the machines that are drawn here: what motion planners put out."""

import numpy as np
from numpy.random import Generator


def multisine(rng: Generator, time: np.ndarray, fastest: float) -> np.ndarray:
    """Harmonics up to the fastest frequency, Hz, each with a similar speed."""
    orders = np.unique(np.append(rng.integers(1, 5, 2), 5))
    phases = rng.uniform(0, 2 * np.pi, orders.size)
    angles = 2 * np.pi * np.outer(time * fastest / 5, orders) + phases
    return np.sin(angles) @ (rng.uniform(0.5, 1.0, orders.size) / orders)


def chirp(rng: Generator, time: np.ndarray, fastest: float) -> np.ndarray:
    """A sine that is swept up and down over a factor of four, its speed about constant."""
    sweep = np.sin(2 * np.pi * 2 * time / time[-1] + rng.uniform(0, 2 * np.pi))
    frequency = 0.5 * fastest * 2.0**sweep
    angle = 2 * np.pi * np.append(0.0, np.cumsum(frequency[1:] * np.diff(time)))
    return np.sin(angle) / frequency


def _moves(rng: Generator, time: np.ndarray, fastest: float, ramp: float) -> np.ndarray:
    """Velocity of moves to and fro between two regions, with ramps and dwells, ramps in s."""
    speed, now, place, side = np.zeros_like(time), 0.2 / fastest, 0.5, 1
    while now < time[-1] - 3 * ramp:
        target = rng.uniform(0.6, 1.0) if side > 0 else rng.uniform(0.0, 0.4)
        span = 2 * ramp + rng.uniform(0.0, 1.5) / fastest
        inside = np.minimum(time - now, now + span - time) / ramp
        speed += (target - place) / (span - ramp) * np.clip(inside, 0.0, 1.0)
        now, place, side = now + span + rng.uniform(0.0, 0.3) / fastest, target, -side
    return speed


def trapezoids(rng: Generator, time: np.ndarray, fastest: float) -> np.ndarray:
    """Moves with trapezoidal velocity, the ramp half a period of the fastest frequency."""
    speed = _moves(rng, time, fastest, rng.uniform(0.4, 0.7) / fastest)
    return np.cumsum(speed) * (time[1] - time[0])


def s_curves(rng: Generator, time: np.ndarray, fastest: float) -> np.ndarray:
    """The same with limited jerk: the ramps themselves are ramped."""
    ramp = rng.uniform(0.4, 0.7) / fastest
    width = max(int(ramp / (time[1] - time[0])), 1)
    speed = np.convolve(_moves(rng, time, fastest, ramp), np.ones(width) / width, "same")
    return np.cumsum(speed) * (time[1] - time[0])
