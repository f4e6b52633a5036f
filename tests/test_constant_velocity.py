"""The constant-velocity test (Kim, Kim & Ha 2004, fig. 8): points, gaps, contradictions."""

import dataclasses
import json

import jax
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.identification.constant_velocity import sentence
from jaxfric.identification.documents import to_json
from jaxfric.looks import drawing
from tests.machines import fleet

SPEEDS = (0.01, 0.03, 0.1)


def staircase(friction, seed=0, noise=0.3, rate=1000.0, ripple=0.0, hold=0.6):
    """An axis that holds each speed both ways, twice, with smooth ramps between."""
    rng, hold, ramp = np.random.default_rng(seed), round(hold * rate), round(0.15 * rate)
    levels = [0.0, *SPEEDS, 0.0, *(-s for s in SPEEDS), 0.0] * 2
    pieces, last = [], 0.0
    for level in levels:
        ease = 0.5 - 0.5 * np.cos(np.pi * np.arange(ramp) / ramp)
        pieces += [last + (level - last) * ease, np.full(hold if level else ramp, level)]
        last = level
    v = np.concatenate(pieces)
    t = np.arange(v.size) / rate
    v = v * (1 + ripple * np.sin(2 * np.pi * 40.0 * t))
    force = 5.0 * np.gradient(v, t) + friction(v) + noise * rng.normal(size=v.size)
    x = np.cumsum(v) / rate
    return jf.Recording(t, force, position=x, velocity=v + 1e-5 * rng.normal(size=v.size))


def bumped(v, bump=6.0):
    """Coulomb, viscous and Stribeck friction, N."""
    return np.sign(v) * (10 + bump * np.exp(-((v / 0.02) ** 2))) + 40 * v


def test_points_are_the_friction_at_the_speeds_held():
    test = jf.constant_velocity(staircase(bumped))
    assert [round(p.velocity, 4) for p in test.points] == sorted(
        s * sign for s in SPEEDS for sign in (1, -1)
    )
    for point in test.points:
        assert point.stretches == 2
        assert abs(point.force - bumped(point.velocity)) < 4 * point.standard_error
        assert point.high - point.low < 0.3
        assert np.isnan(point.curve) and not point.contradicts
    assert all(abs(g.low) < 0.02 or abs(g.high) < 0.08 for g in test.not_evaluated)
    lines = repr(test).splitlines()
    assert lines[0].split()[:2] == ["velocity", "force"] and lines[1].split()[0].startswith("-0.1")
    assert sum(line.startswith("not evaluated ") for line in lines) == len(test.not_evaluated)


@pytest.mark.slow
def test_a_dead_sensor_contradicts_no_curve():
    recording = staircase(bumped)
    dead = dataclasses.replace(recording, force=np.full(recording.num_samples, 3.0))
    test = jf.constant_velocity(dead, jf.identify("coulomb-viscous", dead))
    assert test.points and not test.contradicted


@pytest.mark.slow
def test_a_curve_that_is_too_simple_is_contradicted_and_the_right_one_is_not():
    recording = staircase(bumped)
    right, simple = (jf.identify(m, recording) for m in ("gaussian", "coulomb-viscous"))
    assert not jf.constant_velocity(recording, right).contradicted
    test = jf.constant_velocity(recording, simple)
    assert any(abs(p.velocity) < 0.02 for p in test.contradicted)
    document = simple.to_dict(recording)
    json.loads(to_json(document))
    assert document["warnings"][-1]["name"] == "constant_velocity"
    assert "contradicts the curve" in document["warnings"][-1]["text"]
    assert document["constant_velocity"]["points"][0].keys() == test.points[0]._asdict().keys()
    names = [w["name"] for w in right.to_dict(recording)["warnings"]]
    assert "constant_velocity" not in names


def test_intervals_hold_the_friction():
    """95 % of them; noise that is correlated over 20 ms as well."""
    inside = []
    for seed in range(40):
        recording = staircase(bumped, seed)
        rng = np.random.default_rng(1000 + seed)
        slow = np.convolve(rng.normal(size=recording.num_samples), np.ones(20) / 20**0.5, "same")
        recording = dataclasses.replace(recording, force=recording.force + 0.5 * slow)
        points = jf.constant_velocity(recording).points
        inside += [p.low < bumped(p.velocity) < p.high for p in points]
    assert np.mean(inside) > 0.92


@pytest.mark.slow
def test_healthy_machines_are_not_contradicted():
    """Multisines with hidden load and encoder, and staircases: no warning in any."""
    drawn = fleet(12, seed=5, model="gaussian")
    for i in range(12):
        log = jax.tree.map(lambda x, i=i: np.asarray(x[i]), drawn.recordings)
        assert not jf.constant_velocity(log, jf.identify("gaussian", log)).contradicted
    for seed in range(12):
        log = staircase(bumped, seed)
        assert not jf.constant_velocity(log, jf.identify("gaussian", log)).contradicted


def test_a_speed_that_is_held_in_the_mean_only_is_marked():
    test = jf.constant_velocity(staircase(bumped, ripple=0.5, hold=2.0))
    assert not test.points
    assert any("varied by 3" in gap.reason for gap in test.not_evaluated)
    assert "it varied by 3" in sentence(test, {"position": "m", "force": "N"})


def test_ramps_and_tips_are_no_constant_velocity():
    t = np.arange(4001) / 1000
    v = 0.2 * (1 - np.abs((t % 2) - 1) * 2) + 0.001 * np.random.default_rng(0).normal(size=t.size)
    recording = jf.Recording(t, bumped(v) + 5 * 0.4 * np.sign(np.sin(np.pi * t)), velocity=v)
    test = jf.constant_velocity(recording)
    assert not test.points and len(test.not_evaluated) == 2
    assert "none was held long enough" in sentence(test, {"position": "m", "force": "N"})


@pytest.mark.slow
def test_other_terms_are_taken_off_first():
    model = jf.models.coulomb_viscous() + jf.terms.Spring()
    recording = staircase(lambda v: np.where(v, 10 * np.sign(v) + 40 * v, 0.0))
    x = np.asarray(recording.position)
    recording = dataclasses.replace(recording, force=recording.force + 200 * x)
    found = jf.identify(model, recording)
    test = jf.constant_velocity(recording, found)
    assert test.points and not test.contradicted
    for p in test.points:
        assert abs(p.force - (10 * np.sign(p.velocity) + 40 * p.velocity)) < 0.5


@pytest.mark.slow
def test_it_is_drawn_and_takes_one_recording_only():
    recording = staircase(bumped)
    found = jf.identify("coulomb-viscous", recording)
    drawing.library()
    import matplotlib

    matplotlib.use("Agg")
    names = found.plot(recording).get_legend_handles_labels()[1]
    assert "at constant velocity, contradicts" in names
    assert "not evaluated at constant velocity" in names
    with pytest.raises(ValueError, match="batch"):
        jf.constant_velocity(jf.stack([recording] * 2))


@pytest.mark.slow
def test_emps_has_three_speeds_each_way(data_folder):
    emps = {"columns": {"force": "vir", "position": "qm", "reference": "qg"}}
    recording = jf.read(data_folder / "emps" / "DATA_EMPS.mat", **emps, scale={"force": 35.15065})
    test = jf.constant_velocity(recording, jf.identify("coulomb-viscous", recording))
    assert [round(p.velocity, 3) for p in test.points] == [
        -0.125, -0.083, -0.042, 0.042, 0.083, 0.125
    ]  # fmt: skip
    assert not test.contradicted
    assert all(p.stretches >= 4 for p in test.points)


def test_the_slow_motor_and_the_ramps_of_the_servo_have_none(data_folder):
    motor = jf.read(
        data_folder / "odrive" / "slow_compensated.csv",
        columns={"force": "current", "position": "position_counts"},
    )
    test = jf.constant_velocity(motor)
    assert not test.points
    assert any("varied by" in gap.reason for gap in test.not_evaluated)
    servo = jf.constant_velocity(jf.read(data_folder / "delta_servo" / "S1_1.csv"))
    assert not servo.points and len(servo.not_evaluated) == 2


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_of_one_speed_the_mean_force_is_told(noise):
    rng, t = np.random.default_rng(0), np.arange(4000) / 1000
    v = 0.05 + noise * rng.normal(size=t.size)
    log = jf.Recording(t, bumped(v) + 0.1 * rng.normal(size=t.size), 0.05 * t, v)
    found = jf.identify("coulomb-viscous", log)
    assert found.result_name == "not_excited"
    assert not np.isfinite(found.parameters["inertia"].standard_error)
    (point,) = jf.constant_velocity(log, found).points
    assert point.low < bumped(0.05) < point.high and point.seconds > 3
    if not noise:
        said = sentence(jf.constant_velocity(log, found), {"force": "N", "position": "m"})
        assert "the mean force is 12.01 ± 0.0" in said and "at 0.05 m/s." in said


def test_a_report_has_the_contradiction():
    recording = staircase(bumped)
    plain = jf.identify("coulomb-viscous", recording)
    assert jf.constant_velocity(recording, plain).contradicted
    assert "the force contradicts the curve" in " ".join(plain.report(recording).split())
