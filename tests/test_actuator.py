"""An actuator in simulation: what arrives of a command is what `predict` would have asked for."""

import json

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric import models, terms
from jaxfric.export.parts import unwritten
from jaxfric.models import coulomb_viscous, from_parameters
from jaxfric.simulation.errors import arrived, force_error

AXIS = {"inertia": 2.0, "coulomb+": 5.0, "coulomb-": 6.0, "viscous+": 10.0, "viscous-": 11.0}
FAULTS = {
    "gain asymmetry": (terms.GainAsymmetry(), {"gain_asymmetry": 0.2}),
    "lower gain": (terms.GainAsymmetry(), {"gain_asymmetry": -0.4}),
    "force ripple": (terms.ForceRipple(), {"pitch": 0.04, "ripple_sin": 0.1, "ripple_cos": -0.05}),
    "force constant": (
        terms.PositionDependentForceConstant(-0.06, 0.04, 2),
        {"command_at_low_end": 0.3, "command_at_high_end": 0.1},
    ),
    "dead-band": (terms.ActuatorDeadband(), {"deadband": 2.0}),
    "saturation": (terms.ActuatorSaturation(), {"saturation": 0.3, "knee": 8.0}),
    "soft saturation": (
        terms.SoftSaturation(),
        {"saturation": 1.0, "saturation_level": 25.0},
    ),
    "load friction": (terms.LoadDependentFriction(), {"load_friction": 0.1}),
    "reaction friction": (terms.ReactionFriction(), {"reaction_friction": 0.2}),
    "gain step": (terms.GainStep(), {"step_gain": 0.1, "step_time": 0.7}),
    "delay": (terms.TransportDelay(), {"delay": 0.0043}),
    "lag": (terms.ActuatorLag(), {"lag": 0.004}),
}


def axis(*names):
    term, values = coulomb_viscous(), dict(AXIS)
    for name in names:
        term, values = term + FAULTS[name][0], values | FAULTS[name][1]
    return from_parameters(term, values)


def swing(count=1500, dtype=float):
    t = np.arange(count) * 1e-3
    position = 0.05 * np.sin(2 * np.pi * t)
    return jf.Recording(*(jnp.asarray(x, dtype) for x in (t, 0 * t, position)))


def distance(model, run):
    """Of the command from the prediction along the simulated motion, in parts of the command."""
    force = np.asarray(run.force, float)
    # A command is held for a sample; at a sample that is the mean of both sides.
    mean = 0.5 * (force[1:] + force[:-1])
    left = mean - np.asarray(jf.predict(model, run), float)[1:]
    moving = np.abs(np.asarray(run.velocity, float))[1:] > 0.02
    moving[:300] = False
    return np.sqrt(np.mean(left[moving] ** 2) / np.mean(mean[moving] ** 2))


@pytest.mark.parametrize(
    "names",
    [
        ("reaction friction",),
        ("gain asymmetry", "dead-band", "saturation", "load friction", "gain step"),
        pytest.param(("delay", "dead-band"), marks=pytest.mark.slow),
        *[pytest.param((name,), marks=pytest.mark.slow) for name in FAULTS],
    ],
    ids=" ".join,
)
def test_the_command_is_what_prediction_asks_for(names):
    model = axis(*names)
    run = jf.simulate(model, swing(), jf.PD(3000.0, 120.0))
    assert distance(model, run) < 2e-3
    assert distance(axis(), run) > 0.01


@pytest.mark.slow
def test_in_single_precision_too():
    model = axis("gain asymmetry", "dead-band", "saturation", "load friction")
    run = jf.simulate(model, swing(dtype=np.float32), jf.PD(3000.0, 120.0))
    assert run.force.dtype == jnp.float32
    whole = jf.simulate(model, swing(), jf.PD(3000.0, 120.0))
    np.testing.assert_allclose(run.position, whole.position, atol=1e-4)


def open_loop(model, force, step=1e-3, **options):
    t = np.arange(len(force)) * step
    log = jf.Recording(t, np.asarray(force, float), position=0 * t)
    return jf.simulate(model, log, initial=(0.0, 0.0), **options)


def test_a_command_inside_the_dead_band_moves_nothing():
    """5 N of Coulomb friction behind 2 N of dead-band: 6.9 N hold still, 7.1 N accelerate 0.1/2."""
    still = open_loop(axis("dead-band"), np.full(200, 6.9))
    assert not np.any(np.asarray(still.velocity))
    moved = np.asarray(open_loop(axis("dead-band"), np.full(200, 7.1)).velocity)
    assert moved[100] == pytest.approx(0.1 / 2 * 0.1, rel=0.3) and moved[100] < 0.1 / 2 * 0.1


def test_friction_by_load_takes_its_part_off_at_rest():
    """U = f + 0.1 f on the way forward: 5 N are overcome by 5.5."""
    assert not np.any(np.asarray(open_loop(axis("load friction"), np.full(50, 5.49)).velocity))
    assert np.all(np.asarray(open_loop(axis("load friction"), np.full(50, 5.51)).velocity)[1:] > 0)


def test_friction_by_the_reaction_makes_the_axis_heavier_ahead_and_lighter_in_braking():
    """11 N less 5 N of Coulomb friction accelerate (1 + 0.2) 2 kg; -4 N and friction brake 0.8."""
    model = from_parameters(
        terms.Coulomb() + terms.Inertia() + terms.ReactionFriction(),
        {"coulomb": 5.0, "inertia": 2.0, "reaction_friction": 0.2},
    )
    run = open_loop(model, np.where(np.arange(300) < 200, 11.0, -4.0))
    v = np.asarray(run.velocity)
    assert (v[150] - v[50]) / 0.1 == pytest.approx(6 / 2.4, rel=1e-9)
    assert (v[270] - v[210]) / 0.06 == pytest.approx(-9 / 1.6, rel=1e-9)


def test_a_weight_is_held_by_the_friction_that_it_makes():
    """10 N of weight on a screw of 0.3: from 7 to 13 N nothing moves; outside, 1 N of rest does."""
    model = from_parameters(
        terms.Coulomb() + terms.Inertia() + terms.Offset() + terms.ReactionFriction(),
        {"coulomb": 0.0, "inertia": 2.0, "offset": 10.0, "reaction_friction": 0.3},
    )
    for force, way in ((7.05, 0.0), (12.95, 0.0), (6.9, -1.0), (13.1, 1.0)):
        assert np.all(np.sign(open_loop(model, np.full(50, force)).velocity)[1:] == way)


@pytest.mark.parametrize("share", [1.0, 1.2])
def test_friction_that_is_all_of_its_load_is_refused(share):
    model = axis("reaction friction").with_parameters({"reaction_friction": share})
    with pytest.raises(ValueError, match="locks itself"):
        jf.simulate(model, swing(), jf.PD(3000.0, 120.0))


FREE = {"inertia": 2.0}


@pytest.mark.parametrize("delay", [0.0, 0.0043, 0.0101])
def test_a_step_arrives_late_to_the_part_of_a_sample(delay):
    """A free mass, 4 N from 50 ms on: v = 2 (t − 0.05 − τ), whatever part of a sample τ is."""
    model = from_parameters(terms.Inertia() + terms.TransportDelay(), FREE | {"delay": delay})
    force = np.where(np.arange(100) < 50, 0.0, 4.0)
    run = open_loop(model, force, substeps=4)
    wanted = 2.0 * np.clip(np.asarray(run.time) - 0.05 - delay, 0.0, None)
    # Within a sub-step of 0.25 ms the mean force acts: the impulse is right at its ends.
    np.testing.assert_allclose(run.velocity, wanted, atol=1e-12)


def test_a_lag_is_exact_for_a_held_command():
    model = from_parameters(terms.Inertia() + terms.ActuatorLag(), FREE | {"lag": 0.01})
    run = open_loop(model, np.where(np.arange(100) < 20, 0.0, 4.0), substeps=3)
    late = np.clip(np.asarray(run.time) - 0.02, 0.0, None)
    wanted = 2.0 * (late - 0.01 * (1 - np.exp(-late / 0.01)))
    np.testing.assert_allclose(run.velocity, wanted, atol=1e-12)


def test_each_segment_starts_without_a_past():
    model = from_parameters(terms.Inertia() + terms.TransportDelay(), FREE | {"delay": 0.0043})
    t, force = np.arange(60) * 1e-3, np.repeat([4.0, -2.0], 30)
    parts = np.repeat([0, 1], 30)
    log = jf.Recording(t, force, position=0 * t, segment=parts)
    run = np.asarray(jf.simulate(model, log, initial=(0.0, 0.0)).velocity)
    # As if the first command of the segment had always been.
    np.testing.assert_allclose(
        run, np.repeat([2.0, -1.0], 30) * (t - t[[0, 30]][parts]), atol=1e-12
    )


@pytest.mark.slow
def test_it_differentiates_and_compiles_from_outside():
    log = swing(300)

    def worth(gain, delay):
        values = {"gain_asymmetry": gain, "delay": delay}
        model = axis("gain asymmetry", "delay").with_parameters(values)
        return jnp.mean(jf.simulate(model, log, jf.PD(3000.0, 120.0), substeps=2).position ** 2)

    at = (0.2, 0.0043)
    slope = np.asarray(jax.jit(jax.grad(worth, argnums=(0, 1)))(*at))
    for i, step in enumerate((1e-5, 1e-7)):
        up, down = ([x + s * step * (j == i) for j, x in enumerate(at)] for s in (1, -1))
        difference = float(worth(*up) - worth(*down)) / (2 * step)
        assert slope[i] == pytest.approx(difference, rel=1e-3)


def test_an_actuator_that_gives_nothing_is_refused():
    with pytest.raises(ValueError, match="gain_asymmetry is -0.95.*less than a tenth"):
        jf.simulate(axis("gain asymmetry").with_parameters({"gain_asymmetry": -0.95}), swing(20))


def test_a_force_limit_is_held_predicted_with_saved_and_said():
    """The command goes beyond it, the axis feels no more, and the figure counts no more."""
    limited = axis().with_force_limit(9.0)
    run = jf.simulate(limited, swing(), jf.PD(kp=2.0e4, kd=300.0))
    bounded = jf.simulate(axis(), swing(), jf.PD(kp=2.0e4, kd=300.0, limit=9.0))
    np.testing.assert_allclose(run.position, bounded.position, atol=1e-12)
    command = np.asarray(run.force)
    assert np.abs(command).max() > 10 > np.abs(np.asarray(bounded.force)).max()
    np.testing.assert_allclose(np.clip(command, -9.0, 9.0), bounded.force, atol=1e-9)
    np.testing.assert_allclose(arrived(limited, run), bounded.force, atol=1e-9)
    assert np.array_equal(arrived(axis(), run), command)
    assert force_error(limited, run) == pytest.approx(force_error(axis(), bounded), rel=1e-6)
    assert force_error(limited, run) < 0.5 * force_error(axis(), run)
    again = models.load(json.dumps(limited.to_dict()))
    assert float(again.force_limit) == 9.0 and "force_limit" in repr(again)
    assert again.to_dict() == limited.to_dict() and "force_limit" not in axis().to_dict()
    (line,) = unwritten(limited)
    assert line.startswith("force limit: no more than 9 N arrives")


@pytest.mark.parametrize("value", [9.0, {"unit": "N"}, {"value": -1.0}, {"value": "many"}])
def test_a_damaged_force_limit_is_refused(value):
    document = axis().to_dict() | {"force_limit": value}
    with pytest.raises(ValueError, match="force_limit|force limit"):
        models.load(json.dumps(document))


@pytest.mark.slow
def test_a_held_force_acts_half_a_sample_after_its_stamp():
    """A log at 250 Hz, its model exact: all that `predict` leaves is when the force acts."""
    t = np.arange(4000) / 250.0
    position = 0.05 * np.sin(2 * np.pi * 0.9 * t) + 0.02 * np.sin(2 * np.pi * 1.7 * t)
    run = jf.simulate(axis(), jf.Recording(t, 0 * t, position), jf.PD(3000.0, 120.0))
    at_once, held = axis(), axis().with_force_delay(0.5 / 250)
    assert force_error(held, run) < 0.1 * force_error(at_once, run)
    assert force_error(held, run) < force_error(axis().with_force_delay(0.6 / 250), run)
    # What is simulated holds the force anyhow.
    again = jf.simulate(held, jf.Recording(t, 0 * t, position), jf.PD(3000.0, 120.0))
    np.testing.assert_array_equal(again.force, run.force)
    saved = models.load(json.dumps(held.to_dict()))
    assert float(saved.force_delay) == 0.002 and "force_delay" in repr(saved)
    assert "force_delay" not in at_once.to_dict()
    with pytest.raises(ValueError, match="finite time"):
        axis().with_force_delay(np.nan)
    with pytest.raises(ValueError, match="force_delay"):
        models.load(json.dumps(axis().to_dict() | {"force_delay": 0.002}))
