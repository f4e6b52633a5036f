"""Coverage of the 95 % intervals on axes in closed loop: encoder, held force, slow hidden load."""

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.identification.identified import result_names
from tests.machines import fleet


def held(name, projection, count, seed, **machine):
    """Whether each interval holds the truth, (parameters, successful machines)."""
    logs, truth = fleet(count, seed, name, **machine)
    found = jf.identify(name, logs, projection=projection)
    fine = np.asarray(found.result._value) == result_names().index("successful")
    assert fine.mean() > 0.95
    inside = []
    for key, estimate in found.parameters.items():
        low, high = (np.asarray(limit) for limit in estimate.interval(0.95))
        inside.append(((low <= truth[key]) & (truth[key] <= high))[fine])
    return np.array(inside)


PROJECTIONS = pytest.mark.parametrize(
    "projection", [jf.ClosedWindows(), jf.WeakForm(24)], ids=["closed", "weak"]
)


# 96 to 97 % were measured on 200 machines; blocks of 1/64 of the record, as short as the
# correlation, would give 82 %.
@pytest.mark.slow
@PROJECTIONS
def test_coverage_in_closed_loop_with_a_slow_load(projection):
    """The hidden load is correlated over 50 ms, the record holds 40 times twice that."""
    inside = held("coulomb-viscous", projection, 48, seed=1)
    # 48 machines x 5 parameters; inertia and the two directions are nearly independent, so count
    # 144: 0.93 less three binomial deviations of 0.021.
    assert inside.mean() >= 0.865, inside.mean(axis=1)


# A kernel leaves out the slow samples next to reversals, where the bump is.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "projection"),
    [("gaussian", jf.ClosedWindows()), ("coulomb-viscous", jf.WeakForm(24))],
    ids=["closed", "weak"],
)
@pytest.mark.parametrize("counts", [None, 1e4])
def test_coverage_over_many_closed_loops(name, projection, counts):
    inside = held(name, projection, 200, seed=2, counts=counts)
    print(f"\n{name} {projection} {counts}: {inside.mean():.3f}", inside.mean(axis=1).round(3))
    assert 0.90 <= inside.mean() <= 0.98, inside.mean(axis=1)
