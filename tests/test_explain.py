"""Explaining: nothing where nothing is missing, the planted effect where one is, in any unit."""

import dataclasses
import json
import threading
import types

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.signal

from jaxfric import PD, Encoder, Recording, models, signals, simulate, terms
from jaxfric.checks import Remark
from jaxfric.explanation import (
    acceptance,
    candidates,
    contest,
    curves,
    dates,
    doubts,
    evaluation,
    evidence,
    explain,
    findings,
    holdout,
    improvement,
    inputs,
    intervals,
    least_squares,
    locate,
    mismatch,
    outstanding,
    parameters,
    parsimony,
    physical_constraints,
    predictions,
    problem,
    refining,
    regression,
    reported,
    sanity,
    scanning,
    search,
    selection,
    significance,
    spectral_lines,
    stepwise,
    structure,
    timing,
    trials,
    uncertainty,
    verdict,
    verification,
    wording,
)
from jaxfric.explanation.figures import Figures
from jaxfric.explanation.finding import Finding
from jaxfric.explanation.friction_at_rest import beside_rest
from jaxfric.explanation.inputs import interpolated
from jaxfric.explanation.motion import motion_of
from jaxfric.explanation.sentences import sentence
from jaxfric.identification.uncertainty import Estimate
from jaxfric.simulation.actuator import parted
from jaxfric.simulation.errors import force_error
from jaxfric.simulators import Known
from jaxfric.terms.base import summands
from jaxfric.terms.effect import Residual
from jaxfric.terms.effects import EFFECTS, disturbance_pulses
from jaxfric.terms.sample import Scales

TIME = np.arange(16384) / 1000.0
COULOMB = 20.0
PARAMETERS = {"inertia": 5.0} | {
    f"{name}{sign}": value * (1.1 if sign == "+" else 0.9)
    for sign in "+-"
    for name, value in {
        "coulomb": COULOMB,
        "viscous": 60.0,
        "stribeck_force": 6.0,
        "stribeck_velocity": 0.01,
    }.items()
}


def set_point(seed):
    """Some sine waves, up to 0.3 m/s, over about 0.15 m."""
    draw = np.random.default_rng(seed)
    rates = 2 * np.pi * 0.7 * (1 + draw.uniform(0, 2.5, 5))
    phases = draw.uniform(0, 2 * np.pi, 5)
    x = sum(np.sin(w * TIME + p) / w for w, p in zip(rates, phases, strict=True))
    v = sum(np.cos(w * TIME + p) for w, p in zip(rates, phases, strict=True))
    scale = 0.3 / np.quantile(np.abs(v), 0.98)
    return x * scale, v * scale


@pytest.fixture(scope="module")
def healthy():
    """Two recordings of one healthy machine in closed loop, with encoder and noise."""
    machine = models.from_parameters(models.gaussian(), PARAMETERS)
    loop = PD(kp=5.0 * 60**2, kd=2 * 5.0 * 60)
    runs = []
    for seed in (0, 1):
        x, v = set_point(seed)
        channels = {"reference": jnp.asarray(x), "reference_velocity": jnp.asarray(v)}
        clock = Recording(TIME, np.zeros_like(TIME), x, v, channels=channels)
        run = simulate(
            machine, clock, loop, encoder=Encoder(resolution=1e-6), force_noise=0.2,
            key=jax.random.key(seed), substeps=8,
        )  # fmt: skip
        runs.append(dataclasses.replace(run, channels={}, source=f"run {seed}"))
    return runs


def limited(seed, limit):
    """The machine with an actuator that gives no more than a limit, N, and its loop's command."""
    machine = models.from_parameters(models.gaussian(), PARAMETERS)
    gains = 5.0 * 60**2, 2 * 5.0 * 60
    x, v = set_point(seed)
    channels = {"reference": jnp.asarray(x), "reference_velocity": jnp.asarray(v)}
    clock = Recording(TIME, np.zeros_like(TIME), x, v, channels=channels)
    run = simulate(
        machine, clock, PD(*gains, limit), encoder=Encoder(resolution=1e-6), force_noise=0.2,
        key=jax.random.key(seed), substeps=8,
    )  # fmt: skip
    place, force = np.asarray(run.position), np.asarray(run.force)
    asked = gains[0] * (x - place) + gains[1] * (v - np.gradient(place, TIME))
    more = np.sign(asked) * np.maximum(np.abs(asked) - limit, 0.0)
    more = np.where(np.abs(force) > limit - 1.0, more, 0.0)
    return dataclasses.replace(run, force=jnp.asarray(force + more), channels={})


def planted(recording, term, alpha, beta=()):
    """The recording of a machine with that physics at the same motion."""
    known = term.with_beta(jnp.asarray(beta)) if beta else term
    x = np.asarray(recording.position)
    v = np.gradient(x, TIME)
    smooth = np.convolve(v, np.hanning(41) / np.hanning(41).sum(), "same")
    motion = dataclasses.replace(recording, velocity=jnp.asarray(smooth))
    force = np.asarray(known.columns(motion)) @ np.asarray(alpha)
    if known.inertial:
        force = force + np.gradient(np.asarray(known.momentum(motion)) @ np.asarray(alpha), TIME)
    return dataclasses.replace(recording, force=recording.force + force)


CASES = {
    "cogging": (terms.Cogging(), (2.0, 1.0), (0.01,)),
    "spring": (terms.Spring(), (60.0,), ()),
    "sticky_spot": (terms.StickySpot(), (6.0,), (0.02, 0.005)),
    "friction_step": (terms.FrictionStep(), (3.0,), (9.0,)),
    "parameter_step": (terms.ParameterStep(), (25.0,), (9.0,)),
    "periodic_disturbance": (terms.PeriodicDisturbance(), (2.0, -1.0), (6.3,)),
    "frictional_lag": (terms.FrictionalLag(poles=1), (6.0,), (0.03, 0.06)),
}
LOAD = terms.DryCompliance(8.0, 0.2, 2.0)


def test_nothing_is_missing_where_nothing_is(healthy):
    found = explain(healthy[0], "gaussian", healthy[1])
    assert found.verdict == "consistent"
    assert found.findings == []
    errors = found.fit["filtered_force_error"]
    assert errors["before"] == errors["after"] < 0.02
    # Beside that, what a user gets from predict: with the noise of the force, 1.2 %, in it.
    errors = found.fit["force_error"]
    assert errors["before"] == errors["after"] < 0.03
    # What was not found is listed, with a size between the noise and the Coulomb level.
    sizes = {entry["effect"]: entry["smallest_detectable"] for entry in found.not_visible}
    assert 0 < sizes["cogging"] < 0.1 * COULOMB


def test_no_size_is_promised_of_an_effect_one_of_whose_laws_the_motion_does_not_show():
    """Friction that grows with the motor's force is a gain where the axis never brakes."""
    names = "load_dependent_friction", "spring"
    tried = [types.SimpleNamespace(threshold=0.1, new_part=1.0, effect=EFFECTS[n]) for n in names]
    left = types.SimpleNamespace(energy=4.0, residual=np.ones(4))
    for unseen in (frozenset(), frozenset(names[:1])):
        found = verification.smallest_visible(trials.Contest(tried, [], 1.0, unseen), left)
        assert set(found) == set(names) - unseen


@pytest.mark.slow
def test_friction_of_a_recorded_load_is_told_by_that_load(healthy):
    runs = []
    for number, recording in enumerate(healthy):
        load = 200.0 * (1.2 + np.sin(0.7 * TIME + number))
        log = dataclasses.replace(recording, channels={"load": jnp.asarray(load)})
        runs.append(planted(log, terms.LoadDependentFriction("load"), (0.02,)))
    found = explain(runs[0], "gaussian", runs[1])
    assert [f.effect for f in found.findings] == ["load_dependent_friction"]
    assert float(found.findings[0].parameters["load_friction"].value) == pytest.approx(
        0.02, rel=0.1
    )
    assert found.findings[0].confirmed


def test_a_position_that_is_held_between_updates_is_a_curve_through_them(healthy):
    position = np.asarray(healthy[0].position)
    seldom = dataclasses.replace(
        healthy[0], position=jnp.asarray(position[np.arange(position.size) // 4 * 4])
    )
    fresh, remarks = interpolated(seldom)
    assert [r.name for r in remarks] == ["position_held"] and "every 4 samples" in remarks[0].text
    stairs = np.std(np.asarray(seldom.position) - position)
    assert np.std(np.asarray(fresh.position) - position) < 0.05 * stairs
    assert interpolated(healthy[0]) == (healthy[0], [])
    # Between two updates there is no more than one node.
    seen = [evidence.gather(motion_of(log), 12) for log in (healthy[0], fresh)]
    assert [each.width for each in seen] == [12, 24]


@pytest.mark.slow
@pytest.mark.parametrize("effect", CASES)
def test_what_is_missing_is_named_with_its_parameters(healthy, effect):
    term, alpha, beta = CASES[effect]
    run, held = (planted(r, term, alpha, beta) for r in healthy)
    found = explain(run, "gaussian", held)
    assert [f.effect for f in found.findings] == [effect]
    finding = found.findings[0]
    assert finding.share > 0.5 and finding.p_value <= 0.01
    names = [p.name for p in (*term.affine, *term.nonlinear)]
    for name, value in zip(names, (*alpha, *beta), strict=True):
        estimate = finding.parameters[name]
        within = 5 * float(estimate.standard_error) + 0.02 * abs(value)
        assert abs(float(estimate.value) - value) < within, name
    places = {place["coordinate"] for place in found.where}
    assert places & {name.removesuffix("_lines") for name in EFFECTS[effect].coordinates}
    errors = found.fit["holdout_force_error"]
    assert errors["after"] < 0.8 * errors["before"]


@pytest.mark.slow
def test_ripple_of_the_force_constant_is_told_from_a_detent(healthy):
    pitch, part = 0.01, 0.06
    run, held = (
        dataclasses.replace(
            log,
            force=log.force * (1 + part * jnp.sin(2 * np.pi * log.position / pitch)),
        )
        for log in healthy
    )
    found = explain(run, "gaussian", held)
    assert [f.effect for f in found.findings] == ["cogging"] and found.findings[0].confirmed
    finding = found.findings[0]
    assert finding.parameters["ripple_sin"].unit == "1"
    assert float(finding.parameters["amplitude"].value) == pytest.approx(part, rel=0.03)
    assert float(finding.parameters["pitch"].value) == pytest.approx(pitch, rel=3e-3)
    assert finding.sentence.startswith("The force differs from what is commanded by 0.0")
    assert "force ripple" in finding.sentence


@pytest.mark.slow
def test_inertia_and_friction_that_both_vary_slowly_are_no_force_constant(healthy, monkeypatch):
    """Alike in phase a force constant takes more than either alone, and so comes first."""
    wave, stroke = (0.9, 0.5), float(np.ptp(np.asarray(healthy[0].position)))
    runs = []
    for log in healthy:
        log = planted(log, terms.PositionDependentInertia(), wave, (2.2 * stroke,))
        wavy = terms.PositionDependentFriction()
        runs.append(planted(log, wavy, tuple(4 * x for x in wave), (2 * stroke,)))
    compared, of_two = [], search._of_two

    def spied(found, other):
        compared.append(found.selection.names)
        return of_two(found, other)

    monkeypatch.setattr(search, "_of_two", spied)
    found = explain(runs[0], "gaussian", runs[1])
    assert compared and "position_dependent_force_constant" in compared[0]
    named = {f.effect for f in found.findings}
    assert named == {"position_dependent_inertia", "position_dependent_friction"}
    for finding in found.findings:
        assert "position_dependent_force_constant" not in finding.confusable_with


@pytest.mark.slow
def test_a_bump_that_falls_over_decades_of_the_speed_is_a_stribeck_bump(healthy):
    bump = terms.Generalised(0.02, 0.5)
    runs = [planted(log, bump, (8.0,)) for log in healthy]
    found = explain(runs[0], "coulomb-viscous", runs[1])
    assert [f.effect for f in found.findings] == ["stribeck"]
    # Beside the Gaussian one that the machine has, of 6 N and exponent 2.
    assert float(found.findings[0].parameters["stribeck_exponent+"].value) < 1.0


@pytest.mark.slow
def test_friction_that_changes_gradually_is_a_step_with_a_duration(healthy):
    term, values = terms.FrictionRamp(), {"step_time": 8.0, "step_duration": 2.5}
    run, held = (planted(log, term, (3.0,), tuple(values.values())) for log in healthy)
    found = explain(run, "gaussian", held)
    assert [f.effect for f in found.findings] == ["friction_step"]
    finding = found.findings[0]
    for name, value in values.items():
        low, high = finding.parameters[name].interval()
        assert low < value < high and high - low < 0.5 * value
    assert "in the course of 2." in finding.sentence


@pytest.mark.slow
def test_the_answer_does_not_depend_on_units_time_or_direction(healthy):
    term, alpha, beta = CASES["cogging"]
    run = planted(healthy[0], term, alpha, beta)
    plain = explain(run, "gaussian")
    other = dataclasses.replace(
        run, time=run.time + 100.0, position=-1e3 * run.position, force=-1e-6 * run.force
    )
    turned = explain(other, "gaussian")
    assert turned.verdict == plain.verdict
    assert [f.effect for f in turned.findings] == [f.effect for f in plain.findings]
    ours, theirs = (e.findings[0].parameters for e in (plain, turned))
    ratio = float(theirs["amplitude"].value) / float(ours["amplitude"].value)
    assert ratio == pytest.approx(1e-6, rel=0.02)
    assert float(theirs["pitch"].value) == pytest.approx(1e3 * float(ours["pitch"].value), rel=1e-3)


@pytest.mark.slow
def test_a_wrong_value_is_told_from_missing_physics(healthy):
    wrong = PARAMETERS | {"viscous+": 90.0, "inertia": 5.5}
    model = models.from_parameters(models.gaussian(), wrong)
    found = explain(healthy[0], model, healthy[1])
    assert [f.effect for f in found.findings] == ["parameter_mismatch"]
    moved = found.to_dict()["findings"][0]["parameters"]
    assert moved["inertia"]["from"] == 5.5
    assert moved["inertia"]["to"] == pytest.approx(5.0, rel=0.01)
    assert moved["viscous+"]["to"] == pytest.approx(66.0, rel=0.05)
    right = explain(healthy[0], models.from_parameters(models.gaussian(), PARAMETERS))
    assert right.verdict == "consistent"


@pytest.mark.slow
def test_values_that_are_right_stay_as_given_and_findings_are_still_verified(healthy):
    model = models.from_parameters(models.gaussian(), PARAMETERS)
    first, second = (planted(run, *CASES["cogging"]) for run in healthy)
    found = explain(first, model, second, fixed=True)
    assert [f.effect for f in found.findings] == ["cogging"]
    assert found.model.parameters.items() >= PARAMETERS.items()
    (finding,) = found.findings
    errors = found.fit["filtered_force_error"]
    assert finding.share == pytest.approx(1 - (errors["after"] / errors["before"]) ** 2)
    assert explain(first, model, healthy[1], fixed=True).findings == []


@pytest.mark.slow
def test_another_simulator_is_compared_without_a_model(healthy):
    x, v = set_point(0)
    machine = models.from_parameters(models.gaussian(), PARAMETERS)
    clock = Recording(TIME, np.zeros_like(TIME), x, v)
    simulation = simulate(machine, clock, PD(kp=18000.0, kd=600.0), substeps=8)
    simulation = dataclasses.replace(simulation, channels={})
    term, alpha, beta = CASES["cogging"]
    found = explain(planted(healthy[1], term, alpha, beta), simulation)
    assert [f.effect for f in found.findings] == ["cogging"]
    assert explain(healthy[1], simulation).findings == []


def test_the_document_holds_what_the_contract_says(healthy):
    term, alpha, beta = CASES["cogging"]
    run, held = (planted(r, term, alpha, beta) for r in healthy)
    found = explain(run, "gaussian", held)
    document = json.loads(json.dumps(found.to_dict()))
    assert document["schema"] == "jaxfric.explanation/1"
    assert document["verdict"] in ("explained", "partly_explained")
    assert {"coordinate", "share", "p_value", "detail"} <= set(document["where"][0])
    finding = document["findings"][0]
    assert finding["sentence"].startswith("A force periodic in position")
    assert {"effect", "confusable_with", "equation", "parameters", "share", "holdout_share"} <= set(
        finding
    )
    again = models.Model.from_dict(document["model"])
    assert float(again.parameters["pitch"]) == pytest.approx(0.01, rel=1e-3)


@pytest.mark.slow
def test_the_models_run_forward_before_and_after(healthy):
    term, alpha, beta = CASES["spring"]
    run = planted(healthy[0], term, tuple(5 * a for a in alpha), beta)
    errors = explain(run, "gaussian", simulate=True).fit["simulation_error"]
    assert errors["after"] < 0.1 * errors["before"]


def test_too_short_a_recording_says_so(healthy):
    short = jax.tree.map(lambda x: x[:300], healthy[0])
    with pytest.raises(ValueError, match=r"slip|structure"):
        explain(short, "gaussian")


@pytest.mark.slow
def test_a_late_force_is_a_delay_and_nothing_else(healthy):
    run, held = (dataclasses.replace(r, force=jnp.roll(r.force, -6)) for r in healthy)
    run, held = (jax.tree.map(lambda x: x[:-8], r) for r in (run, held))
    found = explain(run, "gaussian", held)
    assert [f.effect for f in found.findings] == ["transport_delay"]
    delay = found.findings[0].parameters["delay"]
    # The force was aligned within a sample before.
    assert float(delay.value) == pytest.approx(6e-3, abs=1.1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "time"), [("clock", 4e-3), ("sensor_filter", 3e-3), ("sensor_filter", 0.02)]
)
def test_a_force_that_is_recorded_late_is_the_log_s(healthy, effect, time):
    """Not of the machine: as a compliance it was named, with a tone beside it."""
    runs = []
    for run in healthy:
        force = np.asarray(run.force)
        if effect == "clock":
            force = np.interp(TIME - time, TIME, force)
        else:
            keep = np.exp(-1e-3 / time)
            force = scipy.signal.lfilter([1 - keep], [1, -keep], force, zi=[keep * force[0]])[0]
        runs.append(dataclasses.replace(run, force=jnp.asarray(force)))
    found = explain(runs[0], "gaussian", holdout=runs[1])
    (one,) = (each for each in found.findings if each.confirmed)
    # So short a filter may be a delay, and the other way round.
    assert effect == one.effect or (time < 0.01 and effect in one.confusable_with)
    told = next(iter(one.parameters.values()))
    low, high = told.interval()
    assert low < time + 1e-3 and time - 1e-3 < high and told.half_width() < 0.4 * time
    assert found.verdict == "explained"
    # What moves the machine is simulated without it.
    actuator = parted(found.model, 1e-3)[1]
    assert actuator.faults is None and actuator.delay == actuator.lag == 0


@pytest.mark.slow
def test_a_delay_that_explains_most_is_put_back_before_more_is_searched(healthy, monkeypatch):
    """Its time is that beside what is found then."""
    spring = planted(healthy[0], terms.Spring(), (30.0,))
    run = dataclasses.replace(spring, force=jnp.roll(spring.force, -10))
    run = jax.tree.map(lambda x: x[:-12], run)
    searches = []

    def select(posed, *args, **kwargs):
        found = stepwise.select(posed, *args, **kwargs)
        searches.append(found.names)
        return found

    monkeypatch.setattr(search, "select", select)
    posed = problem.problem_of(run, models.named("gaussian"))
    found = search.searched(motion_of(run), posed, 0)
    names = [each.effect.name for each in found.selection.selected]
    assert names == ["spring", "transport_delay"]
    assert searches[0] == {"transport_delay"}
    assert all("transport_delay" not in names for names in searches[1:])
    time, stiffness = (float(found.selection.last.alphas[i][0]) for i in (-1, -2))
    assert time == pytest.approx(10e-3, abs=1.1e-3) and stiffness == pytest.approx(30, rel=0.05)


@pytest.mark.slow
def test_a_delay_too_long_for_its_first_order_is_undone(healthy):
    gaussian = models.named("gaussian")

    def overlooked(run):
        posed = problem.problem_of(run, gaussian)
        nothing = selection.Selection(posed.base, posed.base, [], trials.Contest([], [], 200.0))
        return timing.overlooked(run, posed, nothing)

    run = dataclasses.replace(healthy[0], force=jnp.roll(healthy[0].force, -30))
    lateness = overlooked(jax.tree.map(lambda x: x[:-32], run))
    assert lateness.selected.trial.candidate.effect.name == "transport_delay"
    assert lateness.selected.rivals == () and lateness.selected.p_value <= significance.LEVEL
    assert lateness.time == pytest.approx(30e-3, abs=1.1e-3)  # within a sample, as above
    assert overlooked(healthy[0]) is None
    term, alpha, beta = CASES["cogging"]
    assert overlooked(planted(healthy[0], term, alpha, beta)) is None


@pytest.mark.slow
@pytest.mark.parametrize(
    ("stages", "said"),
    [
        ("first", ["actuator_lag"]),
        ("two", ["actuator_lag", "transport_delay"]),
        ("second", ["actuator_lag", "transport_delay"]),
    ],
)
def test_several_lags_in_a_row_may_be_a_delay_or_a_lag(healthy, stages, said):
    """Commanded is what lags of first order, or one of second, become the force that acts, at a
    smooth motion.
    """
    rate, x, v = 1000.0, *set_point(0)
    shares = np.fft.fft(PARAMETERS["inertia"] * np.gradient(v, TIME) + 22.0 * np.tanh(v / 0.02))
    swing = 2j * np.pi * np.fft.fftfreq(len(TIME), 1 / rate)
    late = 0.012 * swing
    lag = {"first": 1 + late, "two": (1 + late / 2) ** 2, "second": 1 + late + late**2 / 2}[stages]
    lag *= np.abs(swing) < 2 * np.pi * 60
    force = np.fft.ifft(shares * lag).real + np.random.default_rng(0).normal(0, 0.2, len(TIME))
    run = jax.tree.map(lambda a: a[500:-500], Recording(TIME, force, x))
    posed = problem.problem_of(run, models.named("gaussian"))
    nothing = selection.Selection(posed.base, posed.base, [], trials.Contest([], [], 500.0))
    found = timing.overlooked(motion_of(run), posed, nothing)
    assert sorted([found.selected.effect.name, *found.selected.rivals]) == said
    assert found.time == pytest.approx(0.012, rel=0.2)


@pytest.mark.slow
def test_a_delay_is_found_from_a_guess_that_is_far_off(healthy):
    run = dataclasses.replace(healthy[0], force=jnp.roll(healthy[0].force, -10))
    run = jax.tree.map(lambda x: x[:-12], run)
    posed = problem.problem_of(run, models.named("gaussian"))
    undoing = timing._Undoing(run, posed, posed.base)
    delay = EFFECTS["transport_delay"]
    found = [undoing.least(delay, guess) for guess in (3e-3, 9.5e-3, 30e-3)]
    times = [time for _, time in found]
    np.testing.assert_allclose(times, times[1], rtol=2 * timing.CLOSE)
    assert times[1] == pytest.approx(10e-3, abs=1.1e-3)
    assert found[0][0] < 0.5 * undoing.least(EFFECTS["actuator_lag"], 9.5e-3)[0]


def test_of_the_rest_only_noise_is_made_up_for_what_undoing_a_lag_takes_of_it(healthy):
    posed = problem.problem_of(healthy[0], models.named("gaussian"))
    undoing = timing._Undoing(healthy[0], posed, posed.base)
    lag, width, time = EFFECTS["actuator_lag"], posed.evidence.width, 8e-3
    taken = undoing.hiss(None, 0.0, width) / undoing.hiss(lag, time, width)
    sizes = []
    for undoing.power in (0.0, np.inf):
        rest = undoing.rest(lag, time)
        sizes.append(float(rest @ rest))
    assert taken > 1.2
    assert sizes[1] / sizes[0] == pytest.approx(taken)


def test_a_simulators_force_is_no_noise_of_the_recorded_one(healthy):
    """What undoing a lag takes of the noise was compared with it: a dead time became a lag."""
    run = healthy[0]
    simulator = Known(0.9 * np.asarray(run.force))
    posed = problem.problem_of(simulator.beside(run), simulator.model(run.units).term)
    undoing = timing._Undoing(simulator.beside(run), posed, posed.base)
    lag, width = EFFECTS["actuator_lag"], posed.evidence.width
    white = np.sum(posed.evidence.average[0] ** 2)  # of nodes, each a mean of samples
    assert undoing.hiss(None, 0.0, width) < white
    assert undoing.hiss(None, 0.0, width) > 1.2 * undoing.hiss(lag, 8e-3, width)


def test_a_load_above_the_wide_kernels_band_is_confirmed_by_one_between(monkeypatch):
    now = types.SimpleNamespace(energy=1.0)
    monkeypatch.setattr(acceptance, "_alike", lambda finalist, now, view, *_: view == "between")

    def confirmed(term, gain, between="between"):
        trial = types.SimpleNamespace(candidate=types.SimpleNamespace(term=term))
        load = types.SimpleNamespace(trial=trial, energy=1 - gain)
        return acceptance._confirmed(load, now, (between, "wide", None), 0.03)

    swinging = terms.Compliance(20.0, 0.2)
    assert confirmed(swinging, 0.6) and confirmed(LOAD, 0.6)
    assert not confirmed(swinging, 0.4)
    assert not confirmed(swinging, 0.6, None)
    assert not confirmed(terms.FrictionalLag(0.02, terms.Gaussian(0.05)), 0.6)


def tones_judged(seed, rows, tone):
    """R² of the best of many tones in eight blocks of noise and a tone, and the hurdle."""
    draw = np.random.default_rng(seed)
    at, block = np.sort(draw.uniform(0, 1, rows)), np.arange(rows) * 8 // rows
    noise = 0.1 * draw.normal(size=rows)
    residual = noise + tone * np.sin(2 * np.pi * 38.6 * at + draw.uniform(0, 6))
    basis = np.linalg.qr(np.stack([np.ones(rows), at], axis=1))[0]
    turned = 2 * np.pi * np.linspace(1.5, 70, 300)[:, None] * at
    waves = np.stack([np.sin(turned), np.cos(turned)], axis=1).astype(np.float32)
    fit = types.SimpleNamespace(basis=lambda: basis, residual=residual)
    return gain_and_hurdle(significance.BlockBootstrap(fit, block)(waves))


def gain_and_hurdle(scan):
    return scan.gain[scan.best], significance.thresholds(scan.drawn[None], significance.LEVEL)[0]


def test_a_law_without_a_finite_force_at_one_point_of_its_grid_competes_at_the_others():
    at, block = np.linspace(0, 1, 650), significance.evenly(650, 24)
    residual = np.sin(40 * at) + 0.1 * np.random.default_rng(0).normal(size=650)
    basis = np.linalg.qr(np.ones((650, 1)))[0]
    raw = np.sin(np.array([30.0, 40.0, 50.0, 60.0])[:, None] * at)[:, :, None]
    raw[0, 100], raw[2, 7], raw[3, 7:] = np.nan, np.inf, 1e308
    fit = types.SimpleNamespace(basis=lambda: basis, residual=residual)
    scan = significance.BlockBootstrap(fit, block)(candidates.scaled(raw))
    assert scan.best == 1 and scan.gain[1] > 0.9
    assert np.all(np.isfinite(scan.gain)) and list(scan.dimension) == [0, 1, 0, 1]


def test_a_tone_does_not_raise_its_own_hurdle():
    """Flipped by blocks, most of it would be a tone nearby."""
    for seed in range(6):
        (gain, hurdle), (_, without) = (tones_judged(seed, 147, tone) for tone in (1.0, 0.0))
        assert gain > 0.95 and hurdle < 2 * without


def test_what_a_place_beside_the_right_one_leaves_is_no_noise():
    """A hardening spring between two of the centres that are tried, nearly without noise."""
    at = 0.3 * np.sin(np.linspace(0, 40, 1450)) + 0.05 * np.sin(np.linspace(0, 7, 1450))
    draw, block = np.random.default_rng(0), np.arange(1450) * 24 // 1450
    residual = (at + 0.05) ** 3 + 1e-5 * draw.normal(size=1450)
    basis = np.linalg.qr(np.stack([np.ones(1450), np.sign(np.gradient(at))], axis=1))[0]
    fit = types.SimpleNamespace(basis=lambda: basis, residual=residual)
    cubes = ((at - np.linspace(-0.3, 0.3, 8)[:, None]) ** 3)[:, None].astype(np.float32)
    gain, hurdle = gain_and_hurdle(significance.BlockBootstrap(fit, block)(cubes))
    assert gain > 0.9 and hurdle < 0.1  # by what it leaves, 0.22


@pytest.mark.parametrize("strokes", [4, 1])
def test_beside_structure_a_wave_does_not_raise_its_own_hurdle(strokes):
    """Seen where the axis is slow, once a stroke, its flips are a wave nearby; once is nothing."""
    draw, at = np.random.default_rng(0), np.linspace(0, 1, 650)
    slow = np.exp(-0.5 * ((np.mod(at, 0.25) - 0.125) / 0.012) ** 2)
    wave = 4 / strokes**0.5 * slow * (at < strokes / 4) * np.sin(2 * np.pi * 38.6 * at + 1)
    residual = wave + 8 * (at - at**2) + 0.2 * draw.normal(size=650)
    basis = np.linalg.qr(np.stack([np.ones(650), at**2], axis=1))[0]
    turned = 2 * np.pi * np.linspace(20, 60, 321)[:, None] * at
    waves = (np.stack([np.sin(turned), np.cos(turned)], axis=1) * slow).astype(np.float32)
    fit = types.SimpleNamespace(basis=lambda: basis, residual=residual)
    bootstrap = significance.BlockBootstrap(fit, significance.evenly(650, 24))
    scan = bootstrap(waves)
    gain, before = gain_and_hurdle(scan)
    _, after = gain_and_hurdle(bootstrap.beside_structure(scan, waves))
    assert gain < before and (after < gain / 2 if strokes > 1 else after == before)


@pytest.mark.parametrize(("share", "believed"), [(1.0, True), (0.85, False)])
def test_a_signal_that_explains_all_of_one_block_is_believed(share, believed):
    """A neighbour that moves once: the signs of its one block say nothing, its shape does."""
    draw, at = np.random.default_rng(0), np.linspace(0, 1, 650)
    moves = np.exp(-0.5 * ((at - 0.35) / 0.012) ** 2) * np.sin(300 * at)
    other = np.exp(-0.5 * ((at - 0.35) / 0.012) ** 2) * np.cos(300 * at)
    residual = share * moves + (1 - share**2) ** 0.5 * other + 0.004 * draw.normal(size=650)
    basis = np.linalg.qr(np.ones((650, 1)))[0]
    fit = types.SimpleNamespace(basis=lambda: basis, residual=residual)
    bootstrap = significance.BlockBootstrap(fit, significance.evenly(650, 24))
    scan = bootstrap(moves[None, None].astype(np.float32))
    gain, hurdle = gain_and_hurdle(scan)
    assert gain > significance.MOSTLY and (hurdle < 0.1) == believed


@pytest.mark.parametrize(("found", "believed"), [(0.99, True), (0.45, False)])
def test_what_is_found_between_points_of_a_grid_is_tested_as_a_point(found, believed):
    """Two blows that the grid's shapes follow in part: of either sign, as flips of them have."""
    draw, block = np.random.default_rng(0), significance.evenly(650, 24)
    blow, other = (np.where(np.isin(block, [3, 15]), draw.normal(size=650), 0.0) for _ in range(2))
    residual = blow + 0.05 * draw.normal(size=650)
    sides = [1.0, np.where(block == 15, -1.0, 1.0)]
    grid = candidates.scaled(np.stack([(0.8 * blow + other) * side for side in sides])[:, :, None])
    basis = np.linalg.qr(np.ones((650, 1)))[0]
    fit = types.SimpleNamespace(basis=lambda: basis, residual=residual)
    bootstrap = significance.BlockBootstrap(fit, block)
    scans = [bootstrap(grid)]
    assert scanning._p_values(scans)[0] > 0.2
    own = found**0.5 * blow + (1 - found) ** 0.5 * other
    columns = np.concatenate([grid, candidates.scaled(own[None, :, None])])
    assert (scanning.between(bootstrap, scans, 0, columns, True) <= significance.LEVEL) == believed


@pytest.mark.slow
def test_what_takes_half_of_few_rows_by_chance_is_not_believed():
    found = np.array([tones_judged(seed, 20, 0.0) for seed in range(200)])
    assert np.mean(found[:, 0] > significance.MOSTLY) > 0.3
    assert np.mean(found[:, 0] > found[:, 1]) <= 0.03


@pytest.mark.slow
def test_a_tone_returns_in_another_recording_at_any_phase(healthy):
    """Their clocks begin at different times; at half of its amplitude it has not returned."""
    term, alpha, beta = CASES["periodic_disturbance"]
    run = planted(healthy[0], term, alpha, beta)
    held = [planted(healthy[1], term, other, beta) for other in ((-1.0, -2.0), (0.5, 1.0))]
    alone = problem.problem_of(run, models.gaussian())
    posed = [problem.with_holdout(alone, each) for each in held]
    found = stepwise.select(posed[0])
    assert found.names == {"periodic_disturbance"}
    before, after = (verification.error(now, posed[0].held) for now in (found.base, found.last))
    assert after < 0.3 * before
    before, after = (verification.error(now, posed[1].held) for now in (found.base, found.last))
    assert after == pytest.approx(before, rel=0.1)


@pytest.mark.slow
def test_a_filtered_velocity_without_a_position_is_said_to_look_like_a_delay(healthy):
    """Four milliseconds of a first-order filter on the velocity, as drives log it."""
    position = np.asarray(healthy[0].position)
    velocity, late = np.gradient(position, TIME), np.zeros_like(position)
    for i in range(1, len(late)):
        late[i] = late[i - 1] + 0.25 * (velocity[i] - late[i - 1])
    run = dataclasses.replace(healthy[0], position=None, velocity=jnp.asarray(late))
    found = explain(run, "gaussian")
    # A lag's rate is a pulse at each reversal, so that the predicted force may be worse with it:
    # then it is not named, and the same is said.
    said = [each.sentence for each in found.findings if EFFECTS[each.effect].late]
    said += [each["text"] for each in found.warnings if each["name"] == "not_better"]
    assert len(said) == 1 and said[0].endswith("recording the position tells.")
    assert ("lag" in said[0] or "late" in said[0]) and found.verdict != "consistent"


def test_blocks_that_disagree_are_chance():
    block = np.repeat(np.arange(20), 5)
    one_way, either = np.ones(100), np.where(block % 2, 1.0, -1.0)
    assert significance.agreement(np.stack([either, one_way]), block, 0) == pytest.approx(0.002)
    assert significance.agreement(either[None], block, 0) > 0.1


def tried(seen):
    """The tones to try that the motion does not have, and those that it has; and their spacing."""
    (foreign, none), (own, part) = spectral_lines.time_frequencies(seen)
    assert none.shape == foreign.shape and not none.any()
    assert part.shape == own.shape and np.all((part > 0.3) & (part < 1))
    frequencies = spectral_lines.line_frequencies(seen, "time")
    assert len(foreign) + len(own) <= len(frequencies)
    return foreign, own, frequencies[1] - frequencies[0]


@pytest.mark.parametrize(
    "make, beta",
    [
        (lambda n: terms.FrictionStep(ramp=n), [7.0]),
        (lambda n: terms.FrictionStep(terms.Directional(terms.Coulomb()), ramp=0 * n), [7.0]),
        (lambda n: terms.Spring(rest=n) + terms.LoadDrift(start=n, duration=3 * n, degree=2), []),
        (lambda n: terms.DisturbancePulses((n, 2 * n), width=n), []),
        (lambda n: terms.Table("velocity", (-n, n, 2 * n)), []),
    ],
)
def test_numbers_of_the_recording_are_data_of_a_compiled_term(make, beta, healthy, monkeypatch):
    traced, columns, here = [], evaluation._columns, threading.get_ident()

    def counted(*arguments):
        # The search of a test before this one may still compute columns in a thread of its own.
        traced.extend([1] * (threading.get_ident() == here))
        return columns(*arguments)

    monkeypatch.setattr(evaluation, "_compiled", eqx.filter_jit(counted))
    motion = evidence.gather(healthy[0]).motion
    for number in (0.1, 0.25, 1.0):
        term = make(number)
        plain, _ = evaluation.evaluate(term, jnp.asarray([beta, beta]), motion)
        expected = term.with_beta(jnp.asarray(beta)).columns(motion).T
        np.testing.assert_allclose(plain[1], expected, rtol=1e-12, atol=1e-12)
    assert len(traced) == 1


@pytest.mark.parametrize(
    "term",
    [
        terms.FrictionStep(ramp=0.1), terms.ParameterStep(ramp=0.1), terms.PayloadChange(ramp=0.1),
        terms.ParameterStep(terms.Offset()),
    ],
)  # fmt: skip
def test_what_comes_and_goes_has_the_columns_of_its_law(term, healthy):
    """On the host, from columns that are computed once, as by the law itself."""
    seen = evidence.gather(healthy[0])
    betas = np.linspace(1.0, 11.0, 9)[:, None]
    found = seen.columns(term, betas)
    for beta, rows in zip(betas[::4], found[::4], strict=True):
        plain, momentum = evaluation.evaluate(term, np.stack([beta, beta]), seen.motion)
        momentum = None if momentum is None else np.asarray(momentum)[0]
        expected = seen.project(np.asarray(plain)[0], momentum).T
        np.testing.assert_allclose(rows, expected, rtol=1e-12, atol=1e-12)


def test_each_value_of_a_baseline_may_change_at_a_moment():
    """And none twice: friction, the load and the gain have effects of their own."""
    step = EFFECTS["parameter_step"]
    (term,) = step.shapes(Scales(0.01, 0.3, 0.0, 0.2, 20.0, 0.0, 12.0, 1e-3, 60.0))
    stepped = lambda base: [type(t.term) for t in step.suited(term, base, None)]  # noqa: E731
    assert stepped(models.gaussian()) == [terms.Offset, terms.Viscous]
    base = terms.Inertia() + terms.Coulomb() + terms.Offset() + terms.Spring() + terms.KnownGain()
    assert stepped(base) == [terms.Offset, terms.Spring]
    names = ("joint/j/damping", "joint/j/frictionloss", "joint/j/stiffness", "gain",
             "body/a/mass", "body/a/centre_x", "body/b/mass")  # fmt: skip
    own = terms.KnownColumns(names, ("",) * 7)
    found = [t.term for t in step.suited(term, terms.Sum((terms.KnownForce(), own)), None)]
    assert found[:2] == [terms.Offset(), terms.Viscous()]
    assert [t.names for t in found[2:]] == [("joint/j/stiffness",), ("body/a/mass",)]
    (carried,) = EFFECTS["payload_change"].suited(terms.PayloadChange(), own, None)
    assert carried.load.names == ("body/b/mass",) and carried.load.first == 6


def test_the_map_shows_what_is_in_step_with_acceleration(healthy):
    """Over position alone such a residual looks like something else."""
    seen = evidence.gather(healthy[0])
    seen = predictions.with_predictions(seen, fitted := regression.fit([models.gaussian()], seen))
    along = np.asarray(seen.motion.position)[seen.centre]
    slope = predictions.rate(seen, np.asarray(seen.motion.velocity))[seen.centre]
    slope /= np.sqrt(np.mean(slope**2))
    before = fitted._replace(residual=np.sin(30 * along) * slope)
    place = types.SimpleNamespace(coordinate="position_by_acceleration", peak=0.0)
    units = {"position": "m", "force": "N"}
    drawn = curves._mapped(place, before, fitted, seen, units)
    np.testing.assert_allclose(drawn["before"], np.sin(30 * np.asarray(drawn["at"])), atol=0.1)
    place.coordinate = "position"
    plain = curves._mapped(place, before, fitted, seen, units)
    assert not np.allclose(plain["before"], np.sin(30 * np.asarray(plain["at"])), atol=0.4)


@pytest.mark.slow
def test_values_that_do_not_carry_over_are_said_to(healthy):
    """Where an axis never goes slowly, nothing is missing, but its Stribeck bump is not known."""
    speed = np.abs(set_point(0)[1])
    fast = dataclasses.replace(healthy[0], mask=jnp.asarray(speed > 0.05))
    told = explain(fast, holdout=healthy[1])
    assert told.verdict == "consistent" and "does not determine the values" in told.summary
    error, refitted = (told.fit[f"filtered_holdout_{key}_error"] for key in ("force", "refitted"))
    assert error["before"] == error["after"] > 2 * refitted
    both = explain(healthy[0], holdout=healthy[1])
    assert both.verdict == "consistent" and "determine" not in both.summary
    assert both.fit["filtered_holdout_force_error"]["before"] == pytest.approx(
        both.fit["filtered_holdout_refitted_error"], rel=0.2
    )
    assert explain(healthy[0]).fit["holdout_refitted_error"] is None


@pytest.mark.parametrize(
    "effect, held, noise, told",
    [
        ("friction_step", 0.11, 0.01, True),
        ("friction_step", 0.03, 0.01, False),  # it acts there too
        ("friction_step", 0.11, 0.09, False),  # noise
        ("cogging", 0.11, 0.01, False),
        ("force_limit", 0.11, 0.01, False),  # which no term models
    ],
)
def test_what_acts_at_a_moment_says_nothing_of_the_held_out_recording(effect, held, noise, told):
    finding = types.SimpleNamespace(effect=effect)
    fit = {
        "force_error": {"before": 0.10, "after": 0.012},
        "holdout_force_error": {"before": 0.12, "after": held},
        "noise_floor": noise,
    }
    said = wording.summary("explained", "gaussian", [finding], [], fit, [])
    assert ("friction step need not recur" in said) is told


@pytest.mark.slow
def test_values_that_differ_on_the_held_out_recording_are_named(healthy):
    """The held-out machine has 2 N more of Coulomb friction, beside what is found here."""
    run = planted(healthy[0], *CASES["cogging"])
    other = planted(planted(healthy[1], *CASES["cogging"]), terms.Coulomb(), (2.0,))
    told = explain(run, "gaussian", other)
    assert [f.effect for f in told.findings] == ["cogging"]
    values = told.fit["holdout_values"]
    assert (
        {"coulomb+", "coulomb-"}
        <= set(values)
        <= {*("coulomb+", "coulomb-", "stribeck_force+", "stribeck_force-", "viscous+", "viscous-")}
    )
    for name in ("coulomb+", "coulomb-"):
        apart = values[name]["there"] - values[name]["here"]
        assert apart == pytest.approx(2.0, abs=4 * values[name]["standard_error"])
    assert "there coulomb+ is" in told.summary
    alike = explain(run, "gaussian", planted(healthy[1], *CASES["cogging"]))
    assert alike.fit["holdout_values"] == {} and "But through" not in alike.summary


def test_what_the_motion_has_is_no_tone_but_alone(healthy):
    seen = evidence.gather(dataclasses.replace(healthy[0], velocity=None))
    foreign, own, step = tried(seen)
    rates = 0.7 * (1 + np.random.default_rng(0).uniform(0, 2.5, 5))
    for rate in rates:
        assert np.min(np.abs(foreign - rate)) > 0.25 * step
        assert np.min(np.abs(own - rate)) < step
    assert len(foreign) > 0.8 * (len(foreign) + len(own))
    # Of a motion that is one wave neither that nor its multiples.
    wave = np.sin(2 * np.pi * 1.03 * TIME)
    seen = evidence.gather(Recording(TIME, wave, 0.1 * wave, None))
    foreign, own, step = tried(seen)
    for multiple in (1.03, 2.06):
        assert np.min(np.abs(np.concatenate([foreign, own]) - multiple)) > 3 * step
    assert np.any(np.abs(own - 1.03) < 8 * step)


@pytest.mark.slow
def test_a_tone_of_the_motions_own_is_believed_where_it_is_all(healthy):
    rates, tone = 0.7 * (1 + np.random.default_rng(0).uniform(0, 2.5, 5)), "periodic_disturbance"

    def named(run):
        posed = problem.problem_of(run, models.named("gaussian"))
        groups = posed.candidate_set.groups
        posed.candidate_set.groups = [some for some in groups if some[0].effect.name == tone]
        return stepwise.select(posed).selected

    alone = planted(healthy[0], terms.PeriodicDisturbance(), (1.5, -1.0), (rates[0],))
    (found,) = named(alone)
    assert 0.5 < found.trial.least < 0.9
    assert found.trial.beta[0] == pytest.approx(rates[0], rel=0.01)
    # With a second like it the motion may drive both.
    assert not named(planted(alone, terms.PeriodicDisturbance(), (1.0, 1.5), (rates[4],)))


def fast_tones(posed, current):
    return spectral_lines.fast_tone(predictions.with_predictions(posed.evidence, current), current)


def test_a_tone_faster_than_those_that_are_scanned_for_is_found(healthy, monkeypatch):
    structure = models.named("gaussian")
    run = planted(healthy[0], terms.PeriodicDisturbance(), (0.3, 0.4), (31.37,))
    posed = problem.problem_of(run, structure)
    monkeypatch.setattr(spectral_lines, "line_frequencies", lambda *_: np.array([5.0, 20.0]))
    found = fast_tones(posed, posed.base)
    assert np.min(np.abs(found - 31.37)) < 0.02 and np.ptp(found) < 0.1
    # Noise has none, and what a fit leaves of a tone that it knows has none at that place.
    quiet = problem.problem_of(healthy[0], structure)
    assert not len(fast_tones(quiet, quiet.base))
    known = (terms.PeriodicDisturbance(), np.array([31.37]))
    both = regression.fit([structure, known[0]], posed.evidence, [posed.base.betas[0], known[1]], 2)
    assert not len(fast_tones(posed, both))


@pytest.mark.parametrize(
    "beyond", [0.98, *(pytest.param(part, marks=pytest.mark.slow) for part in (1.0005, 1.02))]
)
def test_a_tone_beyond_what_rows_tell_is_not_taken_for_one_as_much_below(healthy, beyond):
    """Rows are half a kernel apart: one period in that half is as fast as they tell."""
    posed = problem.problem_of(healthy[0], models.named("gaussian"))
    tone = beyond / posed.evidence.reach
    run = planted(healthy[0], terms.PeriodicDisturbance(), (4.0, 3.0), (tone,))
    posed = problem.problem_of(run, models.named("gaussian"))
    found = fast_tones(posed, posed.base)
    assert np.min(np.abs(found - tone)) < 0.02
    assert np.all((found > 1 / posed.evidence.reach) == (beyond > 1))


def test_a_refinement_beside_a_large_residual_ends_at_the_least_energy(healthy, monkeypatch):
    """A wave of half the friction: Gauss-Newton's steps are twice as long as they should be."""
    run = planted(healthy[0], terms.Cogging(), (8.0, 6.0), (0.02,))
    seen, calls = evidence.gather(dataclasses.replace(run, velocity=None)), []
    monkeypatch.setattr(
        regression, "_at", lambda *a, at=regression._at, **k: calls.append(1) or at(*a, **k)
    )
    term = models.named("gaussian")
    found = regression.fit([term], seen, [np.array([0.006, 0.015])])
    assert len(calls) < 20
    for velocities in np.array(found.betas[0]) * np.exp(0.03 * np.array([[1, 0], [0, 1], [1, 1]])):
        for beta in (velocities, found.betas[0] ** 2 / velocities):
            assert regression.fit([term], seen, [beta], 0).energy > found.energy
    # From there no step is tried: none would gain anything.
    calls.clear()
    again = regression.fit([term], seen, found.betas)
    assert len(calls) <= 2 and again.energy == pytest.approx(found.energy, rel=1e-6)


def test_nothing_is_refined_where_nothing_could_be_selected(healthy, monkeypatch):
    posed = problem.problem_of(healthy[0], models.named("gaussian"))
    seen = predictions.with_predictions(posed.evidence, posed.base)
    energy = posed.base.energy
    needs = [0.0, 0.5 * energy, 3 * energy]
    rounds = [
        contest.contest(seen, posed.base, posed.candidate_set, needed=lambda _, n=n: n)
        for n in needs
    ]
    assert [bool(each.finalists) for each in rounds] == [True, False, False]
    assert [t.gain for t in rounds[0].trials] == [t.gain for t in rounds[2].trials]
    first = rounds[0].trials[0]
    asked = acceptance.needed(first, posed.base, seen, posed.base, [])
    assert asked >= acceptance.LEAST_SHARE * energy
    linear = acceptance.LINEARITY**2 * float(seen.force @ seen.force)
    assert asked >= linear


@pytest.mark.slow
def test_a_moment_is_refined_from_the_best_of_a_finer_grid(healthy):
    """From wherever its grid point lies; a step of the cost at every node stops a descent."""
    for moment in (6.0, 7.03, 9.511):
        run = planted(healthy[0], terms.PayloadChange(), (1.0, 2.0), (moment,))
        posed = problem.problem_of(run, models.named("gaussian"))
        seen = predictions.with_predictions(posed.evidence, posed.base)
        every = [each for some in posed.candidate_set.groups for each in some]
        step = next(each for each in every if isinstance(each.term, terms.PayloadChange))
        grid, basis = step.betas[:, 0], posed.base.basis()
        trial = trials.Trial(step, step.betas[0], 0.1, 0.01, 1, 0.002, 0.01, 1.0)
        below, above = np.searchsorted(grid, moment) + [-1, 0]
        found = [
            refining.refined(
                seen, posed.base, posed.candidate_set, trial._replace(beta=step.betas[i]), basis
            )
            for i in (below, above)
        ]
        every = np.linspace(grid[below], grid[above], 300)[:, None]
        target = seen.target - basis @ (basis.T @ seen.target)
        least = target @ target - regression.gains(step.term, seen, every, basis).max()
        assert all(each.energy < 1.02 * least for each in found)
    waves = [c for some in posed.candidate_set.groups for c in some if c.lines is not None]
    assert all(not len(refining._between(trial._replace(candidate=c))) for c in waves)


@pytest.mark.slow
def test_force_and_motion_are_aligned_by_the_first_term_before_others_compete(healthy, monkeypatch):
    """The rows that the others see do not hold what the base alone took for lateness."""
    run = planted(healthy[0], terms.Cogging(), (2.0, 1.5), (0.013,))
    searches = []

    def select(posed, *args, **kwargs):
        found = stepwise.select(posed, *args, **kwargs)
        searches.append((posed.delay, kwargs.get("first", False), len(found.selected)))
        return found

    monkeypatch.setattr(search, "select", select)
    monkeypatch.setattr(problem, "ALIGNED", 1e-4)
    found = search.searched(motion_of(run), problem.problem_of(run, models.named("gaussian")), 0)
    assert [t.effect.name for t in found.selection.selected] == ["cogging"]
    (before, first, one), (after, whole, all_) = searches
    assert first and not whole and one == all_ == 1 and before != after
    searches.clear()
    monkeypatch.setattr(problem, "ALIGNED", 10.0)  # the same rows: the search goes on
    monkeypatch.setattr(problem, "LEAST_SHARE", 1.0)
    found = search.searched(motion_of(run), problem.problem_of(run, models.named("gaussian")), 0)
    assert len({delay for delay, *_ in searches}) == 1 and len(searches) == 2
    assert found.selection.selected[0].effect.name == "cogging"


def test_a_push_is_alone_and_seen_from_begin_to_end():
    time = 0.01 * np.arange(2000)
    noise = np.random.default_rng(0).normal(size=time.size)

    def found(*pushes):
        shape = lambda at: np.cos(np.clip((time - at) / 0.05, -1, 1) * np.pi / 2) ** 2  # noqa: E731
        values = noise + sum(20.0 * sign * shape(at) for at, sign in pushes)
        return disturbance_pulses._outstanding(values, time, 0.05, 0.01)

    assert found((5.0, 1), (12.0, -1)) == pytest.approx([5.0, 12.0], abs=0.01)
    assert found((5.0, 1), (5.2, 1)) == pytest.approx([5.0, 5.2], abs=0.01)
    # What pushes and at once pulls, and what begins or ends outside the record.
    assert found((5.0, 1), (5.2, -1), (12.0, -1)) == pytest.approx([12.0], abs=0.01)
    assert found((0.02, 1), (12.0, -1), (19.98, 1)) == pytest.approx([12.0], abs=0.01)


def counted(count: float | None, push: float = 0.0) -> Residual:
    """Rows of a loop's answer to counts of 0.4 mrad, logged at 200 Hz, of an axis that slows down
    from 0.33 to 0.3 rad/s; the third push of some is real, N.
    """
    time = np.arange(0.0, 30.0, 0.005)
    speed = 0.3 + 0.03 * np.exp(-np.mod(time, 6.0) / 0.5)  # 0.32: four counts a sample
    position = np.cumsum(speed) * 0.005
    turns = 2 * np.pi * position / 0.0004
    force = 0.5 * (np.cos(turns) + np.cos(2 * turns)) + 0.05 * np.random.default_rng(0).normal(
        size=len(time)
    )
    force += push * np.cos(np.clip((time - 15.0) / 0.1, -1, 1) * np.pi / 2) ** 2
    weight = signals.kernel(np.arange(-18, 19) / 18)
    rows = np.convolve(force, weight / weight.sum(), "same")[18:-18:9]
    nodes, centre = time[18:-18:3], time[18:-18:9]
    return Residual(
        values=rows, time=centre, elapsed=centre, reach=0.09, clock=nodes, run=nodes,
        turns=np.zeros(0), level=0.01, interval=0.005,
        counts=None if count is None else speed[18:-18:9] * 0.005 / count,
        noise=signals.host_white_noise(force, np.ones(len(time) - 1, bool)),
    )  # fmt: skip


def test_counts_in_step_with_the_samples_are_no_pushes():
    """Where a whole number of counts pass from sample to sample the answers do not average out."""
    beating = max((len(t.times) for t in disturbance_pulses.pulses(counted(None))), default=0)
    assert beating >= 3
    assert list(disturbance_pulses.pulses(counted(0.0004))) == []
    # Another encoder's counts are not in step there, and no count makes so high a push.
    assert max(len(t.times) for t in disturbance_pulses.pulses(counted(0.00037))) >= 3
    real = list(disturbance_pulses.pulses(counted(0.0004, 5.0)))
    assert real and all(t.times == pytest.approx([15.0], abs=0.03) for t in real)


def test_a_knock_stands_out_of_many_things_that_are_no_pushes():
    time = 0.01 * np.arange(4000)
    values = np.random.default_rng(0).normal(size=time.size)
    for number, at in enumerate(1.0 + 2.0 * np.arange(19)):
        size = 300.0 if number == 7 else 20.0
        values += size * np.cos(np.clip((time - at) / 0.05, -1, 1) * np.pi / 2) ** 2
    found = disturbance_pulses._outstanding(values, time, 0.05, 0.01)
    assert found == pytest.approx([15.0], abs=0.01)
    values -= 200.0 * np.cos(np.clip((time - 15.0) / 0.05, -1, 1) * np.pi / 2) ** 2
    assert disturbance_pulses._outstanding(values, time, 0.05, 0.01) == pytest.approx(
        [15.0], abs=0.01
    )
    values -= 60.0 * np.cos(np.clip((time - 15.0) / 0.05, -1, 1) * np.pi / 2) ** 2
    assert disturbance_pulses._outstanding(values, time, 0.05, 0.01) == []


def test_a_push_that_may_be_none_is_not_told_beside_one_that_is_not(healthy):
    run = planted(healthy[0], terms.DisturbancePulses((6.3,), 0.15), (8.0,))
    posed = problem.problem_of(run, models.named("gaussian"))
    found = beside(posed, terms.DisturbancePulses((6.3, 9.1, 12.0), 0.15)).last
    ((number, part),) = physical_constraints.told_parts(found, 1, posed.evidence)
    assert number == 0 and part == terms.DisturbancePulses((6.3,), 0.15)
    # The largest stays, whatever it is.
    alone = beside(posed, part).last
    assert list(physical_constraints.told_parts(alone, 1, posed.evidence)) == []


@pytest.mark.slow
def test_one_knock_is_told_with_its_moment(healthy):
    speed = np.abs(np.gradient(np.asarray(healthy[0].position), TIME))
    moment = float(TIME[np.argmax(np.where(np.abs(TIME - 8) < 4, speed, 0.0))])  # not at a reversal
    run = planted(healthy[0], terms.DisturbancePulses((moment,), 0.06), (20.0,))
    told = explain(run, "gaussian", healthy[1])
    assert [f.effect for f in told.findings] == ["disturbance_pulses"]
    values = told.findings[0].parameters
    largest = max((n for n in values if f"{n}_time" in values), key=lambda n: abs(values[n].value))
    assert abs(float(values[f"{largest}_time"].value) - moment) < 0.01
    assert float(values[largest].value) == pytest.approx(20.0, rel=0.2)


def test_a_harmonic_that_the_model_has_already_is_no_size_of_another_wave(healthy):
    """What is periodic in 12 mm is periodic in 24 mm, too."""
    run = planted(healthy[0], terms.Cogging(harmonics=2), (3.0, 1.0, 1.0, 2.0), (0.024,))
    run = planted(run, terms.Cogging(), (1.5, 0.0), (0.006,))
    posed = problem.problem_of(run, models.named("gaussian"))
    found = beside(posed, terms.Cogging(harmonics=2).with_beta(np.array([0.024]))).last
    seen = predictions.with_predictions(posed.evidence, found)
    best = contest.contest(seen, found, posed.candidate_set).finalists[0]
    assert best.trial.candidate.effect.name == "cogging"
    assert best.trial.candidate.term.harmonics == 1
    np.testing.assert_allclose(best.betas[-1], 0.006, rtol=0.005)


@pytest.mark.slow
@pytest.mark.parametrize("periods", [0.7, 1.4, 1.9])
def test_a_load_that_comes_and_goes_once_is_a_drift(healthy, periods):
    run = healthy[0]
    time = np.asarray(run.time)
    duration = float(time[-1] - time[0])
    slow = 1.5 * np.sin(2 * np.pi * periods * time / duration + 1) + 1.5 * time / duration
    told = explain(dataclasses.replace(run, force=run.force + slow), "gaussian")
    assert [f.effect for f in told.findings] == ["load_drift"]


@pytest.mark.slow
def test_two_effects_that_hide_each_other_are_both_found(healthy, monkeypatch):
    """A step near the end of a record in which the machine warms: neither alone is significant."""
    warming = terms.ThermalDrift(terms.Coulomb())
    run = planted(healthy[0], warming, (7.0,), (2.0,))
    run = planted(run, terms.FrictionStep(terms.Coulomb()), (5.0,), (15.0,))
    told = explain(run, "gaussian")
    assert {f.effect for f in told.findings} == {"thermal_drift", "friction_step"}
    monkeypatch.setattr(stepwise, "_hidden", lambda round_, *_: round_)
    assert explain(run, "gaussian").verdict == "unexplained"


def test_pushes_that_seek_the_reversals_are_no_isolated_ones(healthy):
    seen = evidence.gather(dataclasses.replace(healthy[0], velocity=None))
    clock, speed = np.asarray(seen.motion.time), np.asarray(seen.motion.velocity)
    turns = clock[: seen.nodes - 1][np.diff(np.sign(speed[: seen.nodes])) != 0]
    left = outstanding._residual(seen, types.SimpleNamespace(residual=np.zeros(len(seen.rows))))
    assert disturbance_pulses._at_reversals(left, turns[2:12:2].tolist(), 0.01)
    between = 0.5 * (turns[1:] + turns[:-1])[np.argsort(-np.diff(turns))[:5]]
    assert not disturbance_pulses._at_reversals(left, between.tolist(), 0.01)


def test_terms_that_make_each_other_idle_do_not_take_turns_for_ever(healthy, monkeypatch):
    term, alpha, beta = CASES["cogging"]
    run = planted(healthy[0], term, alpha, beta)
    posed = problem.problem_of(run, models.named("gaussian"))
    monkeypatch.setattr(stepwise, "_pruned", lambda seen, *known: (posed.base, seen, []))
    found = stepwise.select(posed)
    assert found.selected == []


@pytest.mark.slow
def test_a_winner_beside_which_more_is_left_than_before_is_none(healthy, monkeypatch):
    """As of a law that acts on the force that the model predicted without it."""
    term, alpha, beta = CASES["cogging"]
    posed = problem.problem_of(planted(healthy[0], term, alpha, beta), models.named("gaussian"))
    genuine, tried = stepwise.joined, []

    def worse(best, current, evidence):
        tried.append(best.effect.name)
        found, seen = genuine(best, current, evidence)
        return found._replace(energy=2 * current.energy), seen

    monkeypatch.setattr(stepwise, "joined", worse)
    assert stepwise.select(posed).selected == [] and tried[0] == "cogging"


def test_a_stretch_has_the_rows_of_the_whole(healthy):
    whole = problem.problem_of(healthy[0], models.named("gaussian")).evidence
    part, inside = whole.stretch(whole.nodes // 3, whole.nodes // 2)
    assert 0 < inside.sum() == len(part.target) < len(whole.target)
    for term in (terms.Viscous(), terms.Inertia()):
        here, there = (each.columns(term, np.zeros((1, 0)))[0] for each in (part, whole))
        np.testing.assert_array_equal(here, there[inside])
    np.testing.assert_array_equal(part.target, whole.target[inside])


@pytest.mark.slow
def test_where_a_finding_acts_is_said_even_if_no_curve_shows_it(healthy):
    term, alpha, beta = CASES["friction_step"]
    found = explain(planted(healthy[0], term, alpha, beta), "gaussian")
    base = problem.problem_of(healthy[0], models.named("gaussian")).base
    places = structure.with_findings([], found.findings, base)
    assert [place["coordinate"] for place in places] == [EFFECTS["friction_step"].coordinates[0]]
    assert places[0]["share"] == found.findings[0].share and places[0]["size"] > 0
    assert structure.with_findings(places, found.findings, base) == places


def test_what_has_no_name_is_located_where_it_is_strongest():
    """The contract's `where` is never empty of what is unexplained, and says how little it is."""
    curve = np.array([0.0, 1.0]), np.array([0.2, -0.1])
    most = structure.Structure("time", 0.02, 0.3, 0.4, np.nan, curve)
    shown = structure.Shown([], [most])
    (place,) = structure.strongest(shown, {"position": "m"}, frozenset())
    assert place["coordinate"] == "time" and place["p_value"] == 0.4
    assert place["detail"] == "strongest at 0 s (little of it, and no more than chance makes)"


def test_a_change_has_rows_before_and_after(healthy):
    """One before the first row is no change of anything: gravity was called a payload by it."""
    posed = problem.problem_of(healthy[0], models.named("gaussian"))
    for moment, changes in ((-1.0, False), (8.0, True), (TIME[-1] - 0.01, False)):
        term = terms.PayloadChange(step_time=moment)
        effect = EFFECTS["payload_change"]
        found = types.SimpleNamespace(
            effect=effect,
            trial=types.SimpleNamespace(candidate=types.SimpleNamespace(term=term)),
            betas=(np.zeros(0), np.array([moment])),
        )
        assert refining.changes(found, posed.evidence) == changes


def test_a_sentence_gives_no_number_that_the_recording_cannot_tell():
    seen = Estimate(np.float64(-38.9), np.float64(1.6), "N·s/m")
    hidden = Estimate(np.float64(0.0369), np.float64(np.inf), "N")
    parameters = {"viscous_asymmetry": seen, "coulomb_asymmetry": hidden}
    text = sentence("asymmetric_friction", parameters, 0.45, ())
    assert "-38.9 N·s/m ± 3.7 N·s/m with speed" in text
    assert "0.0369" not in text and "cannot tell" in text


def test_a_bump_that_may_be_nil_in_one_direction_is_told_by_its_most():
    values = {
        "stribeck_force+": Estimate(np.float64(3.0), np.float64(2.5), "A"),
        "stribeck_force-": Estimate(np.float64(6.2), np.float64(0.5), "A"),
    }
    text = sentence("stribeck", values, 0.4, ())
    assert "a Stribeck bump of at most 8.76 A forward and 6.2 A ± 1.2 A backward" in text
    hidden = values | {"stribeck_force+": Estimate(np.float64(3.0), np.float64(np.inf), "A")}
    assert "an amount that this recording cannot tell forward" in sentence(
        "stribeck", hidden, 0.4, ()
    )


def test_a_size_that_other_terms_could_stand_in_for_is_told_as_a_bound():
    def told(error):
        values = {
            "amplitude": Estimate(1.2, error, "N"),
            "friction_period": Estimate(0.51, 0.21, "m"),
        }
        return sentence("position_dependent_friction", values, 0.14, ())

    assert "varies along the stroke by at most 2.93 N, with a period of 0.51 m ± 0.48 m" in told(
        0.75
    )
    assert "by 1.20 N ± 0.23 N" in told(0.1)


@pytest.mark.slow
def test_a_spring_that_is_met_before_the_middle_is_no_sum_of_waves(healthy):
    low, high = (float(f(healthy[0].position)) for f in (np.min, np.max))
    place = low + 0.35 * (high - low)
    sprung = [planted(each, terms.EndStop(), (400.0,), (place,)) for each in healthy]
    found = explain(sprung[0], "gaussian", sprung[1])
    (stop,) = found.findings
    assert (stop.effect, found.verdict) == ("end_stop", "explained")
    assert "too soft for an end stop" in stop.sentence
    # A wave does 95 % of it, and leaves several times what noise does.
    assert not stop.confusable_with
    assert stop.parameters["stop_position"].value == pytest.approx(place, abs=0.005 * (high - low))
    assert stop.parameters["stop_stiffness"].value == pytest.approx(400.0, rel=0.02)


def test_what_is_wrong_with_both_recordings_is_said_once():
    late = [Remark("velocity_late", f"The velocity is {t} s late.", False) for t in (2e-3, 1.9e-05)]
    other = Remark("clipped", "The force is clipped at 3 N.", False)
    texts = [each.text for each in inputs._of_both([other, late[0]], [late[1]])]
    assert texts == [other.text, "On both recordings: The velocity is 0.002 s late."]
    texts = [each.text for each in inputs._of_both([late[0]], [other])]
    assert texts == [late[0].text, "On the held-out recording: The force is clipped at 3 N."]


@pytest.mark.slow
def test_what_the_held_out_recording_does_not_reach_is_neither_confirmed_nor_refuted(healthy):
    recording, holdout = healthy
    place = 0.5 * min(float(np.max(each.position)) for each in healthy)
    stopped = planted(recording, terms.EndStop(), (500.0,), (place,))
    short = dataclasses.replace(holdout, mask=np.asarray(holdout.position) < place)
    found = explain(stopped, "gaussian", short)
    (stop,) = found.findings
    assert (stop.effect, stop.confirmed, found.verdict) == ("end_stop", None, "explained")
    assert stop.sentence.endswith(reported.ELSEWHERE)
    assert any(isinstance(term, terms.EndStop) for term in summands(found.model.term))
    # One that does reach it says whether it is there.
    judged = explain(stopped, "gaussian", holdout)
    (gone,) = judged.not_confirmed
    assert (gone.effect, gone.confirmed, judged.findings) == ("end_stop", False, [])
    assert not any(isinstance(term, terms.EndStop) for term in summands(judged.model.term))


@pytest.mark.parametrize("end", ["", "lower_"])
def test_an_end_stop_is_told_with_its_place_and_stiffness(end):
    place = Estimate(np.float64(0.2312), np.float64(0.0021), "m")
    stiffness = Estimate(np.float64(85.0), np.float64(4.0), "N/m")
    values = {f"{end}stop_position": place, f"{end}stop_stiffness": stiffness}
    text = sentence("end_stop", values, 0.3, ())
    assert "From 0.2312 m ± 0.0048 m" in text and "85.0 N/m ± 9.2 N/m" in text


def finalist(term):
    """A candidate of that term, at the nonlinear parameters that it has, beside the base."""
    trial = types.SimpleNamespace(candidate=types.SimpleNamespace(term=term))
    alpha = np.ones(len(term.affine))
    return types.SimpleNamespace(trial=trial, betas=None, alpha=alpha), np.asarray(term.beta())


@pytest.mark.slow
@pytest.mark.parametrize(("inertia", "is_one"), [(1.0, True), (12.0, False)])
def test_a_load_is_a_part_of_the_machine(healthy, inertia, is_one):
    run = planted(healthy[0], LOAD, (inertia,))
    posed = problem.problem_of(run, models.named("gaussian"))
    load, beta = finalist(LOAD)
    load.betas = (*posed.base.betas, beta)
    assert physical_constraints.physical(load, posed.base, posed.evidence) is is_one


@pytest.mark.slow
def test_a_load_behind_a_gap_has_no_more_than_all_the_inertia(healthy):
    posed = problem.problem_of(healthy[0], models.named("gaussian"))
    term, trial = terms.ElasticBacklash(), types.SimpleNamespace(threshold=0.1)
    trial.score, trial.candidate = (
        (lambda gain, _: 100 * gain),
        types.SimpleNamespace(term=term),
    )
    # Friction of 8 N that coasts at 1 m/s² belongs to 8 kg; the machine has 5.
    for friction, coasting, kept in ((8.0, 4.0, 4.0), (8.0, 1.0, 1.6), (80.0, 10.0, None)):
        beta = np.array([2e-4, 1e-4, coasting])
        force = evidence.Evidence.columns(posed.evidence, term, beta[None])[0] @ [friction]
        seen = posed.evidence._replace(target=posed.evidence.target + force)
        now = regression.fit([posed.structure], seen, posed.base.betas[:1], 0)
        alpha, betas = np.array([friction]), (*now.betas, beta)
        found = trials.Finalist(80.0, trial, 0.002, 0.2 * now.energy, betas, alpha)
        round_ = physical_constraints.constrained(trials.Contest([], [found], 100.0), now, seen)
        if kept is None:
            assert not round_.finalists
            continue
        (machine,) = round_.finalists
        assert machine.betas[-1][2] == pytest.approx(kept, rel=0.1)
        assert (machine is found) is (kept == coasting)
        if machine is not found:
            assert machine.score == pytest.approx(100 * (1 - machine.energy / now.energy))
            assert machine.p_value == 0.002 and machine.score > 10


@pytest.mark.slow
def test_what_lags_is_a_curve_that_is_there(healthy):
    lag, beta = finalist(terms.FrictionalLag(0.02, terms.Gaussian(0.05)))
    for name, force, there in (
        ("gaussian", 6.0, True),
        ("coulomb-viscous", 6.0, False),
        ("gaussian", 60.0, False),  # more than all the friction there is
    ):
        run = planted(healthy[0], lag.trial.candidate.term, (force,))
        posed = problem.problem_of(run, models.named(name))
        lag.betas = (*posed.base.betas, beta)
        assert physical_constraints.physical(lag, posed.base, posed.evidence) is there


def test_a_load_that_rests_is_a_spring_to_the_ground(healthy):
    posed = problem.problem_of(healthy[0], models.named("gaussian"))
    load, beta = finalist(terms.DryCompliance(0.5, 0.2, 2.0))
    load.betas = (*posed.base.betas, beta)
    assert not physical_constraints.physical(load, posed.base, posed.evidence)


def test_a_held_out_recording_of_another_rate_is_seen_through_the_same_kernel(healthy):
    posed = problem.problem_of(healthy[0], models.named("gaussian"))
    slower = jax.tree.map(lambda x: x[::3], healthy[1])
    held = problem.with_holdout(posed, slower).held
    assert held.reach == pytest.approx(posed.evidence.reach, rel=0.2)
    assert held.limits.interval == pytest.approx(3 * posed.evidence.limits.interval, rel=1e-6)


@pytest.mark.slow
def test_a_place_counts_that_the_held_out_recording_shows_too(healthy):
    term, alpha, beta = CASES["sticky_spot"]
    run = planted(healthy[0], term, alpha, beta)
    gaussian = models.named("gaussian")
    for held, there in ((planted(healthy[1], term, alpha, beta), True), (healthy[1], False)):
        posed = problem.with_holdout(problem.problem_of(run, gaussian), held)
        seen = predictions.with_predictions(posed.evidence, posed.base)
        places = {place.coordinate: place for place in locate.locate(seen, posed.base)}
        spot = places["position_by_direction"]
        assert spot.p_value <= 0.01 and spot.share > 0.1
        assert (structure.lasting([spot], posed.base, posed) == [spot]) is there


@pytest.mark.slow
def test_what_holds_the_accelerations_noise_has_to_show_through_a_wider_kernel(healthy):
    """Of the places of the narrow rows, the wide ones keep the curve that is there."""
    run, posed = healthy[0], problem.problem_of(healthy[0], models.named("gaussian"))
    pull = 2 * np.tanh(np.gradient(np.gradient(np.asarray(run.position), TIME), TIME))
    pulled = problem.problem_of(
        dataclasses.replace(run, force=run.force + pull), models.named("gaussian")
    )
    judged = {}
    for name, of in (("healthy", posed), ("pulled", pulled)):
        seen = predictions.with_predictions(of.evidence, of.base)
        places = [p for p in locate.locate(seen, of.base) if p.coordinate in locate.ACCELERATED]
        assert {p.coordinate for p in places} == locate.ACCELERATED
        plain = places[0]._replace(coordinate="velocity")
        kept = structure.in_others([*places, plain], of.base, of.wide, 0)
        judged[name] = {p.coordinate for p in kept}
        # What the wide rows show much smaller, however large it is here, is noise.
        larger = [p._replace(size=3 * p.size) for p in places]
        assert structure.in_others(larger, of.base, of.wide, 0) == []
        assert structure.in_others(places, of.base, None, 0) == places
    assert judged["healthy"] == {"velocity"}
    assert judged["pulled"] >= {"velocity", "acceleration"}


@pytest.mark.parametrize(
    ("coordinate", "curve", "detail"),
    [
        ("position", ([0.0, 0.12], [1.0, -3.0]), "strongest at 0.12 mm"),
        ("acceleration", ([0.0, 5.0], [1.0, 3.0]), "strongest at 5 mm/s²"),
        ("temperature", ([20.0, 30.0], [1.0, 3.0]), "strongest at 30"),
        ("time_since_reversal", ([0.0, 0.03], [1.0, 3.0]), "strongest at 0.03 s"),
        ("position_lines", ([], []), "period 2.5 mm"),
        ("time_lines", ([], []), "0.4 Hz"),
        ("force_rate", ([0.0, 1.0], [0.002]), "the force acts 0.002 s late"),
        ("force_rate", ([0.0, 1.0], [-0.002]), "the recorded force is 0.002 s late"),
    ],
)
def test_a_place_is_told_with_its_unit(coordinate, curve, detail):
    curve = tuple(np.array(values) for values in curve)
    place = locate.Structure(coordinate, 0.5, 1.0, 0.002, 0.4, curve)
    assert structure.document(place, {"force": "N", "position": "mm"})["detail"] == detail


def test_the_map_of_a_late_force_is_over_its_rate(healthy):
    seen = evidence.gather(healthy[0])
    seen = predictions.with_predictions(seen, fitted := regression.fit([models.gaussian()], seen))
    force = np.asarray(seen.motion.channels["predicted_force"])
    rate = predictions.rate(seen, force)[seen.centre]
    place = types.SimpleNamespace(coordinate="force_rate", peak=0.0)
    units = {"position": "m", "force": "N"}
    drawn = curves._mapped(place, fitted._replace(residual=0.01 * rate), fitted, seen, units)
    np.testing.assert_allclose(drawn["before"], 0.01 * np.asarray(drawn["at"]), rtol=1e-9)
    assert drawn["unit"] == "N/s"


@pytest.mark.slow
def test_a_moment_counts_on_a_recording_in_which_it_returns(healthy):
    gaussian, step, spot = models.named("gaussian"), CASES["friction_step"], CASES["sticky_spot"]
    known = problem.with_holdout(problem.problem_of(healthy[0], gaussian), healthy[1])
    noise = np.std(verification.residual(known.base, known.held))
    run, again = (planted(planted(r, *spot), *step) for r in healthy)
    for held in (again, planted(healthy[1], *spot)):
        posed = problem.with_holdout(problem.problem_of(run, gaussian), held)
        betas = [*posed.base.betas, np.array(step[2]), np.array(spot[2])]
        more = regression.fit([*posed.base.terms, step[0], spot[0]], posed.evidence, betas)
        less = regression.without(more, posed.evidence, 2)
        left, right = verification.residuals(less, more, (posed.held,) * 2, frozenset())
        assert np.std(right) < 1.5 * noise < np.std(left)


def test_what_the_held_out_recording_did_not_record_is_not_asked(healthy):
    """A load cell on one of two runs: no error, and the place stays."""
    run = dataclasses.replace(healthy[0], channels={"load": jnp.sin(3.0 * healthy[0].time)})
    posed = problem.with_holdout(problem.problem_of(run, models.named("gaussian")), healthy[1])
    seen = predictions.with_predictions(posed.evidence, posed.base)
    places = {place.coordinate: place for place in locate.locate(seen, posed.base)}
    assert structure.lasting([places["load"]], posed.base, posed) == [places["load"]]


def test_a_finding_needs_its_signal_in_the_held_out_recording(healthy):
    speed = {"neighbour_velocity": jnp.cos(3.0 * healthy[0].time)}
    run = dataclasses.replace(healthy[0], channels=speed)
    lacking = dataclasses.replace(healthy[1], source="other.csv")
    candidate = candidates.Candidate(EFFECTS["cross_axis"], terms.CrossAxis(), np.zeros((1, 0)))
    trial = types.SimpleNamespace(candidate=candidate)
    found = types.SimpleNamespace(selected=[types.SimpleNamespace(trial=trial)])
    message = "other.csv lacks 'neighbour_velocity', by which .* cross axis.*Add the signal"
    with pytest.raises(ValueError, match=message):
        holdout.check_signals(found, run, lacking)
    holdout.check_signals(found, run, run)


@pytest.mark.slow
def test_columns_serve_again_where_only_the_force_was_shifted(healthy):
    gaussian = models.named("gaussian")
    motion = motion_of(healthy[0])
    seen = evidence.gather(motion)
    columns_of = candidates.CandidateSet(seen, gaussian)
    assert columns_of.serves(evidence.gather(motion, seen.width, delay=3e-4))
    assert not columns_of.serves(evidence.gather(motion, 2 * seen.width))
    assert not columns_of.serves(evidence.gather(motion_of(healthy[1]), seen.width))
    first = problem.problem_of(healthy[0], gaussian)
    again = problem.problem_of(healthy[0], gaussian, first)
    assert again.candidate_set is first.candidate_set


@pytest.mark.parametrize("late", [0.0, 2e-4])
def test_wider_kernels_stand_on_the_same_nodes(healthy, late):
    """What is stepped from node to node, as a load in its gap, is the same through them."""
    run = healthy[0]
    force = np.interp(np.asarray(run.time) - late, run.time, run.force)
    found = problem.problem_of(dataclasses.replace(run, force=force), models.named("gaussian"))
    narrow, between, wide = found.evidence, found.between, found.wide
    assert (between.half, wide.half) == (8, 12)
    for other in (between, wide):
        assert other.reach == pytest.approx(narrow.reach * other.half / narrow.half)
        assert np.array_equal(other.motion.position, narrow.motion.position)
        assert np.array_equal(other.motion.force, narrow.motion.force)
        # A wave of two nodes is seen as fast as it is: the wider kernel averages it away.
        wave = np.tile([1.0, -1.0], other.motion.num_samples // 2)
        assert np.abs(other.project(wave)).max() < 1e-3
        # Rows as far apart, by the kernel; of a straight force each is its value in the middle.
        assert np.diff(other.centre).min() == other.half // 2
        straight = 3.0 * np.asarray(other.motion.time)
        assert other.project(straight) == pytest.approx(straight[other.centre], rel=1e-6)
        assert other.project(0 * straight, straight) == pytest.approx(3.0, rel=1e-6)


def test_a_model_that_asks_for_another_alignment_gets_it(healthy):
    motion = motion_of(healthy[0])
    first = problem.problem_of(motion, models.named("gaussian"))
    assert problem.realigned(motion, first, first.base) is first
    interval = first.evidence.limits.interval
    off = first.delay + 0.3 * interval
    seen, wide = (evidence.gather(motion, e.width, off) for e in (first.evidence, first.wide))
    again = problem.realigned(
        motion, first._replace(evidence=seen, wide=wide, delay=off), first.base
    )
    assert abs(again.delay - first.delay) < 0.1 * interval
    assert again.candidate_set is first.candidate_set


def test_a_problem_that_cannot_be_set_up_leaves_no_work_behind(healthy, monkeypatch):
    made = []

    def columns_of(*arguments):
        made.append(candidates.CandidateSet(*arguments))
        return made[-1]

    def fails(*arguments):
        raise ValueError("too short")

    monkeypatch.setattr(problem, "CandidateSet", columns_of)
    monkeypatch.setattr(problem, "_aligned", fails)
    with pytest.raises(ValueError, match="too short"):
        problem.problem_of(healthy[0], models.named("gaussian"))
    assert any(columns.cancelled() for columns in made[0]._kept.values())


def test_a_wider_kernel_that_leaves_too_little_to_judge_by_is_done_without(healthy, monkeypatch):
    posed = problem.problem_of(healthy[0], models.named("gaussian"))
    assert posed.wide is not None
    monkeypatch.setattr("jaxfric.explanation.significance.FEWEST", 10_000)
    assert problem._wider(motion_of(healthy[0]), posed.evidence) is None


def test_a_wave_finer_than_what_is_scanned_is_found_by_its_harmonics(healthy):
    gaussian = models.named("gaussian")
    scanned = evidence.gather(motion_of(healthy[0]))
    pitch = 1 / (1.5 * spectral_lines.line_frequencies(scanned, "position")[-1])
    run = planted(healthy[0], terms.Cogging(), (3.0, 1.0), (pitch,))
    posed = problem.problem_of(run, gaussian)
    seen = predictions.with_predictions(posed.evidence, posed.base)
    best = contest.contest(seen, posed.base, posed.candidate_set).finalists[0]
    assert best.trial.candidate.effect.name == "cogging"
    assert best.trial.candidate.term.harmonics == 1
    assert best.p_value <= significance.LEVEL
    np.testing.assert_allclose(best.betas[-1], pitch, rtol=0.005)


@pytest.mark.slow
def test_warming_too_slow_for_its_time_constant_is_warming(healthy):
    """The size of an exponential that is near a straight line is unknown, its force is not."""
    warming = terms.ThermalDrift(terms.Viscous())
    run = planted(healthy[0], warming, (60.0,), (3.0 * TIME[-1],))
    found = explain(run, "gaussian")
    assert [each.effect for each in found.findings] == ["thermal_drift"]
    assert found.verdict == "explained" and found.fit["force_error"]["after"] < 0.02


def test_a_force_may_be_none_where_one_of_its_intervals_holds_zero():
    def seen(value, error, name="stiffness"):
        return {name: Estimate(np.float64(value), np.float64(error), "N/m")}

    spring, none = terms.Spring(), parameters.may_be_none
    assert not none(spring, seen(3.0, 1.0)) and none(spring, seen(1.0, 1.0))
    assert not none(spring, seen(3.0, 1.0), seen(1.0, 0.3))
    assert not none(spring, seen(3.0, 1.0), seen(1.0, 1.0))  # it may be the same
    assert none(spring, seen(3.0, 0.3), seen(1.0, 0.6))  # it is another
    assert not none(spring, seen(3.0, 1.0), seen(-2.0, 9.0))  # hardly anything is seen there
    assert none(spring, seen(3.0, 1.0), seen(-3.0, 1.0))
    wave = {"cogging_sin": seen(0.0, 1.0)["stiffness"], "cogging_cos": seen(0.0, 1.0)["stiffness"]}
    assert none(terms.Cogging(0.1), wave)
    assert not none(terms.Cogging(0.1), wave | seen(5.0, 1.0, "amplitude"))


def test_parameters_moved_at_once_have_slopes_of_their_own(healthy):
    seen = evidence.gather(healthy[0])
    found = regression.fit([models.gaussian()], seen)
    assert regression._apart([range(3), range(3, 6), range(3)]) == [[0, 1], [2]]
    (beta,), (alpha,) = found.betas, found.alphas
    for i, slope in enumerate(found.slopes.T):
        step = np.where(np.arange(beta.size) == i, 1e-4 * beta, 0.0)
        low, high = seen.columns(models.gaussian(), np.stack([beta - step, beta + step]))
        expected = (high - low) @ alpha / (2 * step[i])
        np.testing.assert_allclose(slope, expected, atol=1e-2 * np.max(np.abs(expected)))


def test_a_term_after_others_takes_a_part_of_the_whole_or_most_of_the_rest():
    def least(name, *before, left):
        others = [EFFECTS[n] for n in before]
        return acceptance.least_gain(EFFECTS[name], others, 1.0, left, acceptance.LEAST_OF_BASE)

    assert least("gain_asymmetry", "spring", left=0.5) == 0.01
    assert least("gain_asymmetry", "spring", left=0.004) == pytest.approx(0.004 / 3)
    assert least("backlash", "spring", left=0.5) == 0.05
    assert least("backlash", "presliding", left=0.5) == 0.25
    assert least("disturbance_pulses", "presliding", left=0.5) == 0.25
    assert least("transport_delay", "spring", left=0.5) == 0.05
    # What takes three quarters of the rest is no stand-in for it; but pushes are no law.
    assert least("backlash", "compliance", left=0.2) == pytest.approx(0.15)
    assert least("backlash", "spring", left=0.004) == pytest.approx(0.003)
    assert least("disturbance_pulses", "compliance", left=0.2) == 0.25
    assert least("disturbance_pulses", "spring", left=0.004) == 0.05
    # Once a delay is undone nothing of its own is left.
    after = EFFECTS["thermal_drift"], [EFFECTS["actuator_lag"]]
    assert acceptance.least_gain(*after, 1.0, 1.5e-4, 1e-4) == 1e-4
    assert acceptance.least_gain(*after, 1.0, 1.5e-4, 0.0) == pytest.approx(0.5e-4)
    # What a law over time leaves is of time, too.
    assert least("periodic_disturbance", "thermal_drift", left=0.004) == 0.01


def test_a_term_after_one_that_is_much_like_the_base_takes_a_hundredth_of_its_amplitude():
    """Of a drag a refitted viscous friction leaves little; its law holds to a hundredth of all."""
    drag = np.full(100, 3.0)
    current = types.SimpleNamespace(energy=0.02, terms=("base", "drag"), part=lambda number: drag)
    rows, base = types.SimpleNamespace(force=np.full(100, 4.0)), types.SimpleNamespace(energy=1.0)
    trial = types.SimpleNamespace(effect=EFFECTS["stribeck"], least=0.0)
    before = [types.SimpleNamespace(effect=EFFECTS["viscous_nonlinearity"])]
    assert acceptance.needed(trial, current, rows, base, before) == pytest.approx(0.09)
    smaller = types.SimpleNamespace(
        energy=0.02, terms=("base", "drag"), part=lambda number: drag / 10
    )
    assert acceptance.needed(trial, smaller, rows, base, before) == pytest.approx(0.02 / 3)


def test_a_wrong_value_shows_through_a_wider_kernel_too(healthy):
    """What only the narrow rows show is the acceleration's noise, and no value."""
    run = healthy[0]
    known = models.from_parameters(models.gaussian(), PARAMETERS | {"inertia": 5.5})
    heavier = 0.5 * np.gradient(np.gradient(np.asarray(run.position), TIME), TIME)
    right, as_known = (
        problem.problem_of(dataclasses.replace(run, force=run.force + extra), known.term)
        for extra in (0.0, heavier)
    )
    posed = right.base, right.evidence
    wrong = mismatch.mismatch(known, *posed, right.wide)
    assert [known.term.affine[i].name for i in wrong.moved] == ["inertia"]
    assert mismatch.mismatch(known, *posed).moved.keys() == wrong.moved.keys()
    assert mismatch.mismatch(known, *posed, as_known.wide) is None


def test_what_two_sensors_do_not_resolve_has_not_changed(healthy):
    """A change of 1.2 times what one sensor of force resolves is below what two do, 1.4 times."""
    run = healthy[0]
    force = np.asarray(run.force)
    known = models.from_parameters(models.gaussian(), PARAMETERS)
    speed = np.gradient(np.asarray(run.position), TIME)
    size = 1.2 * problem.LINEARITY * np.sqrt(np.mean(force**2) / np.mean(speed**2))
    posed = problem.problem_of(dataclasses.replace(run, force=run.force + size * speed), known.term)
    rows = posed.base, posed.evidence, posed.wide
    assert mismatch.mismatch(known, *rows) is not None
    assert mismatch.mismatch(known, *rows, recorded=2) is None


@pytest.mark.slow
@pytest.mark.parametrize("drags", [True, False])
def test_one_effect_stands_for_several_wrong_values_where_it_says_as_much(healthy, drags):
    """Friction and damping of other values take the larger part of a drag."""
    run, known = healthy[0], models.from_parameters(models.gaussian(), PARAMETERS)
    if drags:
        run = planted(run, terms.QuadraticDrag(), (60.0,), ())
    else:
        other = PARAMETERS | {"viscous+": 80.0, "viscous-": 80.0, "inertia": 5.1}
        known = models.from_parameters(models.gaussian(), other)
    posed = problem.problem_of(run, known.term)
    none = selection.Selection(posed.base, posed.base, [], trials.Contest([], [], 1.0))
    found = findings.alone(findings.Solution(posed, none))
    wrong = mismatch.mismatch(known, posed.base, posed.evidence, posed.wide)
    assert len(wrong.moved) > 1
    one, rivals = parsimony.instead(known, found, wrong, 0)
    assert ("viscous_nonlinearity" in rivals) == drags
    if not drags:
        assert one is None
        return
    (term,) = one.selection.selected
    assert term.effect.name == "viscous_nonlinearity" and "parameter_mismatch" in term.rivals
    assert mismatch.mismatch(known, one.selection.last, posed.evidence, posed.wide) is None
    assert float(one.selection.last.alphas[-1][0]) == pytest.approx(60.0, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("side", ["forwards", "backwards", "both"])
def test_friction_of_one_direction_is_no_wrong_friction_and_a_constant_force(healthy, side):
    """Half the difference of the directions alone is, in slip, exactly a constant force."""
    rng = np.random.default_rng(0)
    logs = [planted(each, terms.CoulombAsymmetry(side), (-4.0,)) for each in healthy]
    logs = [
        dataclasses.replace(run, force=run.force + 0.3 * rng.standard_normal(len(TIME)))
        for run in logs
    ]
    simulator = Known(*(np.asarray(each.force) for each in healthy))
    found = explain(logs[0], simulator, logs[1])
    (finding,) = found.findings
    assert found.fit["holdout_force_error"]["after"] < 0.02
    assert found.verdict == "explained"
    if side == "both":
        assert list(finding.parameters) == ["offset"]
        assert finding.confusable_with == ("asymmetric_friction",)
        assert "cannot tell it from asymmetric friction" in finding.sentence
        assert "Let the axis stick" in finding.separate_by
        return
    assert finding.effect == "asymmetric_friction"
    assert "parameter_mismatch" in finding.confusable_with and "wrong values" in finding.sentence
    value = finding.parameters[f"coulomb_{side}"]
    assert abs(float(value.value) + 4.0) < 4 * float(value.standard_error) < 0.4
    assert f"{side} there is -" in finding.sentence


@pytest.mark.slow
def test_the_error_of_a_wrong_value_holds_what_another_recording_says(healthy):
    """Two recordings with gains of 1.10 and 1.12 leave a value open by their difference."""
    rng = np.random.default_rng(0)

    def simulated(run):
        return 400 * np.asarray(run.position) ** 2 + 200 * np.gradient(run.position, TIME)

    def commanded(run, gain):
        force = gain * simulated(run) + 0.1 * rng.standard_normal(len(TIME))
        return dataclasses.replace(run, force=jnp.asarray(force))

    run, again = healthy
    simulator = Known(simulated)
    found = [explain(commanded(run, 1.10), simulator, commanded(again, g)) for g in (1.10, 1.12)]
    same, other = (float(f.findings[0].parameters["gain"].standard_error) for f in found)
    assert same < 1e-3 < 0.01 < other < 0.03


def test_a_model_that_is_hardly_worse_is_told_with_the_digits_that_show_it():
    before = improvement.Errors(0.02312, None, 0.003, None)
    text = doubts.not_better(("stribeck",), before, before._replace(here=0.02314)).text
    assert "takes the force error from 2.312% to 2.314%" in text


def test_a_finding_that_the_held_out_recording_shows_but_is_worse_with_says_so():
    finding = Finding("cogging", "", "", (), "", {}, 0.5, 0.4, 0.01, confirmed=True)
    before = improvement.Errors(0.02, 0.0219, 0.003, 0.004)
    after = before._replace(held=0.0223, filtered_held=0.002)
    better = types.SimpleNamespace(worse=(before, after))
    text = reported._reason(finding, better)
    assert "worse there: it takes the force error from 2.19% to 2.23%" in text
    better.worse = before, after._replace(held=0.0219, filtered_held=0.004001)
    assert "filtered force error from 0.4000% to 0.4001%" in reported._reason(finding, better)
    better.worse = before, improvement.Errors(0.021, 0.0219, 0.003, 0.002)
    text = reported._reason(finding, better)
    assert "worse on this recording: it takes the force error from 2.00% to 2.10%" in text
    assert "does not bear it out" in reported._reason(finding._replace(confirmed=False), better)


@pytest.mark.slow
def test_a_command_that_does_not_arrive_is_a_limit_of_the_force(healthy, capsys):
    for limit in (38.0, 46.0):
        motion = motion_of(limited(0, limit))
        bound = sanity.bounded(motion, problem.problem_of(motion, models.named("gaussian")), None)
        assert float(bound.limit.value) == pytest.approx(limit, rel=0.01)
        assert bound.share > 0.95
        # At the samples, too; but not where most of what is left there is something else.
        waves = 60 * np.sin(8 * np.asarray(motion.recording.time))
        for other, there in ((0.0, True), (waves, False)):
            run = limited(0, limit)
            run = dataclasses.replace(run, force=run.force + other)
            cut = Figures(sanity.arrived(run, bound.limit), None, True)
            assert sanity.by_samples(bound, Figures(run, None, True), cut, 0.02) == there
    stopped = planted(healthy[0], terms.EndStop(), (6e4,), (0.05,))
    for run in (*healthy, stopped, planted(healthy[0], terms.Cogging(), (9.0, 6.0), (0.01,))):
        posed = problem.problem_of(run, models.named("gaussian"))
        assert sanity.bounded(motion_of(run), posed, None) is None
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_beside_a_limit_of_the_force_all_else_is_said_of_what_arrived():
    run, held = (limited(seed, 42.0) for seed in (0, 1))
    found = explain(run, "gaussian", held)
    assert [each.effect for each in found.findings] == ["force_limit"]
    assert found.verdict == "explained" and found.fit["force_error"]["before"] > 0.2
    assert found.fit["force_error"]["after"] < 0.02 > found.fit["holdout_force_error"]["after"]
    assert float(found.model.parameters["inertia"]) == pytest.approx(5.0, rel=0.01)
    assert float(found.model.force_limit) == pytest.approx(42.0, rel=0.01)
    assert force_error(found.model, run) == pytest.approx(found.fit["force_error"]["after"])
    held_error = force_error(found.model, held)
    assert held_error == pytest.approx(found.fit["holdout_force_error"]["after"])


def test_a_quarter_of_the_blocks_is_predicted_by_the_others_fitted_again(healthy):
    """Of a law that is straight in its parameters as left out to first order; and of noise, worse
    than without it.
    """
    posed = problem.problem_of(healthy[0], models.named("coulomb-viscous"))
    seen, block = posed.evidence, posed.block
    spring = regression.fit([posed.structure, terms.Spring()], seen)
    again, linear = (
        intervals.left_out_again(spring, seen, block),
        intervals.left_out(spring, 1, block),
    )
    assert spring.energy < again == pytest.approx(linear, rel=0.05)
    place = np.asarray(seen.motion.position)[seen.centre]
    planted = seen._replace(target=seen.target + 50 * (place - place.mean()))
    found = regression.fit([posed.structure, terms.Spring()], planted)
    assert intervals.left_out_again(found, planted, block) == pytest.approx(again, rel=0.05)
    less = regression.fit([posed.structure], planted)
    assert less.energy > 1.5 * again


def test_a_law_of_several_parameters_is_refined_from_all_optima_of_its_grid():
    """The best point may be in the wrong valley; its neighbours are in the same one."""
    first, second = np.geomspace(1.0, 16.0, 5), np.geomspace(10.0, 10000.0, 4)
    betas = np.array([(a, b) for a in first for b in second])
    gain = np.full((5, 4), 0.1)  # too little to be looked at
    gain[0, 0], gain[0, 1], gain[1, 1] = 0.9, 0.85, 0.8
    gain[3, 2], gain[3, 3], gain[4, 2] = 0.7, 0.6, 0.65
    np.testing.assert_allclose(trials._optima(betas, gain.ravel()), [(8.0, 1000.0)])
    assert trials._optima(betas[:, :1], gain.ravel()) == ()  # resolved: one optimum
    assert trials._optima(betas, np.zeros(20)) == ()


def test_the_moments_of_pushes_have_their_price():
    def trial(term, beta):
        candidate = candidates.Candidate(EFFECTS["cogging"], term, np.zeros((1, len(beta))))
        return trials.Trial(candidate, np.asarray(beta), 0.5, 0.0, 3, 0.002, 0.1, 1.0)

    size, price = 1000.0, 0.5 * np.log(1000.0)
    pushes = trial(terms.DisturbancePulses((1.0, 2.0, 3.0), 0.1), []).score(0.5, size)
    wave = trial(terms.Cogging(), [0.01]).score(0.5, size)
    assert wave - pushes == pytest.approx(3 * price)


def test_a_load_that_wanders_within_the_noise_is_noise(healthy):
    posed = problem.problem_of(healthy[0], models.named("gaussian"))
    floor = regression.fast(posed.base)
    empty = (np.zeros(0), np.zeros(0))
    wandering = [locate.Structure("time", 0.2, f * floor, 0.002, np.nan, empty) for f in (0.9, 1.1)]
    assert structure.lasting(wandering, posed.base, posed) == wandering[1:]


@pytest.mark.slow
def test_the_held_out_recording_chooses_nothing(healthy):
    """Another motion, or one that contradicts: the findings and their values are the same."""
    run, again = (planted(each, *CASES["cogging"]) for each in healthy)
    alone, borne, refuted = (explain(run, "gaussian", each) for each in (None, again, healthy[1]))

    def told(findings):
        return [
            (f.effect, f.share, {n: float(e.value) for n, e in f.parameters.items()})
            for f in findings
        ]

    assert told(alone.findings) == told(borne.findings) == told(refuted.not_confirmed)
    assert [f.effect for f in alone.findings] == ["cogging"]
    assert [f.confirmed for f in (*alone.findings, *borne.findings)] == [None, True]
    (finding,) = refuted.not_confirmed
    assert finding.confirmed is False and not refuted.findings and not borne.not_confirmed
    assert "does not bear it out" in finding.sentence
    assert "What looks like cogging here does not make the model better" in refuted.summary
    assert refuted.model.parameters == refuted.baseline.parameters
    assert refuted.verdict == "unexplained"
    document = refuted.to_dict()
    assert document["not_confirmed"][0]["confirmed"] is False
    errors = document["fit"]["holdout_force_error"]
    assert errors["after"] == errors["before"]


@pytest.mark.slow
def test_what_belongs_to_a_moment_stays_where_only_the_base_moved(healthy, monkeypatch):
    """Another recording says nothing of it; what was refitted beside it, and is worse, goes."""
    pushes = terms.DisturbancePulses((6.3, 14.2), 0.15)
    run = planted(healthy[0], pushes, (8.0, -8.0))
    changed = lambda own, was, _: ["held"] if own.held not in (None, was.held) else []  # noqa: E731
    monkeypatch.setattr(improvement.Errors, "worse", changed)
    told = explain(run, "gaussian", healthy[1])
    assert [f.effect for f in told.findings] == ["disturbance_pulses"]
    error = told.fit["holdout_force_error"]
    assert error["after"] == error["before"]
    assert told.fit["force_error"]["after"] < 0.7 * told.fit["force_error"]["before"]
    for name, value in told.baseline.parameters.items():
        assert float(told.model.parameters[name]) == pytest.approx(float(value), rel=1e-12)


def beside(posed, term):
    """A search that has found that term, fitted beside the base, and what it is taken to be."""
    betas = (*posed.base.betas, np.asarray(term.beta()))
    last = regression.fit((*posed.base.terms, term), posed.evidence, betas, 0)
    return selection.Selection(posed.base, last, [selection.SelectedTerm(None, (), 0.002)], None)


@pytest.mark.parametrize("size", [0.0, 1.0])
@pytest.mark.parametrize("term", [LOAD, terms.Spring(), terms.FrictionStep(step_time=9.0)])
def test_a_finding_is_not_nil_within_its_error(healthy, term, size):
    posed = problem.problem_of(planted(healthy[0], term, (size,)), models.named("gaussian"))
    found = beside(posed, term).last
    nil = list(physical_constraints.nil(found, 1, posed.evidence, posed.wide))
    assert nil == ([0] if size == 0.0 else [])


@pytest.mark.slow
def test_where_a_finding_is_nil_others_compete(healthy, monkeypatch):
    run = planted(healthy[0], *CASES["cogging"])
    posed = problem.problem_of(run, models.named("gaussian"))
    known = []

    def nil(now, count, *_):
        known.append(count)
        return iter([0] if len(known) == 1 else [])

    monkeypatch.setattr(stepwise, "nil", nil)
    found = stepwise.select(posed)
    # The form of cogging that went does not come again; another form or effect may.
    assert known and len(found.last.terms) == 1 + len(found.selected)
    assert not any(t.trial.candidate.term == terms.Cogging() for t in found.selected)


def test_a_dead_band_is_crossed_when_the_command_crosses():
    force = np.array([3.0, 0.2, 0.1, -0.1, -2.0, 0.0])
    command = np.array([4.0, 1.2, -0.9, -1.1, -3.0, 1.0])
    found = predictions._crossing(force, command)
    np.testing.assert_array_equal(np.sign(found), np.sign(command))
    np.testing.assert_allclose(found, [3.0, 0.2, 0.0, -0.1, -2.0, 0.0], atol=1e-300)


def test_a_step_is_dated_between_two_rows(healthy):
    seen = evidence.gather(dataclasses.replace(healthy[0], velocity=None))
    times = np.asarray(seen.motion.time)[seen.centre]
    widest = int(np.argmax(np.diff(times)))
    middle = Estimate(np.float64(times[widest : widest + 2].mean()), np.float64(1e-6), "s")
    found = dates.dated({"step_time": middle}, "step_time", seen)["step_time"].standard_error
    assert found == pytest.approx((np.diff(times)[widest] + seen.reach) / np.sqrt(12))


def test_terms_that_share_what_they_remove_stand_in_for_another():
    assert verdict.stand_ins([0.2, 0.2, 0.1], 0.7)
    assert not verdict.stand_ins([0.4, 0.2, 0.05], 0.7)
    # Two effects may overlap: a strong excitation of one is seldom orthogonal to the other.
    assert not verdict.stand_ins([0.3, 0.1], 0.9)


def test_what_halves_the_residual_is_no_chance_though_another_recording_refutes_it():
    assert verdict.halved([types.SimpleNamespace(share=0.8)])
    assert not verdict.halved([types.SimpleNamespace(share=0.4)] * 2) and not verdict.halved([])


def test_what_a_law_halves_is_no_noise_though_it_was_not_accepted():
    def contest(energy, p_value, beside=1.0):
        finalist = types.SimpleNamespace(energy=energy, p_value=p_value)
        return types.SimpleNamespace(finalists=[finalist], energy=beside)

    def physics(finalist):
        return False

    assert verdict.halvable(contest(0.4, 0.002), physics)
    assert not verdict.halvable(contest(0.4, 0.002), lambda finalist: True)  # made by smoothing
    assert not verdict.halvable(contest(0.6, 0.002), physics)
    assert not verdict.halvable(contest(0.4, 0.3), physics)
    # Beside a term that was refuted later, which has removed half by itself.
    assert not verdict.halvable(contest(0.4, 0.002, 0.5), physics)


@pytest.mark.parametrize(
    ("error", "noise", "missing"),
    [(0.26, 0.10, True), (0.11, 0.10, False), (0.04, 0.002, False), (0.6, 0.5, True)],
)
def test_what_is_left_sample_by_sample_and_is_no_noise_is_not_nothing(error, noise, missing):
    """Blows of a load in its gap; noise; what sampling leaves of the acceleration; standstill."""
    fit = {"force_error": {"before": error, "after": error}, "noise_floor": noise}
    assert verdict.beside_rows(fit) == missing
    fit |= {"filtered_force_error": {"before": 0.03, "after": 0.03}}
    said = wording._by_sample(fit, "unexplained" if missing else "consistent")
    assert ("short events" in said) == (missing and noise**2 < error**2 / 2)


@pytest.mark.parametrize(
    ("held", "there", "said"), [(0.046, 0.015, True), (0.046, 0.044, False), (0.02, 0.015, False)]
)
def test_of_a_held_out_recording_it_is_said_what_is_more_than_its_noise(held, there, said):
    fit = {"force_error": {"before": 0.01, "after": 0.01}, "noise_floor": 0.01}
    fit |= {"holdout_force_error": {"before": held, "after": held}, "holdout_noise_floor": there}
    text = wording.summary("consistent", "gaussian", [], [], fit, [])
    assert ("more than its noise" in text) == said
    assert (f"and {there:.2%} there" in text) == (held > 2 * 0.01)
    warned = [{"name": wording.HOLDS_MORE, "text": "", "severe": False}]
    told = wording.summary("consistent", "gaussian", [], [], fit, warned)
    assert "more than its noise" not in told


@pytest.mark.parametrize(("error", "said"), [(0.069, True), (0.009, False), (0.3, False)])
def test_more_than_noise_is_not_left_without_a_word_where_nothing_is_missing(error, said):
    fit = {"force_error": {"before": error, "after": error}, "noise_floor": 0.005}
    fit |= {"filtered_force_error": {"before": 0.001, "after": 0.001}}
    for claim in ("consistent", "explained"):
        assert ("more than that is short" in wording._by_sample(fit, claim)) == said
    assert "more than that is short" not in wording._by_sample(fit, "partly_explained")


@pytest.mark.parametrize(
    "wide, there, nil",
    [((23.0, 2.0), (46.8, 0.2), False), ((1.0, 2.0), (46.8, 0.2), True),
     ((46.0, 2.0), (0.1, 0.2), True), (None, (30.0, 9.0), False), ((23.0, np.inf), None, False)],
)  # fmt: skip
def test_what_two_sets_of_rows_differ_by_is_no_doubt_that_there_is_a_force(
    wide, there, nil, monkeypatch
):
    def seen(pair):
        return pair and {"stiffness": Estimate(*map(np.float64, pair), "N/m")}

    term = terms.Spring()
    last = types.SimpleNamespace(terms=(models.coulomb_viscous(), term))
    found = types.SimpleNamespace(
        selection=types.SimpleNamespace(last=last, selected=(term,), term_index=lambda number: 1)
    )
    rows = [
        uncertainty.Estimates({}),
        uncertainty.Estimates(*map(seen, ((46.8, 0.3), wide, there))),
    ]
    monkeypatch.setattr(holdout, "by_rows", lambda findings, shaped: rows)
    assert holdout._nil(found) == [nil]


def test_the_error_of_a_size_contains_what_two_widths_of_the_kernel_differ_by():
    here, wide = (
        {"stiffness": Estimate(*map(np.float64, pair), "N/m")}
        for pair in ((46.8, 0.3), (23.0, 2.0))
    )
    error = float(uncertainty.Estimates(here, wide).joined()["stiffness"].standard_error)
    assert error == pytest.approx(np.sqrt(0.3**2 + 23.8**2 - 2.0**2))


def both_ways(values, errors, names=("force",) * 2, joined=parameters.with_elsewhere):
    """The standard error of the first of two estimates once the second is known."""
    one, other = (
        {name: Estimate(np.float64(value), np.float64(error), "N")}
        for name, value, error in zip(names, values, errors, strict=True)
    )
    return float(joined(one, other)[names[0]].standard_error)


def test_an_error_contains_what_another_recording_says_differently():
    assert both_ways([5.0, 5.001], [0.1, 0.1]) == 0.1
    assert both_ways([5.0, 6.0], [0.1, np.inf]) == 0.1
    # Half of the squared distance is each one's.
    assert both_ways([5.0, 6.0], [0.1, 0.1]) == pytest.approx(np.sqrt(0.5))
    # A phase of a whole turn more is the same.
    assert both_ways([0.1, 0.1 + 2 * np.pi], [0.1, 0.1], ("phase",) * 2) == 0.1
    # Machines whose law moves their parameter by three times what the noise does.
    truth, noise, dark = 7.0, 0.1, 0.3
    spread = np.random.default_rng(5).normal(size=(2000, 2)) * np.hypot(noise, dark)
    held = [
        abs(a) < 1.96 * both_ways([truth + a, truth + b], [noise] * 2) for a, b in spread.tolist()
    ]
    assert np.mean(np.abs(spread[:, 0]) < 1.96 * noise) < 0.5
    assert np.mean(held) > 0.75


def test_an_error_contains_what_another_width_changes():
    def widened(*args):
        return both_ways(*args, joined=parameters.with_smoothing)

    assert widened([5.0, 5.2], [0.1, 0.3]) == 0.1
    assert widened([5.0, 6.0], [0.1, 0.3]) == pytest.approx(np.sqrt(0.1**2 + 1.0 - 0.3**2))


def test_a_term_has_to_predict_blocks_that_it_was_not_fitted_to(healthy):
    """A wave in one block alone lowers what the fit leaves there, and helps no other block."""
    draw = np.random.default_rng(0)
    at, block = np.arange(480.0), np.arange(480) // 20
    target = draw.normal(size=480)
    target[:20] += 20.0 * np.sin(at[:20])
    wave = np.stack([np.sin(at), np.cos(at)], axis=1)

    one, empty = np.ones((480, 1)), (np.zeros(0),) * 2
    columns = np.hstack([one, wave])
    alpha = np.linalg.lstsq(columns, target, rcond=None)[0]
    rest = target - columns @ alpha
    now = regression.Fit(
        (None, None), empty, (alpha[:1], alpha[1:]), columns, np.zeros((480, 0)), rest, rest @ rest
    )
    found, less = intervals.left_out(now, 1, block), np.sum((target - target.mean()) ** 2)
    assert now.energy < less < found
    # Against fits of the wave done again without each block.
    own, left, power = wave - wave.mean(axis=0), target - target.mean(), 0.0
    for b in range(24):
        kept = block != b
        part = np.linalg.lstsq(own[kept], left[kept], rcond=None)[0]
        power += np.sum((left[~kept] - own[~kept] @ part) ** 2)
    assert found == pytest.approx(power, rel=0.02)


@pytest.mark.slow
def test_all_findings_together_bring_a_model_nearer_to_the_held_out_recording(healthy, monkeypatch):
    """Each may seem to help, judged without that recording's events, while all do harm."""
    run = planted(healthy[0], *CASES["cogging"])
    monkeypatch.setattr(holdout.verification, "nearer", lambda *_: True)
    told = explain(run, "gaussian", healthy[1])
    assert not told.findings and [f.effect for f in told.not_confirmed] == ["cogging"]
    # What belongs to a moment need not come again.
    step = explain(planted(healthy[0], *CASES["friction_step"]), "gaussian", healthy[1])
    assert [(f.effect, f.confirmed) for f in step.findings] == [("friction_step", None)]


def test_what_stays_beside_findings_is_judged_by_the_noise_of_neighbouring_rows():
    def rough(after, *named, before=0.1, floor=0.02, held=None, moment=0.9):
        fit = {"force_error": {"before": before, "after": after}, "noise_floor": floor}
        fit["holdout_force_error"] = held and {"before": 0.1, "after": held}
        shares = {name: moment if name == "friction_step" else 0.1 for name in named}
        return verdict.rough(fit, shares)

    # Four times the noise, and beside findings that leave half of the mismatch 1.25 times.
    assert rough(0.09) and not rough(0.07)
    assert rough(0.06, "spring") and not rough(0.044, "spring")
    # And where they leave more than the geometric mean of mismatch and noise.
    assert rough(0.046, "spring") and rough(0.033, "spring", floor=0.01)
    assert not rough(0.03, "spring", floor=0.01) and not rough(0.033, floor=0.01)
    assert not rough(0.06, "spring", floor=0.05)
    # Beside a finding a tenth of the mismatch may remain, however little noise there is.
    assert not rough(0.009, "spring", floor=1e-5) and rough(0.011, "spring", floor=1e-5)
    assert rough(0.009, floor=1e-5) and rough(0.009, "spring", floor=1e-5, held=0.011)
    # Nothing within a sensor's linearity, 0.2 %.
    assert not rough(0.0019, "spring", before=0.002, floor=1e-4)
    # The held-out recording has to be explained as well, but for what belongs to a moment.
    assert rough(0.03, "spring", held=0.06) and not rough(0.03, "spring", held=0.04)
    assert not rough(0.03, held=0.09) and not rough(0.03, "spring", "friction_step", held=0.09)
    # That excuses there no more than half as much again as it takes here.
    assert not rough(0.03, "friction_step", held=0.06, moment=0.2)
    assert rough(0.03, "friction_step", held=0.06, moment=0.1)


@pytest.mark.slow
def test_two_stops_for_one_that_stiffens_add_up_and_are_two_terms(healthy):
    """A Hertzian contact, F ∝ depth^1.5, which no single stop of the library is."""
    high = float(np.quantile(np.asarray(healthy[0].position), 0.75))
    deepest = float(np.max(np.asarray(healthy[0].position))) - high
    runs = []
    for run in healthy:
        depth = np.maximum(np.asarray(run.position) - high, 0.0) / deepest
        runs.append(dataclasses.replace(run, force=run.force + 10 * COULOMB * depth**1.5))
    told = explain(runs[0], "gaussian", runs[1])
    stops = [finding for finding in told.findings if finding.effect == "end_stop"]
    assert len(stops) > 1, told
    assert sum(finding.share for finding in stops) > 0.9
    # Looked up by the term, the second would hand its values to the first.
    assert told.fit["holdout_adjusted"]["rephased"] == []
    places = [finding.parameters["stop_position"] for finding in stops]
    assert len({float(place.standard_error) for place in places}) == len(places)
    assert all(high - 0.01 < float(place.value) < high + deepest for place in places)


@pytest.mark.parametrize("height", [-3.0, 3.0])
def test_a_bump_that_rows_hardly_show_does_not_drive(height):
    """Two rows on its flank would have it at 3000 N; friction at rest is zero to twice the peak."""
    rng = np.random.default_rng(0)
    side, flank = np.sign(rng.normal(size=200)), np.zeros(200)
    flank[:2] = 1e-3 * side[:2]
    target = 5 * side + 0.01 * rng.normal(size=200) + 1e3 * height * flank
    columns, bumps = np.stack([side, flank], axis=1), np.array([False, True])
    coulomb, bump = least_squares.bounded(columns, target, bumps, np.array([1.0, 0.0]), 8.0)
    assert coulomb == pytest.approx(5, abs=0.05)
    assert bump == pytest.approx(np.sign(height) * coulomb, rel=3e-3)


@pytest.mark.parametrize(
    ("seen", "expected"), [(0.02, 5.2), (0.1, 6.25), (0.2, 7.5), (0.4, 7.5), (0.8, 7.5)]
)
def test_friction_at_rest_is_up_to_twice_that_in_the_slowest_row(seen, expected):
    """H + d ≤ 2 (c h + d): that bounds what is extrapolated, and nothing that was seen."""
    rng = np.random.default_rng(1)
    side = np.sign(rng.normal(size=400))
    flank = side * np.linspace(0.0, seen, 400)
    target = 5 * side + 7.5 * flank + 0.01 * rng.normal(size=400)
    columns, bumps = np.stack([side, flank], axis=1), np.array([False, True])
    coulomb, bump = least_squares.bounded(columns, target, bumps, np.array([1.0, 0.0]), 50.0)
    assert bump == pytest.approx(expected, rel=0.05)
    assert bool(bump == pytest.approx(coulomb / (1 - 2 * seen))) == (expected < 7.5)


def test_what_a_law_adds_to_dry_friction():
    both = models.gaussian() + terms.FrictionAsymmetry() + terms.Generalised()
    bumps, dry = beside_rest([both, terms.PowerLaw()], both_ways=True)
    names = [p.name for p in both.affine]
    assert [n for n, bump in zip(names, bumps[:-1], strict=True) if bump] == [
        "stribeck_force+", "stribeck_force-", "stribeck_force",
    ]  # fmt: skip
    level = dict(zip(names, dry[:-1], strict=True))
    assert {n: level[n] for n in names if level[n]} == {"coulomb+": 0.5, "coulomb-": 0.5}
    assert not beside_rest([both], both_ways=False)[1].any()
