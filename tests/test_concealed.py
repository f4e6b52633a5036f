"""Machines with something concealed in them are what they say they are."""

import dataclasses

import jax
import numpy as np
import pytest

from jaxfric import models
from jaxfric.terms.effects import EFFECTS
from jaxfric.validation import concealed
from jaxfric.validation.concealed import definitions, drawing, tuning
from jaxfric.validation.concealed.definitions import DEFINITIONS, half_of
from jaxfric.validation.concealed.kinds import PHYSICS
from jaxfric.validation.concealed.nominal import friction, rms
from jaxfric.validation.concealed.tuning import in_loop
from jaxfric.validation.proof import planning

SIZE = 0.12
# Where a lag makes the force differ most, at a reversal, its size does not count (slip alone does).
IN_SLIP = {"transport_delay", "actuator_lag", "position_dependent_delay", "clock", "sensor_filter"}


def quick(seed, effects=(), size=SIZE):
    """A machine whose recordings are the first 4000 samples of what it would do."""
    machine = concealed.draw(seed, effects, size)
    return dataclasses.replace(machine, plan=machine.plan._replace(samples=4000))


def slip_residual(machine, run, hold=0):
    """Measured force beyond M a + friction + hidden force on the samples in slip, N."""
    log = (run.recording, run.holdout)[hold]
    hidden = (run.hidden, run.hidden_holdout)[hold]
    true, physics = run.true[hold], dict(machine.physics)
    if "stribeck" in machine.effects:
        physics |= {"bump+": 0.0, "bump-": 0.0}
    if "asymmetric_friction" in machine.effects:
        for name in ("coulomb", "viscous"):
            mean = 0.5 * (physics[f"{name}+"] + physics[f"{name}-"])
            physics |= {f"{name}+": mean, f"{name}-": mean}
    v = 0.5 * (true.velocity[1:] + true.velocity[:-1])
    a = np.diff(true.velocity) / np.diff(np.asarray(log.time))
    slip = np.abs(v) > 0.05 * np.quantile(np.abs(v), 0.98)
    slip &= true.velocity[1:] * true.velocity[:-1] > 0
    known = physics["mass"] * a + friction(physics, v, np.sign(v))
    known = known + sum((force[:-1] for force in hidden.values()), np.zeros_like(v))
    return (np.asarray(log.force)[:-1] - known)[slip]


def expected_noise(machine):
    return float(np.hypot(machine.noise.force, machine.noise.process))


# A wrong parameter and a zero belong to a model, not to a machine, a hard limit is a definition of
# saturation, and how friction passes zero is drawn of every machine; machines whose mass or gain
# changes while they run are not drawn yet: tests/test_moments.py plants those, and
# tests/test_places.py a force at one place, tests/test_encoder_and_gain.py what its name says.
NOT_DRAWN = {
    "smooth_friction",
    "parameter_mismatch",
    "position_zero",
    "force_limit",
    "payload_change",
    "gain_step",
    "parameter_step",
    "disturbance_force",
    "local_force",
    "encoder_error",
    "gain_drift",
}


def test_every_effect_of_the_catalogue_can_be_concealed_but_those_that_are_named():
    assert set(concealed.names()) == set(EFFECTS) - NOT_DRAWN
    assert not set(concealed.OUTSIDE) & set(EFFECTS)


def test_the_same_seed_is_the_same_machine_and_another_is_not():
    assert concealed.draw(3, ("cogging",)) == concealed.draw(3, ("cogging",))
    assert concealed.draw(3) != concealed.draw(4)
    first, second = concealed.record(quick(3)), concealed.record(quick(3))
    np.testing.assert_array_equal(first.recording.force, second.recording.force)
    np.testing.assert_array_equal(first.holdout.position, second.holdout.position)


def test_what_is_healthy_about_a_machine_does_not_depend_on_what_is_concealed():
    healthy, sick = concealed.draw(5), concealed.draw(5, ("cogging",))
    changed = {k for k in healthy.physics if healthy.physics[k] != sick.physics[k]}
    assert changed and all(k.startswith(("cogging", "pitch")) for k in changed)
    assert (healthy.plan, healthy.noise) == (sick.plan, sick.noise)


@pytest.mark.parametrize("seed", [0, 2, 4])
def test_a_healthy_machine_is_mass_times_acceleration_and_friction(seed):
    machine = quick(seed)
    run = concealed.record(machine)
    assert run.hidden == {} and machine.baseline in models.names()
    for hold in (0, 1):
        residual = slip_residual(machine, run, hold)
        assert rms(residual) < 1.4 * expected_noise(machine)


def test_the_held_out_run_is_another_one():
    run = concealed.record(quick(1))
    position, other = np.asarray(run.recording.position), np.asarray(run.holdout.position)
    assert abs(np.corrcoef(position, other)[0, 1]) < 0.9
    force, other = np.asarray(run.recording.force), np.asarray(run.holdout.force)
    assert abs(np.corrcoef(force, other)[0, 1]) < 0.9
    assert run.recording.velocity is None and "reference" in run.recording.channels


def test_machines_spread_over_units_and_sample_rates():
    machines = [concealed.draw(seed) for seed in range(40)]
    levels = np.log10([machine.coulomb for machine in machines])
    rates = np.log10([machine.plan.sample_rate for machine in machines])
    assert np.ptp(levels) > 6 and np.ptp(rates) > 1.2
    assert {machine.baseline for machine in machines} >= {"gaussian", "lorentzian", "exponential"}
    for machine in machines:
        assert 4000 <= machine.plan.samples <= 60_000
        assert 6 <= machine.plan.samples / machine.plan.sample_rate <= 60.1


@pytest.mark.slow
def test_the_flanks_of_a_gap_give_way_by_less_than_it():
    for seed in (64, 66, 69):
        truth = concealed.draw(seed, ("backlash",)).truth["backlash"]
        assert 0 < truth["windup"] <= 0.5001 * truth["half_gap"], seed


@pytest.mark.slow
@pytest.mark.parametrize("definition", ["two_mass", "dry_load", "free_load"])
def test_the_load_behind_a_gap_has_the_force_and_windup_that_are_told(definition):
    machine = concealed.draw(64, ("backlash",), definitions={"backlash": definition})
    truth = machine.truth["backlash"]
    force = machine.physics["load_friction_share"] * machine.coulomb
    assert truth["backlash_force"] == pytest.approx(force)
    assert truth["windup"] == pytest.approx(force / machine.physics["stiffness"])


@pytest.mark.slow
def test_a_stop_is_where_the_axis_comes_to_it():
    """This one stays so far behind its set-point that a stop by the set-point is never reached."""
    (seed,) = (c.seed for c in planning.plan(360, 20261129, (0.02, 0.3)) if c.name == "00044")
    machine = concealed.draw(seed, ("end_stop",))
    force = concealed.record(machine).hidden["end_stop"]
    assert rms(force) / machine.coulomb == pytest.approx(machine.truth["end_stop"]["size"], rel=0.2)


def check(name, seed, machine, run):
    """A concealed effect is finite, moves the axis, explains the force and has its size."""
    hidden = run.hidden[name]
    position = np.asarray(run.recording.position)
    assert np.all(np.isfinite(hidden)) and np.all(np.isfinite(run.hidden_holdout[name]))
    assert np.ptp(position) > 0.6 * machine.plan.stroke
    assert rms(slip_residual(machine, run)) < 1.4 * expected_noise(machine)
    size = machine.truth[name]["size"]
    force = hidden - np.mean(hidden) if PHYSICS[name].centred else hidden
    acting = in_loop(machine, name, force, run.true[0].velocity)
    most = 4.0 if name in IN_SLIP else 1.6
    assert size / 1.6 < acting < most * size, (name, seed, size, acting)


@pytest.mark.parametrize("name", ["spring", "sticky_spot", "friction_step", "actuator_deadband"])
def test_an_effect_is_there_and_as_large_as_drawn(name):
    machine = concealed.draw(9, (name,), SIZE)
    check(name, 9, machine, concealed.record(machine))


@pytest.mark.slow
@pytest.mark.parametrize("name", PHYSICS)
def test_every_effect_is_there_and_as_large_as_drawn(name):
    machine = concealed.draw(101, (name,), SIZE)
    check(name, 101, machine, concealed.record(machine))


@pytest.mark.slow
@pytest.mark.parametrize("pair", [("cogging", "transport_delay"), ("presliding", "spring")])
def test_two_effects_share_the_hidden_force(pair):
    machine = concealed.draw(7, pair, SIZE)
    run = concealed.record(machine)
    assert set(run.hidden) == set(machine.truth) == set(pair)
    assert rms(slip_residual(machine, run)) < 1.4 * expected_noise(machine)


def test_a_caller_in_single_precision_gets_it():
    with jax.enable_x64(False):
        run = concealed.record(quick(0))
        assert run.recording.position.dtype == np.float32
    assert run.true[0].position.dtype == np.float64


def test_what_cannot_be_concealed_is_said():
    with pytest.raises(ValueError, match=r"No effect rust .*there are .*cogging"):
        concealed.draw(0, ("rust",))
    with pytest.raises(ValueError, match="named twice"):
        concealed.draw(0, ("spring", "spring"))


@pytest.mark.slow
def test_a_loop_that_bursts_is_made_slower():
    """With a gap in front of an inertia that varies, this one did: no number was left of it."""
    effects = "position_dependent_inertia", "backlash"
    machine = concealed.draw(1493997760, effects, (0.1, 0.3))
    assert machine.physics["kp"] < 0.1 * concealed.draw(1493997760).physics["kp"]
    assert all(truth["size"] < 0.4 for truth in machine.truth.values())
    run = concealed.record(machine)
    for recording in (run.recording, run.holdout):
        position, wanted = recording.position, recording.channels["reference"]
        assert np.max(np.abs(position - wanted)) < 0.3 * np.ptp(position)
        assert np.isfinite(recording.force).all()


def test_a_loop_that_bursts_however_slow_is_said(monkeypatch):
    tried = []

    def burst(machine, name, truth, n, size):
        tried.append(machine.physics["kp"])
        return truth | {"size": tuning.BURST}

    monkeypatch.setattr(drawing, "tune", burst)
    with pytest.raises(ValueError, match="loop of machine 3 with backlash bursts"):
        concealed.draw(3, ("backlash",))
    assert len(tried) > 1
    assert tried == sorted(tried, reverse=True)


# Definitions


def test_most_effects_have_a_definition_that_is_only_scored_and_none_changes_sides():
    halves = {d.half for d in DEFINITIONS}
    assert halves == {"development", "scored"}
    assert len({(d.of, d.name) for d in DEFINITIONS}) == len(DEFINITIONS)
    assert {d.of for d in DEFINITIONS} <= {*concealed.names(), "stick", "log"}
    assert {d for h in halves for d in definitions.definitions(h)} == set(DEFINITIONS)
    # As they stood before any of them was asked for.
    assert half_of("actuator_saturation", "clip") == half_of("stick", "bristles") == "scored"
    assert half_of("actuator_saturation", "tanh") == half_of("stick", "smooth") == "development"


def test_the_bristles_of_a_healthy_machine_are_stiffer_than_a_log_resolves():
    machine = concealed.draw(391328099, definitions={"stick": "bristles"})
    physics, plan = machine.physics, machine.plan
    dry = max(physics[f"coulomb{s}"] + physics[f"bump{s}"] for s in "+-")
    # Turned round by twice its dry friction.
    passed = np.sqrt(physics["presliding_distance"] * physics["mass"] / dry)
    assert passed <= 0.1 / plan.sample_rate and plan.substeps == 43


def test_the_usual_definition_is_what_is_drawn_where_none_is_asked_for():
    plain = concealed.draw(5, ("cogging",))
    assert plain.truth["cogging"]["definition"] == "harmonics"
    assert concealed.draw(5, ("cogging",), definitions={"cogging": "harmonics"}) == plain
    bump = concealed.draw(5, ("stribeck",)).truth["stribeck"]
    assert bump["definition"] == bump["shape"]
    asked = concealed.draw(5, ("stribeck",), definitions={"stribeck": "exponential"})
    assert asked.truth["stribeck"]["shape"] == "exponential"
    assert (
        concealed.draw(5, ("gravity_unbalance",)).truth["gravity_unbalance"]["definition"] == "law"
    )


def test_a_definition_that_is_not_there_is_said():
    with pytest.raises(ValueError, match=r"No definition round of cogging; there are harmonics"):
        concealed.draw(5, ("cogging",), definitions={"cogging": "round"})
    with pytest.raises(ValueError, match="of cogging, which is not concealed"):
        concealed.draw(5, definitions={"cogging": "triangle"})


def by_definition(of, name, seed=101):
    """A machine by one definition."""
    effects = () if of in ("stick", "log") else (of,)
    return concealed.draw(seed, effects, SIZE, {of: name})


def settled(machine, run, of):
    """The size of the force in the run, and the residual beyond it, in parts of the noise."""
    hidden = run.hidden[of]
    return rms(hidden) / machine.coulomb, rms(slip_residual(machine, run)) / expected_noise(machine)


@pytest.mark.parametrize(
    ("of", "name"),
    [
        ("load_dependent_friction", "reaction"),
        ("cogging", "triangle"),
        ("thermal_drift", "work"),
        ("friction_step", "ramp"),
    ],
)
def test_an_effect_by_another_definition_is_as_large_as_drawn(of, name):
    machine = by_definition(of, name)
    size, residual = settled(machine, concealed.record(machine), of)
    assert 0.6 * SIZE < size < 1.6 * SIZE and residual < 1.4


@pytest.mark.slow
@pytest.mark.parametrize(
    "which",
    [d for d in DEFINITIONS if d.of not in ("stick", "log")],
    ids=lambda d: f"{d.of}-{d.name}",
)
def test_every_definition_is_physics_that_explains_the_force(which):
    machine = by_definition(which.of, which.name)
    run = concealed.record(machine)
    size, residual = settled(machine, run, which.of)
    assert np.isfinite(size) and size > 0.3 * SIZE
    assert np.isfinite(run.hidden_holdout[which.of]).all()
    # A logger's delay belongs to the position, along which the force has been late.
    assert residual < 1.4 or which.kind.logged is not None


@pytest.mark.slow
def test_a_hard_limit_is_met_and_never_passed():
    machine = by_definition("actuator_saturation", "clip")
    run = concealed.record(machine)
    knee, command = machine.physics["knee"], np.asarray(run.true[0].force)
    arrived = command - run.hidden["actuator_saturation"]
    moving = np.abs(run.true[0].velocity) > 0.05 * np.quantile(np.abs(run.true[0].velocity), 0.98)
    assert np.max(np.abs(command)) > knee
    assert np.max(np.abs(arrived[moving])) < 1.001 * knee


@pytest.mark.slow
def test_a_smooth_friction_creeps_where_the_exact_one_sticks():
    rests = []
    for name in ("exact", "smooth"):
        machine = by_definition("stick", name, seed=106)
        velocity = concealed.record(machine).true[0].velocity
        rests.append(np.mean(velocity == 0.0))
    assert rests[0] > 0.01 and rests[1] < 0.1 * rests[0]


@pytest.mark.slow
def test_the_log_alone_holds_a_position_and_filters_a_velocity():
    plain, held, drive = (
        concealed.record(by_definition("log", name))
        for name in ("position", "held_position", "filtered_velocity")
    )
    position = np.asarray(plain.recording.position)
    np.testing.assert_array_equal(plain.recording.force, held.recording.force)
    np.testing.assert_array_equal(
        held.recording.position, position[np.arange(position.size) // 3 * 3]
    )
    velocity, true = np.asarray(drive.recording.velocity), drive.true[0].velocity
    assert rms(velocity - true) < 0.1 * rms(true)
    assert np.corrcoef(velocity[1:], true[:-1])[0, 1] > np.corrcoef(velocity[:-1], true[1:])[0, 1]


def test_a_loggers_delay_is_not_felt_by_the_axis():
    machine = by_definition("transport_delay", "timestamp")
    late, delay = concealed.record(machine), machine.truth["transport_delay"]["delay"]
    run = concealed.record(dataclasses.replace(machine, effects=(), truth={}))
    np.testing.assert_array_equal(run.recording.force, late.recording.force)
    clock, position = np.asarray(run.recording.time), np.asarray(run.recording.position)
    np.testing.assert_allclose(late.recording.position, np.interp(clock - delay, clock, position))
