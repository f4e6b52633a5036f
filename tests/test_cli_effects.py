"""The command that tells of the effects."""

import json

import pytest

from jaxfric.cli import main
from jaxfric.terms import glossary
from jaxfric.terms.effects import EFFECTS


@pytest.fixture(autouse=True)
def _no_cache(monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")


def printed(capsys, *arguments):
    assert main(["effects", *arguments]) == 0
    found = capsys.readouterr()
    assert found.err == ""
    return found.out


def test_all_effects_with_all_that_is_known(capsys):
    text = printed(capsys)
    flat = " ".join(text.split())
    for effect in EFFECTS.values():
        assert f"{effect.name}: {effect.equation}" in flat
        assert effect.separate_by in flat
        assert ", ".join(effect.confusable_with) in flat
        for name in (*effect.coordinates, *effect.needs):
            assert name.replace("_", " ") in flat
    assert max(map(len, text.splitlines())) <= 98


def test_one_effect_has_parameters_units_and_bounds(capsys):
    text = printed(capsys, "sticky_spot")
    lines = [line.split() for line in text.splitlines()]
    assert ["spot_force", "N", "solved", "for"] in lines
    assert next(line for line in lines if line[:1] == ["spot_width"])[1] == "m"
    assert "quarter of the stroke" in text and "Cross the place slowly" in text


def test_fixed_bounds_are_numbers_and_rivals_all_listed(capsys):
    text = printed(capsys, "viscous_nonlinearity")
    assert "from 0.25 to 4" in text
    for term in ("QuadraticDrag", "ShearThinning", "PowerLaw"):
        assert f"{term}: " in text
    assert "own" in printed(capsys, "stribeck")


def test_what_differs_in_the_number_of_harmonics_is_told_once(capsys):
    text = printed(capsys, "cogging")
    assert text.count("Cogging: ") == 1 and "cogging_harmonic3_cos" in text
    assert printed(capsys, "frictional_lag").count("FrictionalLag: ") == 1


def test_first_order_is_said(capsys):
    assert "first order" in printed(capsys, "backlash")


@pytest.mark.parametrize("name", EFFECTS)
def test_every_effect_can_be_asked_for(name):
    entry = glossary.document([name])["effects"][0]
    for shape in entry["terms"]:
        assert shape["law"] and shape["parameters"]
        for parameter in shape["parameters"]:
            assert parameter["name"] and parameter["unit"]
            assert len(parameter["range"]) > 5 and "\n" not in parameter["range"]
    text = glossary.detail(name)
    assert text.startswith(f"{name}: ") and max(map(len, text.splitlines())) <= 98


def test_json_of_all_and_of_one(capsys, tmp_path):
    found = json.loads(printed(capsys, "--json"))
    assert found["schema"] == "jaxfric.effects/1"
    assert [entry["name"] for entry in found["effects"]] == list(EFFECTS)
    out = tmp_path / "effects.json"
    assert printed(capsys, "cogging", "--json", str(out)) == ""
    entry = json.loads(out.read_text("utf-8"))["effects"]
    assert [each["name"] for each in entry] == ["cogging"]
    assert entry[0]["needs"] == ["position"]
    assert {"name": "pitch", "unit": "m"}.items() <= entry[0]["terms"][0]["parameters"][-1].items()


def test_an_unknown_effect_is_bad_usage(capsys):
    assert main(["effects", "gremlins"]) == 2
    found = capsys.readouterr()
    assert found.out == "" and found.err.count("\n") == 1
    assert "gremlins" in found.err and "cogging" in found.err
