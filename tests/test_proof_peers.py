"""The methods that the proof is compared with find what is plainly there, and no more."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import peer_methods as methods

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
