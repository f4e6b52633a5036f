"""Friction that passes zero speed gradually is no other friction, and no gap and no push."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

import jaxfric as jf
from jaxfric import PD, Encoder, models, simulate
from jaxfric.explanation import least_squares
from jaxfric.terms import Coulomb, Directional, SmoothCrossing

NAME = "smooth_friction"
PARAMETERS = (*models.gaussian().affine, *models.gaussian().nonlinear)
STRUCTURE = models.gaussian() + Directional(SmoothCrossing())
FRICTION = {"coulomb": 20.0, "viscous": 60.0, "stribeck_force": 8.0, "stribeck_velocity": 0.012}


def record(width, seed, smoothed=28.0):
    """Moves from place to place of an axis whose friction is tanh(v/width) of what it would be."""
    rng, time = np.random.default_rng(seed), np.arange(20000) / 1000.0
    values = FRICTION | {"smoothed_force": smoothed, "crossing_velocity": width}
    own = {f"{name}{sign}": value for name, value in values.items() for sign in "+-"}
    machine = models.from_parameters(STRUCTURE, own | {"inertia": 5.0})
    x, at, first = np.zeros_like(time), 0.0, 0
    while first < len(time):
        to, speed = rng.uniform(-0.2, 0.2), 0.3 * rng.uniform(0.1, 1.0)
        span = max(1.9 * abs(to - at) / speed, 0.1)
        share = np.clip((time[first:] - time[first]) / span, 0, 1)
        x[first:] = at + (to - at) * share**3 * (10 - 15 * share + 6 * share**2)
        at, first = to, first + int(1000 * (span + rng.uniform(0, 0.2)))
    v = np.gradient(x, time)
    channels = {"reference": jnp.asarray(x), "reference_velocity": jnp.asarray(v)}
    clock = jf.Recording(time, np.zeros_like(time), x, v, channels=channels)
    run = simulate(
        machine, clock, PD(kp=5.0 * 60**2, kd=2 * 5.0 * 60), encoder=Encoder(resolution=1e-6),
        force_noise=0.3, key=jax.random.key(seed), substeps=16,
    )  # fmt: skip
    return dataclasses.replace(run, channels={}, velocity=None)


def test_the_law_makes_a_hyperbolic_tangent_of_a_jump():
    speed = np.concatenate([-np.geomspace(1e-6, 1, 50), np.geomspace(1e-6, 1, 50)])
    none = np.zeros_like(speed)
    motion = jf.Recording(none, none, none, speed)
    both = (Coulomb() + SmoothCrossing(0.01)).columns(motion) @ np.array([3.0, 3.0])
    np.testing.assert_allclose(both, 3 * np.tanh(speed / 0.01), rtol=1e-9, atol=1e-15)


@settings(max_examples=40, deadline=None)
@given(
    force=st.floats(0.1, 10),
    bump=st.floats(0, 5),
    lacking=st.floats(-3, 30),
    seed=st.integers(0, 9),
)
def test_friction_does_not_drive_whatever_it_lacks(force, bump, lacking, seed):
    """Of least squares no friction at rest is below zero, with what is taken off it."""
    speed = np.linspace(0.02, 1, 200)
    columns = np.stack([np.ones(200), np.exp(-((speed / 0.2) ** 2)), np.tanh(speed / 0.05) - 1], 1)
    noise = 0.01 * np.random.default_rng(seed).standard_normal(200)
    target = columns @ np.array([force, bump, lacking]) + noise
    bumps, dry = np.array([0.0, 1.0, -1.0]), np.array([1.0, 0.0, 0.0])
    found = least_squares.bounded(columns, target, bumps, dry, 1e3)
    assume(found[0] > 0)  # a force with the wrong sign is for others to tell
    at_rest = found[0] + found[1] - found[2]
    assert at_rest >= -1e-9 and found[1] >= 0 and found[2] >= 0
    if 0 <= lacking <= force + bump and bump > 0.1:
        np.testing.assert_allclose(found, [force, bump, lacking], atol=0.5)


@pytest.mark.slow
def test_a_gradual_crossing_is_named_with_its_width():
    found = jf.explain(record(0.002, 0), holdout=record(0.002, 1))
    assert found.verdict == "explained"
    assert [finding.effect for finding in found.findings] == [NAME]
    values = found.findings[0].parameters
    for sign in "+-":
        assert float(values[f"crossing_velocity{sign}"].value) == pytest.approx(0.002, rel=0.05)
        assert float(values[f"smoothed_force{sign}"].value) == pytest.approx(28.0, rel=0.05)
    errors = found.fit["holdout_force_error"]
    assert errors["after"] < 0.5 * errors["before"]
    again = simulate(found.model, record(0.002, 1), None)
    assert np.isfinite(np.asarray(again.velocity)).all()


@pytest.mark.slow
def test_one_that_noise_hides_is_a_part_of_the_baseline():
    found = jf.explain(record(0.006, 0), holdout=record(0.006, 1))
    assert found.verdict == "consistent" and not found.findings
    remarks = [each for each in found.warnings if each["name"] == NAME]
    assert len(remarks) == 1 and "part of the baseline" in remarks[0]["text"]
    assert {"crossing_velocity+", "crossing_velocity-"} <= set(found.baseline_parameters)
    errors = found.fit["force_error"]
    assert errors["before"] == errors["after"]
    # Beside a model that is given with its values nothing is put right in silence.
    values = found.model.parameters
    given = models.from_parameters(
        models.gaussian(), {p.name: float(values[p.name]) for p in PARAMETERS}
    )
    told = jf.explain(record(0.006, 0), given, record(0.006, 1))
    assert NAME in [finding.effect for finding in told.findings]


@pytest.mark.slow
def test_a_jump_stays_one():
    found = jf.explain(record(1e-5, 0), holdout=record(1e-5, 1))
    assert found.verdict == "consistent" and not found.findings
    assert not [each for each in found.warnings if each["name"] == NAME]
