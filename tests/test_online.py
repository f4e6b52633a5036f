"""Identification while the axis runs: sums, parameters, change detection, streams."""

import io
import json
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import jaxfric as jf
from jaxfric import online
from jaxfric.cli import main
from jaxfric.online import chart, feed, moments, solving

RATE, PERIOD = 500.0, 2.0


def friction(v, size=1.0):
    """An asymmetric Lorentzian axis, N."""
    forward = 20 + 8 / (1 + (v / 0.02) ** 2) + 60 * v
    return size * np.where(v > 0, forward, -18 - 10 / (1 + (v / 0.03) ** 2) + 80 * v)


TRUTH = {
    "coulomb+": 20, "viscous+": 60, "stribeck_force+": 8, "stribeck_velocity+": 0.02,
    "coulomb-": 18, "viscous-": 80, "stribeck_force-": 10, "stribeck_velocity-": 0.03,
}  # fmt: skip


def stream(seconds, noise=0.5, size=None, seed=0):
    """Time, position, velocity and force of an axis of 5 kg."""
    t = np.arange(round(seconds * RATE)) / RATE
    w = 2 * np.pi / PERIOD
    x = -0.1 / w * np.cos(w * t) - 0.05 / (3 * w) * np.cos(3 * w * t + 0.3)
    v = 0.1 * np.sin(w * t) + 0.05 * np.sin(3 * w * t + 0.3)
    a = 0.1 * w * np.cos(w * t) + 0.15 * w * np.cos(3 * w * t + 0.3)
    size = 1.0 if size is None else size(t)
    rng = np.random.default_rng(seed)
    return t, x, v, 5 * a + friction(v, size) + noise * rng.normal(size=t.size)


def samples(seconds, **how):
    t, _, v, u = stream(seconds, **how)
    return jnp.stack([jnp.asarray(t), jnp.asarray(v), jnp.asarray(u)], axis=1)


@jax.jit
def run(state, values):
    return jax.lax.scan(online.update, state, values)


def followed(seconds, model="lorentzian", **how):
    """A follower after a stream, and its changes."""
    options = {k: how.pop(k) for k in ("keep", "window", "false_alarms") if k in how}
    follower = online.Follower(model, slowest=1e-3, fastest=0.2, **options)
    changes = [follower.add(*row) for row in np.asarray(samples(seconds, **how)).tolist()]
    return follower, [c for c in changes if c]


@pytest.mark.slow
def test_the_parameters_are_those_of_the_axis_without_its_mass():
    state, news = run(online.start(1e-3, 0.2), samples(60, noise=0.0))
    assert list(state.strokes) == [29, 30] and int(np.sum(news.closed)) == 59
    found = online.solve(solving.friction_only("lorentzian"), state)
    assert bool(found.settled)
    for name, value in found.model.parameters.items():
        assert float(value) == pytest.approx(TRUTH[name], rel=2e-3), name
    simple = online.solve(solving.friction_only("coulomb-viscous"), state)
    batch = jf.identify("coulomb-viscous", log_of(60, noise=0.0))
    for name, value in simple.model.parameters.items():
        assert float(value) == pytest.approx(float(batch.parameters[name].value), rel=0.05), name


def log_of(seconds, **how):
    t, x, v, u = stream(seconds, **how)
    return jf.Recording(t, u, position=x, velocity=v)


@pytest.mark.slow
@given(
    speeds=st.lists(st.floats(1e-3, 3.9), min_size=1, max_size=20),
    nodes=st.integers(4, 33),
    wider=st.floats(1.0, 30.0),
)
@settings(max_examples=30, deadline=None)
def test_wider_nodes_keep_the_time_and_the_mean_speed(speeds, nodes, wider):
    narrow = np.geomspace(1e-3, 4.0, nodes)
    wide = np.geomspace(1e-3, 4.0 * wider, nodes)
    before = np.sum(moments.hats(narrow, np.array(speeds)), axis=0)
    after = before @ moments.hats(wide, narrow)
    assert np.sum(after) == pytest.approx(len(speeds)) and np.all(after >= 0)
    assert after @ wide == pytest.approx(np.sum(speeds))
    state = online.start(1e-3, 4.0, nodes=nodes)
    sums = jnp.stack([jnp.asarray(before)] * 2)
    moved = moments.wider(
        state._replace(total=moments.Sums(sums, sums, jnp.zeros(2))), jnp.asarray(2.0 * wider)
    )
    np.testing.assert_allclose(moved.nodes, wide, rtol=1e-9)
    np.testing.assert_allclose(moved.total.weight[0], after, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("how", [{}, {"keep": 5.0}, {"window": 4}])
def test_faster_samples_widen_the_nodes(how):
    """Little of what was gathered is lost, and the object does what the scan does."""
    values = np.array(samples(20))
    values[:3000, 1] *= 0.02  # slow at first
    values[:, 2] = 20 * np.sign(values[:, 1]) + 60 * values[:, 1]
    values = jnp.asarray(values)
    narrow, _ = run(online.start(1e-3, 0.006, **how), values)
    wide, _ = run(online.start(1e-3, 0.3, **how), values)
    follower = online.Follower("coulomb-viscous", slowest=1e-3, fastest=0.006, **how)
    for row in np.asarray(values).tolist():
        follower.add(*row)
    for ours, theirs in zip(follower.state().total, narrow.total, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9)
    fastest = float(jnp.max(jnp.abs(values[:, 1])))
    assert fastest < follower.fastest < moments.ABOVE * fastest
    found, wanted = (online.solve(follower.term, each).model.parameters for each in (narrow, wide))
    for name, value in wanted.items():
        assert float(found[name]) == pytest.approx(float(value), rel=1e-2), name
    assert not np.isfinite(narrow.reference).any()


def test_no_change_is_told_where_the_axis_only_moves_faster():
    """The line through slow motion says nothing of the friction at ten times the speed."""
    t, _, v, u = stream(60)
    slow = np.where(t < 30, 0.1, 1.0)
    v = slow * v
    u = friction(v) + np.random.default_rng(1).normal(size=t.size)
    follower = online.Follower("coulomb-viscous", slowest=1e-3, fastest=0.03)
    told = [follower.add(*row) for row in np.stack([t, v, u], axis=1).tolist()]
    assert not [change for change in told if change] and follower.fastest > 0.1


@pytest.mark.parametrize("how", [{}, {"keep": 5.0}, {"window": 4}])
def test_the_object_does_what_the_scan_does(how):
    values = samples(20)
    state, _ = run(online.start(1e-3, 0.2, **how), values)
    follower, changes = followed(20, "coulomb-viscous", **how)
    assert not changes
    for ours, theirs in zip(follower.state().total, state.total, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-12)
    assert follower.strokes == tuple(int(c) for c in state.strokes)


@pytest.mark.slow
def test_memory_is_constant_and_the_update_is_pure():
    state = online.start(1e-3, 0.2)
    shapes = jax.tree.map(jnp.shape, state)
    after, _ = run(state, samples(5))
    assert jax.tree.map(jnp.shape, after) == shapes
    batch = jax.vmap(run, in_axes=(None, 0))(state, jnp.stack([samples(5), samples(5, seed=1)]))[0]
    np.testing.assert_allclose(batch.total.load[0], after.total.load)


def test_forgetting_follows_a_warm_up():
    """Friction falls by a third in a minute; what forgets in 5 s of slip lags by about that."""

    def size(t):
        return 1 + 0.5 * np.exp(-t / 20)

    values = samples(60, size=size)
    term = solving.friction_only("coulomb-viscous")
    speeds = np.array([0.05, -0.05, 0.1, -0.1])
    whole, fading = (
        np.asarray(
            online.solve(term, run(online.start(1e-3, 0.2, keep=keep), values)[0])
            .model.friction(jnp.asarray(speeds))
        )
        for keep in (math.inf, 5.0)
    )  # fmt: skip
    level = friction(speeds, size(np.array(60.0)))
    assert np.max(np.abs(fading / level - 1)) < 0.06
    assert np.min(np.abs(whole / level - 1)) > 0.08


@pytest.mark.slow
def test_a_step_of_friction_is_detected_and_followed():
    follower, changes = followed(120, size=lambda t: np.where(t > 80, 1.1, 1.0))
    assert len(changes) == 1
    change = changes[0]
    assert 80 < change.time < 84 and change.excess > 0 and 0.01 < change.share < 0.12
    found = follower.solution().model
    at = jnp.asarray([0.05, -0.05, 0.1, -0.1])
    np.testing.assert_allclose(found.friction(at), friction(np.asarray(at), 1.1), rtol=0.01)


def alarms(values, rate):
    """Alarms of a chart over values, `(N, C)`: charts side by side."""
    height = chart.threshold(rate)
    empty = chart.empty(jnp.zeros(values.shape[1]))
    return jax.jit(
        lambda v: jax.lax.scan(lambda c, x: chart.add(c, x, height), empty, v)[1]
    )(values)  # fmt: skip


@pytest.mark.parametrize("rate", [1e-2, 1e-3])
def test_the_false_alarm_rate_is_what_is_stated(rate):
    """Half a million strokes without a change: at ten a minute, a month of running."""
    values = jax.random.normal(jax.random.key(0), (4000, 125)) * 3.0 + 7.0
    found = float(jnp.mean(alarms(values, rate)))
    assert 0.6 * rate < found < 1.25 * rate  # a chart just begun has not yet climbed


@pytest.mark.slow
def test_the_false_alarm_rate_over_simulated_months():
    values = jax.random.normal(jax.random.key(1), (100_000, 40))
    assert 0.7e-4 < float(jnp.mean(alarms(values, 1e-4))) < 1.3e-4


@pytest.mark.slow
def test_a_long_stream_without_a_change_gives_no_alarm():
    """1000 strokes at one in ten thousand; the noise is that of the samples."""
    _, changes = followed(1000, "lorentzian")
    assert not changes


def test_gaps_and_missing_samples_break_a_stroke_only():
    values = np.array(samples(20))
    values[3000:3010, 2] = np.nan
    values = np.delete(values, slice(6000, 6400), axis=0)
    state, _ = run(online.start(1e-3, 0.2), jnp.asarray(values))
    whole, _ = run(online.start(1e-3, 0.2), samples(20))
    assert 1 <= int(jnp.sum(whole.strokes - state.strokes)) <= 4
    follower = online.Follower("coulomb-viscous", slowest=1e-3, fastest=0.2)
    for row in values.tolist():
        follower.add(*row)
    assert follower.strokes == tuple(int(c) for c in state.strokes)


def test_misuse_is_said():
    with pytest.raises(ValueError, match="0 < slowest < fastest"):
        online.start(0.2, 0.1)
    with pytest.raises(ValueError, match="position"):
        online.Follower(jf.models.gaussian() + jf.terms.Cogging(), slowest=1e-3, fastest=0.1)
    with pytest.raises(ValueError, match="false alarms"):
        online.start(1e-3, 0.1, false_alarms=2.0)


def write(path, seconds=120.0):
    t, x, _, u = stream(seconds, size=lambda t: np.where(t > 80, 1.15, 1.0))
    rows = "\n".join(f"{a:.4f},{b:.8f},{c:.4f}" for a, b, c in zip(t, x, u, strict=True))
    path.write_text(f"time,position,force\n{rows}\n")


@pytest.mark.slow
def test_watch_follows_a_file(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    path = tmp_path / "axis.csv"
    write(path)
    assert main(["watch", str(path), "--once", "--json", "--model", "lorentzian"]) == 0
    told = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [d["event"] for d in told].count("change") == 1
    assert told[0]["sample_rate"] == pytest.approx(RATE) and told[0]["units"]["force"] == "N"
    last = told[-1]["parameters"]
    for name in ("coulomb+", "coulomb-", "viscous+", "viscous-"):
        assert last[name] == pytest.approx(1.15 * TRUTH[name], rel=0.05), name
    assert main(["watch", str(path), "--once", "--every", "40"]) == 0
    said = capsys.readouterr().out
    assert said.startswith(f"{path}: 500 Hz, force in N, position in m\n  Columns: time")
    assert "CHANGE" in said


def test_watch_says_when_the_axis_moves_faster_than_at_first(tmp_path, capsys, monkeypatch):
    """Ten seconds at a tenth of the speed decide no friction at full speed."""
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    t = np.arange(30 * 500) / 500
    v = np.where(t < 10, 0.02, 0.2) * np.sin(np.pi * t)
    u = np.sign(v) * 6 + 40 * v
    rows = "\n".join(f"{a:.4f},{b:.8f},{c:.4f}" for a, b, c in zip(t, v, u, strict=True))
    path = tmp_path / "axis.csv"
    path.write_text(f"time,velocity,force\n{rows}\n")
    assert main(["watch", str(path), "--once", "--json"]) == 0
    told = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    faster = [d for d in told if d["event"] == "faster"]
    assert len(faster) == 1 and 10 < faster[0]["time"] < 11 and faster[0]["fastest"] > 0.2
    last = told[-1]["parameters"]
    assert last["coulomb+"] == pytest.approx(6, rel=1e-2)
    assert last["viscous-"] == pytest.approx(40, rel=1e-2)
    # The room above the fastest sample is not the speed of the axis.
    assert told[0]["fastest_seen"] == pytest.approx(0.02, rel=1e-4)
    assert main(["watch", str(path), "--once"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "speeds up to 0.02 m/s so far; up to 0.04 m/s are told apart" in said


def test_watch_says_what_is_wrong(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    for text, said in (
        ("a,b\n1,2\n", "no column is recognised"),
        ("time,position,force\n0,0,0\n", "samples came"),
        ("time,position,force\n0,0\n", "row 2 has 2 cells"),
        ("time,position,force\n0,x,0\n", "no number"),
    ):
        monkeypatch.setattr("sys.stdin", io.StringIO(text))
        assert main(["watch", "-"]) == 2
        assert said in capsys.readouterr().err


def test_watch_follows_text_only(tmp_path, capsys):
    path = tmp_path / "axis.mat"
    path.write_bytes(b"\x9c\x00\xff")
    assert main(["watch", str(path), "--once"]) == 2
    assert "axis.mat: byte 0 is no text" in capsys.readouterr().err


def test_a_growing_file_is_read_line_by_line(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,force\n0,1\n1,")
    with path.open() as file:
        lines = feed.growing(file, once=False)
        assert [next(lines), next(lines)] == ["time,force\n", "0,1\n"]
        with path.open("a") as more:
            more.write("2\n")
        assert next(lines) == "1,2\n"


def test_the_delayed_derivative_has_no_lag():
    derivative = feed.Derivative(8, 1e-3)
    t = np.arange(2000) / 1000
    found = [derivative.add(feed.Sample(a, math.sin(a), math.nan, 0.0)) for a in t.tolist()]
    found = [m for m in found if m]
    np.testing.assert_allclose([m.velocity for m in found], [math.cos(m.time) for m in found],
                               atol=2e-5)  # fmt: skip
