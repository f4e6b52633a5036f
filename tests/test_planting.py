"""Forces planted in recordings: what is planted, and what is counted as found."""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.identification.uncertainty import Estimate
from jaxfric.validation import proof
from jaxfric.validation.proof import trials

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import comparing
import planting
import real_proof

LOGS = [planting.Log(name, f"{name}.csv", None, "coulomb-viscous", {}) for name in ("a-b", "c")]


@pytest.fixture(scope="module")
def recording():
    """Seven strokes of 0.2 m with 20 N of Coulomb friction and 5 kg."""
    time = np.arange(4000) * 2e-3
    x = 0.1 * np.sin(2 * np.pi * 0.9 * time) * (1 + 0.1 * np.sin(time))
    v = np.gradient(x, time)
    force = 20 * np.sign(v) + 50 * v + 5 * np.gradient(v, time)
    noise = 0.2 * np.random.default_rng(1).normal(size=time.size)
    return jf.Recording(time=time, force=force + noise, position=x)


LEVEL = (20.0, 5.0)


# The plan


def test_the_effects_take_turns_in_every_log_and_size():
    cases = planting.plan(LOGS, (0.05, 0.1), 4, 1)
    assert [c.name for c in cases if not c.effects] == ["a-b-own", "c-own"]
    planted = [c for c in cases if c.effects]
    assert len(planted) == 16 and len({c.name for c in planted}) == 16
    names = [c.effects[0] for c in planted]
    assert set(names[: len(planting.planted())]) == set(planting.planted())
    assert [c.size[0] for c in planted[:8]] == [0.05] * 4 + [0.1] * 4
    assert planting.plan(LOGS, (0.05, 0.1), 4, 1) == cases


def test_a_second_bump_is_not_planted():
    logs = [LOGS[0]._replace(baseline="gaussian")]
    cases = planting.plan(logs, (0.1,), 40, 1)
    assert not [c for c in cases if "stribeck" in c.effects]


def test_a_plan_of_nothing_is_refused():
    with pytest.raises(ValueError, match="at least one"):
        planting.plan(LOGS, (), 4, 1)


# What is planted


@pytest.mark.slow
@pytest.mark.parametrize("name", planting.planted())
def test_the_force_has_its_size(recording, name):
    case = proof.Case("a-001", "single", 5, (name,), (0.1, 0.1))
    truth, (force, held) = planting.plant(recording, recording, LEVEL, name, case)
    assert truth["size"] == pytest.approx(0.1, rel=0.3)
    # Of a spring or a weight the mean is the baseline's offset.
    size = np.std(force) if planting.kind(name).centred else np.sqrt(np.mean(force**2))
    assert size == pytest.approx(truth["size"] * 20, rel=1e-6)
    if name == "disturbance_pulses":  # pushes come at other times
        assert np.max(np.abs(held - force)) > 0.1 * np.max(np.abs(force))
    else:
        np.testing.assert_allclose(held, force)


def test_no_force_is_planted_that_acts_at_rest_only():
    """Nine tenths of the time it stands at its lower end, where quantiles put a stop."""
    time = np.arange(4000) * 2e-3
    x = 0.05 * (1 - np.cos(2 * np.pi * np.clip(time - 7, 0, 0.9) / 0.9))
    x = x + 1e-6 * np.round(np.random.default_rng(1).normal(size=time.size))
    still = jf.Recording(time=time, force=np.zeros_like(time), position=x)
    case = proof.Case("a-001", "single", 5, ("end_stop",), (0.1, 0.1))
    motion = planting.nominal(still, *LEVEL)
    try:
        _, (force,) = planting.plant(still, None, LEVEL, "end_stop", case)
    except ValueError as error:
        assert "no room for end_stop" in str(error)
    else:
        assert np.sum(force[motion.way != 0] ** 2) > 0.5 * np.sum(force**2)


def test_units_do_not_matter(recording):
    case = proof.Case("a-001", "single", 5, ("cogging",), (0.1, 0.1))
    _, (force,) = planting.plant(recording, None, LEVEL, "cogging", case)
    small = jf.Recording(
        time=recording.time, force=recording.force * 1e-6, position=recording.position * 1e3
    )
    _, (tiny,) = planting.plant(small, None, (20e-6, 5e-9), "cogging", case)
    np.testing.assert_allclose(tiny, 1e-6 * force, rtol=1e-6, atol=1e-9 * np.max(np.abs(force)))


# What is counted


def finding(effect, *alike, **parameters):
    values = {k: {"value": v, "standard_error": e} for k, (v, e) in parameters.items()}
    told = {"effect": effect, "confusable_with": list(alike), "parameters": values}
    return told | {"share": 0.5}


def said(*findings, where=(), before=0.1, after=0.05):
    return {
        "error": None,
        "verdict": "explained",
        "where": [
            {"coordinate": name, "size": size, "share": share} for name, size, share in where
        ],
        "findings": list(findings),
        "fit": {"holdout_force_error": {"before": before, "after": after}},
        "oracle": None,
        "seconds": 1.0,
        "code": "abc",
        "held_norm": 100.0,
        "own_norm": 100.0,
    }


def named(answer, own, *effects):
    return [f["effect"] for f in comparing.difference(answer, own, effects)["findings"]]


def test_what_was_there_before_is_not_counted():
    own = said(finding("cogging", pitch=(2.5, 0.01)), finding("frictional_lag"))
    again = finding("cogging", pitch=(2.52, 0.02))
    other = finding("cogging", pitch=(4.0, 0.02))
    assert named(said(again, finding("frictional_lag")), own, "spring") == []
    assert named(said(again, other), own, "cogging") == ["cogging"]


def test_a_machine_has_one_stop_at_each_end():
    own = said(finding("end_stop", lower_stop_position=(0.11, 0.01)))
    below = finding("end_stop", lower_stop_position=(0.07, 0.01))
    above = finding("end_stop", stop_position=(0.2, 0.01))
    assert named(said(below), own, "cogging") == []
    assert named(said(above), own, "cogging") == ["end_stop"]


def test_an_own_finding_under_another_name_is_not_counted():
    own = said(finding("frictional_lag"))
    renamed = finding("end_stop", "frictional_lag")
    assert named(said(renamed), own, "spring") == []
    assert named(said(renamed), own, "end_stop") == ["end_stop"]
    assert named(said(renamed, finding("frictional_lag")), own, "spring") == ["end_stop"]


def test_a_finding_that_takes_in_an_own_one_and_is_declared_confusable_with_the_planted_counts():
    own = said(finding("end_stop"), where=[("position", 2.0, 1.0)])  # 4 N²
    both = finding("gravity_unbalance", "spring", "end_stop")
    now = said(both, where=[("position", 4.0, 1.0)])  # 16 N², 8 of them the finding's
    assert named(now, own, "spring") == ["gravity_unbalance"]
    assert named(now, own, "cogging") == []
    small = {**both, "share": 0.3}
    assert named({**now, "findings": [small]}, own, "spring") == []


def test_a_place_counts_where_structure_has_grown():
    own = said(where=[("position", 2.0, 1.0)])  # 4 N² in all
    now = said(where=[("position", 2.5, 0.5), ("time", 0.1, 0.0)])  # 12.5 N²
    grown = comparing.difference(now, own, ("spring",))["where"]
    assert [place["coordinate"] for place in grown] == ["time"]
    now = said(where=[("position", 3.0, 0.72)])
    assert comparing.difference(now, own, ("spring",))["where"]


def test_the_same_effect_planted_counts_if_it_has_grown():
    own = said(finding("spring"), where=[("position", 2.0, 1.0)])
    now = said(finding("spring") | {"share": 0.9}, where=[("position", 3.0, 0.72)])
    assert named(now, own, "spring") == ["spring"]
    assert named(now, own, "cogging") == []
    now["findings"][0]["share"] = 0.4
    assert named(now, own, "spring") == []


def test_the_own_reduction_is_taken_off_the_error():
    own, now = said(before=0.05, after=0.03), said(before=0.13, after=0.04)
    errors = comparing.difference(now, own, ("spring",))
    assert errors["fit"]["holdout_force_error"]["before"] == pytest.approx(
        math.sqrt(0.13**2 - 0.05**2 + 0.03**2)
    )
    assert errors["oracle"] == pytest.approx(0.03)


def test_cases_are_scored_against_the_log_as_it_is(tmp_path):
    cases = planting.plan(LOGS[:1], (0.1,), 2, 1)
    for part in (trials.SEALED, trials.ANSWERS):
        (tmp_path / part).mkdir()
    own = finding("frictional_lag")
    for c in cases:
        truth = {name: {"size": 0.1} for name in c.effects}
        trials.path(tmp_path, trials.SEALED, c).write_text(json.dumps({"truth": truth}))
        told = said(own, *(finding(name) for name in c.effects))
        trials.path(tmp_path, trials.ANSWERS, c).write_text(json.dumps(told))
    scores = comparing.scores(tmp_path, cases)
    assert len(scores) == 2 and all(s.exact for s in scores)
    wrong = trials.failed("it broke") | {"code": None}
    trials.path(tmp_path, trials.ANSWERS, cases[0]).write_text(json.dumps(wrong))
    assert "as it is has no answer" in comparing.scores(tmp_path, cases)[0].error
    assert comparing.described(tmp_path, cases) == [("a-b", "it broke", "-", "-")]


@pytest.mark.slow
def test_a_planted_wave_is_found(tmp_path, recording):
    file = tmp_path / "axis.npz"
    names = ("time", "position", "force")
    np.savez(file, **{name: np.asarray(getattr(recording, name)) for name in names})
    log = planting.Log("axis", str(file), None, "coulomb-viscous", {})
    folder = tmp_path / "planted"
    cases = [c for c in planting.plan([log], (0.2,), 20, 1) if c.effects in ((), ("cogging",))][:2]
    for part in (trials.SEALED, trials.ANSWERS):
        (folder / part).mkdir(parents=True)
    for c in cases:
        planting.trial(c, folder, {"axis": log})
    assert [s.error for s in comparing.scores(folder, cases)] == [None]
    assert comparing.scores(folder, cases)[0].among


# The real proof's comparison


def test_waves_are_compared_with_a_map():
    x = np.linspace(0, 2 * math.pi, 4000, endpoint=False)
    known = real_proof.spectrum(x, 0.8 * np.sin(7 * x + 0.3) + 0.2 * np.sin(12 * x - 1) + 5)
    assert known[7] == pytest.approx((0.8, 0.3)) and known[12] == pytest.approx((0.2, -1))
    # A pitch that is a little off: the phase agrees where the recording is.
    order, middle = 7.002, math.pi
    phase = 0.3 + (7 - order) * middle
    parameters = {"amplitude": 0.75, "phase": phase, "pitch": 2 * math.pi / order}
    parameters |= {"amplitude_harmonic2": 0.1, "phase_harmonic2": 0.5}
    wave = jf.explanation.Finding(
        "cogging", "", "", (), "",
        {k: Estimate(np.float64(v), np.float64(0.01), "A") for k, v in parameters.items()},
        0.5, None, 0.01,
    )  # fmt: skip
    found = real_proof.waves([wave], middle)
    assert set(found) == {7, 14}
    assert found[7] == pytest.approx((0.75, 0.01, 0.3))
    rows = list(real_proof.compared(known, known, found))
    assert rows[0] == ("7", "0.80 A", "0.80 A, +0°", "0.75 ± 0.02 A, +0°")
    assert rows[1][0] == "12" and rows[1][3] == "not found"
    assert real_proof.degrees(3.5 * math.pi) == pytest.approx(-90)
