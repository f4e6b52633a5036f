"""A hard end stop is named by where the axis stands pressed, and nothing else is taken for one."""

import dataclasses

import jax
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.explanation.motion import motion_of
from jaxfric.explanation.problem import problem_of
from jaxfric.explanation.sanity import stopped

from .stops import Axis, beyond, inside, log


def seen(run, held=None):
    """The hard stops of a log by a generic baseline."""
    with jax.enable_x64(True):
        motion = motion_of(run)
        problem = problem_of(motion, jf.models.gaussian())
        for candidates in problem.candidate_sets:
            candidates.close()
        return stopped(motion, problem, None if held is None else motion_of(held))


@pytest.mark.slow
def test_a_hard_stop_is_named_with_its_place_and_nothing_else():
    """Standing at it shows in no row: this axis was "consistent", and end stops "would have been
    seen from" a thousandth of its force.
    """
    axis = Axis(stop=0.4, restitution=0.3)
    found = jf.explain(log(axis, beyond(1)), holdout=log(axis, beyond(2), seed=1))
    (stop,) = found.findings
    assert (stop.effect, stop.confirmed, found.verdict) == ("end_stop", True, "explained")
    low, high = stop.parameters["stop_position"].interval()
    assert low < 0.4 < high and high - low < 0.005
    assert "end_stop" not in {each["effect"] for each in found.not_visible}
    assert "it stands there 2 times, pressed by up to 4" in stop.sentence
    healthy = seen(log(Axis(), beyond(1)))
    assert healthy.stops == [] and not healthy.leans


def test_the_ends_of_a_sweep_on_bristles_are_no_stops():
    """The baseline has no bristles, and bends its friction to none at rest to make up for them."""
    rate, low, high = 2000, 1.5, 6.0
    t = np.arange(16000) / rate
    span = t[-1] / np.log(high / low)
    x = 180e-6 * np.sin(2 * np.pi * low * span * ((high / low) ** (t / t[-1]) - 1))
    # It rests at either end once.
    upper = int(np.argmax(x[:4000]))
    lower = upper + int(np.argmin(x[upper : upper + 4000]))
    rests = np.full(60, x[upper]), np.full(60, x[lower])
    parts = x[:upper], rests[0], x[upper:lower], rests[1], x[lower:]
    x = np.concatenate(parts)[: len(t)]
    v, bristle = np.gradient(x, t), np.zeros_like(x)
    for n, way in enumerate(np.diff(x), 1):  # Dahl's, exactly along each step
        fade = np.exp(-abs(way) / 8e-6)
        bristle[n] = np.sign(way) * (1 - fade) + bristle[n - 1] * fade
    noise = 0.02 * np.random.default_rng(0).normal(size=len(t))
    force = 2.0 * np.gradient(v, t) + 10.0 * bristle + 120.0 * v + noise
    assert seen(jf.Recording(t, force, position=5e-9 * np.round(x / 5e-9))).stops == []


@pytest.mark.slow
@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("restitution", [0.0, 0.25, 0.5])
@pytest.mark.parametrize(
    ("scale", "rotary", "stiffness", "speed"),
    [
        ((1.0, 1.0), False, 2e4, 0.8),
        ((1e-6, 3.0), True, 1e5, 0.8),
        ((5e3, 0.01), False, 1e6, 0.8),
        ((0.02, 0.5), True, 2e4, 0.1),
    ],
)
def test_its_interval_holds_its_place(way, restitution, scale, rotary, stiffness, speed):
    axis = Axis(stop=0.4, restitution=restitution, stiffness=stiffness)
    targets = beyond(3, 8, (3, 6)) if speed < 0.5 else beyond(3)
    run = log(axis, targets, 3, way, scale, rotary, speed=speed)
    (stop,) = seen(run).stops
    low, high = stop.contact.place.interval()
    place = way * 0.4 * scale[1]
    assert low < place < high and high - low < 0.01 * scale[1]
    assert (stop.contact.upper, stop.visits) == (way > 0, 2)
    assert stop.stiffness < stiffness * scale[0] / scale[1]
    kept = np.asarray(stop.contact.without(run).mask)
    assert not kept[way * np.asarray(run.position) > 0.4 * scale[1]].any() and kept.mean() > 0.7


@pytest.mark.slow
def test_both_ends():
    axis = Axis(stop=0.4, lower=-0.45, restitution=0.2)
    targets = [*beyond(4, 10, (3, 7)), -0.48, 0.1, -0.48, 0.2, -0.3]
    stops = seen(log(axis, targets)).stops
    assert [stop.contact.upper for stop in stops] == [True, False]
    for stop, place in zip(stops, (0.4, -0.45), strict=True):
        low, high = stop.contact.place.interval()
        assert low < place < high


@pytest.mark.slow
def test_the_held_out_recording_confirms_or_refutes_it():
    axis = Axis(stop=0.4)
    run = log(axis, beyond(1))
    away, there = log(axis, inside(5), 5), log(axis, beyond(5), 5)
    passes = log(dataclasses.replace(axis, stop=None), beyond(6), 6)
    told = [seen(run, held).stops[0].confirmed for held in (away, there, passes)]
    assert told == [None, True, False]
    found = jf.explain(run, holdout=passes)
    (gone,) = found.not_confirmed
    assert (gone.effect, gone.confirmed, found.findings) == ("end_stop", False, [])
    assert found.verdict == "unexplained"


ENDS = [0.3, 0.1, -0.2, 0.44, 0.44, 0.44, 0.0, -0.4, 0.2, 0.44, 0.1, -0.3]
UPPER = (3.0, 7.0)  # while it is at 0.44 m


@pytest.mark.slow
@pytest.mark.parametrize(
    "axis",
    {
        "none": Axis(),
        "sticks at the end": Axis(static=1.95, gains=(100.0, 20.0, 100.0)),
        "sticks without an integral": Axis(static=1.9, gains=(40.0, 12.0, 0.0)),
        "a weight": Axis(weight=6.0),
        "a weight, the drive off": Axis(weight=6.0, brake=UPPER, drive=False),
        "a weight the other way, the drive off": Axis(weight=-6.0, brake=UPPER, drive=False),
        "a limit switch": Axis(brake=UPPER, drive=False),
        "a spring": Axis(pulls=8.0, most=8.0),
        "a pendulum": Axis(swings=6.0, most=9.0),
        "a brake in the middle, wound up": Axis(brake=(8.5, 10.5)),
    }.items(),
    ids=lambda pair: pair[0],
)
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_nothing_else_is_taken_for_a_stop(axis, way):
    for seed in range(2):
        assert seen(log(axis[1], ENDS, seed, way)).stops == []


@pytest.mark.slow
@pytest.mark.parametrize("late", [-20, 20])
def test_a_late_force_is_no_stop(late):
    run = log(Axis(), [*inside(1), *ENDS])
    run = dataclasses.replace(run, force=np.roll(np.asarray(run.force), late))
    assert seen(run).stops == []
