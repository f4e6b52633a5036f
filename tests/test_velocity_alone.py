"""Recordings of velocity and force without a position: it is the velocity's integral."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric import signals
from jaxfric.explanation import inputs, zero
from jaxfric.explanation.evidence import gather
from jaxfric.explanation.motion import motion_of
from jaxfric.explanation.regression import fit

PITCH, AMPLITUDE = 0.012, 0.8
LAW = {"inertia": 2.0, "coulomb": 3.0, "viscous": 4.0}


def log(start: float, seed: int, noise: float = 0.01, **given) -> jf.Recording:
    """An axis with cogging that moves to and fro from `start` on, m; its velocity and force."""
    time = np.arange(6000) / 500
    rate, draws = 2 * np.pi * 0.31, np.random.default_rng(seed)
    position = start + 0.1 * np.sin(rate * time + 0.2 * seed) + 0.02 * np.sin(2.7 * rate * time)
    velocity, acceleration = (
        np.gradient(position, time),
        np.gradient(np.gradient(position, time), time),
    )
    force = LAW["inertia"] * acceleration + LAW["coulomb"] * np.sign(velocity)
    force += LAW["viscous"] * velocity + AMPLITUDE * np.sin(2 * np.pi * position / PITCH)
    force += draws.normal(0, noise, len(time))
    return jf.Recording(time=time, force=force, velocity=velocity, **given)


def test_the_integral_of_the_velocity_is_the_position_from_zero():
    given = log(0.3, 1)
    found = signals.placed(given)
    assert found.position_every == 0 and found.position[0] == 0
    exact = 0.3 + 0.1 * np.sin(2 * np.pi * 0.31 * np.asarray(given.time) + 0.2)
    exact += 0.02 * np.sin(2.7 * 2 * np.pi * 0.31 * np.asarray(given.time))
    np.testing.assert_allclose(found.position, exact - exact[0], atol=1e-4)
    assert signals.placed(found) is found


def test_an_invalid_sample_is_passed_over_and_a_gap_is_not():
    given = log(0.0, 1)
    whole = signals.placed(given).position
    lone = dataclasses.replace(given, mask=np.arange(6000) != 700)
    np.testing.assert_allclose(signals.placed(lone).position, whole, atol=1e-5)
    nothing = np.where(np.arange(6000) == 700, np.nan, np.asarray(given.velocity))
    np.testing.assert_allclose(
        signals.placed(dataclasses.replace(given, velocity=nothing)).position, whole, atol=1e-5
    )
    gap = dataclasses.replace(given, time=np.asarray(given.time) + (np.arange(6000) > 3000))
    assert signals.placed(gap).position is None
    parts = dataclasses.replace(given, segment=np.arange(6000) // 3000, num_segments=2)
    assert signals.placed(parts).position is None


@pytest.mark.slow
def test_identify_and_predict_read_the_position_that_a_velocity_implies():
    given = log(0.3, 1)
    model = jf.models.coulomb_viscous() + jf.terms.Cogging()
    fit = jf.identify(model, given)
    assert float(fit.model.parameters["pitch"]) == pytest.approx(PITCH, rel=1e-3)
    size = np.hypot(*(float(fit.model.parameters[f"cogging_{n}"]) for n in ("sin", "cos")))
    assert size == pytest.approx(AMPLITUDE, rel=0.01)
    moving = np.abs(given.velocity) > 0.02
    left = np.asarray(jf.predict(fit.model, given) - given.force)[moving]
    assert np.std(left) < 0.05 * AMPLITUDE
    both = jf.identify(model, jf.stack([given, log(0.0, 2)]))
    np.testing.assert_allclose(both.model.parameters["pitch"], PITCH, rtol=1e-3)


@pytest.mark.slow
def test_cogging_is_explained_without_a_position_and_confirmed_from_another_start():
    found = jf.explain(log(0.3, 1), holdout=log(0.2041, 2))
    assert found.verdict == "explained" and [each.effect for each in found.findings] == ["cogging"]
    cogging = found.findings[0]
    assert cogging.confirmed and not cogging.instead
    assert float(cogging.parameters["pitch"].value) == pytest.approx(PITCH, rel=1e-3)
    assert float(cogging.parameters["amplitude"].value) == pytest.approx(AMPLITUDE, rel=0.02)
    held = found.fit["holdout_force_error"]
    assert held["after"] < 0.1 * held["before"]
    assert any(each["name"] == "position_integrated" for each in found.warnings)
    ours = jf.predict(found.model, log(0.3, 1))
    assert jnp.isfinite(ours).all()


def with_position(given: jf.Recording, start: float) -> jf.Recording:
    return dataclasses.replace(given, position=signals.placed(given).position + start)


@pytest.mark.slow
@pytest.mark.parametrize("which", ["recording", "holdout"])
def test_one_of_two_recordings_has_a_position(which):
    here, there = log(0.3, 1), log(0.2041, 2)
    if which == "recording":
        here = with_position(here, 0.7)
    else:
        there = with_position(there, 0.7)
    found = jf.explain(here, holdout=there)
    assert [each.effect for each in found.findings] == ["cogging"] and found.findings[0].confirmed
    held = found.fit["holdout_force_error"]
    assert held["after"] < 0.1 * held["before"]
    assert any(each["name"] == "position_integrated" for each in found.warnings)


def test_where_one_recording_has_a_gap_neither_is_integrated():
    here, there = log(0.3, 1), log(0.2041, 2)
    gap = dataclasses.replace(there, time=np.asarray(there.time) + (np.arange(6000) > 3000))
    assert all(
        each is given for each, given in zip(inputs._placed(here, gap), (here, gap), strict=True)
    )
    assert all(each.position is not None for each in inputs._placed(here, there))


def test_a_wave_of_several_harmonics_is_sought_over_its_whole_period():
    given = log(0.3, 1)
    seen = gather(motion_of(signals.placed(given)))
    term = jf.terms.Cogging(harmonics=3)
    model = fit([term], seen, [np.array([PITCH])])
    places = zero._places(model, seen, seen)
    assert places[0] == 0 and places[-1] == pytest.approx(float(model.betas[0][0]))
    model = fit([term, jf.terms.Spring()], seen, [np.array([PITCH]), np.zeros(0)])
    places = zero._places(model, seen, seen)
    assert places[-1] - places[0] == pytest.approx(2 * (seen.limits.high - seen.limits.low))


@pytest.mark.slow
def test_friction_alone_needs_no_word_of_a_position():
    time = np.arange(6000) / 500
    given = log(0.0, 3)
    plain = np.asarray(given.force) - AMPLITUDE * np.sin(
        2 * np.pi / PITCH * (0.1 * np.sin(2 * np.pi * 0.31 * time + 0.6)
                             + 0.02 * np.sin(2.7 * 2 * np.pi * 0.31 * time))
    )  # fmt: skip
    found = jf.explain(dataclasses.replace(given, force=plain))
    assert found.verdict == "consistent"
    assert not any(each["name"] == "position_integrated" for each in found.warnings)
