"""Sensors and actuators that are dead, late, clipped, coarse, drifting or changed."""

import numpy as np
from numpy.random import Generator

from .logs import Log, log_uniform
from .mistake import Mistake, changed, some


def _peak(log: Log) -> float:
    """What the force reaches in one row of a hundred."""
    return float(np.quantile(np.abs(log.columns["force"]), 0.99))


def _force_dead(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(force=_peak(log) * 10 ** rng.uniform(-4, 0) * rng.normal(size=log.size))


def _force_constant(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(force=np.full(log.size, _peak(log) * rng.uniform(-1, 1)))


def _force_in_a_few_levels(log: Log, rng: Generator, other: Log) -> Log:
    step = _peak(log) / rng.uniform(0.6, 4.0)
    return log.having(force=step * np.round(log.columns["force"] / step))


def _force_cut_to_whole_numbers(log: Log, rng: Generator, other: Log) -> Log:
    """Towards zero, as a conversion in C does it."""
    step = _peak(log) / log_uniform(rng, 3, 50)
    return log.having(force=step * np.trunc(log.columns["force"] / step))


def _force_frozen_from_a_moment_on(log: Log, rng: Generator, other: Log) -> Log:
    at = int(rng.uniform(0.2, 0.9) * log.size)
    force = log.columns["force"]
    return log.having(force=changed(force, slice(at, None), force[at]))


def _force_updated_rarely(log: Log, rng: Generator, other: Log) -> Log:
    every = max(2, int(log.cycle * log_uniform(rng, 0.02, 1.0)))
    index = np.arange(log.size) // every * every
    return log.having(force=log.columns["force"][index])


def _position_dead(log: Log, rng: Generator, other: Log) -> Log:
    count = np.ptp(log.columns["position"]) * 1e-4
    return log.having(position=count * np.round(0.7 * rng.normal(size=log.size)), velocity=None)


def _position_dead_beside_velocity(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(position=np.full(log.size, log.columns["position"][0]))


def _velocity_dead(log: Log, rng: Generator, other: Log) -> Log:
    size = 0.0 if rng.random() < 0.5 else log.top * 10 ** rng.uniform(-4, 0)
    return log.having(velocity=size * rng.normal(size=log.size))


def _position_frozen_from_a_moment_on(log: Log, rng: Generator, other: Log) -> Log:
    at = int(rng.uniform(0.3, 0.9) * log.size)
    x = log.columns["position"]
    return log.having(position=changed(x, slice(at, None), x[at]), velocity=None)


def _force_clipped(log: Log, rng: Generator, other: Log) -> Log:
    limit = _peak(log) * rng.uniform(0.2, 0.9)
    return log.having(force=np.clip(log.columns["force"], -limit, limit))


def _force_clipped_on_one_side(log: Log, rng: Generator, other: Log) -> Log:
    """An amplifier of single supply."""
    limit = _peak(log) * rng.uniform(0.0, 0.7)
    return log.having(force=np.minimum(log.columns["force"], limit))


def _force_overflows(log: Log, rng: Generator, other: Log) -> Log:
    """A whole number of 16 bits that runs over."""
    limit = _peak(log) * rng.uniform(0.4, 0.95)
    return log.having(force=(log.columns["force"] + limit) % (2 * limit) - limit)


def _force_without_sign(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(force=np.abs(log.columns["force"]))


def _force_filtered(log: Log, rng: Generator, other: Log) -> Log:
    """Twice the same first-order filter, causal, down to a third of the fastest motion."""
    share = 1 - np.exp(-1 / (log.cycle / (2 * np.pi) / log_uniform(rng, 0.3, 5.0)))
    force = np.array(log.columns["force"])
    for _ in range(2):
        state = force[0]
        for i, value in enumerate(force.tolist()):
            state += share * (value - state)
            force[i] = state
    return log.having(force=force)


def _late(x: np.ndarray, samples: int) -> np.ndarray:
    return np.roll(np.pad(x, (abs(samples), abs(samples)), "edge"), samples)[
        abs(samples) : x.size + abs(samples)
    ]


def _samples(log: Log, rng: Generator, cycles: float) -> int:
    return int(min(max(log_uniform(rng, 1.0, cycles * log.cycle), 1), log.size // 4))


def _force_late(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(force=_late(log.columns["force"], _samples(log, rng, 8.0)))


def _force_early(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(force=_late(log.columns["force"], -_samples(log, rng, 8.0)))


def _velocity_late(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(velocity=_late(log.columns["velocity"], _samples(log, rng, 2.0)))


def _velocity_filtered_heavily(log: Log, rng: Generator, other: Log) -> Log:
    width = max(3, int(log.cycle * log_uniform(rng, 0.1, 1.0)))
    padded = np.pad(log.columns["velocity"], (width - 1, 0), "edge")
    return log.having(velocity=np.convolve(padded, np.ones(width) / width, "valid"))


def _gain_changes_on_the_way(log: Log, rng: Generator, other: Log) -> Log:
    at = int(rng.uniform(0.3, 0.7) * log.size)
    factor = log_uniform(rng, 1.3, 5.0)
    force = log.columns["force"]
    return log.having(force=changed(force, slice(at, None), factor * force[at:]))


def _gain_changes_with_sign(log: Log, rng: Generator, other: Log) -> Log:
    force = log.columns["force"]
    return log.having(force=force * np.where(force > 0, log_uniform(rng, 1.2, 3.0), 1.0))


def _force_sign_changes_on_the_way(log: Log, rng: Generator, other: Log) -> Log:
    at = int(rng.uniform(0.3, 0.7) * log.size)
    force = log.columns["force"]
    return log.having(force=changed(force, slice(at, None), -force[at:]))


def _force_drifts(log: Log, rng: Generator, other: Log) -> Log:
    ramp = np.linspace(0, 1, log.size) * _peak(log) * log_uniform(rng, 0.2, 3.0)
    return log.having(force=log.columns["force"] + ramp)


def _force_jumps(log: Log, rng: Generator, other: Log) -> Log:
    at = int(rng.uniform(0.3, 0.7) * log.size)
    step = np.where(np.arange(log.size) < at, 0.0, _peak(log) * log_uniform(rng, 0.3, 3.0))
    return log.having(force=log.columns["force"] + step)


def _force_with_a_hum(log: Log, rng: Generator, other: Log) -> Log:
    wave = np.sin(2 * np.pi * np.arange(log.size) / log.cycle * rng.uniform(1.2, 6.0))
    return log.having(force=log.columns["force"] + _peak(log) * rng.uniform(0.3, 2.0) * wave)


def _spike(x: np.ndarray, rng: Generator) -> np.ndarray:
    at = int(rng.integers(x.size // 10, x.size - x.size // 10))
    return changed(x, at, np.ptp(x) * log_uniform(rng, 3.0, 1e6))


def _spike_in_force(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(force=_spike(log.columns["force"], rng))


def _spike_in_position(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(position=_spike(log.columns["position"], rng))


def _spike_in_velocity(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(velocity=_spike(log.columns["velocity"], rng))


def _values_missing(log: Log, rng: Generator, other: Log) -> Log:
    for role in ("force", "position"):
        for _ in range(int(rng.integers(0, 5))):
            where = some(rng, 0.001, 0.1, log.size)
            log = log.having(**{role: changed(log.columns[role], where, np.nan)})
    return log


def _lost(log: Log, rng: Generator) -> np.ndarray:
    """One row in a thousand to one in ten, and one at least."""
    lost = rng.random(log.size) < log_uniform(rng, 1e-3, 0.1)
    return changed(lost, rng.integers(log.size), True).astype(bool)


def _values_missing_as_zero(log: Log, rng: Generator, other: Log) -> Log:
    """What a bus sends where a telegram was lost."""
    lost = _lost(log, rng)
    return log.having(
        **{role: np.where(lost, 0.0, x) for role, x in log.columns.items() if role != "time"}
    )


def _values_missing_as_a_number(log: Log, rng: Generator, other: Log) -> Log:
    lost = _lost(log, rng)
    return log.having(force=np.where(lost, -9999.0, log.columns["force"]))


def _force_missing_on_the_way_back(log: Log, rng: Generator, other: Log) -> Log:
    back = np.gradient(log.columns["position"]) < 0
    return log.having(force=np.where(back, np.nan, log.columns["force"]), velocity=None)


def _turn(log: Log, rng: Generator) -> float:
    return float(np.ptp(log.columns["position"]) / rng.uniform(1.5, 6.0))


def _position_wraps(log: Log, rng: Generator, other: Log) -> Log:
    return log.having(position=log.columns["position"] % _turn(log, rng))


def _wrapped_position_filtered(log: Log, rng: Generator, other: Log) -> Log:
    x = log.columns["position"] % _turn(log, rng)
    width = int(rng.integers(2, 6))
    return log.having(position=np.convolve(np.pad(x, (width - 1, 0), "edge"),
                                           np.ones(width) / width, "valid"))  # fmt: skip


def _wrapped_position_with_lost_rows(log: Log, rng: Generator, other: Log) -> Log:
    log = log.having(position=log.columns["position"] % _turn(log, rng))
    return log.rows(np.flatnonzero(rng.random(log.size) > rng.uniform(0.02, 0.3)))


_TIME = frozenset({"load_drift", "friction_step", "thermal_drift", "disturbance_pulses"})
_DELAY = frozenset({"transport_delay", "actuator_lag"})

MISTAKES = (
    Mistake(_force_dead, "dead sensor"),
    Mistake(_force_constant, "dead sensor"),
    Mistake(_force_in_a_few_levels, "dead sensor"),
    Mistake(_force_frozen_from_a_moment_on, "dead sensor"),
    Mistake(_force_updated_rarely, "dead sensor", effects=_DELAY),
    Mistake(_position_dead, "dead sensor", velocity=False),
    Mistake(_position_dead_beside_velocity, "dead sensor", velocity=True),
    Mistake(_velocity_dead, "dead sensor", velocity=True),
    Mistake(_position_frozen_from_a_moment_on, "dead sensor", velocity=False),
    Mistake(_force_cut_to_whole_numbers, "force range", effects=frozenset({"actuator_deadband"})),
    Mistake(_force_clipped, "force range", effects=frozenset({"actuator_saturation"})),
    Mistake(_force_clipped_on_one_side, "force range", effects=frozenset({"gain_asymmetry"})),
    Mistake(_force_overflows, "force range"),
    Mistake(_force_without_sign, "force range"),
    Mistake(_force_filtered, "late", effects=_DELAY),
    Mistake(_force_late, "late", effects=_DELAY),
    Mistake(_force_early, "late", effects=_DELAY),
    Mistake(_velocity_late, "late", velocity=True),
    Mistake(_velocity_filtered_heavily, "late", velocity=True),
    Mistake(_gain_changes_on_the_way, "changes", effects=_TIME),
    Mistake(_gain_changes_with_sign, "changes", effects=frozenset({"gain_asymmetry"})),
    Mistake(_force_sign_changes_on_the_way, "changes", effects=_TIME),
    Mistake(_force_drifts, "changes", effects=_TIME),
    Mistake(_force_jumps, "changes", effects=_TIME),
    Mistake(_force_with_a_hum, "changes", effects=frozenset({"periodic_disturbance"})),
    Mistake(_spike_in_force, "spike"),
    Mistake(_spike_in_position, "spike"),
    Mistake(_spike_in_velocity, "spike", velocity=True),
    Mistake(_values_missing, "missing"),
    Mistake(_values_missing_as_zero, "missing"),
    Mistake(_values_missing_as_a_number, "missing"),
    Mistake(_force_missing_on_the_way_back, "missing", velocity=False),
    Mistake(_position_wraps, "wrap"),
    Mistake(_wrapped_position_filtered, "wrap", velocity=False),
    Mistake(_wrapped_position_with_lost_rows, "wrap"),
)
