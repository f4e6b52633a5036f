"""The methods of the map of regimes, on records without noise."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
pytest.importorskip("scipy")
import regime_methods  # noqa: E402
import regimes  # noqa: E402


@pytest.fixture(scope="module")
def record():
    return regimes.recorded(1e-6, 1e-9, 2.0, regimes.MASS, draws=3, seed=0)


@pytest.mark.parametrize("name", [n for n in regime_methods.METHODS if n[:3] not in ("seq", "LMS")])
def test_whole_periods_without_noise_give_the_friction(record, name):
    bias, spread = regimes.errors(regime_methods.METHODS[name](record))
    assert bias < 0.003 and spread < 0.003


def test_the_others_come_near(record):
    for name, most in (("sequential, mass told", 0.05), ("LMS", 0.2)):
        assert regimes.errors(regime_methods.METHODS[name](record))[0] < most


def test_only_the_told_mass_matters_where_the_record_does_not_close():
    record = regimes.recorded(1e-6, 1e-9, 0.85, 1.2 * regimes.MASS, draws=4, seed=1)
    found = {n: np.hypot(*regimes.errors(m(record))) for n, m in regime_methods.METHODS.items()}
    assert found["(P), mass told"] > 3 * found["(L)"]
    assert np.isnan(found["frequency domain"])
