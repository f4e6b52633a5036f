"""No change is missed in silence: early ones, faster motion, and faults of a stream."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jaxfric import online
from jaxfric.cli import main
from jaxfric.online import changepoint
from tests.test_online import friction

RATE = 200.0


def plain(v):
    """Coulomb and viscous friction, N."""
    return np.where(v > 0, 20 + 60 * v, -18 + 80 * v)


def strokes(count, slip=plain, noise=0.3, seed=0, amplitude=0.15):
    """Time, velocity and force of an axis of 5 kg, `count` strokes each way of a second."""
    t = np.arange(round(2 * count * RATE)) / RATE
    v = amplitude * np.sin(np.pi * t)
    a = amplitude * np.pi * np.cos(np.pi * t)
    rng = np.random.default_rng(seed)
    return np.stack([t, v, 5 * a + slip(v) + noise * rng.normal(size=t.size)], axis=1)


def changed(values, at, more=10.0):
    """More Coulomb friction from a stroke on."""
    values = values.copy()
    values[:, 2] += np.where(values[:, 0] > 2 * at, more * np.sign(values[:, 1]), 0.0)
    return values


def follow(values, **how):
    follower = online.Follower(slowest=1e-3, fastest=0.3, **how)
    return follower, [c for row in values.tolist() if (c := follower.add(*row))]


@pytest.mark.parametrize("at", [3, 5, 8, 12, 15, 16, 20, 40])
def test_a_large_change_is_detected_whenever_it_comes(at):
    """Also while a reference is identified, and while the charts learn."""
    follower, changes = follow(changed(strokes(at + 12, seed=at), at))
    assert len(changes) == 1 and 2 * at < changes[0].time < 2 * at + 14
    assert changes[0].excess == pytest.approx(10, rel=0.2)
    found = follower.assess().parameters
    for name, value in {"coulomb+": 30, "coulomb-": 28, "viscous+": 60, "viscous-": 80}.items():
        assert abs(float(found[name].value) - value) < 2 * float(found[name].half_width()), name


def test_it_says_from_when_on_changes_are_detected():
    follower, _ = follow(strokes(2))
    assert follower.learning and follower.changes_from == (changepoint.BEGIN, 17)
    follower, _ = follow(strokes(18))
    assert not follower.learning


@given(
    seed=st.integers(0, 2**31), count=st.integers(3, 32), at=st.floats(2.0, 30.0),
    varied=st.booleans(),
)  # fmt: skip
@settings(max_examples=50, deadline=None)
def test_two_levels_are_told_from_one(seed, count, at, varied):
    """Of a law that is a line of speed nothing is found at one in a million, of a step the step."""
    rng = np.random.default_rng(seed)
    speed = rng.uniform(0.05, 0.2, count) if varied else np.full(count, 0.1)
    force = 20 + 60 * speed + 0.01 * rng.normal(size=count)
    assert changepoint.split(speed, force, 1e-6) is None
    at = int(at)
    if count < 10 or not 4 <= at <= count - 4:
        return
    force[at:] += 5
    found = changepoint.split(speed, force, 1e-6)
    assert found is not None and found.strokes == count - at
    assert found.shift == pytest.approx(5, rel=0.05)


def test_the_last_strokes_give_fewer_false_alarms_than_stated():
    rng = np.random.default_rng(3)
    rate, tries = 0.05, 2000
    alarms = sum(
        changepoint.split(rng.uniform(0.05, 0.2, 12), rng.normal(20, 1, 12), rate) is not None
        for _ in range(tries)
    )
    assert alarms < rate * tries + 3 * np.sqrt(rate * tries)


def test_a_lone_fast_sample_changes_nothing():
    values = strokes(40)
    spiked = changed(values, 25, 4.0)
    spiked[int(30.25 * RATE), 1] = 50.0
    follower, changes = follow(spiked)
    assert follower.fastest == 0.3 and len(changes) == 1 and 50 < changes[0].time < 60
    state, _ = jax.jit(lambda s, x: jax.lax.scan(online.update, s, x))(
        online.start(1e-3, 0.3), jnp.asarray(spiked)
    )
    assert float(state.nodes[-1]) == pytest.approx(0.3)


def test_what_was_learnt_stays_when_the_axis_moves_faster_once():
    values = strokes(40)
    fast = (values[:, 0] > 36) & (values[:, 0] < 38)
    values[fast, 1] *= 3
    values[fast, 2] = plain(values[fast, 1])
    follower, changes = follow(changed(values, 25, 4.0))
    assert 0.45 < follower.fastest < 0.9  # twice the fastest at most
    assert len(changes) == 1 and 50 < changes[0].time < 60


def test_a_change_after_the_axis_moves_faster_is_detected():
    slow, fast = strokes(20), strokes(40, amplitude=0.6, seed=1)
    fast[:, 0] += 40
    values = np.concatenate([slow, fast])
    assert not follow(values)[1]
    changes = follow(changed(values, 45))[1]
    assert len(changes) == 1 and 90 < changes[0].time < 98


@pytest.mark.parametrize("how", [{}, {"keep": 20.0}, {"window": 12}])
def test_intervals_hold_the_truth(how):
    """Of 40 streams two are expected outside, and in each four parameters."""
    outside = 0
    for seed in range(10):
        found = follow(strokes(12, seed=seed), **how)[0].assess()
        assert found.passive and not found.faults
        for name, value in {"coulomb+": 20, "coulomb-": 18, "viscous+": 60, "viscous-": 80}.items():
            low, high = found.parameters[name].interval()
            outside += not float(low) < value < float(high)
    assert outside <= 8


def test_what_speaks_against_a_result_is_found():
    values = strokes(12)
    values[:, 2] *= -1
    found = follow(values)[0].assess()
    assert not found.passive and found.faults["negative_parameter"] >= 2
    found = follow(strokes(12, friction))[0].assess()
    assert found.passive and found.faults["structure_left"] > 0.02
    assert np.isinf(float(follow(strokes(1))[0].assess().parameters["coulomb+"].standard_error))


def write(path, values):
    rows = "\n".join(",".join(f"{x:.9g}" for x in row) for row in values)
    path.write_text(f"time,velocity,force\n{rows}\n")


def watched(path, capsys):
    assert main(["watch", str(path), "--once", "--json"]) == 0
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


@pytest.mark.slow
def test_watch_tells_learning_errors_and_faults(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    path = tmp_path / "axis.csv"
    write(path, changed(strokes(20), 12))
    told = watched(path, capsys)
    assert [d["event"] for d in told].count("change") == 1
    first, *_, last = (d for d in told if d["event"] == "parameters")
    assert first["learning"] and first["changes_from"] == [changepoint.BEGIN, 17]
    assert last["standard_errors"].keys() == last["parameters"].keys()
    assert 0 < last["standard_errors"]["coulomb+"] < 1
    assert main(["watch", str(path), "--once"]) == 0
    said = capsys.readouterr().out
    assert "learning: large changes" in said and " ± " in said

    values = strokes(12)
    values[:, 2] = 12.3
    write(path, values)
    assert "force_constant" in {d.get("name") for d in watched(path, capsys)}
    values = strokes(12)
    values[:, 2] *= -1
    write(path, values)
    assert {"not_passive", "negative_parameter"} <= {d.get("name") for d in watched(path, capsys)}


def test_watch_says_what_the_clock_does(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    path = tmp_path / "axis.csv"
    write(path, strokes(8)[::-1])
    assert main(["watch", str(path), "--once"]) == 2
    assert "axis.csv: row 3: time does not increase" in capsys.readouterr().err
    values = strokes(8)
    values[2000:, 0] -= 9.0
    write(path, values)
    clock = [d for d in watched(path, capsys) if d["event"] == "clock"]
    assert len(clock) == 1 and clock[0]["row"] == 2002 and clock[0]["steps"] == 1
