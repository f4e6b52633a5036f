"""What changed in a machine between two recordings."""

import dataclasses
import json

import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import Recording, models, terms
from jaxfric.cli import main
from jaxfric.explanation import Earlier, common_factor, explain
from jaxfric.explanation.baseline import Baseline
from jaxfric.explanation.evidence import gather
from jaxfric.explanation.finding import Moved
from jaxfric.explanation.mismatch import Mismatch
from jaxfric.explanation.regression import fit, without_shapes
from jaxfric.explanation.sentences import changed_sentence, parameter
from jaxfric.identification.uncertainty import Estimate
from jaxfric.validation.proof.planning import plan
from jaxfric.validation.proof.trials import draw, record

from .test_cli import write_axis
from .test_explain import healthy as healthy, planted

NAMES = ("inertia", "coulomb+", "viscous+", "coulomb-", "viscous-")
VALUES = (5.0, 22.0, 66.0, 18.0, 54.0)


@pytest.fixture(autouse=True)
def _no_cache(monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")


def with_friction(recording, more):
    return planted(recording, terms.Coulomb(), (more,))


@pytest.mark.slow
def test_more_coulomb_friction_is_told_with_its_change(healthy):
    found = explain(with_friction(healthy[1], 2.0), Earlier(healthy[0]))
    assert found.verdict == "explained" and [f.effect for f in found.findings] == [
        "parameter_mismatch"
    ]
    moved = found.findings[0].parameters
    assert set(moved) == {"coulomb+", "coulomb-"}
    for name, value in (("coulomb+", 22.0), ("coulomb-", 18.0)):
        change = moved[name].value - moved[name].before
        error = np.hypot(moved[name].standard_error, moved[name].before_error)
        assert change == pytest.approx(2.0, abs=4 * error) and error < 0.5
        assert moved[name].before == pytest.approx(value, abs=1.0)
    assert "Coulomb friction forwards rose from 2" in found.findings[0].sentence
    assert "since run 0" in found.findings[0].sentence
    assert "What is named accounts for the difference" in found.summary


@pytest.mark.slow
def test_another_gain_is_told_by_one_number(healthy):
    old, new = healthy
    found = explain(dataclasses.replace(new, force=new.force / 0.88), Earlier(old))
    assert found.verdict == "explained"
    (finding,) = found.findings
    factor = finding.parameters["force_factor"]
    assert factor.before == 1.0 and float(factor.standard_error) < 0.01
    low, high = factor.interval()
    assert low < 1 / 0.88 < high
    assert (
        finding.sentence.startswith("One factor for all values") and "% lower" in finding.sentence
    )
    assert "friction alone" not in finding.sentence
    for name in ("inertia", "coulomb+", "coulomb-", "viscous+"):
        value = finding.parameters[name]
        assert float(value.value / value.before) == pytest.approx(float(factor.value))


@pytest.mark.slow
def test_friction_that_has_grown_by_one_factor_is_no_gain(healthy):
    """The inertia is what it was."""
    old, new = healthy
    law = terms.Directional(terms.Coulomb() + terms.Viscous())
    found = explain(planted(new, law, (4.4, 13.2, 3.6, 10.8)), Earlier(old))
    assert found.verdict == "explained"
    assert "force_factor" not in found.findings[0].parameters


@pytest.mark.slow
def test_the_same_machine_has_not_changed(healthy):
    found = explain(healthy[1], Earlier(healthy[0]))
    assert found.verdict == "consistent" and not found.findings
    assert "Nothing differs" in found.summary


@pytest.mark.slow
def test_another_homing_is_no_change(healthy):
    """Cogging of one amplitude at another phase: the encoder's zero is another."""
    cogging = (terms.Cogging(), (2.0, 1.0), (0.01,))
    old, new = (planted(run, *cogging) for run in healthy)
    moved = dataclasses.replace(new, position=new.position + jnp.asarray(0.0037))
    found = explain(moved, Earlier(old))
    assert found.verdict == "consistent", found.summary


def fine(draw, start):
    """A screw of 50 turns a stroke with an error of its pitch, and where it moved."""
    time = np.arange(0, 12, 0.002)
    rates, sizes = 2 * np.pi * np.array([0.13, 0.37]), np.array([0.2, 0.05])
    angle = rates * time[:, None] + start
    position, speed = np.sin(angle) @ sizes, np.cos(angle) @ (rates * sizes)
    force = -4 * np.sin(angle) @ (rates**2 * sizes) + 15 * np.sign(speed) + 40 * speed
    force += 2 * np.sin(2 * np.pi * position / 0.01) + 0.2 * draw.normal(size=time.shape)
    return Recording(time, force, position)


@pytest.mark.slow
def test_a_fine_wave_of_the_earlier_recording_is_known_by_its_period():
    """Of fifty cycles a stroke a coarse grid finds another one, and leaves the wave."""
    draw = np.random.default_rng(5)
    old, new = fine(draw, 0.0), fine(draw, 1.0)
    found = explain(new, Earlier(old))
    assert found.verdict == "consistent" and not found.findings


def test_a_baseline_with_a_fine_wave_is_fitted_at_its_period():
    evidence = gather(fine(np.random.default_rng(5), 0.0))
    whole = terms.Sum((terms.Inertia(), terms.Coulomb(), terms.Viscous(), terms.Cogging()))
    base = fit([whole], evidence, [None])
    assert base.betas[0][-1] == pytest.approx(0.01, rel=1e-4)
    assert base.energy < 1e-3 * float(evidence.target @ evidence.target)
    # Looked for anew beside a candidate, its period is where it was.
    assert np.array_equal(without_shapes(whole, base.betas[0]), base.betas[0])
    bump = models.gaussian()
    assert np.isnan(without_shapes(bump, np.array([0.02, 0.03]))).all()


def test_values_that_the_earlier_recording_hardly_shows_tell_no_factor():
    model = models.from_parameters(models.coulomb_viscous(), dict(zip(NAMES, VALUES, strict=True)))
    names = list(model.parameters)
    errors = np.array([0.3 * abs(float(v)) for v in model.parameters.values()])
    errors[names.index("viscous-")] *= 2
    errors[names.index("inertia")] = np.inf
    known = Baseline(model.term, "recording a.csv", model, np.diag(errors**2))
    assert [names[i] for i in common_factor._unknown(known)] == ["inertia", "viscous-"]
    assert common_factor._unknown(known._replace(covariance=None)) == ()


def test_a_factor_puts_the_whole_model_right_but_for_what_is_unknown():
    model = models.from_parameters(models.coulomb_viscous(), dict(zip(NAMES, VALUES, strict=True)))
    wrong = Mismatch({0: 1.0, 1: 2.0}, 0.9, 0.002, 1.0)
    assert common_factor.put_right(model, None) == (model, ())
    assert common_factor.put_right(model, wrong) == (model, (0, 1)) and wrong.numbers == 2
    one = wrong._replace(factor=1.2, unknown=(4,))
    right, free = common_factor.put_right(model, one)
    assert free == (4,) and one.numbers == 1
    np.testing.assert_allclose(right.alpha, 1.2 * np.asarray(model.alpha))


def test_the_sentence_has_both_values_and_the_error_of_the_change():
    moved = {
        "coulomb+": Moved(20.1, Estimate(22.3, 0.08, "N"), 0.06),
        "viscous-": Moved(240.0, Estimate(201.0, 4.0, "N·s/m"), 3.0),
    }
    assert changed_sentence(moved, 0.71, "old.csv") == (
        "Coulomb friction forwards rose from 20.10 to 22.30 N (± 0.23), viscous friction backwards "
        "fell from 240 to 201 N·s/m (± 12) since old.csv; 71% of the difference."
    )
    assert parameter("inertia") == "inertia" and parameter("coulomb") == "Coulomb friction"


@pytest.mark.slow
def test_the_command_takes_an_earlier_recording(tmp_path, capsys):
    old, new = (write_axis(tmp_path / f"{n}.csv", 4001, seed=i) for i, n in enumerate("ab"))
    out = tmp_path / "changed.json"
    assert main(["explain", new, "--baseline", new, "--json", str(out)]) == 2
    assert "b.csv itself" in capsys.readouterr().err and not out.exists()
    # The same commanded motion, as maintenance repeats it.
    assert main(["explain", new, "--baseline", old, "--json", str(out)]) == 0
    told = json.loads(out.read_text("utf-8"))
    assert told["baseline"]["name"] == "recording a.csv" and len(told["baseline"]["sha256"]) == 64
    assert told["verdict"] == "consistent" and "Nothing differs" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("name", ["00019", "00052"])
def test_what_the_earlier_recording_has_too_is_no_change(name):
    """Of healthy machines three in 27 had "changed" between two motions: by a law in which the
    model of the first lacks something of the machine, or whose size may be none.
    """
    (case,) = (case for case in plan(240, 777001, (0.1, 0.3)) if case.name == name)
    run = record(draw(case.seed, case.effects, case.size, dict(case.definitions)))
    found = explain(run.holdout, Earlier(run.recording))
    assert (found.verdict, found.findings) == ("consistent", [])
