"""Sticking at a reversal, or yielding: told from the displacement, in any unit."""

import dataclasses
import types

import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import Recording, explain
from jaxfric.explanation import evidence, regression, reversals, search, stepwise
from jaxfric.explanation.inputs import interpolated
from jaxfric.explanation.motion import motion_of
from jaxfric.explanation.problem import across_reversals, problem_of
from jaxfric.models import named
from jaxfric.terms.effects import EFFECTS
from jaxfric.validation import concealed

COUNT, RATE = 24000, 1000.0
TIME = np.arange(COUNT) / RATE
LEVEL, DISTANCE, PITCH = 20.0, 8e-6, 1e-6


def path(creep):
    """Strokes of about 0.1 m, with a pause of 50 ms after each in which the axis turns by `creep`.

    Position, direction of the stroke, and how much of the pause is over.
    """
    swing, pause = 0.75, 0.05
    leg = np.floor(TIME / (swing + pause)).astype(int)
    inside = TIME - leg * (swing + pause)
    share = 0.5 - 0.5 * np.cos(np.pi * np.minimum(inside / swing, 1.0))
    waited = np.clip((inside - swing) / pause, 0, 1)
    way = np.where(leg % 2 == 0, 1.0, -1.0)
    ends = np.where(np.arange(leg[-1] + 3) % 2 == 0, 0.0, 0.1)
    ends = ends + 0.03 * np.sin(2.3 * np.arange(len(ends)) ** 1.3)
    start, end = ends[leg] + way * creep, ends[leg + 1]
    return start + (end - start) * share - way * creep * waited, way, waited


def recorded(x, friction, seed=0, force_unit=1.0, unit=1.0):
    """Counts of an encoder, a mass of 2 kg, and a noise of 0.1 N."""
    speed = np.gradient(x, TIME)
    acceleration = np.gradient(np.convolve(speed, np.ones(9) / 9, "same"), TIME)
    noise = 0.1 * np.random.default_rng(seed).standard_normal(COUNT)
    force = 2.0 * acceleration + friction + 50.0 * speed + noise
    counts = PITCH * np.round(x / PITCH)
    return Recording(TIME, force_unit * force, unit * counts)


def yielding(**options):
    """Dahl's friction along strokes that turn back softly."""
    x, _, _ = path(6 * DISTANCE)
    z = np.ones(COUNT)
    for i, step in enumerate(np.diff(x), 1):
        keep = np.exp(-abs(step) / DISTANCE)
        z[i] = keep * z[i - 1] + (1 - keep) * np.sign(step)
    return recorded(x, LEVEL * z, **options)


def sticking(**options):
    """Coulomb friction: at rest the force passes from one level to the other."""
    x, direction, waited = path(0.0)
    return recorded(x, LEVEL * direction * (1 - 2 * waited), **options)


def creeping(**options):
    """Friction that is steep about zero velocity, as simulators regularise it: it creeps over."""
    x, _, _ = path(DISTANCE)
    speed = np.gradient(x, TIME)
    steep = 2e-3 * np.quantile(np.abs(speed), 0.98)
    return recorded(x, LEVEL * np.tanh(speed / steep), **options)


def yields(recording, seen=None):
    seen = seen or evidence.gather(motion_of(recording))
    base = regression.fit([named("symmetric-coulomb-viscous")], seen)
    return reversals.yields(recording, seen, base)


@pytest.mark.parametrize(("force_unit", "unit"), [(1.0, 1.0), (1e-6, 1e3)])
def test_an_axis_that_yields_is_told_from_one_that_sticks(force_unit, unit):
    for seed in range(3):
        assert yields(yielding(seed=seed, force_unit=force_unit, unit=unit))
        assert not yields(sticking(seed=seed, force_unit=force_unit, unit=unit))


@pytest.mark.slow
def test_a_curve_between_updates_of_the_position_is_no_motion():
    """It leaves the rest up to two samples before the axis breaks away."""
    machine = concealed.draw(1462541569, (), (0.1, 0.3), {"log": "held_position"})
    fresh, _ = interpolated(concealed.record(machine).recording)
    assert fresh.position_every == 3
    posed = problem_of(fresh, named(machine.baseline))
    assert not reversals.yields(fresh, posed.evidence, posed.base)
    blind = dataclasses.replace(fresh, position_every=1)
    assert reversals.yields(blind, posed.evidence, posed.base)


@pytest.mark.parametrize(("share", "known"), [(0.3, False), (3.0, True)])
def test_less_than_a_count_is_no_motion(share, known, monkeypatch):
    """At rest the position follows the force by a share of a count, beside noise."""
    x, direction, waited = path(0.0)
    level = direction * (1 - 2 * waited)
    rest = (waited > 0) & (waited < 1)
    dither = 0.3 * np.random.default_rng(1).standard_normal(COUNT)
    log = recorded(x + PITCH * (0.5 * share * level * rest + dither), LEVEL * level)
    sure = []
    monkeypatch.setattr(reversals, "_one_way", lambda slopes: sure.append(slopes) or True)
    assert yields(log) is known
    assert np.median(sure[0]) == pytest.approx(0.5 * share * PITCH, rel=0.5)


def test_another_zero_in_each_part_of_a_log_is_no_noise():
    log = yielding()
    part = (np.arange(COUNT) >= COUNT // 2).astype(np.int32)
    parts = dataclasses.replace(
        log, position=log.position + 5.0 * part, segment=jnp.asarray(part), num_segments=2
    )
    assert yields(parts)


@pytest.mark.slow
@pytest.mark.parametrize(("force_unit", "unit"), [(1.0, 1.0), (1e-6, 1e3)])
def test_an_axis_that_creeps_over_is_told_from_one_that_yields(force_unit, unit):
    """Below the slowest speed that is told from rest it is no friction over a distance."""
    for make, creeps in ((yielding, False), (creeping, True)):
        motion = motion_of(make(force_unit=force_unit, unit=unit))
        problem = problem_of(motion, named("symmetric-coulomb-viscous"))
        rows = evidence.gather(motion, problem.evidence.width, problem.delay, True)
        base = regression.fit([problem.structure], rows)
        assert reversals.creeps(rows, base) == creeps


def test_the_mirror_of_a_recording_says_the_same():
    for recording in (yielding(), sticking()):
        mirrored = dataclasses.replace(
            recording, position=-recording.position, force=-recording.force
        )
        assert yields(mirrored) == yields(recording)


def test_one_or_two_large_slopes_say_nothing_about_the_others():
    draw = np.random.default_rng(1)
    rest = 1e-10 * np.array([-1.0, -0.05, -0.03, 0.15, 0.4, 2.0, 3.0, 3.0, 4.0, 4.0, 5.0])
    assert reversals._one_way(np.concatenate([[0.4, 1.0], 1.0 + 0.1 * draw.normal(size=11)]))
    assert not reversals._one_way(np.concatenate([[0.4, 1.0], rest]))
    assert not reversals._one_way(draw.normal(size=13))


def test_without_a_position_nothing_is_said():
    recording = yielding()
    seen = evidence.gather(motion_of(recording))
    speed = jnp.gradient(recording.position, recording.time)
    bare = dataclasses.replace(recording, position=None, velocity=speed)
    assert yields(recording, seen) and not yields(bare, seen)


@pytest.mark.slow
def test_presliding_of_a_few_counts_is_named_with_its_distance():
    found = explain(yielding(), "symmetric-coulomb-viscous", yielding(seed=1))
    assert found.findings[0].effect == "presliding"
    parameters = found.findings[0].parameters
    assert abs(float(parameters["presliding_distance"].value) - DISTANCE) < 0.35 * DISTANCE
    assert abs(float(parameters["presliding_force"].value) - LEVEL) < 0.15 * LEVEL


def slipping(distances=(24e-6, 28e-6, 32e-6, 36e-6), **options):
    """Elements side by side along strokes that turn back softly, each with its own distance."""
    x, _, _ = path(20 * DISTANCE)
    bent = np.ones((COUNT, len(distances)))
    for i, step in enumerate(np.diff(x), 1):
        bent[i] = np.clip(bent[i - 1] + step / np.array(distances), -1, 1)
    return recorded(x, LEVEL * bent.mean(axis=1), **options)


@pytest.mark.slow
def test_presliding_of_elements_that_slip_one_by_one_is_no_load_on_a_spring():
    """Dahl's bristle has an exponential end: it was one, and a compliance of any frequency."""
    found = explain(slipping(), "symmetric-coulomb-viscous", slipping(seed=1))
    assert [each.effect for each in found.findings] == ["presliding"]
    parameters = found.findings[0].parameters
    assert float(parameters["presliding_force"].value) == pytest.approx(LEVEL, rel=0.05)
    names = "presliding_distance", "presliding_spread"
    last, spread = (float(parameters[name].value) for name in names)
    assert last * (1 - spread / 2) == pytest.approx(30e-6, rel=0.05)  # of all four the mean
    assert found.verdict == "explained"


def hilly(seed=0):
    """Presliding beside a force of position."""
    recording = yielding(seed=seed)
    hills = 3.0 * np.sin(2 * np.pi * recording.position / 0.02)
    return dataclasses.replace(recording, force=recording.force + hills)


def searched(recording):
    problem = problem_of(recording, named("symmetric-coulomb-viscous"))
    return search._selected(motion_of(recording), problem, 0, frozenset())


def names(found):
    return [taken.trial.candidate.effect.name for taken in found.selected]


@pytest.mark.slow
def test_what_does_not_act_at_reversals_is_found_without_them():
    problem, found = searched(hilly())
    assert problem.reversals and not problem.in_slip.reversals
    assert names(found.in_slip) == ["cogging"] and names(found)[0] == "cogging"
    assert all(EFFECTS[name].at_reversals for name in names(found)[1:]) and len(found.selected) > 1
    # Of the reversals, it is no start for another search.
    last, selected = stepwise.elsewhere(found)
    assert names(types.SimpleNamespace(selected=selected)) == ["cogging"]
    assert len(last.terms) == len(last.betas) == len(last.alphas) == 1 + len(selected)


@pytest.mark.slow
def test_reversals_that_are_left_out_since_the_axis_creeps_are_told():
    found = explain(creeping(), "symmetric-coulomb-viscous", creeping(seed=1))
    (remark,) = [each for each in found.warnings if each["name"] == "creeps"]
    assert not remark["severe"] and " m/s it is not told from a jump" in remark["text"]
    told = explain(sticking(), "symmetric-coulomb-viscous", sticking(seed=1)).warnings
    assert "creeps" not in {each["name"] for each in told}


@pytest.mark.slow
def test_an_axis_that_sticks_is_asked_once():
    recording = sticking()
    problem, found = searched(recording)
    assert not problem.reversals and found.in_slip is None
    assert across_reversals(recording, problem) is problem


def bent(seed, begin, distance=1e-3):
    """An axis with bristles that are bent by `begin` where its record begins at rest."""
    rng = np.random.default_rng(seed)
    time = np.arange(16000) / RATE
    leg, since = np.divmod(time, 1.0)
    leg, share = leg.astype(int), np.clip(since / 0.9, 0, 1)
    ends = 0.05 * (-1.0) ** np.arange(18) * (0.6 + 0.4 * rng.random(18))
    place = ends[leg] + (ends[leg + 1] - ends[leg]) * share**3 * (10 - 15 * share + 6 * share**2)
    state = np.full_like(place, begin)
    for i, way in enumerate(np.diff(place)):
        state[i + 1] = state[i] + (np.sign(way) - state[i]) * (1 - np.exp(-abs(way) / distance))
    speed = np.gradient(place, time)
    force = 5 * np.gradient(speed, time) + 20 * state + 60 * speed
    return Recording(time, force + rng.normal(0, 0.05, time.size), place)


@pytest.mark.slow
@pytest.mark.parametrize("begin", [1.0, pytest.param(0.0, marks=pytest.mark.slow)])
def test_what_a_machine_remembers_from_before_the_record_has_no_name(begin):
    found = explain(bent(1, begin), "coulomb-viscous", bent(2, 1.0))
    assert [each.effect for each in found.findings] == ["presliding"]
    assert found.verdict == "explained"


def test_short_segments_keep_their_rows():
    parts = {"run": np.repeat(np.arange(10), 10), "position": np.tile(np.arange(10.0), 10)}
    rows = np.arange(80)
    np.testing.assert_array_equal(evidence._known_from(parts, rows, rows, 5.0), rows)
    parts, rows = {"run": np.zeros(1000, int), "position": np.arange(1000.0)}, np.arange(800)
    np.testing.assert_array_equal(evidence._known_from(parts, rows, rows, 5.0), rows[6:])
