"""Forces at one place of the stroke."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import Recording, models, terms
from jaxfric.explanation import explain
from jaxfric.explanation.sentences import told
from jaxfric.identification.uncertainty import Estimate
from jaxfric.terms.effects import EFFECTS


def axis(inertia, friction, reach, term, alpha, rate=1000.0, seed=0, duration=20.0):
    """A recording of sine waves over a stroke, of a machine with that term."""
    draw = np.random.default_rng(seed)
    time = np.arange(int(duration * rate)) / rate
    rates = 2 * np.pi * np.array([0.21, 0.47, 0.9]) * draw.uniform(0.9, 1.1, 3)
    phases = draw.uniform(0, 2 * np.pi, 3)
    sizes = 0.5 * reach * np.array([0.7, 0.2, 0.1])
    waves = [(w, w * time + p, s) for w, p, s in zip(rates, phases, sizes, strict=True)]
    x, v, a = (
        sum(s * w**n * f(angle) for w, angle, s in waves)
        for n, f in ((0, np.sin), (1, np.cos), (2, lambda angle: -np.sin(angle)))
    )
    clean = Recording(time, np.zeros_like(time), x, v)
    own = np.asarray(term.columns(clean)) @ np.asarray(alpha)
    force = inertia * a + friction * (np.sign(v) + 0.3 * v / np.abs(v).max()) + own
    noise = 0.03 * friction * draw.standard_normal(len(time))
    return Recording(time, jnp.asarray(force + noise), jnp.asarray(x))


def test_less_friction_at_a_place_is_said_as_that():
    worn = {
        "spot_force": Estimate(np.float64(-20.0), np.float64(0.2), "N"),
        "spot_position": Estimate(np.float64(0.5), np.float64(0.001), "m"),
        "spot_width": Estimate(np.float64(0.06), np.float64(0.001), "m"),
    }
    assert told(EFFECTS["sticky_spot"], worn).startswith("Friction is lower by 20.00 N ± 0.")
    more = worn | {"spot_force": Estimate(np.float64(20.0), np.float64(0.2), "N")}
    assert told(EFFECTS["sticky_spot"], more).startswith("Extra friction of 20.00 N ± 0.")


def test_no_place_has_less_friction_than_none():
    beta = np.array([0.5, 0.06])
    assert terms.StickySpot().burden(beta, np.array([-20.0])).friction == 20.0
    assert terms.StickySpot().burden(beta, np.array([20.0])) is None


def test_a_force_at_one_place_is_told_by_where_it_pulls():
    """Where the axis needs a force upwards, one acts downwards."""
    up = {
        "local_force": Estimate(np.float64(12.0), np.float64(0.2), "N"),
        "local_force_position": Estimate(np.float64(0.5), np.float64(0.001), "m"),
        "local_force_width": Estimate(np.float64(0.06), np.float64(0.001), "m"),
    }
    for value, way in ((12.0, "smaller"), (-12.0, "larger")):
        values = up | {"local_force": up["local_force"]._replace(value=np.float64(value))}
        text = told(EFFECTS["local_force"], values)
        assert "a force of 12.00 N ± 0." in text and f"towards {way} positions" in text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "machine", "at", "width", "size"),
    [
        (terms.StickySpot, (40.0, 30.0, 0.8), -0.15, 0.05, -12.0),  # less friction
        (terms.StickySpot, (3e-4, 0.02, 30.0), 6.0, 1.5, -0.012),
        (terms.LocalForce, (40.0, 30.0, 0.8), 0.1, 0.06, 8.0),  # and no wave
        (terms.LocalForce, (3e-4, 0.02, 30.0), -5.0, 2.0, -0.01),
    ],
)
def test_what_acts_at_one_place_is_found(law, machine, at, width, size):
    runs = [axis(*machine, law(at, width), (size,), seed=seed) for seed in (0, 1)]
    found = explain(runs[0], models.gaussian(), runs[1])
    (finding,) = found.findings
    force, place = law.affine[0].name, law.nonlinear[0].name
    assert EFFECTS[finding.effect].laws == (law,) and found.verdict == "explained"
    assert float(finding.parameters[force].value) == pytest.approx(size, rel=0.1)
    assert float(finding.parameters[place].value) == pytest.approx(at, abs=0.2 * width)
