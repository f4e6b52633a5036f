"""A force whose clock runs faster than the motion's, by a baseline that is fitted."""

import importlib
import re

import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import Recording, explain, models
from jaxfric.explanation.motion import motion_of
from jaxfric.explanation.problem import problem_of
from jaxfric.explanation.sanity import drifting

TIME = np.arange(0.0, 20.0, 2e-3)
RATES = 2 * np.pi * np.array([0.3, 0.8, 2.2])
SIZES = np.array([0.15, 0.06, 0.015])


def moved(time, scale=1.0):
    """Position, velocity and acceleration."""
    angle = np.outer(time, RATES) + np.array([0.0, 1.0, 2.0])
    waves = np.sin(angle), RATES * np.cos(angle), -(RATES**2) * np.sin(angle)
    return [scale * (wave @ SIZES) for wave in waves]


def log(late=0.0, rate=0.0, heavier=0.0, sticks=0.0, unit=1.0):
    """An axis whose force is `late` in the middle and by `rate` more each second; whose load is
    heavier in the second half; whose friction falls as it warms.
    """
    then = TIME - late - rate * (TIME - 10.0)
    _, v, a = moved(then)
    mass = 2.5 + heavier * (then > 10.0)
    force = mass * a + 8 * np.sign(v) * (1 + sticks * np.exp(-then / 8.0)) + 20 * v
    force = force + 0.3 * np.random.default_rng(0).normal(size=len(TIME))
    return Recording(TIME, unit * force, moved(TIME)[0])


def said(recording):
    motion = motion_of(recording)
    return drifting(motion, problem_of(motion, models.coulomb_viscous()))


@pytest.mark.parametrize("unit", [1.0, 1e-3])
@pytest.mark.parametrize(("late", "rate", "way"), [(0.0, 1e-3, "later"), (-0.01, -1e-3, "earlier")])
def test_a_clock_that_runs_faster_is_told_by_how_much(late, rate, way, unit):
    remark = said(log(late, rate, unit=unit))
    assert remark is not None and remark.severe and remark.name == "clock"
    numbers = re.search(r"at t (\S+) s (\S+) \(t − 9\.999 s\)", remark.text)
    assert numbers, remark.text
    np.testing.assert_allclose([*map(float, numbers.groups())], [late, rate], rtol=0.01, atol=1e-4)
    assert f"{way} each second" in remark.text


@pytest.mark.parametrize(
    "machine",
    [{}, {"late": 0.01}, {"heavier": 1.0}, {"heavier": -1.0, "late": 0.005}, {"sticks": 0.5}],
)
def test_what_changes_or_is_late_is_no_other_clock(machine):
    assert said(log(**machine)) is None


def test_interrupted_logs_are_left_alone():
    whole = log(rate=1e-3)
    parts = jnp.asarray((TIME > 5.0).astype(np.int32))
    split = Recording(whole.time, whole.force, whole.position, segment=parts)
    assert said(split) is None


def test_put_right_as_it_says_nothing_is_left():
    """The numbers that it tells are those to take the force by."""
    found = importlib.import_module("jaxfric.explanation.sanity.drifting")
    run = log(-0.01, -1e-3)
    motion = motion_of(run)
    late = found._late(motion, problem_of(motion, models.coulomb_viscous()), 2)
    np.testing.assert_allclose(late.clock, [-0.01, -1e-3], rtol=5e-3)
    there = TIME + late.clock[0] + late.clock[1] * (TIME - TIME.mean())
    put = np.interp(there, TIME, np.asarray(run.force))
    assert said(Recording(TIME, put, run.position)) is None


@pytest.mark.slow
def test_nothing_is_named_beside_two_clocks():
    answer = explain(log(rate=1e-3), "coulomb-viscous")
    assert answer.verdict == "unexplained" and not answer.findings
    warning = next(each for each in answer.warnings if each["name"] == "clock")
    assert warning["severe"] and "Log both by one clock" in warning["text"]
