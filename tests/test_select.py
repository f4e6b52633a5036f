"""Which friction model: the right one, the simpler on a tie, and why no more can be told."""

import json

import jax
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.cli import main
from jaxfric.data import io
from jaxfric.identification import selection, standings

KINDS = ("coulomb-viscous", "gaussian", "lorentzian", "exponential")


def machine(kind, seed, slow=True):
    """A drawn axis whose bump shows, and its recording: slow strokes too, or fast ones only."""
    rng = np.random.default_rng(seed)
    values = {"inertia": rng.uniform(2, 8)}
    for sign in "+-":
        values[f"coulomb{sign}"] = rng.uniform(10, 25)
        values[f"viscous{sign}"] = rng.uniform(30, 90)
        if kind != "coulomb-viscous":
            values[f"stribeck_force{sign}"] = rng.uniform(5, 10)
            values[f"stribeck_velocity{sign}"] = rng.uniform(0.01, 0.02)
    model = jf.models.from_parameters(jf.models.named(kind), values)
    t = np.arange(16001) / 1000
    w = 2 * np.pi / 4
    x = 0.03 * np.sin(w * t) + 0.02 * np.sin(3 * w * t + 1) + 0.005 * np.sin(7 * w * t + 2)
    x = x if slow else 20 * x
    v, a = np.gradient(x, t), np.gradient(np.gradient(x, t), t)
    force = np.asarray(model.friction(v)) + values["inertia"] * a + 0.3 * rng.normal(size=t.size)
    return jf.Recording(t, force, position=x, velocity=v)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_right_shape_is_chosen(kind):
    """Of eight machines of each kind all but one at most: 90 % of all."""
    chosen = [jf.select(machine(kind, seed), KINDS).name for seed in range(8)]
    assert chosen.count(kind) >= 7, chosen


def test_rows_hold_the_slow_motion_beside_quick_reversals():
    """At 6 m/s² a kernel of 16 samples to each side holds nothing below 0.096 m/s."""
    t = np.arange(8001) / 1000
    v = 0.64 * np.arcsin(np.sin(3 * np.pi * t))
    for noise, narrow in ((0.0, True), (0.02, False)):  # where the noise allows it
        rough = v + noise * np.random.default_rng(0).normal(size=t.size)
        log = jf.signals.prepare(jf.Recording(t, np.sign(v) + v, velocity=rough))
        rows = standings.regression(log, np.zeros(t.size, int))
        assert bool(standings.recorded(rows) < 0.05) is narrow


def test_without_slow_motion_it_is_said_that_shapes_cannot_be_told():
    found = jf.select(machine("gaussian", 0, slow=False))
    assert found.name == "coulomb-viscous" and found.name in found.tied
    assert "because there is too little motion below" in found.reason


@pytest.mark.slow
def test_what_the_whole_recording_contradicts_is_not_chosen():
    """Folds that lack a direction tell nothing; all samples tell a bump of a third of the force."""
    names = ("gaussian", "coulomb-viscous", "lorentzian")
    alike = [
        selection.Candidate(name, 9 - 4 * (i == 1), np.ones(5), 0.1) for i, name in enumerate(names)
    ]
    tied = selection.Selection("coulomb-viscous", tuple(alike), names)
    found = selection._not_contradicted(tied, machine("gaussian", 0))
    assert found.name == "gaussian" and found.contradicted == ("coulomb-viscous",)
    assert "does not contradict, as it does coulomb-viscous" in repr(found).replace("\n", " ")
    assert selection._not_contradicted(tied, machine("coulomb-viscous", 0)) == tied


def test_the_standings_are_those_of_identifying_each_one():
    """The quick way on shared rows gives what fitting each model to each fold gives."""
    recording = machine("gaussian", 3)
    models = {name: jf.models.named(name) for name in ("coulomb-viscous", "symmetric-gaussian")}
    slow = {c.name: c for c in jf.select(recording, models).candidates}
    quick = {c.name: c for c in jf.select(recording, tuple(models)).candidates}
    for name in models:
        assert quick[name].filtered_force_error == pytest.approx(
            slow[name].filtered_force_error, rel=0.03
        )
        assert quick[name].parameters == slow[name].parameters


def test_the_interval_and_the_order():
    found = jf.select(machine("gaussian", 1))
    errors = [c.filtered_force_error for c in found.candidates]
    assert errors == sorted(errors) and len(errors) == len(jf.models.names())
    assert all(0 < c.half_width < c.filtered_force_error for c in found.candidates)


@pytest.mark.slow
def test_the_command(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    recording = machine("gaussian", 2)
    path = str(tmp_path / "axis.csv")
    columns = {"time": recording.time, "force": recording.force, "velocity": recording.velocity}
    io.write_table(path, jax.tree.map(np.asarray, columns))
    assert main(["select", path]) == 0
    said = capsys.readouterr().out
    assert "held-out error" in said and "* chosen: gaussian" in said
    assert main(["select", path, "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["model"] == "gaussian"
    assert main(["identify", path, "--model", "best", "--json", "-"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["name"] == "gaussian" and len(document["selection"]["candidates"]) == 10
    assert main(["select", str(tmp_path / "none.csv")]) == 2
    assert "jaxfric select" in capsys.readouterr().err


@pytest.mark.slow
def test_a_model_may_be_spelled_as_its_function():
    recording = jf.scenario.record(jf.scenario.machine(), force_noise=0.5, key=jax.random.key(0))
    spelled = jf.select(recording, ["coulomb_viscous", "lorentzian"])
    assert {one.name for one in spelled.candidates} == {"coulomb-viscous", "lorentzian"}
    shown = repr(spelled)
    assert shown.splitlines()[0].split()[:2] == ["model", "parameters"] and "lorentzian" in shown
    assert "<table" in spelled._repr_html_()
    with pytest.raises(ValueError, match="No model is called 'coulomb_viscos'"):
        jf.select(recording, ["coulomb_viscos"])
