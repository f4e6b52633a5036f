"""A hard limit of force that is reached in short accelerations between long stretches of slip."""

import numpy as np
import pytest

from jaxfric import Recording, models
from jaxfric.explanation import problem, sanity
from jaxfric.explanation.motion import motion_of


def demanded(inertia, friction, speeds, limit, excess, rate=1000.0, cruise=1.2):
    """There and back at each speed, and the loop's demand, N, of an axis that is accelerated by all
    that a limit leaves, N, and slowed down by half of it; `excess` is asked for in vain.
    """
    draw = np.random.default_rng(1)
    up, down = (limit - friction) / inertia, (0.5 * limit + friction) / inertia
    v, force = [], []
    for speed in np.outer(speeds, (1, -1)).ravel():
        parts = [int(rate * abs(speed) / up), int(cruise * rate), int(rate * abs(speed) / down)]
        ramps = np.arange(parts[0]) / parts[0], 1 - np.arange(parts[2]) / parts[2]
        v += [speed * ramps[0], np.full(parts[1], speed), speed * ramps[1], np.zeros(20)]
        beyond = excess * draw.uniform(0.3, 1) * np.sin(np.pi * ramps[0]) ** 2
        levels = limit + beyond, np.full(parts[1], friction), np.full(parts[2], -0.5 * limit)
        force += [*(np.sign(speed) * each for each in levels), np.zeros(20)]
    v, force = np.concatenate(v), np.concatenate(force)
    time, x = np.arange(len(v)) / rate, np.cumsum(v) / rate
    return Recording(time, force + 0.03 * friction * draw.standard_normal(len(v)), x, v)


@pytest.mark.parametrize(
    ("inertia", "friction", "speeds", "limit"),
    [(300.0, 150.0, (0.2, 0.5, 0.9, 0.6), 1500.0), (2e-4, 0.02, (35.0, 20.0, 15.0, 38.0), 0.09)],
)
def test_a_limit_in_short_accelerations_is_found(inertia, friction, speeds, limit):
    machine = inertia, friction, speeds, limit
    asked = motion_of(demanded(*machine, 0.5 * limit))
    assert 0 < np.mean(np.abs(asked.recording.force) > 1.05 * limit) < 0.1
    bound = sanity.bounded(asked, problem.problem_of(asked, models.gaussian()), None)
    assert float(bound.limit.value) == pytest.approx(limit, rel=0.02)
    # A machine whose force all arrives has none.
    arrived = motion_of(demanded(*machine, 0.0))
    assert sanity.bounded(arrived, problem.problem_of(arrived, models.gaussian()), None) is None
