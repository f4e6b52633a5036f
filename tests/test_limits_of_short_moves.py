"""A force limit that only short moves between long dwells reach."""

import numpy as np
import pytest

import jaxfric as jf

KNEE, INTERVAL = 280.0, 1e-3


def picking(seed: int) -> jf.Recording:
    """Fast and slow moves with dwells: a peak of fourteen times the root-mean-square force."""
    chance = np.random.default_rng(seed)
    place, ways = 0.0, []

    def move(way: float, seconds: float, dwell: float) -> float:
        share = np.arange(round(seconds / INTERVAL)) * INTERVAL / seconds
        ways.append(place + way * share**3 * (10 - 15 * share + 6 * share**2))
        ways.append(np.full(round(dwell / INTERVAL), place + way))
        return place + way

    for _ in range(14):
        place = move(
            -np.sign(place or 1) * chance.uniform(0.05, 0.15), chance.uniform(0.06, 0.18), 1.5
        )
        place = move(-np.sign(place) * chance.uniform(0.03, 0.06), 1.0, 0.2)
    position = np.concatenate(ways)
    time = INTERVAL * np.arange(position.size)
    velocity = np.gradient(position, time)
    side = np.tanh(velocity / 1e-4)
    force = 4 * np.gradient(velocity, time) + 8 * velocity
    force += side * (6 + 4 * np.exp(-((velocity / 0.02) ** 2)))
    force += np.sign(force) * np.maximum(np.abs(force) - KNEE, 0)
    force += chance.normal(0, 0.3, force.size)
    return jf.Recording(time, force, np.round(position / 1e-6) * 1e-6)


@pytest.mark.slow
def test_a_limit_at_many_times_the_mean_force_is_named():
    given = picking(1)
    size = np.sqrt(np.mean(np.asarray(given.force) ** 2))
    assert KNEE > 5 * size
    (found,) = jf.explain(given, "gaussian", picking(2)).findings
    assert found.effect == "actuator_saturation" and found.confirmed
    # Four moves reach it, so that its interval is of two degrees of freedom, and wide.
    knee = found.parameters["knee"]
    low, high = knee.interval()
    assert low < KNEE < high and knee.value == pytest.approx(KNEE, rel=0.05)
