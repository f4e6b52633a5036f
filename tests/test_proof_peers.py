"""The methods that the proof is compared with find what is plainly there, and no more."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import peer_methods as methods
import prove_peers

ROWS = 400


@pytest.fixture
def rows():
    """A baseline of two columns, a library of twelve, and a force that holds the fourth."""
    rng = np.random.default_rng(1)
    base, columns = rng.normal(size=(ROWS, 2)), rng.normal(size=(ROWS, 12))
    target = base @ [3.0, -2.0] + 0.7 * columns[:, 3] + 0.1 * rng.normal(size=ROWS)
    return base, columns, target


@pytest.mark.parametrize("name", methods.SELECTING)
def test_a_column_is_selected(name, rows):
    pytest.importorskip(methods.NEEDS.get(name, "numpy"))
    taken = methods.SELECTING[name](*rows)
    assert taken[0] == 3
    assert len(taken) <= 3


@pytest.mark.parametrize("name", methods.SELECTING)
def test_selection_does_not_depend_on_units(name, rows):
    pytest.importorskip(methods.NEEDS.get(name, "numpy"))
    base, columns, target = rows
    scaled = base, columns * np.geomspace(1e-6, 1e6, 12), 1e-6 * target
    assert methods.SELECTING[name](*scaled) == methods.SELECTING[name](*rows)


@pytest.mark.parametrize("name", methods.PREDICTING)
def test_a_residual_is_predicted(name):
    pytest.importorskip(methods.NEEDS[name])
    rng = np.random.default_rng(2)
    seen, held = rng.uniform(-1, 1, (2, ROWS, 3))
    wave = lambda s: 1e-3 * np.sin(3 * s[:, 0])  # noqa: E731
    left = wave(held) - methods.PREDICTING[name](seen, wave(seen), held)
    assert np.linalg.norm(left) < 0.3 * np.linalg.norm(wave(held))


# The table


def case(kind, effect, before, after, oracle, *named):
    said = {
        "explain": {"named": [[name] for name in named], "after": after},
        "boosted trees": {"named": None, "after": before},
    }
    effects = [effect] if effect else []
    return {"kind": kind, "effects": effects, "before": before, "oracle": oracle, "said": said}


def test_all_methods_are_judged_by_the_oracle_of_the_proof():
    cases = [
        case("single", "cogging", 0.10, 0.05, 0.04, "cogging", "spring"),
        case("single", "cogging", 0.10, 0.10, 0.04),
        case("healthy", None, 0.10, 0.12, None, "spring"),
        case("healthy", None, 0.10, 0.10, None),
    ]
    explain, trees = prove_peers.rows(cases, ["boosted trees"])
    assert explain[0] == "explain" and explain[1].startswith("50.0%")  # healthy, something named
    assert explain[2].startswith("50.0%") and explain[4:6] == ("1", "7.50%")
    assert explain[6] == "41.7%" and explain[7].startswith("50.0%")
    assert trees[1:5] == ("-",) * 4 and trees[6] == "0.0%" and trees[7].startswith("0.0%")


def test_a_case_without_answer_is_left_out():
    assert prove_peers.explained({"error": "it broke"}) is None
    answer = {
        "error": None,
        "findings": [{"effect": "spring"}],
        "fit": {"holdout_force_error": {"before": 0.2, "after": 0.1}},
    }
    assert prove_peers.explained(answer) == {"named": [["spring"]], "after": 0.1}


def test_methods_without_their_package_are_left_out(monkeypatch):
    there = prove_peers.importlib.util.find_spec
    monkeypatch.setattr(
        prove_peers.importlib.util, "find_spec", lambda m: None if m == "sklearn" else there(m)
    )
    assert not set(methods.PREDICTING) & set(prove_peers.there())
    assert {"stepwise", "stlsq", "raw ranking"} <= set(prove_peers.there())
