"""The claims of Kim, Kim & Ha (2004), section IV, on our own machine; where one fails, it is said.

What holds: ALM is consistent, AGM is close, ACVM is wrong at low velocity only, and neither mass
nor acceleration is needed. What does not: on a whole period, problem (P) is no worse than (L), even
with a mass 20 % off: acceleration is orthogonal there, whatever
stands in front of it. On a record that does not close, with noise, (L) is
worse than (P) with the mass known or fitted (0.16 N against 0.02 N): it wins only where the mass is
wrong. And 24 noise draws put 85 %, not 95 %, of the truth within two standard errors.
"""

import importlib.util
import pathlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import ClosedWindows, models
from jaxfric.identification.identifying import identify
from jaxfric.simulation import scenario
from jaxfric.simulation.control import Encoder

HELPER = pathlib.Path(__file__).parents[1] / "benchmarks" / "problem_p.py"
spec = importlib.util.spec_from_file_location("problem_p", HELPER)
compare = importlib.util.module_from_spec(spec)
spec.loader.exec_module(compare)

SEEDS = 12
NOISE = 0.5
FRICTION = [name for name in scenario.TRUTH if name != "inertia"]
NARROW = [scenario.TRUTH["stribeck_velocity+"], scenario.TRUTH["stribeck_velocity-"]]


@pytest.fixture(scope="module")
def period():
    return scenario.record(scenario.machine())


def noisy_batch(recording, count=SEEDS):
    """The same motion with independent force noise (which does not act on the axis) in each row."""
    noise = NOISE * jax.random.normal(jax.random.key(7), (count, recording.num_samples))
    batch = jax.tree.map(lambda x: jnp.broadcast_to(x, (count, *x.shape)), recording)
    return jax.tree.unflatten(
        jax.tree.structure(batch),
        [x + noise if x is batch.force else x for x in jax.tree.leaves(batch)],
    )


def errors(found):
    """Errors of the friction parameters and their standard errors, each (seeds, parameters)."""

    def row(one):
        estimates = [one.parameters[name] for name in FRICTION]
        return tuple(jnp.stack([e[i] for e in estimates]) for i in (0, 1))

    values, deviations = jax.vmap(row)(found)
    truth = np.array([scenario.TRUTH[name] for name in FRICTION])
    return np.asarray(values) - truth, np.asarray(deviations)


def curve_error(found, low, high):
    parameters = {name: float(value) for name, value in found.model.parameters.items()}
    model = models.from_parameters(found.model.term, parameters)
    return compare.curve_distance(model, scenario.machine(), low, high)


def test_the_record_is_one_closed_period(period):
    v = np.asarray(period.velocity)
    assert abs(v[0] - v[-1]) < 1e-6 * np.max(np.abs(v))
    np.testing.assert_allclose(period.time[-1], scenario.PERIOD)
    assert np.mean(v == 0.0) > 0.01  # it sticks at reversals
    force, friction = (
        np.asarray(period.force),
        np.asarray(scenario.machine().friction(period.velocity)),
    )
    inertial = scenario.TRUTH["inertia"] * np.gradient(v, 1 / 5000.0)
    slip = np.abs(v) > 0.002
    assert np.linalg.norm((force - friction - inertial)[slip]) < 0.005 * np.linalg.norm(force[slip])


@pytest.mark.slow
def test_alm_is_exact_without_noise(period):
    found = identify("lorentzian", period)
    assert found.projection == "closed_windows"
    for name in FRICTION:
        assert abs(float(found.parameters[name].value) / scenario.TRUTH[name] - 1) < 2e-3, name


@pytest.mark.slow
def test_alm_intervals_cover_the_truth(period):
    error, deviation = errors(identify("lorentzian", noisy_batch(period)))
    covered = np.mean(np.abs(error) < 2.0 * deviation)
    # Nominal 95 % of 24 x 8 estimates; those of one run are dependent, so count 24 x 2.
    assert covered > 0.85, covered


@pytest.mark.slow
def test_alm_error_shrinks_with_the_length_of_the_record(period):
    longer = scenario.record(scenario.machine(), periods=8)
    spread = []
    for recording in (period, longer):
        error, _ = errors(identify("lorentzian", noisy_batch(recording)))
        spread.append(np.sqrt(np.mean(error**2, axis=0)))
    ratio = np.exp(np.mean(np.log(spread[1] / spread[0])))
    assert ratio < 0.5  # 1/√8 = 0.35 expected


@pytest.mark.slow
def test_agm_is_close_and_acvm_wrong_only_at_low_velocity(period):
    alm, agm, acvm = (identify(n, period) for n in ("lorentzian", "gaussian", "coulomb-viscous"))
    whole = [curve_error(found, 0.002, 0.18) for found in (alm, agm, acvm)]
    assert whole[0] < 0.1 * whole[1] < 0.1 * whole[2]
    # Break-away is 28 N: AGM within 2 %, ACVM within 5 % above and beyond 10 % at low velocity.
    assert whole[1] < 0.02 * 28
    assert curve_error(acvm, 0.04, 0.18) < 0.05 * 28
    assert curve_error(acvm, 1e-4, 0.01) > 0.1 * 28


@pytest.mark.slow
def test_neither_mass_nor_acceleration_is_needed_and_p_needs_the_right_mass(period):
    """On a record that does not close, (P) with a wrong mass is biased; (L) closes its window."""
    cut = jax.tree.map(lambda x: x[:8500], period)
    truth = scenario.machine()
    found = identify("lorentzian", cut, projection=ClosedWindows())
    wrong = compare.problem_p(truth.term, cut, NARROW, 1.2 * scenario.TRUTH["inertia"])
    assert compare.curve_error(wrong, truth, 0.002, 0.18) > 0.2
    assert curve_error(found, 0.002, 0.18) < 0.02
    # Its window holds a tenth of the squared speed forward: by default the weak form uses it all.
    whole = identify("lorentzian", cut)
    assert whole.projection == "weak_form"
    assert curve_error(whole, 0.002, 0.18) < curve_error(found, 0.002, 0.18)


@pytest.mark.slow
def test_on_a_whole_period_a_wrong_mass_does_not_hurt_p(period):
    """Lemma 1: so problem (P) is not worse than (L) here, only dearer."""
    truth = scenario.machine()
    wrong = compare.problem_p(truth.term, period, NARROW, 1.2 * scenario.TRUTH["inertia"])
    assert compare.curve_error(wrong, truth, 0.002, 0.18) < 0.01


@pytest.mark.slow
def test_through_an_encoder_the_curve_is_still_within_one_percent():
    """At 5 µm the Stribeck velocity comes out 10 % wide; the curve is what stays true."""
    for resolution, bound in ((1e-7, 0.002), (1e-6, 0.003), (5e-6, 0.01)):
        recording = scenario.record(
            scenario.machine(), 1, Encoder(resolution), NOISE, jax.random.key(1)
        )
        assert curve_error(identify("lorentzian", recording), 0.002, 0.18) < bound * 28
