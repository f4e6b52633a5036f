"""What changes at one moment, on machines of a few lines: an arm in rad, a slide in mm."""

import dataclasses

import jax
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.validation.concealed import draw, record
from jaxfric.validation.proof import planning

MOMENT = 5.0


def ran(change, turning, seconds=12.0, rate=500):
    """A recording of a loop whose `load` or `gain` is another from the moment on, and a simulator
    of the axis as it was before.
    """
    size, inertia, weight, coulomb, viscous = (
        (1.0, 0.8, 6.0, 1.5, 0.6) if turning else (150.0, 0.004, 0.0, 12.0, 0.02)
    )
    draw, step = np.random.default_rng(3), 1 / (4 * rate)
    time = step * np.arange(round(seconds / step))
    rates, sizes = 2 * np.pi * np.array([0.23, 0.61, 1.1]), size * np.array([0.5, 0.2, 0.08])
    angles = rates * time[:, None] + draw.uniform(0, 2 * np.pi, 3)
    goals, speeds = np.sin(angles) @ sizes, np.cos(angles) @ (sizes * rates)
    place, speed, rows = goals[0], speeds[0], []
    for now, goal, wanted in zip(time, goals, speeds, strict=True):
        load = 1.3 if change == "load" and now > MOMENT else 1.0
        gain = 1.2 if change == "gain" and now > MOMENT else 1.0
        force = inertia * (3600 * (goal - place) + 120 * (wanted - speed)) + weight * np.cos(place)
        resists = coulomb * np.tanh(speed / (1e-3 * size)) + viscous * speed
        acting = force / gain - resists - load * weight * np.cos(place)
        acceleration = acting / (load * inertia)
        simulated = inertia * acceleration + weight * np.cos(place) + resists
        rows.append((now, force, place, simulated))
        speed += step * acceleration
        place += step * speed
    time, force, place, simulated = np.array(rows)[::4].T
    force = force + 0.004 * np.sqrt(np.mean(force**2)) * draw.normal(size=force.size)
    count = 2 * np.pi / 2**16 if turning else 1e-3
    units = {"force": "N·m", "position": "rad"} if turning else {"force": "N", "position": "mm"}
    recording = jf.Recording(time, force, count * np.round(place / count), units=units)
    return recording, jf.simulators.Known(simulated)


@pytest.mark.slow
@pytest.mark.parametrize("turning", [True, False])
@pytest.mark.parametrize(
    ("change", "effect", "name", "relative"),
    [
        ("load", "payload_change", "payload_inertia", 0.3),
        ("gain", "gain_step", "step_gain", None),
    ],
)
def test_a_change_at_one_moment_is_named_with_it(change, effect, name, relative, turning):
    recording, simulator = ran(change, turning)
    found = jf.explain(recording, simulator)
    best = found.findings[0]
    assert best.effect == effect and best.share > 0.8
    assert best.parameters["step_time"].value == pytest.approx(MOMENT, abs=0.1)
    truth = 0.2 if relative is None else relative * (0.8 if turning else 0.004)
    assert best.parameters[name].value == pytest.approx(truth, rel=0.1)
    assert "At t = " in best.sentence


@pytest.mark.slow
@pytest.mark.parametrize(("begin", "seconds"), [(4.0, 2.5), (7.2, 0.8)])
def test_a_force_that_acts_for_a_while_is_told_with_its_times(begin, seconds):
    recording, simulator = ran("", True)
    time = np.asarray(recording.time)
    acts = (time > begin) & (time < begin + seconds)
    recording = dataclasses.replace(recording, force=recording.force + 0.9 * acts)
    (finding,) = jf.explain(recording, simulator).findings
    assert finding.effect == "disturbance_force" and "From t = " in finding.sentence
    truth = {"push_time": begin, "push_duration": seconds, "push_force": 0.9}
    for name, value in truth.items():
        low, high = finding.parameters[name].interval()
        assert low < value < high and high - low < 0.5 * value


@pytest.mark.slow
def test_the_moment_of_a_change_is_anywhere_while_the_axis_rests():
    """Between two moves a force may have begun at any time: the interval holds all of them."""
    time = np.arange(0.0, 24.0, 2e-3)
    speed = np.where(time % 4 < 2.5, 0.3 * np.sin(2 * np.pi * (time % 4) / 2.5), 0.0)
    friction = 8 * np.sign(speed) + 5 * speed
    force = 2 * np.gradient(speed, time) + friction + np.where(time > 11.8, 3.0, 0.0)
    force += 0.05 * np.random.default_rng(2).normal(size=len(time))
    recording = jf.Recording(time, force, velocity=speed)
    (finding,) = jf.explain(recording, "coulomb-viscous").findings
    low, high = finding.parameters["step_time"].interval()
    assert low < 10.6 and 11.9 < high < 14
    assert float(finding.parameters["step_offset"].value) == pytest.approx(3.0, rel=0.02)


@pytest.mark.slow
def test_where_nothing_changes_no_moment_is_named():
    recording, simulator = ran("", True)
    assert jf.explain(recording, simulator).findings == []


@pytest.mark.slow
def test_what_is_none_beside_the_base_s_own_values_is_not_reported():
    """Friction by acceleration, which no effect has: a load of 0 ± 185 kg was named."""
    case = planning.plan(48, 20261401, (0.1, 0.3))[47]
    machine = draw(case.seed, case.effects, case.size, dict(case.definitions))
    runs = record(machine)
    with jax.enable_x64(True):
        told = jf.explain(runs.recording, machine.baseline, runs.holdout)
    for finding in told.findings:
        sizes = [e.interval() for e in finding.parameters.values() if hasattr(e, "interval")]
        assert any(low * high > 0 for low, high in sizes), finding.sentence
    # Friction by the force of inertia has a part of it, the rest is said to be left.
    assert told.verdict == "partly_explained" and told.where
    assert {each.effect for each in told.findings} <= {"load_dependent_friction"}
