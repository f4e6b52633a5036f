"""What a recording does not determine of its baseline is none: another motion would show it."""

import numpy as np
import pytest

from jaxfric import Recording, explain


def axis(rate, seed, drag=0.0, bump=0.0):
    """Coulomb and viscous friction on sines of some `rate`, Hz, with a drag c v abs(v) and a
    Stribeck bump that is 5 mm/s wide.
    """
    draw = np.random.default_rng(seed)
    time = np.arange(0.0, 20.0, 1e-3)
    rates = 2 * np.pi * rate * np.array([1.0, 1.7])
    angles = rates * time[:, None] + draw.uniform(0, 2 * np.pi, 2)
    sizes = 0.06 / np.array([1.0, 2.5])
    x, v = np.sin(angles) @ sizes, np.cos(angles) @ (sizes * rates)
    a = -np.sin(angles) @ (sizes * rates**2)
    dry = 9.0 + bump * np.exp(-((v / 5e-3) ** 2))
    force = 4 * a + dry * np.sign(v) + 30 * v + drag * v * np.abs(v)
    return Recording(time, force + 0.08 * draw.normal(size=len(time)), x)


@pytest.mark.slow
@pytest.mark.parametrize("drag", [0.0, 40.0])
def test_a_bump_that_nothing_determines_is_none_on_a_slower_recording(drag):
    """The axis turns within a kernel: the rows begin above the speeds of a bump."""
    found = explain(axis(1.5, 0, drag), holdout=axis(0.15, 1, drag))
    assert [each.effect for each in found.findings] == ["viscous_nonlinearity"] * bool(drag)
    for way in "+-":  # or one of 0.2 % of the friction that is as wide as the drag
        assert abs(float(found.model.parameters[f"stribeck_force{way}"])) < 0.02
    floor = found.fit["holdout_noise_floor"]
    assert found.fit["holdout_force_error"]["after"] < 1.2 * floor


@pytest.mark.slow
def test_a_bump_that_is_seen_stays():
    found = explain(axis(0.15, 0, bump=4.0), holdout=axis(0.2, 1, bump=4.0))
    assert found.verdict == "consistent"
    assert float(found.model.parameters["stribeck_force+"]) == pytest.approx(4.0, rel=0.1)
