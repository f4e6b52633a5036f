"""Models: a sum with its parameters, by name and as JSON."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st

from jaxfric import models, terms
from jaxfric.data.recording import Recording

ALL = models.names()


def filled(name, units=()):
    """The named model with a value of its own for every parameter."""
    term = models.named(name)
    names = [p.name for p in (*term.affine, *term.nonlinear)]
    return models.from_parameters(term, {n: 0.5 + 0.1 * i for i, n in enumerate(names)}, units)


def motion(v=None):
    v = np.linspace(-1.0, 1.0, 21) if v is None else v
    return Recording(time=np.arange(v.size, dtype=float), force=np.zeros_like(v), velocity=v)


def test_the_names_of_the_contract():
    plain = ["coulomb-viscous", "gaussian", "lorentzian", "exponential", "generalised"]
    assert sorted(ALL) == sorted([*plain, *(f"symmetric-{name}" for name in plain)])


@pytest.mark.parametrize("name", ALL)
def test_named_models_have_the_parameters_of_their_name(name):
    term = models.named(name)
    names = [p.name for p in (*term.affine, *term.nonlinear)]
    assert names[0] == "inertia"
    signed = {n for n in names if n.endswith(("+", "-"))}
    if name.startswith("symmetric-"):
        assert not signed
        assert "offset" in names
    else:
        assert signed == set(names[1:])
    assert any(n.startswith("stribeck_velocity") for n in names) == ("viscous" not in name)


def test_the_parameters_of_the_contract():
    assert list(filled("gaussian").parameters) == [
        "inertia", "coulomb+", "viscous+", "stribeck_force+", "coulomb-", "viscous-",
        "stribeck_force-", "stribeck_velocity+", "stribeck_velocity-",
    ]  # fmt: skip


def test_underscores_serve_for_hyphens():
    assert models.named("coulomb_viscous").affine == models.coulomb_viscous().affine


def test_an_unknown_name_is_refused_with_the_names_there_are():
    with pytest.raises(ValueError, match=r"'stribek'.*gaussian.*symmetric-lorentzian"):
        models.named("stribek")


# ---- parameters by name ----


@pytest.mark.parametrize("name", ALL)
def test_values_go_in_by_name_and_come_out_by_name(name):
    model = filled(name)
    again = models.from_parameters(model.term, model.parameters)
    assert list(again.parameters) == list(model.parameters)
    np.testing.assert_array_equal(list(again.parameters.values()), list(model.parameters.values()))


def test_a_missing_parameter_is_named():
    with pytest.raises(ValueError, match=r"Missing parameter viscous.*needs coulomb, viscous"):
        models.from_parameters(terms.Coulomb() + terms.Viscous(), {"coulomb": 1.0})


def test_an_unknown_parameter_is_named():
    with pytest.raises(ValueError, match=r"No parameter colomb; there are coulomb"):
        models.from_parameters(terms.Coulomb(), {"coulomb": 1.0, "colomb": 2.0})
    with pytest.raises(ValueError, match="No parameter viscous"):
        filled("gaussian").with_parameters({"viscous": 1.0})


def test_with_parameters_replaces_those_given_only():
    before = filled("generalised")
    after = before.with_parameters({"stribeck_exponent-": 1.9, "inertia": 7.0})
    changed = {n for n, v in after.parameters.items() if float(v) != float(before.parameters[n])}
    assert changed == {"stribeck_exponent-", "inertia"}
    assert float(after.parameters["stribeck_exponent-"]) == 1.9


def test_parameters_of_a_batch_have_a_leading_axis():
    rows = [filled("gaussian"), filled("gaussian").with_parameters({"inertia": 9.0})]
    batch = jax.tree.map(lambda *x: jnp.stack([jnp.asarray(y) for y in x]), *rows)
    assert batch.parameters["inertia"].shape == (2,)
    np.testing.assert_array_equal(batch.parameters["inertia"], [0.5, 9.0])
    np.testing.assert_array_equal(
        batch.parameters["stribeck_velocity-"],
        [float(row.parameters["stribeck_velocity-"]) for row in rows],
    )


# ---- force ----


def test_force_and_friction_by_hand():
    values = {"coulomb+": 2.0, "viscous+": 3.0, "coulomb-": 4.0, "viscous-": 5.0, "inertia": 6.0}
    model = models.from_parameters(models.coulomb_viscous(), values)
    v = np.array([-2.0, 0.0, 2.0])
    np.testing.assert_allclose(model.force(motion(v)), [-14.0, 0.0, 8.0])
    np.testing.assert_allclose(model.friction(v), [-14.0, 0.0, 8.0])
    np.testing.assert_allclose(model.momentum(motion(v)), 6.0 * v)


def test_friction_takes_any_shape():
    model = filled("lorentzian")
    v = np.linspace(-1.0, 1.0, 6)
    assert model.friction(0.5).shape == ()
    np.testing.assert_array_equal(model.friction(v.reshape(2, 3)), model.friction(v).reshape(2, 3))


@pytest.mark.parametrize("name", models.NAMED)
@given(v=st.floats(1e-6, 1e3))
def test_symmetric_friction_is_odd_but_for_the_offset(name, v):
    model = filled(f"symmetric-{name}")
    offset = float(model.parameters["offset"])
    forward, backward = np.asarray(model.friction(np.array([v, -v]))) - offset
    assert forward == pytest.approx(-backward, rel=1e-12)


@pytest.mark.parametrize("name", models.NAMED)
def test_equal_directions_are_the_symmetric_model(name):
    tied = filled(f"symmetric-{name}").with_parameters({"offset": 0.0})
    values = {n: float(v) for n, v in tied.parameters.items() if n != "offset"}
    split = {f"{n}{s}": v for n, v in values.items() if n != "inertia" for s in "+-"}
    free = models.from_parameters(models.named(name), split | {"inertia": values["inertia"]})
    v = np.linspace(-1.0, 1.0, 21)
    np.testing.assert_allclose(free.friction(v), tied.friction(v), rtol=1e-14)


def test_force_is_differentiable_by_every_parameter():
    model = filled("generalised")
    grad = jax.grad(lambda m: jnp.sum(m.force(motion()) ** 2))(model)
    assert all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(grad))


# ---- JSON ----


@pytest.mark.parametrize("name", ALL)
def test_json_gives_the_model_back(name):
    model = filled(name, {"force": "N·m", "position": "rad"})
    again = models.load(json.dumps(model.to_dict(), allow_nan=False))
    assert again.units == model.units
    assert {n: float(v) for n, v in again.parameters.items()} == {
        n: float(v) for n, v in model.parameters.items()
    }
    np.testing.assert_array_equal(again.force(motion()), model.force(motion()))
    assert again.to_dict() == model.to_dict()


def test_units_are_written_beside_the_values():
    document = filled("gaussian", {"force": "N·m", "position": "rad"}).to_dict()
    assert document["parameters"]["inertia"]["unit"] == "kg·m²"
    assert document["parameters"]["viscous+"]["unit"] == "N·m·s/rad"
    assert document["schema"] == "jaxfric.model/1"


def test_a_model_inside_another_document_is_found():
    model = filled("gaussian")
    text = json.dumps({"schema": "jaxfric.explanation/1", "model": model.to_dict()})
    assert models.load(text).to_dict() == model.to_dict()


def damaged(change):
    document = json.loads(json.dumps(filled("gaussian").to_dict()))
    change(document)
    return json.dumps(document)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "JSON"),
        ("{", "JSON"),
        ("[1, 2]", "model document"),
        ("7", "model document"),
        ("null", "model document"),
        ("{}", "schema"),
        ('{"schema": "jaxfric.model/2"}', r"jaxfric\.model/2"),
        ('{"schema": "x", "model": 3}', "model document"),
        ('{"schema": "jaxfric.model/1"}', "term"),
        (damaged(lambda d: d.pop("parameters")), "parameters"),
        (damaged(lambda d: d["parameters"].pop("inertia")), "Missing parameter inertia"),
        (damaged(lambda d: d["parameters"].update(x={"value": 1.0})), "No parameter x"),
        (damaged(lambda d: d["parameters"]["inertia"].update(value="heavy")), "inertia"),
        (damaged(lambda d: d["parameters"]["inertia"].update(value=[])), "inertia"),
        (damaged(lambda d: d["parameters"].update(inertia=3.0)), "damaged"),
        (damaged(lambda d: d["term"].update(type="Nonsense")), "Nonsense"),
        (damaged(lambda d: d["term"].update(type="AbstractLaw")), "AbstractLaw"),
        (damaged(lambda d: d["term"].update(type=["Sum"])), "damaged|term"),
        (damaged(lambda d: d["term"].pop("type")), "damaged"),
        (damaged(lambda d: d["term"].update(terms=3)), "damaged"),
        (damaged(lambda d: d["term"].update(terms=[1, 2])), "damaged"),
        (damaged(lambda d: d["term"]["terms"][1].pop("negative")), "damaged"),
        (damaged(lambda d: d["term"]["terms"][0].update(colour="red")), "damaged"),
        (damaged(lambda d: d.update(units=3)), "units"),
        (damaged(lambda d: d.update(units={"force": 3})), "units"),
    ],
)
def test_a_damaged_document_is_refused_with_what_is_wrong(text, message):
    with pytest.raises(ValueError, match=message):
        models.load(text)


def test_a_parameter_that_the_term_has_a_value_of_may_be_left_out():
    """As in a document of an earlier version, whose loads had no asymmetry."""
    sides = {f"{name}{sign}": 1.0 for sign in "+-" for name in ("coulomb", "viscous")}
    load = {"load_inertia": 0.5, "load_resonance": 9.0, "damping_ratio": 0.1}
    term = models.coulomb_viscous() + terms.DryCompliance()
    values = {"inertia": 2.0} | sides | load | {"load_deceleration": 2.0}
    model = models.from_parameters(term, values)
    assert float(model.parameters["load_asymmetry"]) == 0.0
    document = model.to_dict()
    del document["parameters"]["load_asymmetry"]
    assert float(models.Model.from_dict(document).parameters["load_asymmetry"]) == 0.0
    with pytest.raises(ValueError, match="Missing parameter load_deceleration"):
        models.from_parameters(term, {"inertia": 2.0} | sides | load)
