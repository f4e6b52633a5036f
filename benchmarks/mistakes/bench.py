"""A machine that shares nothing with the library: NumPy and a loop of plain floats.

One body with Coulomb, viscous and Stribeck friction of each direction, a constant force, cogging;
semi-implicit Euler, in which friction may stop the body but not turn it round. The loop's clock
is faster than the logger's, as in a drive.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.random import Generator

from . import motions
from .logs import PLAIN, TRUE_VELOCITY, Log, Pair, log_uniform

# Rows of a log: few lengths, so that few programs are compiled.
LENGTHS = (4000, 8000)
# The most steps of a loop's clock in a run.
MOST_STEPS = 80_000


class Range(NamedTuple):
    """What machines are drawn from: the kinds of motion, the loop, and the logger.

    `cycle`: samples a cycle of the fastest motion, from and to; `rate` Hz; `cascade`: a velocity
    loop inside the position loop instead of feedback of the state.
    """

    name: str
    motions: tuple[Callable[[Generator, np.ndarray, float], np.ndarray], ...]
    cycle: tuple[float, float]
    rate: tuple[float, float]
    cascade: bool


BENCH = Range("bench", (motions.multisine, motions.trapezoids), (24, 300), (50, 10_000), False)
CASCADE = Range("cascade", (motions.chirp, motions.s_curves), (20, 400), (20, 20_000), True)


class _Axis(NamedTuple):
    mass: float
    coulomb: tuple[float, float]
    viscous: tuple[float, float]
    bump: float
    bump_speed: float
    cogging: float
    pitch: float
    omega: float
    cascade: bool


def draw(rng: Generator, kind: Range) -> Pair:
    """A machine and two runs of it."""
    rate, cycle = log_uniform(rng, *kind.rate), log_uniform(rng, *kind.cycle)
    fastest, count = rate / cycle, int(rng.choice(LENGTHS))
    # A dozen cycles at least, or there is too little to identify.
    while count < 12 * cycle:
        count *= 2
    ratio = rng.uniform(6.0, 15.0)
    # The loop's bandwidth times its step is an eighth: sampling costs it four degrees.
    finer = math.ceil(8 * 2 * math.pi * ratio / cycle)
    finer = max(1, min(finer, MOST_STEPS // count))
    stroke, coulomb = log_uniform(rng, 1e-4, 50.0), log_uniform(rng, 1e-6, 3e3)
    motion = kind.motions[rng.integers(len(kind.motions))]
    time = np.arange(count * finer) / (rate * finer)
    goals = [_placed(motion(rng, time, fastest), rng.uniform(-1, 1), stroke) for _ in range(2)]
    speed, hard = _reach(goals[0], time)
    axis = _axis(rng, coulomb, speed, hard, stroke, 2 * math.pi * fastest * ratio, cycle, kind)
    offset = coulomb * rng.uniform(-0.3, 0.3) if rng.random() < 0.3 else 0.0
    names = dict(PLAIN[rng.integers(len(PLAIN))], reference="reference")
    note = f"{motion.__name__}, {rate:.4g} Hz, {cycle:.3g} samples a cycle"
    logger = _logger(rng, coulomb, stroke)
    seed = int(rng.integers(2**31))
    first, second = (
        _run(np.random.default_rng((seed, i)), axis, offset, goal, time, finer, logger)
        for i, goal in enumerate(goals)
    )
    truth = {
        "inertia": axis.mass,
        "coulomb+": axis.coulomb[0] + offset, "coulomb-": axis.coulomb[1] - offset,
        "viscous+": axis.viscous[0], "viscous-": axis.viscous[1],
    }  # fmt: skip
    if axis.bump:
        truth |= {"stribeck_force+": axis.bump, "stribeck_force-": axis.bump}
    about = truth, speed, hard, cycle, "gaussian" if axis.bump else "coulomb-viscous"
    machine = f"{kind.name}: {note}"
    lacks = axis.cogging > 0
    return Pair(*(Log(each, names, *about, machine, lacks) for each in (first, second)))


def _placed(x: np.ndarray, low: float, stroke: float) -> np.ndarray:
    return stroke * (low + (x - x.min()) / np.ptp(x))


def _reach(goal: np.ndarray, time: np.ndarray) -> tuple[float, float]:
    """98 % of the speeds and of the accelerations."""
    speed = np.gradient(goal, time)
    return float(np.quantile(np.abs(speed), 0.98)), float(
        np.quantile(np.abs(np.gradient(speed, time)), 0.98)
    )


def _axis(rng, coulomb, speed, hard, stroke, omega, cycle, kind) -> _Axis:
    skew = rng.uniform(-0.2, 0.2)
    viscous = coulomb / speed * log_uniform(rng, 0.15, 1.0)
    # A bump that the motion passes within a sample cannot be seen, whoever looks.
    bump = coulomb * rng.uniform(0.15, 0.5) if cycle > 100 and rng.random() < 0.6 else 0.0
    return _Axis(
        mass=coulomb / hard * log_uniform(rng, 0.3, 3.0),
        coulomb=(coulomb * (1 + skew), coulomb * (1 - skew)),
        viscous=(viscous, viscous * rng.uniform(0.75, 1.3)),
        bump=bump,
        bump_speed=speed * log_uniform(rng, 0.03, 0.12),
        cogging=coulomb * rng.uniform(0.02, 0.1) if rng.random() < 0.3 else 0.0,
        pitch=stroke / rng.uniform(3.0, 12.0),
        omega=omega,
        cascade=kind.cascade,
    )


class _Logger(NamedTuple):
    resolution: float
    noise: float
    filter: float


def _logger(rng: Generator, coulomb: float, stroke: float) -> _Logger:
    """Encoder's count, the force's noise, and the drive's velocity filter in loop steps."""
    counts = log_uniform(rng, 3e3, 1e6)
    return _Logger(stroke / counts, coulomb * log_uniform(rng, 2e-3, 0.03), rng.uniform(1.0, 4.0))


def _run(rng, axis: _Axis, offset, goal, time, finer, logger: _Logger) -> dict[str, np.ndarray]:
    step = float(time[1] - time[0])
    wanted = np.gradient(goal, step)
    ahead = axis.mass * np.gradient(wanted, step)
    x, force = _steps(axis, offset, goal.tolist(), wanted.tolist(), ahead.tolist(), step)
    speed = np.append(0.0, np.diff(x)) / step
    filtered, state, share = np.empty_like(speed), speed[1], 1 / logger.filter
    for i, value in enumerate(speed.tolist()):
        state += share * (value - state)
        filtered[i] = state
    log = slice(0, None, finer)
    counted = logger.resolution * np.round(x[log] / logger.resolution)
    blur = logger.noise * rng.normal(size=counted.size)
    return {
        "time": time[log], "position": counted, "velocity": filtered[log],
        TRUE_VELOCITY: np.gradient(x, step)[log],
        "force": force[log] + blur, "reference": goal[log],
    }  # fmt: skip


def _steps(axis: _Axis, offset, goal, wanted, ahead, step):
    """True position at each step and the force that is held until the next."""
    mass, omega = axis.mass, axis.omega
    (dry, yrd), (wet, tew) = axis.coulomb, axis.viscous
    bump, width, wave = axis.bump, axis.bump_speed, 2 * math.pi / axis.pitch
    kp, kd, integral = mass * omega**2, 2 * mass * omega, 0.0
    ki = 0.2 * omega if axis.cascade else 0.0
    x, v, positions, forces = goal[0], wanted[0], [], []
    for place, speed, known in zip(goal, wanted, ahead, strict=True):
        positions.append(x)
        if axis.cascade:
            error = 0.5 * omega * (place - x) + speed - v
            integral += ki * step * error
            force = kd * (error + integral) + 0.5 * known
        else:
            force = kp * (place - x) + kd * (speed - v) + known
        forces.append(force)
        free = v + step / mass * (force - offset - axis.cogging * math.sin(wave * x))
        size, up = abs(free), free > 0
        level = (dry if up else yrd) + (wet if up else tew) * size
        if bump:
            level += bump * math.exp(-((size / width) ** 2))
        kick = step / mass * level
        v = 0.0 if size <= kick else free - kick if up else free + kick
        x += step * v
    return np.array(positions), np.array(forces)
