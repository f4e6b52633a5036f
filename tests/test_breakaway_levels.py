"""Break-away levels identified from where a recording leaves a dwell."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.identification.breakaway import Curve, Transition, _level, breakaway, sentence
from jaxfric.looks import drawing
from tests.test_breakaway import axis

RATE, BANDWIDTH, MASS = 1000.0, 35.0, 5.0


def recorded(levels, dwell=0.25, seed=0):
    """Strokes of 0.1 m/s with dwells between, in closed loop, both ways."""
    t = np.arange(round(7 * RATE) + 1) / RATE
    v = np.zeros_like(t)
    at, sign = 0.2, 1.0
    while at < t[-1] - 1.2:
        since = t - at
        v += sign * 0.1 * np.clip(np.minimum(since, 0.6 - since) / 0.1, 0, 1)
        at, sign = at + 0.6 + dwell, -sign
    x = np.cumsum(v) / RATE
    wanted = {"reference": jnp.asarray(x), "reference_velocity": jnp.asarray(v)}
    clock = jf.Recording(t, 0 * t, position=x, channels=wanted)
    loop = jf.PD(kp=MASS * BANDWIDTH**2, kd=2 * MASS * BANDWIDTH)
    run = jf.simulate(axis(levels), clock, loop, encoder=jf.Encoder(1e-6), substeps=2)
    force = np.asarray(run.force)
    force = 0.5 * (force + np.concatenate([force[:1], force[:-1]]))
    force = force + 0.1 * np.random.default_rng(seed).normal(size=force.size)
    return jf.Recording(run.time, jnp.asarray(force), position=run.position)


@pytest.fixture(scope="module")
def found():
    log = recorded((-27.0, 30.0))
    fit = jf.identify("coulomb-viscous", log)
    return log, fit, breakaway(log, fit)


def test_levels_beyond_the_slip_curve_are_found_with_their_intervals(found):
    _, fit, test = found
    for level, true in zip(test.levels, (-27.0, 30.0), strict=True):
        assert level.low <= true <= level.high and level.transitions >= 3
        assert level.value == pytest.approx(true, rel=0.05)
        assert level.beyond and abs(level.curve) < 21
    np.testing.assert_allclose(test.model.breakaway, [level.value for level in test.levels])
    assert fit.model.breakaway is None
    assert "Break-away: backward" in sentence(test, {"force": "N", "position": "m"})


def test_without_any_the_slip_curve_stands_for_them():
    log = recorded(None)
    test = breakaway(log, jf.identify("coulomb-viscous", log))
    assert len(test.levels) == 2
    for level in test.levels:
        assert min(level.low, level.high) <= level.curve <= max(level.low, level.high)
        assert not level.beyond
    assert test.model.breakaway is None


def test_they_stand_in_the_document_and_in_the_picture(found):
    log, fit, test = found
    document = fit.to_dict(log)
    assert document["model"]["breakaway"]["forward"] == pytest.approx(test.levels[1].value)
    assert [each["direction"] for each in document["breakaway"]["levels"]] == [-1, 1]
    axes = drawing.figure(4, 3).subplots()
    drawing.broken_away(axes, test)
    assert len(axes.containers) == 2


def test_a_recording_without_a_dwell_says_so():
    t = np.arange(2000) / 500
    v, a = np.sin(12 * t), 12 * np.cos(12 * t)
    recording = jf.Recording(t, 2 * a + 8 * np.sign(v) + v, velocity=v)
    test = breakaway(recording, jf.identify("coulomb-viscous", recording))
    assert not test.levels and "dwell" in test.why and "dwell" in repr(test)
    assert sentence(test, {"force": "N", "position": "m"}) == ""


def test_levels_that_scatter_down_to_zero_are_none():
    curve = Curve(*(np.full(2, x) for x in (0.0, 15.0, 14.0, 16.0)))
    alike = [Transition(0.0, -1, 1.0, x, x - 1, x + 1) for x in (14.0, 15.0, 16.0)]
    level = _level(alike, -1, curve)
    assert level.high == pytest.approx(-14 + 4.303 / 3**0.5, rel=1e-3) and level.transitions == 3
    apart = [each._replace(value=v) for each, v in zip(alike, (3.0, 15.0, 60.0), strict=True)]
    assert _level(apart, -1, curve) is None


@pytest.mark.slow
def test_a_level_that_may_be_zero_is_none(data_folder):
    """The servo is off within the noise of its force: a level there would be under its friction."""
    servo = jf.read(data_folder / "delta_servo" / "S1_1.csv")
    test = breakaway(servo, jf.identify("gaussian", servo))
    assert not test.levels and "told from zero" in test.why
