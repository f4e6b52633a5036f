"""What must not change the result: acceleration, units, clocks, the order of things."""

import dataclasses
from functools import cache

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import jaxfric as jf
from tests.test_identify import machine, recording

CLOSED = jf.ClosedWindows()


def friction(log, name="coulomb-viscous"):
    found = jf.identify(name, log, projection=CLOSED)
    values = {k: float(e.value) for k, e in found.parameters.items() if k != "inertia"}
    return values, float(found.parameters["inertia"].value)


@cache
def reference(name="coulomb-viscous"):
    """A recording, and what is found in it: once for all tests, and by those that run."""
    log = recording(machine(name), noise=0.1 if name == "gaussian" else 0.3, seconds=4.0)
    return log, *friction(log, name)


def acceleration(log):
    return jnp.gradient(log.velocity, log.time)


@settings(max_examples=10)
@given(st.floats(-50, 50))
def test_adding_acceleration_changes_no_friction_parameter(mass):
    """Lemma 1. The quadrature of the window's cuts is of second order in the interval."""
    log, values, own = reference()
    moved, inertia = friction(dataclasses.replace(log, force=log.force + mass * acceleration(log)))
    for key, value in values.items():
        most = 2e-3 * abs(mass) * (1 if "coulomb" in key else 10) + 1e-12 * abs(value)
        assert abs(moved[key] - value) <= most, key
    np.testing.assert_allclose(inertia, own + mass, rtol=0, atol=1e-3 * (1 + abs(mass)))


@pytest.mark.slow
def test_the_error_of_orthogonality_falls_with_the_square_of_the_interval():
    errors = []
    for rate in (500.0, 1000.0, 2000.0, 4000.0):
        log = recording(machine("coulomb-viscous", mass=0.0), seconds=4.0, rate=rate)
        heavy = recording(machine("coulomb-viscous", mass=100.0), seconds=4.0, rate=rate)
        light, loaded = friction(log)[0], friction(heavy)[0]
        errors.append(max(abs(loaded[k] - light[k]) for k in light if "coulomb" in k))
    # From 500 to 4000 Hz second order would give a factor of 64; the last digits are the stick
    # threshold's, which depends on the samples.
    assert errors[-1] < errors[0] / 8, errors


@settings(max_examples=10)
@given(st.floats(-6, 6), st.floats(-6, 6), st.floats(-3, 3))
def test_units_do_not_matter(force, position, time):
    f, x, t = 10.0**force, 10.0**position, 10.0**time
    for name in ("coulomb-viscous", "gaussian"):
        log, values, _ = reference(name)
        scaled = dataclasses.replace(
            log,
            time=log.time * t,
            force=log.force * f,
            position=log.position * x,
            velocity=log.velocity * x / t,
        )
        moved, _ = friction(scaled, name)
        factors = {
            "coulomb": f,
            "stribeck_force": f,
            "viscous": f * t / x,
            "stribeck_velocity": x / t,
        }
        for key, value in values.items():
            expected = value * factors[key.rstrip("+-")]
            np.testing.assert_allclose(moved[key], expected, rtol=1e-5, err_msg=key)


@settings(max_examples=5)
@given(st.floats(-1e3, 1e3))
def test_a_shift_in_time_does_not_matter(shift):
    log, values, _ = reference("gaussian")
    moved, _ = friction(dataclasses.replace(log, time=log.time + shift), "gaussian")
    for key, value in values.items():
        np.testing.assert_allclose(moved[key], value, rtol=1e-6, err_msg=key)


def test_a_mirrored_axis_has_its_sides_swapped():
    log, values, _ = reference("gaussian")
    mirrored = dataclasses.replace(
        log, force=-log.force, position=-log.position, velocity=-log.velocity
    )
    moved, _ = friction(mirrored, "gaussian")
    swap = {"+": "-", "-": "+"}
    for key, value in values.items():
        np.testing.assert_allclose(moved[key[:-1] + swap[key[-1]]], value, rtol=1e-8)


def pieces(order):
    """The recording as two closed windows (from rest to rest), in a given order, with a gap."""
    log = reference("gaussian")[0]
    v = np.asarray(log.velocity)
    middle = 1 + int(np.argmin(np.abs(v[1000:3000]))) + 1000
    cut = [slice(0, middle), slice(middle, v.size)]

    def join(name):
        return np.concatenate([np.asarray(getattr(log, name))[cut[i]] for i in order])

    lengths = [v[cut[i]].size for i in order]
    segment = np.repeat([0, 1], lengths)
    return jf.Recording(
        time=join("time"), force=join("force"), velocity=join("velocity"), segment=segment
    )


@pytest.mark.slow
def test_the_order_of_windows_does_not_matter():
    first, _ = friction(pieces((0, 1)), "gaussian")
    second, _ = friction(pieces((1, 0)), "gaussian")
    for key, value in first.items():
        np.testing.assert_allclose(second[key], value, rtol=1e-8, err_msg=key)


@pytest.mark.slow
def test_padding_does_not_matter():
    log, values, own = reference("gaussian")
    moved, mass = friction(jf.pad(log, log.num_samples + 777), "gaussian")
    for key, value in values.items():
        np.testing.assert_allclose(moved[key], value, rtol=1e-8, err_msg=key)
    np.testing.assert_allclose(mass, own, rtol=1e-8)
