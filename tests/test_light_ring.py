"""A lightly damped load that a chirp sweeps through: its peak is narrower than a grid's steps."""

import numpy as np
import pytest

from jaxfric import Recording, explain

MOTOR, LOAD, STIFFNESS, DAMPING = 0.004, 0.006, 38.0, 0.012


def swept(top, seed):
    """Motor and load on a spring, the motor's position following a chirp by its loop."""
    sub, rate = 10, 2000
    step, count = 1 / (rate * sub), 16 * rate * sub
    time = np.arange(count) * step
    factor = (top / 0.2) ** (time / 16)
    begun = np.minimum(time, 1.0)
    phase = 2 * np.pi * 0.2 * 16 / np.log(top / 0.2) * (factor - 1)
    fade = (0.035 / 2.5) ** (time / 16) * begun**3 * (10 - 15 * begun + 6 * begun**2)
    goal = 2.5 * fade * np.sin(phase)
    wanted = np.gradient(goal, step)
    ahead = (MOTOR + LOAD) * np.gradient(wanted, step)
    x = v = load = speed = 0.0
    rows = np.empty((16 * rate, 2))
    for k in range(count):
        if k % sub == 0:
            force = 1.57 * (31.0 * (goal[k] - x) + wanted[k] - v) + ahead[k]
            rows[k // sub] = x, force
        spring = STIFFNESS * (x - load) + DAMPING * (v - speed)
        friction = 0.05 * np.tanh(v / 1e-3) + (0.01 + 0.0035 * abs(v)) * v
        v += step * (force - spring - friction) / MOTOR
        speed += step * spring / LOAD
        x, load = x + step * v, load + step * speed
    draw = np.random.default_rng(seed)
    count = 2 * np.pi / 2**18
    position = count * np.round(rows[:, 0] / count)
    force = rows[:, 1] + 0.006 * draw.normal(size=len(rows))
    units = {"force": "N·m", "position": "rad"}
    return Recording(np.arange(len(rows)) / rate, force, position, units=units)


@pytest.mark.slow
def test_a_load_whose_peak_lies_between_the_grids_points_is_found():
    """By itself too: its blocks are few, and what the grid's best point leaves is no noise."""
    first, second = swept(16.0, 1), swept(18.0, 2)
    for run, other in ((first, second), (second, None)):
        answer = explain(run, "coulomb-viscous", other)
        load = next(each for each in answer.findings if each.effect == "compliance")
        resonance = load.parameters["load_resonance"]
        true = np.sqrt(STIFFNESS / LOAD) / (2 * np.pi)
        assert float(resonance.value) == pytest.approx(true, rel=2e-3)
        assert answer.verdict == "explained"
        errors = [answer.fit["filtered_force_error"]]
        errors += [answer.fit["filtered_holdout_force_error"]] if other is not None else []
        assert all(each["after"] < 0.01 * each["before"] for each in errors)
