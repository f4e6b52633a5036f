"""An effect from one file, that of CONTRIBUTING.md, is known everywhere at once."""

import ast
import contextlib
import importlib.util
import io
import json
import re
from pathlib import Path

import jax
import numpy as np
import pytest

import jaxfric as jf
from jaxfric import models
from jaxfric.cli import main
from jaxfric.export import export
from jaxfric.report import equations
from jaxfric.terms import effects, glossary
from jaxfric.validation import concealed, proof
from jaxfric.validation.proof import scoring, trials
from jaxfric.validation.proof.planning import Case

ROOT = Path(__file__).parents[1]
TRUTH = {"latch_force": 3.0, "latch_position": 0.012, "latch_width": 0.006}


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """The effect's file as a module."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    section = text[text.index("## Add an effect") :]
    path = tmp_path_factory.mktemp("own") / "latch.py"
    path.write_text(re.findall(r"^```python\n(.*?)^```", section, re.DOTALL | re.MULTILINE)[0])
    spec = importlib.util.spec_from_file_location("latch", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def latch(file):
    """The effect, registered for one test."""
    yield effects.register(file.LATCH)
    effects.unregister("latch")


@pytest.fixture
def model(latch):
    base = jf.terms.Inertia() + jf.terms.Coulomb()
    return models.from_parameters(base + latch.laws[0](), {"inertia": 2.0, "coulomb": 5.0} | TRUTH)


def recording(model):
    time = np.linspace(0.0, 6.0, 1201)
    position = 0.03 * np.sin(2 * np.pi * time / 3) + 0.004 * np.sin(2 * np.pi * time / 1.1)
    log = jf.Recording(time, 0 * time, position)
    return jf.Recording(time, jf.predict(model, log), position)


@pytest.mark.slow
def test_it_is_identified(model):
    found = jf.identify(model.term, recording(model))
    for name, value in TRUTH.items():
        assert float(found.parameters[name].value) == pytest.approx(value, rel=0.01), name


def test_it_is_simulated(model):
    log = recording(model)
    run = jf.simulate(model, log, controller=jf.PD(4000.0, 200.0))
    assert np.all(np.isfinite(run.position)) and float(np.std(run.position)) > 0.01


def test_it_is_saved_exported_and_shown(model):
    again = models.load(json.dumps(model.to_dict()))
    assert jax.tree.structure(again.term) == jax.tree.structure(model.term)
    for target in ("c", "st", "modelica"):
        assert "latch_force" in export(again, target).text.lower()
    table = export(again, "table", position=(-0.03, 0.03)).text
    assert "latch [N]" in table.splitlines()[0]
    row = equations.rows(again)[-1]
    assert row.name == "latch" and row.products[0].startswith("3 · ((x - 0.012) / 0.006)")


def test_it_is_documented(latch, capsys):
    assert latch.equation in glossary.overview()
    assert main(["effects", "latch"]) == 0
    told = capsys.readouterr().out
    assert "latch_position" in told and "Push the axis out of the place" in told
    page = (ROOT / "docs/pages/reference/effects.md").read_text(encoding="utf-8")
    with contextlib.redirect_stdout(io.StringIO()) as said:
        exec(re.findall(r"^```python[^\n]*\n(.*?)^```", page, re.DOTALL | re.MULTILINE)[0], {})
    assert "## latch\n" in said.getvalue()


def test_it_is_concealed_with_the_size_that_was_asked_for(latch):
    assert concealed.names()[-1] == "latch"
    plan = proof.plan(24 * len(concealed.names()), 1, (0.1, 0.3))
    assert any("latch" in case.effects for case in plan)
    with jax.enable_x64(True):
        machine = concealed.draw(3, ("latch",), 0.2)
    truth = machine.truth["latch"]
    assert truth["size"] == pytest.approx(0.2) and truth["where"] == "position"
    assert machine.plan.low < truth["latch_position"] < machine.plan.low + machine.plan.stroke


@pytest.mark.slow
def test_prove_draws_it_and_explain_names_it(latch, tmp_path):
    case = Case("00001", "single", 4, ("latch",), (0.2, 0.2))
    for part in (trials.SEALED, trials.ANSWERS):
        (tmp_path / part).mkdir()
    trials.trial(case, tmp_path)
    (score,) = scoring.scores(tmp_path, [case])
    assert score.error is None and score.exact, score
    assert {p.name for p in score.parameters} == set(TRUTH)
    assert all(p.error < 0.1 for p in score.parameters)
    answer = json.loads((tmp_path / "answers" / "00001.json").read_text(encoding="utf-8"))
    assert answer["findings"][0]["sentence"].startswith("A magnet pulls towards")


def test_what_is_there_already_is_refused(file):
    with pytest.raises(ValueError, match="cogging already"):
        effects.register(effects.Effect("cogging", "", "position"))
    with pytest.raises(ValueError, match="Cogging already"):
        effects.register(effects.Effect("ripple", "", "position", laws=(jf.terms.Cogging,)))
    with pytest.raises(ValueError, match="No effect is called 'gremlins'"):
        effects.register(effects.Effect("ripple", "", "position", confusable_with=("gremlins",)))
    with pytest.raises(ValueError, match="there are values, friction"):
        effects.Effect("ripple", "", "magic")
    assert "ripple" not in effects.EFFECTS and effects.law_named("Latch") is None


# Where a literal only looks like an effect: the demo's machine, a joint's spring, a model's own
# limit, the clock of a stream, and the verb.
LIKE_ONE = {
    ("models/model.py", "force_limit"), ("cli/watch.py", "clock"),
    ("cli/demo.py", "cogging"), ("export/simple.py", "spring"),
    ("explanation/attributes.py", "spring"),
}  # fmt: skip
VERB = "presliding"


def test_nothing_outside_its_file_names_an_effect_or_asks_for_its_law():
    package = Path(jf.__file__).parent
    laws = {law.__name__ for effect in effects.EFFECTS.values() for law in effect.laws}
    curves = {"Gaussian", "Lorentzian", "Exponential", "Generalised"}  # of the models, too
    found = set()
    for path in package.rglob("*.py"):
        file = path.relative_to(package).as_posix()
        # The machines of `prove` say what they conceal.
        if file.startswith(("terms/", "validation/concealed/")):
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Constant) and node.value in set(effects.EFFECTS) - {VERB}:
                found.add((file, node.value))
            asks = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "isinstance"
            for part in ast.walk(node) if asks or isinstance(node, ast.Compare) else ():
                name = getattr(part, "id", getattr(part, "attr", ""))
                if name in laws - curves:
                    found.add((file, name))
    assert found <= LIKE_ONE, sorted(found - LIKE_ONE)
