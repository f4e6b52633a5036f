"""Mistakes in logs: that they are made as drawn, judged rightly, and not answered in silence."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from jaxfric import cli
from jaxfric.identification.uncertainty import Estimate

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

from mistakes import MISTAKES, Case, bench, cases, hunt, judging, logs, running, sources, tallies
from mistakes.judging import Ran

# Kinds of which one case each is run here, on the same machine; all kinds in the slow test.
QUICK = (
    "force sign", "velocity in rpm", "velocity sign", "force dead", "decimal comma",
)  # fmt: skip


@pytest.fixture(scope="module")
def pair():
    return bench.draw(np.random.default_rng((3, 1)), bench.BENCH)


def of(name):
    return next(m for m in MISTAKES if m.name == name and not m.held_out)


def made(mistake, pair, velocity=True, seed=1):
    log, other = pair
    if mistake.velocity is False or not velocity:
        log, other = log.without_velocity(), other.without_velocity()
    return mistake.apply(log, np.random.default_rng(seed), other.scaled(force=3.0, position=0.4))


@pytest.mark.parametrize("velocity", [True, False], ids=["velocity", "no velocity"])
@pytest.mark.parametrize("mistake", MISTAKES, ids=lambda m: f"{m.family}: {m.name}")
def test_a_mistake_changes_the_file_and_is_the_same_again(mistake, velocity, pair):
    if mistake.velocity not in (None, velocity):
        return
    short = [log.rows(np.arange(800)) for log in pair]
    text = logs.spelled(made(mistake, short, velocity))
    assert text == logs.spelled(made(mistake, short, velocity))
    assert text != logs.spelled(short[0] if velocity else short[0].without_velocity())


def test_every_kind_has_its_turn_and_one_case_in_four_is_healthy():
    count = 4 * (len(MISTAKES) // 3 + 1)
    drawn = [cases.mistake_of(Case(1, n)) for n in range(count)]
    assert drawn.count(None) == count // cases.HEALTHY_EVERY
    assert {m.name for m in drawn if m} == {m.name for m in MISTAKES}


def test_a_case_is_the_same_again_and_another_with_unseen_machines():
    first, again, other = (cases.make(Case(5, 3, unseen)) for unseen in (False, False, True))
    assert logs.spelled(first.log) == logs.spelled(again.log)
    assert first.log.machine != other.log.machine
    assert not set(sources.SEEN) & set(sources.UNSEEN)


@pytest.mark.parametrize("kind", [bench.BENCH, bench.CASCADE], ids=lambda kind: kind.name)
@pytest.mark.parametrize("seed", range(4))
def test_the_machine_obeys_its_own_truth(kind, seed):
    """Plain least squares over the rows in motion, with the machine's own velocity."""
    log = bench.draw(np.random.default_rng(seed), kind).log
    c, truth = log.columns, log.truth
    v = c["velocity"]
    a = np.gradient(v, c["time"])
    moving = np.abs(v) > 0.3 * log.top  # beyond the Stribeck bump
    ways = [(v > 0) * 1.0, -((v < 0) * 1.0), np.maximum(v, 0), np.minimum(v, 0)]
    columns = np.stack([a, *ways], axis=1)[moving]
    scale = np.abs(columns).max(axis=0)
    found = np.linalg.lstsq(columns / scale, c["force"][moving], rcond=None)[0] / scale
    names = ("inertia", "coulomb+", "coulomb-", "viscous+", "viscous-")
    weights = judging.forces(log)
    level = sum(abs(truth[name]) * weights[name] for name in names)
    for name, value in zip(names, found, strict=True):
        assert abs(value - truth[name]) * weights[name] < 0.12 * level, name


def test_other_units_leave_the_physics_as_it_is(pair):
    log = pair.log.scaled(force=1e3, position=1e-3, time=60.0)
    weights, before = judging.forces(log), judging.forces(pair.log)
    for name, weight in weights.items():
        was = pair.log.truth[name] * before[name]
        assert log.truth[name] * weight == pytest.approx(1e3 * was)


def document(log, factor=1.0, error=1e-3, **more):
    parameters = {
        name: Estimate(factor * value, error * abs(value), "").to_dict()
        for name, value in log.truth.items()
    }
    rest = {"result": "successful", "diagnosis": "", "force_error": 0.02, "recording": {}}
    return {"parameters": parameters, **rest, **more}


def verdict(log, mistake="force sign", **more):
    ran = Ran(0, "force in N", "", document(log, **more))
    return judging.identified(ran, log, of(mistake), 0.02).outcome


def test_an_identification_is_judged_by_its_figures_and_its_words(pair):
    log = pair.log
    assert verdict(log) == "right"
    assert verdict(log, factor=-1.0) == "wrong in silence"
    assert verdict(log, factor=1.2) == "right"
    assert verdict(log, factor=1.4) == "wrong in silence"
    assert verdict(log, factor=1.4, error=0.3) == "right", "its interval holds the truth"
    assert verdict(log, factor=-1.0, result="not_excited") == "refused"
    assert verdict(log, force_error=0.5) == "wrong in silence"
    warned = [{"name": "sign", "text": "The force …", "severe": True}]
    assert verdict(log, factor=-1.0, warnings=warned) == "warned"
    assert verdict(log, "all motion in degrees", factor=57.3) == "rescaled"


def test_a_message_is_a_refusal_and_a_traceback_is_none(pair):
    refused = judging.identified(Ran(2, "", "jaxfric: no.", None), pair.log, None, 0.0)
    crashed = judging.identified(Ran(1, "", "Traceback …", None), pair.log, None, 0.0)
    assert (refused.outcome, crashed.outcome) == ("refused", "crashed")


def explanation(log, verdict="consistent", factor=1.0, after=0.05, effects=()):
    findings = [{"effect": effect, "confusable_with": []} for effect in effects]
    fit = {"force_error": {"before": 0.1, "after": after}, "holdout_force_error": None}
    baseline = {"parameters": document(log, factor)["parameters"]}
    both = {"verdict": verdict, "findings": findings, "fit": fit, "baseline": baseline}
    both["summary"] = ""
    return judging.explained(Ran(0, "", "", both), log, of("force late")).outcome


def test_an_explanation_is_judged_by_what_it_calls_explained(pair):
    assert explanation(pair.log) == "right"
    assert explanation(pair.log, factor=-1.0) == "wrong in silence"
    assert explanation(pair.log, "unexplained", factor=-1.0) == "warned"
    assert explanation(pair.log, "explained", effects=["transport_delay"]) == "warned"
    assert explanation(pair.log, "partly_explained", after=0.2) == "wrong in silence"


def test_a_warning_of_a_healthy_log_is_false_and_an_open_verdict_or_a_border_is_none():
    def answer(outcome, *signs):
        return {"family": "healthy", "commands": {"any": {"outcome": outcome, "signs": signs}}}

    assert tallies.false_warnings([answer("warned", "force_late"), answer("refused", "no_slip")])
    honest = [answer("right"), answer("refused", "on_border"), answer("warned", "unexplained")]
    assert not tallies.false_warnings(honest)


def test_the_report_tells_what_was_silent_and_how_to_see_it_again():
    commands = {"identify": {"outcome": "wrong in silence", "off": ["inertia −1"], "signs": []}}
    one = {"seed": 7, "number": 3, "unseen": True, "mistake": "force sign", "family": "sign"}
    one |= {"machine": "bench", "model": "gaussian", "velocity": True, "commands": commands}
    one |= {"outcome": "wrong in silence", "own": "right"}
    text = tallies.report([one], "python …")
    assert "Wrong in silence: 1 of 1 cases" in text
    assert "--seed 7 --case 3 --unseen" in text and "inertia −1" in text


@pytest.fixture
def command(monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    return cli.main


@pytest.mark.parametrize("name", QUICK)
def test_the_command_line_says_something(name, pair, command, tmp_path):
    log = made(of(name), pair)
    file = tmp_path / "log.csv"
    file.write_text(logs.spelled(log), encoding="utf-8")
    ran = running.run(command, ["identify", str(file), "--model", log.model], tmp_path)
    found = judging.identified(ran, log, of(name), 0.1)
    said = ("rescaled",) if name == "millimetres stated beside metres" else ()
    assert found.outcome in ("right", "refused", "warned", *said), found
    if said:
        assert "velocity [m/s] × 1000" in ran.printed and "N/mm" in ran.printed.replace("N·s²", "N")


def test_a_healthy_log_is_right_without_a_word(pair, command, tmp_path):
    file = tmp_path / "log.csv"
    file.write_text(logs.spelled(pair.log), encoding="utf-8")
    ran = running.run(command, ["identify", str(file), "--model", pair.log.model], tmp_path)
    assert judging.identified(ran, pair.log, None, 0.0).outcome == "right"


@pytest.mark.slow
@pytest.mark.parametrize("unseen", [False, True], ids=["seen", "unseen"])
def test_no_wrong_answer_in_silence(unseen, command, tmp_path):
    """Sixteen cases on the machines, and on those that no threshold was made on.

    The aim is none in silence. Measured on fresh cases are 0 of 200 on unseen machines and 2 of 113
    on the others (a force held for a sample beside a light axis; a gain for each sign), and 2
    warnings on 79 healthy logs; the bounds on the others leave room for chance.
    """
    answers = []
    for number in range(int(unseen), 32, 2):
        folder = tmp_path / str(number)
        folder.mkdir()
        answers.append(hunt(Case(19, number, unseen), command, folder))
    (tmp_path / "answers.json").write_text(json.dumps(answers))
    report = tallies.report(answers, "pytest")
    assert len(tallies.silent(answers)) <= (0 if unseen else 1), report
    healthy = sum(a["family"] == "healthy" for a in answers)
    assert len(tallies.false_warnings(answers)) <= 0.02 * healthy + 1, report
