"""Signs, units and columns that are mistaken for another."""

import numpy as np
from numpy.random import Generator

from .logs import Log, log_uniform
from .mistake import Mistake

RPM = 60 / (2 * np.pi)
DEGREES = 180 / np.pi


def _times(role: str, factor: float, log: Log) -> Log:
    return log.having(**{role: factor * log.columns[role]})


def _force_sign(log: Log, rng: Generator, other: Log) -> Log:
    return _times("force", -1.0, log)


def _position_sign(log: Log, rng: Generator, other: Log) -> Log:
    return _times("position", -1.0, log)


def _velocity_sign(log: Log, rng: Generator, other: Log) -> Log:
    return _times("velocity", -1.0, log)


def _velocity_in_rpm(log: Log, rng: Generator, other: Log) -> Log:
    return _times("velocity", RPM, log)


def _velocity_in_degrees(log: Log, rng: Generator, other: Log) -> Log:
    return _times("velocity", DEGREES, log)


def _velocity_a_thousand_times(log: Log, rng: Generator, other: Log) -> Log:
    return _times("velocity", (1e3, 1e-3)[rng.integers(2)], log)


def _velocity_of_the_other_side_of_a_gear(log: Log, rng: Generator, other: Log) -> Log:
    factor = log_uniform(rng, 1.5, 150.0)
    return _times("velocity", factor if rng.random() < 0.5 else 1 / factor, log)


def _velocity_in_counts_a_sample(log: Log, rng: Generator, other: Log) -> Log:
    step = float(np.median(np.diff(log.columns["time"])))
    return _times("velocity", step * log_uniform(rng, 1e3, 1e5) / log.top, log)


def _position_in_millimetres(log: Log, rng: Generator, other: Log) -> Log:
    return _times("position", 1e3, log)


def _position_in_degrees(log: Log, rng: Generator, other: Log) -> Log:
    return _times("position", DEGREES, log)


def _position_in_counts(log: Log, rng: Generator, other: Log) -> Log:
    x = log.columns["position"]
    return log.having(position=np.round(x / np.ptp(x) * log_uniform(rng, 2e3, 1e6)))


def _all_motion(log: Log, factor: float) -> Log:
    for role in {"position", "velocity"} & set(log.columns):
        log = _times(role, factor, log)
    return log


def _all_motion_in_millimetres(log: Log, rng: Generator, other: Log) -> Log:
    return _all_motion(log, 1e3)


def _all_motion_in_degrees(log: Log, rng: Generator, other: Log) -> Log:
    return _all_motion(log, DEGREES)


def _position_alone_in_counts(log: Log, rng: Generator, other: Log) -> Log:
    return _position_in_counts(log, rng, other)


def _force_in_other_units(log: Log, rng: Generator, other: Log) -> Log:
    return _times("force", (1e3, 1e-3, 100.0)[rng.integers(3)], log)


def _millimetres_stated_beside_metres(log: Log, rng: Generator, other: Log) -> Log:
    return _times("position", 1e3, log).called(position="position [mm]", velocity="velocity [m/s]")


_TURNS = ("[U/min]", "[r/min]", "[rev/min]", "[RPM]", "[min^-1]", "(1/min)")


def _turns_a_minute_stated(log: Log, rng: Generator, other: Log) -> Log:
    """As drives spell it, beside radians."""
    unit = _TURNS[rng.integers(len(_TURNS))]
    return _times("velocity", RPM, log).called(
        position="position [rad]", velocity=f"speed {unit}", force="torque [Nm]"
    )


_LATE = (("[milliseconds]", 1e3), ("(msec)", 1e3), ("[microseconds]", 1e6), ("[µs]", 1e6))


def _other_clock_stated(log: Log, rng: Generator, other: Log) -> Log:
    unit, factor = _LATE[rng.integers(len(_LATE))]
    return _times("time", factor, log).called(time=f"time {unit}")


def _position_and_velocity_swapped(log: Log, rng: Generator, other: Log) -> Log:
    c = log.columns
    return log.having(position=c["velocity"], velocity=c["position"])


def _velocity_for_position(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(position=log.columns["velocity"], velocity=None)


def _set_point_for_force(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(force=log.columns["reference"])


def _velocity_for_force(log: Log, rng: Generator, other: Log) -> Log:
    x, t = log.columns["position"], log.columns["time"]
    return log.having(force=log.columns.get("velocity", np.gradient(x, t)))


def _acceleration_for_force(log: Log, rng: Generator, other: Log) -> Log:
    x, t = log.columns["reference"], log.columns["time"]
    return log.having(force=np.gradient(np.gradient(x, t), t))


def _following_error_for_force(log: Log, rng: Generator, other: Log) -> Log:
    """Of a proportional loop it is the force in another unit."""
    return log.having(force=log.columns["reference"] - log.columns["position"])


def _position_for_force(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(force=log.columns["position"])


def _force_of_another_axis(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(force=other.columns["force"])


def _motion_of_another_axis(log: Log, rng: Generator, other: Log) -> Log:
    roles = {"position", "velocity"} & set(log.columns)
    return log.having(**{role: other.columns[role] for role in roles})


def _velocity_of_another_axis(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(velocity=other.columns["velocity"])


def _set_point_for_position(log: Log, rng: Generator, other: Log) -> Log:
    """Harmless where the loop follows well."""
    return log.having(position=log.columns["reference"], velocity=None)


MISTAKES = (
    Mistake(_force_sign, "sign"),
    Mistake(_position_sign, "sign"),
    Mistake(_velocity_sign, "sign", velocity=True),
    Mistake(_velocity_in_rpm, "unit", velocity=True),
    Mistake(_velocity_in_degrees, "unit", velocity=True),
    Mistake(_velocity_a_thousand_times, "unit", velocity=True),
    Mistake(_velocity_of_the_other_side_of_a_gear, "unit", velocity=True),
    Mistake(_velocity_in_counts_a_sample, "unit", velocity=True),
    Mistake(_position_in_millimetres, "unit", velocity=True),
    Mistake(_position_in_degrees, "unit", velocity=True),
    Mistake(_position_in_counts, "unit", velocity=True),
    Mistake(_all_motion_in_millimetres, "unit", rescaling=True),
    Mistake(_all_motion_in_degrees, "unit", rescaling=True),
    Mistake(_position_alone_in_counts, "unit", velocity=False, rescaling=True),
    Mistake(_force_in_other_units, "unit", rescaling=True),
    Mistake(_millimetres_stated_beside_metres, "stated unit", velocity=True, rescaling=True),
    Mistake(_turns_a_minute_stated, "stated unit", velocity=True),
    Mistake(_other_clock_stated, "stated unit"),
    Mistake(_position_and_velocity_swapped, "column", velocity=True),
    Mistake(_velocity_for_position, "column", velocity=True),
    Mistake(_set_point_for_force, "column"),
    Mistake(_velocity_for_force, "column"),
    Mistake(_acceleration_for_force, "column"),
    Mistake(_following_error_for_force, "column", rescaling=True),
    Mistake(_position_for_force, "column"),
    Mistake(_force_of_another_axis, "column"),
    Mistake(_motion_of_another_axis, "column"),
    Mistake(_velocity_of_another_axis, "column", velocity=True),
    Mistake(_set_point_for_position, "column"),
    Mistake(_all_motion_in_millimetres, "held out", held_out=True),
    Mistake(_force_sign, "held out", held_out=True),
    Mistake(_force_of_another_axis, "held out", held_out=True),
)
