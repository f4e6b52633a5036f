"""The proof: its plan, its blindness, its scores."""

import dataclasses
import json
import os
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from jaxfric.cli import main
from jaxfric.identification.uncertainty import Estimate
from jaxfric.terms.effects import effect
from jaxfric.validation import proof
from jaxfric.validation.concealed import OUTSIDE, definitions, names
from jaxfric.validation.proof import counting, running, scoring, trials, workers

RANGE = (0.02, 0.3)


def case(*effects, kind="single"):
    return proof.Case("00001", kind, 7, effects, RANGE)


def sealed(**truth):
    return {"truth": {name: {"size": 0.1, **values} for name, values in truth.items()}}


def finding(name, *alike, **parameters):
    values = {
        key: Estimate(value, error, "N").to_dict() for key, (value, error) in parameters.items()
    }
    return {"effect": name, "confusable_with": list(alike), "parameters": values}


def answer(*findings, verdict="explained", where=(), before=0.10, after=0.05, oracle=0.04):
    return {
        "error": None,
        "verdict": verdict,
        "where": [{"coordinate": name} for name in where],
        "findings": list(findings),
        "fit": {"holdout_force_error": {"before": before, "after": after}},
        "oracle": oracle,
        "seconds": 3.0,
        "code": "abc",
    }


# The plan


def test_the_plan_is_the_seeds_and_longer_ones_go_on_from_it():
    first = proof.plan(30, 5, RANGE)
    assert first == proof.plan(60, 5, RANGE)[:30]
    assert [c.seed for c in first] != [c.seed for c in proof.plan(30, 6, RANGE)]
    assert len({c.seed for c in first}) == 30


def test_the_plan_is_balanced():
    cases = proof.plan(24 * len(names()), 1, RANGE)
    kinds = Counter(c.kind for c in cases)
    count = len(names())
    assert kinds == {
        "healthy": 8 * count, "single": 12 * count, "pair": 3 * count, "outside": count
    }  # fmt: skip
    assert all(c.effects == () for c in cases if c.kind == "healthy")
    singles = Counter(c.effects[0] for c in cases if c.kind == "single")
    assert singles == dict.fromkeys(names(), 12)
    outside = Counter(c.effects[0] for c in cases if c.kind == "outside")
    assert set(outside) == set(OUTSIDE) and max(outside.values()) - min(outside.values()) <= 1
    members = Counter(name for c in cases if c.kind == "pair" for name in c.effects)
    assert set(members) == set(names()) and max(members.values()) <= 2 * min(members.values())


def test_no_pair_is_declared_confusable():
    for c in proof.plan(600, 2, RANGE):
        if c.kind == "pair":
            first, second = c.effects
            assert first != second
            assert second not in effect(first).confusable_with
            assert first not in effect(second).confusable_with


@pytest.mark.parametrize("wrong", [(0, 1, RANGE), (3, -1, RANGE), (3, 1, (0.3, 0.02))])
def test_a_plan_that_cannot_be_is_refused(wrong):
    with pytest.raises(ValueError, match="give"):
        proof.plan(*wrong)


# Scores


def test_right_and_nothing_else_is_exact():
    found = scoring.score(
        case("cogging"), sealed(cogging={}), answer(finding("cogging"), where=("position",))
    )
    assert found.exact and found.among and found.within and found.located
    assert found.reached == pytest.approx(0.05 / 0.06)


def test_a_hard_limit_is_a_saturation():
    found = scoring.score(
        case("actuator_saturation"), sealed(actuator_saturation={}), answer(finding("force_limit"))
    )
    assert found.exact and found.named == ("actuator_saturation",) and found.beliefs[0].true


def test_one_name_too_many_is_not_exact():
    found = scoring.score(
        case("cogging"), sealed(cogging={}), answer(finding("spring"), finding("cogging"))
    )
    assert not found.exact and found.among and found.within
    assert found.located is False


def test_a_declared_doubt_is_within_the_class_only():
    found = scoring.score(case("cogging"), sealed(cogging={}), answer(finding("spring", "cogging")))
    assert not found.exact and not found.among and found.within
    undeclared = answer(finding("spring", "end_stop"))
    assert not scoring.score(case("cogging"), sealed(cogging={}), undeclared).within


def test_both_of_a_pair_are_needed():
    pair = case("cogging", "stribeck", kind="pair")
    truth = sealed(cogging={}, stribeck={})
    one = scoring.score(pair, truth, answer(finding("stribeck"), where=("velocity",)))
    assert (one.exact, one.among, one.within, one.hits, one.located) == (
        False, False, False, 1, False
    )  # fmt: skip
    both = answer(finding("stribeck"), finding("cogging"), where=("velocity", "position"))
    assert scoring.score(pair, truth, both).exact
    assert scoring.score(pair, truth, both).located


@pytest.mark.parametrize(
    ("said", "right"),
    [
        (answer(verdict="consistent", oracle=None), True),
        (answer(verdict="unexplained", oracle=None), False),
        (answer(finding("cogging"), oracle=None), False),
    ],
)
def test_a_healthy_machine_is_consistent_or_wrong(said, right):
    assert scoring.score(case(kind="healthy"), sealed(), said).exact is right


def test_parameters_are_compared_where_the_names_coincide():
    truth = sealed(stribeck={"stribeck_force": 2.0, "shape": "gaussian", "phase": 1.0})
    said = finding(
        "stribeck",
        **{"stribeck_force+": (2.2, 0.1), "stribeck_force-": (2.6, 0.1), "phase": (3.0, 0.1)},
        other=(1.0, 0.1),
    )
    found = scoring.score(case("stribeck"), truth, answer(said, finding("spring", k=(1.0, 0.1))))
    assert [p.name for p in found.parameters] == ["stribeck_force+", "stribeck_force-"]
    # Eight degrees of freedom: 2.31 standard errors.
    assert [p.held for p in found.parameters] == [True, False]
    assert [p.error for p in found.parameters] == pytest.approx([0.1, 0.3])


def test_a_parameter_of_another_law_has_no_true_value_to_hold():
    """A square wave has no amplitude of a sine, but its frequency."""
    said = answer(
        finding("periodic_disturbance", frequency=(2.0, 0.1), amplitude=(2.5, 0.1)),
    )

    def counted_in(name):
        truth = {"frequency": 2.0, "amplitude": 2.0, "definition": name}
        scored = scoring.score(
            case("periodic_disturbance"), sealed(periodic_disturbance=truth), said
        )
        return [
            [p.name for p in counting.parameters([scored], same=same)] for same in (True, False)
        ]

    assert counted_in("sine") == [["frequency", "amplitude"], []]
    assert counted_in("square") == [["frequency"], ["amplitude"]]
    for (of, name), parameters in definitions.UNLIKE.items():
        assert definitions.definition(of, name).kind is not None and parameters


def test_of_an_effect_named_twice_the_strongest_is_compared():
    truth = sealed(periodic_disturbance={"frequency": 2.0})
    waves = [finding("periodic_disturbance", frequency=(f, 0.1)) for f in (2.1, 6.0)]
    (parameter,) = scoring.score(case("periodic_disturbance"), truth, answer(*waves)).parameters
    assert parameter.found == 2.1


def test_where_the_oracle_gains_nothing_no_share_is_made_of_it():
    said = answer(finding("cogging"), before=0.1, after=0.05, oracle=0.095)
    hidden = scoring.score(case("cogging"), sealed(cogging={}), said)
    assert hidden.reached is None and not hidden.shows


def test_an_effect_shows_where_knowing_it_helps_or_nobody_was_asked():
    def shows(**errors):
        return scoring.score(case("cogging"), sealed(cogging={}), answer(**errors)).shows

    assert shows(before=0.1, oracle=0.089) and shows(before=0.1, oracle=None)
    assert not shows(before=0.1, oracle=0.091)


@pytest.mark.parametrize(
    ("without", "shown"),
    [((0.08, 0.05), True), ((0.08, 0.041), False), ((0.041, 0.08), False), ((None, None), True)],
)
def test_two_effects_show_where_knowing_each_of_them_helps(without, shown):
    names = ("cogging", "stribeck")
    said = answer(oracle=0.04) | {"oracle_without": dict(zip(names, without, strict=True))}
    pair = case(*names, kind="pair")
    found = scoring.score(pair, sealed(cogging={}, stribeck={}), said)
    assert found.shows is shown and found.reached is not None
    assert proof.summary([found])["two effects that show: both named"] == (0, int(shown))


def test_a_case_that_went_wrong_is_a_miss_in_every_rate():
    wrong = scoring.score(case("cogging"), None, trials.failed("it broke") | {"code": None})
    table = proof.summary([wrong])
    assert wrong.error == "it broke"
    for label, value in table.items():
        if label.startswith("one effect:"):
            assert (value.hits, value.total) == (0, 1), label
    assert table["cases that went wrong"].hits == 1


def test_a_case_without_answer_counts_at_its_size():
    truth = {"truth": {"cogging": {"size": 0.12}}}
    wrong = scoring.score(case("cogging"), truth, trials.failed("it broke") | {"code": None})
    right = scoring.score(
        case("cogging"), truth, answer(finding("cogging"), where=("position",)) | {"seconds": 5.0}
    )
    table = proof.summary([wrong, right])
    assert table["one effect, 10 % or more: named exactly"] == (1, 2)
    assert table["one effect, 10 % or more: its place found"] == (1, 2)
    assert table["one effect, 5 to 10 %: named exactly"] == (0, 0)
    assert table["seconds a case, longest"] == 5.0
    assert counting.confusion([wrong, right]) == (["cogging"], ["cogging", "no answer"], [[1, 1]])


def test_the_interval_is_the_one_that_was_given():
    said = finding("stribeck", stribeck_force=(2.2, 0.1))
    said["parameters"]["stribeck_force"]["interval"] = [2.01, 2.39]
    found = scoring.score(case("stribeck"), sealed(stribeck={"stribeck_force": 2.0}), answer(said))
    assert [p.held for p in found.parameters] == [False]  # 2.31 standard errors would hold it


def test_what_the_findings_do_to_a_forward_run():
    said = answer(finding("cogging")) | {"run": {"before": 0.2, "after": 0.05}}
    found = scoring.score(case("cogging"), sealed(cogging={}), said)
    assert counting.quieted(found) == pytest.approx(0.75)
    assert "| single | 10.00% | 5.00% | 4.00% | 83.33% | 1 | 20.00% | 5.00% | 1 |" in proof.report(
        [found], "jaxfric prove"
    )
    cannot = answer(finding("backlash")) | {"run": {"before": 0.2, "after": None}}
    assert counting.quieted(scoring.score(case("backlash"), sealed(backlash={}), cannot)) is None


def test_the_interval_of_a_share():
    low, high = proof.Rate(0, 60).interval
    assert low == pytest.approx(0, abs=1e-12) and high == pytest.approx(0.0602, abs=1e-3)
    assert proof.Rate(0, 0).share is None


def some_scores():
    right = scoring.score(case("cogging"), sealed(cogging={}), answer(finding("cogging")))
    wrong = scoring.score(case("cogging"), sealed(cogging={}), answer(finding("spring", "cogging")))
    quiet = answer(verdict="consistent", oracle=None)
    healthy = scoring.score(case(kind="healthy"), sealed(), quiet)
    return [right, wrong, wrong._replace(sizes=(0.03,)), healthy]


def test_confusion_and_power():
    true, named, counts = counting.confusion(some_scores())
    assert (true, named) == (["cogging", "none"], ["cogging", "spring", "none"])
    assert counts == [[1, 2, 0], [0, 0, 1]]
    assert [(name, len(some)) for name, some in counting.binned(some_scores())] == [
        ("2% to 5%", 1), ("10% to 20%", 2)
    ]  # fmt: skip


def test_the_report_says_what_was_missed(tmp_path):
    scores = some_scores()
    text = proof.report(scores, "jaxfric prove", proof.draw(scores, tmp_path))
    assert "| one effect: named exactly | 33.3%" in text
    assert text.count("explained: spring (declared confusable)") == 2
    assert "two states" not in text and "abc" in text
    assert "**The answers are of 2 states" in proof.report(
        [scores[0], scores[1]._replace(code="def")], "jaxfric prove"
    )
    assert {file.name for file in tmp_path.iterdir()} == {"confusion.png", "power.png"}
    assert "one effect: named exactly" in proof.short(scores)


# Running


def written(folder, cases):
    for c in cases:
        trials.path(folder, trials.ANSWERS, c).parent.mkdir(parents=True, exist_ok=True)
        quiet = answer(verdict="consistent", oracle=None)
        trials.path(folder, trials.ANSWERS, c).write_text(json.dumps(quiet))


def test_answers_that_are_there_are_not_repeated(tmp_path, monkeypatch):
    done = []

    def work(cases, *_):
        done.append([c.name for c in cases])
        written(tmp_path, cases)
        yield from (workers.Done(c, None, 1.0) for c in cases)

    monkeypatch.setattr(running, "work", work)
    proof.run(tmp_path, 3, 1, RANGE)
    proof.run(tmp_path, 3, 1, RANGE)
    proof.run(tmp_path, 5, 1, RANGE)
    assert done == [["00001", "00002", "00003"], [], ["00004", "00005"]]
    with pytest.raises(ValueError, match="seed 1"):
        proof.run(tmp_path, 3, 2, RANGE)


def test_a_folder_with_something_else_in_it_is_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(ValueError, match="holds no proof"):
        proof.run(tmp_path, 3, 1, RANGE)
    assert [file.name for file in tmp_path.iterdir()] == ["thesis.tex"]


def do(task):
    """In a process of its own: what the first letters say; that it was done stands in a file."""
    file, _, what = task.partition(":")
    with open(file, "a") as tries:
        tries.write("x")
    tried = len(Path(file).read_text())
    if what == "hang":
        time.sleep(600)
    if what == "die" or (what == "die once" and tried == 1):
        os.kill(os.getpid(), 9)


@pytest.mark.slow
def test_what_hangs_or_dies_costs_itself_only(tmp_path):
    kinds = ("well", "hang", "die", "die once", "well")
    tasks = [f"{tmp_path / str(i)}:{kind}" for i, kind in enumerate(kinds)]
    start = time.monotonic()
    done = list(workers.work(tasks, do, jobs=2, limit=2.0))
    assert time.monotonic() - start < 30
    reasons = {d.task: d.reason for d in done}
    assert len(done) == 5 and [reasons[t] for t in tasks] == [
        None, "no answer within 2 s", "the process died of SIGKILL (short of memory?)", None, None
    ]  # fmt: skip
    tries = [len((tmp_path / str(i)).read_text()) for i in range(5)]
    assert tries == [1, 1, 2, 2, 1]


def refuse():
    raise SystemExit(3)


@pytest.mark.slow
def test_processes_that_do_not_start_end_the_run():
    with pytest.raises(ValueError, match="before they were ready with status 3"):
        list(workers.work(["a:well"], do, jobs=2, prepare=refuse))


def test_a_case_that_is_given_up_is_a_row_with_its_reason(tmp_path, monkeypatch):
    def work(cases, do, jobs, limit, prepare):
        assert limit == 5.0
        written(tmp_path, cases[1:])
        yield workers.Done(cases[0], "no answer within 5 s", 5.0)
        yield from (workers.Done(c, None, 1.0) for c in cases[1:])

    monkeypatch.setattr(running, "work", work)
    cases = proof.run(tmp_path, 2, 1, RANGE, limit=5.0)
    truth = {"truth": {name: {"size": 0.2} for name in cases[0].effects}}
    trials.path(tmp_path, trials.SEALED, cases[0]).write_text(json.dumps(truth))
    first = proof.scores(tmp_path, cases)[0]
    assert first.error == "no answer within 5 s" and first.seconds == 5.0
    assert "no answer within 5 s" in proof.report([first], "jaxfric prove")


WATCHED = []


def _watch(event, arguments):
    if WATCHED and event == "open":
        WATCHED[-1].append(str(arguments[0]))


@pytest.fixture(scope="session")
def hook():
    """Every file that Python opens, by whatever way; a hook stays for good."""
    sys.addaudithook(_watch)


@pytest.fixture
def quick(monkeypatch, hook, tmp_path):
    """Drawing and recording without a simulation; what was opened from explaining on."""
    opened = []

    def explain(recording, baseline, holdout):
        assert (tmp_path / trials.SEALED / "00001.json").is_file()
        opened.append(("explained", recording.source, baseline, holdout.source))
        WATCHED.append(opened)
        raise ValueError("too short")

    machine = Drawn({"cogging": {"size": np.float64(0.1), "amplitudes": [np.float64(2.0)]}})
    monkeypatch.setattr(trials, "draw", lambda *_: machine)
    monkeypatch.setattr(trials, "record", lambda _: Logs(Log("machine 7"), Log("machine 7")))
    monkeypatch.setattr(trials, "explain", explain)
    yield opened
    WATCHED.clear()


@dataclasses.dataclass(frozen=True)
class Log:
    source: str
    sha256: str = ""


@dataclasses.dataclass(frozen=True)
class Logs:
    recording: Log
    holdout: Log


@dataclasses.dataclass(frozen=True)
class Drawn:
    truth: dict
    effects: tuple = ("cogging",)
    baseline: str = "gaussian"
    coulomb: float = 1.0


def test_the_truth_is_sealed_first_and_explain_is_told_nothing(tmp_path, quick):
    for part in (trials.SEALED, trials.ANSWERS):
        (tmp_path / part).mkdir()
    trials.trial(case("cogging"), tmp_path)
    assert quick[0] == ("explained", "case 00001", "gaussian", "case 00001")
    assert [file for file in quick[1:] if f"/{trials.ANSWERS}/" in file]
    assert not [file for file in quick[1:] if f"/{trials.SEALED}/" in file]
    truth = trials.read(tmp_path / trials.SEALED / "00001.json")
    assert truth["truth"] == {"cogging": {"size": 0.1, "amplitudes": [2.0]}}
    said = trials.read(tmp_path / trials.ANSWERS / "00001.json")
    assert said["error"] == "ValueError: too short"
    assert "cogging" not in json.dumps(said)
    row = proof.scores(tmp_path, [case("cogging")])[0]
    assert row.error == "ValueError: too short" and not row.within


@pytest.mark.parametrize(
    "option", [("--cases", "0"), ("--size", "0.3:0.1"), ("--size", "a"), ("--limit", "0")]
)
def test_options_that_make_no_sense(option, capsys):
    with pytest.raises(SystemExit) as stop:
        main(["prove", *option])
    assert stop.value.code == 2
    assert option[0] in capsys.readouterr().err


@pytest.mark.slow
def test_two_real_cases(tmp_path, capsys):
    folder = tmp_path / "proof"
    command = ["prove", "--cases", "2", "--seed", "901", "--size", "0.2", "--out", str(folder)]
    assert main(command) == 0
    assert "cases that went wrong" in capsys.readouterr().out
    assert {file.name for file in Path(folder).iterdir()} >= {"report.md", "sealed", "answers"}
    answers = [trials.read(file) for file in sorted((folder / "answers").iterdir())]
    assert [a["error"] for a in answers] == [None, None]
    assert answers[0]["oracle"] is None and answers[1]["oracle"] > 0
    assert all(set(a["run"]) == {"before", "after"} for a in answers)
    for told in answers[1]["findings"]:
        assert all(len(p["interval"]) == 2 for p in told["parameters"].values())


# By definition, and calibration


def test_definitions_take_turns_on_the_same_machines():
    cases = proof.plan(160, 4, RANGE, "all")
    assert cases[:40] == proof.plan(40, 4, RANGE, "all")
    singles = [c for c in cases if c.kind == "single"]
    assert len(singles) == 120 and all(c.effects == (c.definitions[0][0],) for c in singles)
    assert all(c.definitions[0][0] in ("stick", "log") for c in cases if c.kind == "healthy")
    machines: dict = {}
    for c in cases:
        machines.setdefault(c.definitions[0][0], {}).setdefault(c.definitions[0][1], []).append(
            c.seed
        )
    gaps = list(machines["backlash"].values())
    assert len(gaps) == 4 and len({seeds[0] for seeds in gaps}) == 1
    half = {c.definitions for c in proof.plan(160, 4, RANGE, "scored")}
    assert (("actuator_saturation", "clip"),) in half and (("backlash", "two_mass"),) not in half
    with pytest.raises(ValueError, match="give all, development or scored"):
        proof.plan(8, 4, RANGE, "other")


def defined(of, name, *findings, verdict="explained", kind="single"):
    effects = () if kind == "healthy" else (of,)
    truth = {"truth": {of: {"size": 0.1, "definition": name}} if effects else {}}
    which = proof.Case("00001", kind, 7, effects, RANGE, ((of, name),))
    return scoring.score(which, truth, answer(*findings, verdict=verdict))


def test_scores_are_told_by_definition_and_half():
    scores = [
        defined("backlash", "two_mass", finding("backlash")),
        defined("backlash", "ideal_play", finding("presliding", "backlash")),
        defined("backlash", "ideal_play", verdict="consistent"),
        defined("stick", "smooth", verdict="consistent", kind="healthy"),
    ]
    rows = {(r["of"], r["definition"]): r for r in proof.results(scores)["by_definition"]}
    play = rows["backlash", "ideal_play"]
    assert (play["half"], play["cases"], play["exact"], play["within"]) == ("scored", 2, 0, 1)
    assert play["verdicts"] == {"consistent": 1, "explained": 1}
    assert play["otherwise"] == ["presliding"]
    assert rows["stick", "smooth"]["exact"] == 1 and rows["single", "all"]["half"] == "scored"
    text = proof.report(scores, "jaxfric prove")
    assert "## By physical definition" in text and "| scored | backlash | ideal_play | 2 |" in text
    assert "## By physical definition" not in proof.report(scores[:1], "jaxfric prove")


def test_findings_are_counted_by_how_sure_they_are():
    def said(name, p, confirmed, *alike, **parameters):
        more = {"p_value": p, "share": 0.2, "confirmed": confirmed}
        return finding(name, *alike, **parameters) | more

    truth = sealed(cogging={"amplitude": 1.0})
    cases = [
        answer(said("cogging", 0.002, True, amplitude=(1.05, 0.1))),
        answer(said("spring", 0.002, None, "cogging")),
        answer(said("spring", 0.02, False)),
    ]
    scores = [scoring.score(case("cogging"), truth, each) for each in cases]
    healthy = scoring.score(case(kind="healthy"), sealed(), cases[0])
    rows = {row["of"]: row for row in proof.results([*scores, healthy])["reliability"]}
    assert rows["all"]["findings"] == 4 and rows["all"]["true"] == 1 and rows["all"]["within"] == 2
    assert rows["p up to 0.003"]["findings"] == 3 and rows["p up to 0.03"]["true"] == 0
    assert rows["p up to 0.003"]["mean"] == pytest.approx(0.002)
    assert rows["held-out recording: confirmed"]["findings"] == 2
    assert rows["other names declared"] == {
        "findings": 1, "of": "other names declared", "true": 0, "within": 1
    }  # fmt: skip
    (cogging, every) = proof.results(scores)["coverage"]
    assert cogging["effect"] == "cogging" and (cogging["intervals"], cogging["held"]) == (1, 1)
    assert every["effect"] == "all"
    assert "## How sure, and how often true" in proof.report(scores, "jaxfric prove")


def test_what_came_out_stands_beside_what_was_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(running, "work", lambda cases, *_: iter(()))
    proof.run(tmp_path, 3, 1, RANGE, half="scored")
    proof.conclude(tmp_path, proof.results([]))
    kept = trials.read(tmp_path / "proof.json")
    assert kept["definitions"] == "scored" and kept["results"]["cases"] == 0
    proof.run(tmp_path, 5, 1, RANGE, half="scored")
    with pytest.raises(ValueError, match="seed 1 .* and definitions scored"):
        proof.run(tmp_path, 3, 1, RANGE)
