"""Axes that meet a hard end stop, or rest at the end of their stroke without one, step by step."""

import dataclasses

import numpy as np

import jaxfric as jf

RATE, SUB = 500.0, 20


@dataclasses.dataclass(frozen=True)
class Axis:
    """An axis of 1 kg with 1 N of dry friction on ± 0.5 m, scaled afterwards.

    `stop`: place of the upper one, m, `lower` of the other; `restitution` of a blow; `stiffness`,
    N/m; `most`: limit of the force, N; `static`: friction at rest, N; `weight`, N; `pulls`: a
    spring, N/m; `swings`: gravity of a pendulum that hangs down at 0, N; `brake`: times between
    which the axis is held, s; `drive`: whether the drive is on meanwhile; `gains` of position, its
    derivative and its integral.
    """

    stop: float | None = None
    lower: float | None = None
    restitution: float = 0.0
    stiffness: float = 1e5
    most: float = 4.0
    static: float = 1.3
    weight: float = 0.0
    pulls: float = 0.0
    swings: float = 0.0
    brake: tuple[float, float] = (-1.0, -1.0)
    drive: bool = True
    gains: tuple[float, float, float] = (900.0, 60.0, 4000.0)


def moves(rng, targets, rest=0.35, speed=0.8):
    """A reference of trapezoidal moves between targets, with rests, by substeps."""
    at, path, dt = 0.0, [np.zeros(int(0.2 * RATE * SUB))], 1 / (RATE * SUB)
    for target in targets:
        fast = speed * rng.uniform(0.3, 1.0)
        way, rise = target - at, fast / 4.0
        lasts = abs(way) / fast + rise
        time = np.arange(0, lasts, dt)
        smooth = np.clip(time / rise, 0, 1) * np.clip((lasts - time) / rise, 0, 1)
        course = np.cumsum(smooth)
        path += [at + way * course / course[-1], np.full(int(rest * RATE * SUB), target)]
        at = target
    return np.concatenate(path)


def run(axis: Axis, wanted, rng):
    """Position, m, and commanded force, N, at the samples."""
    dt, kp, kd, ki = 1 / (RATE * SUB), *axis.gains
    rate = np.gradient(wanted, dt)
    decay = -np.log(max(axis.restitution, 1e-3)) / np.pi
    damping = 2 * np.sqrt(axis.stiffness) * decay / np.hypot(1.0, decay)
    x = v = total = force = 0.0
    rows = []
    for k in range(len(wanted)):
        held = axis.brake[0] <= k * dt < axis.brake[1]
        if k % SUB == 0:
            count = 1e-5
            seen = count * np.round(x / count)
            error = wanted[k] - seen
            total = float(np.clip(total + ki * error * SUB * dt, -2 * axis.most, 2 * axis.most))
            force = kp * error + kd * (rate[k] - v) + total + axis.weight
            force = float(np.clip(force, -axis.most + axis.weight, axis.most + axis.weight))
            force = 0.0 if held and not axis.drive else force
            rows.append((seen, force))
        if held:
            v = 0.0
            continue
        upper = -1.0 if axis.stop is None else x - axis.stop
        lower = -1.0 if axis.lower is None else axis.lower - x
        against = max(axis.stiffness * upper + damping * v, 0.0) if upper > 0 else 0.0
        against -= max(axis.stiffness * lower - damping * v, 0.0) if lower > 0 else 0.0
        bends = axis.pulls * x + axis.swings * np.sin(3 * x)
        net = force - axis.weight - bends - 0.4 * v - against
        free = v + dt * net
        dry = 1.0 + (axis.static - 1.0) * np.exp(-((v / 0.01) ** 2))
        v = np.sign(free) * max(abs(free) - dt * dry, 0.0)
        x += dt * v
    position, force = np.array(rows).T
    return position, force


def log(axis, targets, seed=0, way=1.0, scale=(1.0, 1.0), rotary=False, **kinds):
    """The recording of such an axis, to the other side, and in other sizes of force and motion."""
    rng = np.random.default_rng(seed)
    position, force = run(axis, moves(rng, targets, **kinds), rng)
    force = force + 0.01 * rng.normal(size=len(force))
    units = {"force": "N·m", "position": "rad"} if rotary else {}
    time = np.arange(len(position)) / RATE
    return jf.Recording(time, way * scale[0] * force, way * scale[1] * position, units=units)


def inside(seed, count=14):
    """Targets that the axis can reach."""
    return list(np.random.default_rng(seed).uniform(-0.45, 0.35, count))


def beyond(seed, count=14, where=(5, 11), target=0.44):
    """Such targets, some of them beyond a stop at 0.4 m."""
    targets = inside(seed, count)
    for number in where:
        targets[number] = target
    return targets
