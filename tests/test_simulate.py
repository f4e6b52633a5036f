"""Simulation against closed forms: stopping, sticking, energy, units, gradients."""

import dataclasses
import os
import pathlib
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jaxfric import models, terms
from jaxfric.data.recording import Recording
from jaxfric.simulation.control import PD, PID, Cascade, Encoder
from jaxfric.simulation.lateness import at_once
from jaxfric.simulation.prediction import predict
from jaxfric.simulation.simulating import simulate
from jaxfric.simulation.substeps import MOST_SUBSTEPS, default_substeps
from jaxfric.terms import AbstractLaw, ClockOffset, Parameter, SensorFilter, TransportDelay
from jaxfric.units import INERTIA, STIFFNESS
from tests.machines import relative_error

TRUTH = {
    "inertia": 5.0, "coulomb+": 20.0, "viscous+": 60.0, "stribeck_force+": 8.0,
    "stribeck_velocity+": 0.008, "coulomb-": 18.0, "viscous-": 80.0, "stribeck_force-": 10.0,
    "stribeck_velocity-": 0.012,
}  # fmt: skip


class Spring(AbstractLaw):
    """F = k x."""

    affine: ClassVar = (Parameter("stiffness", STIFFNESS),)
    coordinates: ClassVar = frozenset({"position"})

    def law(self, sample):
        return (sample.position,)


class Swinging(AbstractLaw):
    """Mass that varies with position, M(x) = m (1 + x²): u = d(M v)/dt − ½ M′ v²."""

    affine: ClassVar = (Parameter("swinging", INERTIA),)
    coordinates: ClassVar = frozenset({"position", "acceleration"})

    def law(self, sample):
        return (-sample.position * sample.velocity**2,)

    def impulse(self, sample):
        return ((1 + sample.position**2) * sample.velocity,)


def stribeck_axis():
    return models.from_parameters(models.lorentzian(), TRUTH)


def coulomb_viscous(mass=2.0, coulomb=3.0, viscous=4.0):
    term = terms.Inertia() + terms.Coulomb() + terms.Viscous()
    return models.from_parameters(term, {"inertia": mass, "coulomb": coulomb, "viscous": viscous})


def clock(duration, rate):
    return jnp.arange(round(duration * rate) + 1.0) / rate


def driven(time, force=0.0):
    return Recording(time, jnp.zeros_like(time) + force, position=jnp.zeros_like(time))


def sine(duration=2.0, rate=1000.0, amplitude=0.05, period=1.0):
    time = clock(duration, rate)
    wave = amplitude * jnp.sin(2 * jnp.pi * time / period)
    return Recording(time, jnp.zeros_like(time), position=wave)


def loop(bandwidth=40.0):
    return PD(5.0 * bandwidth**2, 10.0 * bandwidth)


def stopping(time, mass, coulomb, viscous, v0):
    """dv/dt = −(Fc + Fv v)/M from v0 to rest, in closed form."""
    tau, level = mass / viscous, coulomb / viscous
    end = tau * np.log1p(v0 / level)
    t = np.minimum(np.asarray(time), end)
    decay = np.exp(-t / tau)
    velocity = np.where(time < end, (v0 + level) * decay - level, 0.0)
    return (v0 + level) * tau * (1 - decay) - level * t, velocity, end


def test_deceleration_follows_the_closed_form_with_order_two():
    time, errors = clock(0.8, 50.0), []
    position, _, end = stopping(time, 2.0, 3.0, 4.0, 1.0)
    for substeps in (1, 2, 4, 8):
        got = simulate(coulomb_viscous(), driven(time), initial=(0.0, 1.0), substeps=substeps)
        errors.append(float(np.max(np.abs(got.position - position))))
        assert np.all(np.asarray(got.velocity)[np.asarray(time) > end + 0.02] == 0.0)
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.mean(orders) > 1.8
    assert errors[-1] < 1e-5 * position[-1]


def test_coulomb_friction_stops_at_the_exact_place_whatever_the_step():
    model = models.from_parameters(
        terms.Inertia() + terms.Coulomb(), {"inertia": 2.0, "coulomb": 3.0}
    )
    for rate in (7.0, 1000.0):
        got = simulate(model, driven(clock(2.0, rate)), initial=(0.0, 1.0), substeps=1)
        # v0² M / (2 Fc)
        np.testing.assert_allclose(got.position[-1], 2.0 / 6.0, rtol=1e-12)
        assert got.velocity[-1] == 0.0


@pytest.mark.parametrize(
    ("force", "direction"), [(27.9, 0), (28.1, 1), (-27.9, 0), (-28.1, -1), (0.0, 0)]
)
def test_sticks_until_the_force_exceeds_break_away(force, direction):
    got = simulate(stribeck_axis(), driven(clock(0.1, 1000.0), force))
    assert np.sign(got.position[-1]) == direction
    assert direction or np.all(np.asarray(got.velocity) == 0.0)


def test_spring_with_coulomb_friction_loses_the_same_amplitude_every_half_swing():
    term = terms.Inertia() + terms.Coulomb() + Spring()
    model = models.from_parameters(term, {"inertia": 1.0, "coulomb": 0.5, "stiffness": 100.0})
    half = np.pi / 10.0
    got = simulate(model, driven(clock(3.0, 1000.0)), initial=(0.0375, 0.0), substeps=4)
    # Amplitude falls by 2 Fc/k = 0.01 a half swing and the axis sticks where k x is below Fc.
    for n, expected in enumerate((0.0375, -0.0275, 0.0175, -0.0075)):
        index = round(n * half * 1000.0)
        np.testing.assert_allclose(got.position[index], expected, atol=2e-6)
    # From −0.0075 (0.75 N, above Fc) about −Fc/k = −0.005 to −0.0025, where 0.25 N cannot move it.
    np.testing.assert_allclose(got.position[-1], -0.0025, atol=2e-6)
    assert got.velocity[-1] == 0.0


@pytest.mark.slow
def test_energy_balance_of_a_stribeck_axis_in_closed_loop():
    model = stribeck_axis()
    got = simulate(model, sine(rate=4000.0), loop())
    x, v = np.asarray(got.position), np.asarray(got.velocity)
    work = np.sum(np.asarray(got.force)[:-1] * np.diff(x))
    power = np.asarray(model.friction(got.velocity)) * v
    lost = np.trapezoid(power, np.asarray(got.time))
    kinetic = 0.5 * TRUTH["inertia"] * (v[-1] ** 2 - v[0] ** 2)
    assert abs(work - lost - kinetic) < 1e-4 * work


def test_position_dependent_inertia_conserves_energy():
    model = models.from_parameters(Swinging() + Spring(), {"swinging": 2.0, "stiffness": 9.0})
    got = simulate(model, driven(clock(5.0, 500.0)), initial=(1.0, 0.0), substeps=4)
    x, v = np.asarray(got.position), np.asarray(got.velocity)
    energy = (1 + x**2) * v**2 + 4.5 * x**2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-5)


@pytest.mark.slow
@settings(max_examples=5, deadline=None)
@given(st.integers(-6, 6), st.integers(-6, 6))
def test_units_do_not_matter(force, position):
    """Micronewton metres or kilonewtons: the same motion, to rounding."""
    f, x = 8.0**force, 8.0**position
    scale = {"inertia": f / x, "coulomb": f, "viscous": f / x, "stribeck_force": f}
    scaled = {n: v * scale.get(n.rstrip("+-"), x) for n, v in TRUTH.items()}
    here, there = sine(0.7, 500.0), sine(0.7, 500.0, amplitude=0.05 * x)
    pd, other = loop(), PD(loop().kp * f / x, loop().kd * f / x)
    a = simulate(stribeck_axis(), here, pd)
    b = simulate(models.from_parameters(models.lorentzian(), scaled), there, other)
    np.testing.assert_allclose(b.position, a.position * x, atol=1e-9 * x)
    np.testing.assert_allclose(b.force, a.force * f, atol=1e-6 * f)


@pytest.mark.slow
def test_default_substeps_are_accurate_and_grow_with_the_interval():
    model, counts = stribeck_axis(), []
    for rate in (200.0, 5000.0):
        reference = sine(1.0, rate)
        counts.append(default_substeps(model, reference))
        chosen = simulate(model, reference, loop(20.0))
        finer = simulate(model, reference, loop(20.0), substeps=20 * counts[-1])
        assert float(jnp.max(jnp.abs(chosen.position - finer.position))) < 1e-3 * 0.05
    assert counts[0] > counts[1] >= 1


@pytest.mark.slow
@pytest.mark.parametrize("smooth", [None, 5e-3])
def test_gradient_matches_finite_differences(smooth):
    reference = sine(0.6, 500.0)

    @jax.jit
    def cost(mass, coulomb, kp):
        model = stribeck_axis().with_parameters({"inertia": mass, "coulomb+": coulomb})
        out = simulate(model, reference, PD(kp, 400.0), substeps=8, smooth=smooth)
        return 1e4 * jnp.sum((out.position - reference.position) ** 2)

    at = (jnp.asarray(5.0), jnp.asarray(20.0), jnp.asarray(8000.0))
    slopes = jax.jit(jax.grad(cost, argnums=(0, 1, 2)))(*at)
    for i, slope in enumerate(slopes):
        step = 1e-6 * at[i]
        ends = [
            cost(*(a + s * step if i == j else a for j, a in enumerate(at))) for s in (1.0, -1.0)
        ]
        np.testing.assert_allclose(slope, (ends[0] - ends[1]) / (2 * step), rtol=1e-4)


@pytest.mark.slow
def test_smooth_approaches_exact_as_its_velocity_shrinks():
    reference, errors = sine(1.0, 500.0), []
    exact = simulate(stribeck_axis(), reference, loop(), substeps=32)
    for eps in (4e-3, 1e-3, 2.5e-4):
        smooth = simulate(stribeck_axis(), reference, loop(), smooth=eps, substeps=64)
        errors.append(float(jnp.max(jnp.abs(smooth.position - exact.position))))
    assert errors[2] < 0.5 * errors[1] < 0.25 * errors[0] * 2


def test_jit_and_vmap_over_models_and_recordings():
    reference = sine(0.2, 500.0)
    single = simulate(stribeck_axis(), reference, loop(), substeps=2)

    @eqx.filter_jit
    def heavier(mass):
        model = stribeck_axis().with_parameters({"inertia": mass})
        return simulate(model, reference, loop(), substeps=2).position

    batch = jax.vmap(heavier)(jnp.asarray([5.0, 6.0]))
    np.testing.assert_allclose(batch[0], single.position, atol=1e-12)
    assert not np.allclose(batch[0], batch[1], atol=1e-6)


def test_encoder_rounds_what_controller_and_recording_see():
    key = jax.random.key(3)
    out = simulate(stribeck_axis(), sine(0.5), loop(), encoder=Encoder(1e-5, 2e-6), key=key)
    again = simulate(stribeck_axis(), sine(0.5), loop(), encoder=Encoder(1e-5, 2e-6), key=key)
    counts = np.asarray(out.position) / 1e-5
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert out.velocity is None
    np.testing.assert_array_equal(out.force, again.force)
    ideal = simulate(stribeck_axis(), sine(0.5), loop())
    assert float(jnp.max(jnp.abs(out.position - ideal.position))) < 1e-4


def test_force_noise_has_its_size_and_leaves_the_motion_alone():
    quiet = simulate(stribeck_axis(), sine(), loop())
    noisy = simulate(stribeck_axis(), sine(), loop(), force_noise=0.5, key=jax.random.key(0))
    np.testing.assert_array_equal(noisy.position, quiet.position)
    np.testing.assert_allclose(np.std(noisy.force - quiet.force), 0.5, rtol=0.06)


def test_controllers_and_force_limit():
    reference = sine()
    integral = simulate(stribeck_axis(), reference, PID(8000.0, 2e5, 400.0))
    plain = simulate(stribeck_axis(), reference, PD(8000.0, 400.0))
    error = [float(jnp.std(r.position - reference.position)) for r in (integral, plain)]
    assert error[0] < error[1]
    limited = simulate(stribeck_axis(), reference, PID(8000.0, 2e5, 400.0, limit=30.0))
    assert float(jnp.max(jnp.abs(limited.force))) <= 30.0
    still = PD(20.0 * 400.0, 400.0)
    cascade = simulate(stribeck_axis(), reference, Cascade(20.0, 400.0), substeps=2)
    at_rest = Recording(reference.time, reference.force, position=reference.position,
                        channels={"reference": reference.position,
                                  "reference_velocity": 0 * reference.position})  # fmt: skip
    start = (reference.position[0], cascade.velocity[0])
    same = simulate(stribeck_axis(), at_rest, still, initial=start, substeps=2)
    np.testing.assert_allclose(same.position, cascade.position, atol=1e-12)


def test_each_segment_starts_anew():
    half = sine(0.5)
    count = half.num_samples
    both = Recording(
        jnp.concatenate([half.time, half.time]), jnp.zeros(2 * count),
        position=jnp.concatenate([half.position, half.position]),
        segment=np.repeat([0, 1], count),
    )  # fmt: skip
    single = simulate(stribeck_axis(), half, loop(), substeps=2)
    out = simulate(stribeck_axis(), both, loop(), substeps=2)
    np.testing.assert_allclose(out.position[:count], single.position, atol=1e-14)
    np.testing.assert_allclose(out.position[count:], single.position, atol=1e-14)


def test_predict_gives_back_the_force_of_the_simulation():
    model, reference = stribeck_axis(), sine(2.0, 2000.0)
    out = simulate(model, reference, loop())
    # The force is held after its sample, so the motion at a sample belongs to the mean of two.
    centred = 0.5 * (out.force[1:] + out.force[:-1])
    slipping = np.abs(np.asarray(out.velocity)[1:]) > 0.05
    wanted = np.asarray(predict(model, out))[1:]
    error = np.linalg.norm((wanted - centred)[slipping]) / np.linalg.norm(centred[slipping])
    assert error < 0.01
    inside = jax.jit(lambda r: predict(model, r))(out)
    assert float(jnp.mean(jnp.abs(inside - predict(model, out)))) < 0.5


def test_what_cannot_be_simulated_is_refused():
    time = clock(0.1, 100.0)
    with pytest.raises(ValueError, match="inertia"):
        light = models.from_parameters(
            terms.Coulomb() + terms.Viscous(), {"coulomb": 1.0, "viscous": 1.0}
        )
        simulate(light, driven(time))
    with pytest.raises(ValueError, match="2 samples"):
        simulate(stribeck_axis(), driven(time[:1]))
    with pytest.raises(ValueError, match="set-point"):
        simulate(stribeck_axis(), Recording(time, 0 * time, velocity=time), loop())
    with pytest.raises(ValueError, match="key"):
        simulate(stribeck_axis(), driven(time), force_noise=1.0)
    with pytest.raises(ValueError, match="positive"):
        Encoder(0.0)


def _emps():
    root = pathlib.Path(
        os.environ.get("JAXFRIC_DATA", pathlib.Path(__file__).parents[2] / "shared/data")
    )
    if not (root / "emps/DATA_EMPS.mat").exists():
        pytest.skip("the EMPS recording is not here (JAXFRIC_DATA)")
    loadmat = pytest.importorskip("scipy.io").loadmat
    data = {
        k: np.ravel(v).astype(float)
        for k, v in loadmat(root / "emps/DATA_EMPS.mat").items()
        if k[0] != "_"
    }
    return data


def test_emps_in_closed_loop_meets_the_published_simulation_error():
    """Published parameters and controller: position 0.0138 %, force 5.85 % (Janot et al. 2019)."""
    data = _emps()
    gain = data["gtau"][0]
    recording = Recording(
        data["t"], gain * data["vir"], data["qm"], channels={"reference": data["qg"]}
    )
    term = terms.Inertia() + terms.Coulomb() + terms.Viscous() + terms.Offset()
    values = {"inertia": 95.1089, "viscous": 203.5034, "coulomb": 20.3935, "offset": -3.1648}
    out = simulate(models.from_parameters(term, values), recording, Cascade(160.18, 243.45 * gain))
    position = jnp.linalg.norm(out.position - recording.position) / jnp.linalg.norm(
        recording.position
    )
    force = jnp.linalg.norm(out.force - recording.force) / jnp.linalg.norm(recording.force)
    assert float(position) < 0.0004
    assert float(force) < 0.08


def test_a_delay_and_a_clock_that_is_as_late_cancel():
    term = models.coulomb_viscous() + TransportDelay() + ClockOffset()
    values = dict.fromkeys((p.name for p in term.affine), 1.0)
    for clock, left in ((0.004, 0.0), (0.001, 0.003)):
        model = models.from_parameters(term, values | {"delay": 0.004, "clock_offset": clock})
        rest, delay = at_once(model)
        assert float(delay) == pytest.approx(left, abs=1e-12)
        assert float(rest.parameters["delay"]) == float(rest.parameters["clock_offset"]) == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("lag", [2e-4, 0.03])
def test_a_filtered_force_is_predicted_as_it_is_recorded(lag):
    """In slip as the filter gives it; what it holds at rest is what was recorded there."""
    values = {"inertia": 5.0} | {f"{n}{s}": 2.0 for n in ("coulomb", "viscous") for s in "+-"}
    model = models.from_parameters(models.coulomb_viscous(), values)
    behind = models.from_parameters(model.term + SensorFilter(), values | {"filter_time": lag})
    time = np.arange(4000) / 1000
    rest = (time > 1.0) & (time < 1.5)
    there, again = 0.1 * np.sin(3 * np.minimum(time, 1.0)), np.maximum(time - 1.5, 0.0)
    run = Recording(time, 0 * time, there + 0.05 * (1 - np.cos(3 * again)))
    acting = np.where(rest, 7.0, np.asarray(predict(model, run)))  # friction holds what pushes
    seen, keep = acting.copy(), np.exp(-1e-3 / lag)
    for i in range(1, len(seen)):
        behind_by = (acting[i] - acting[i - 1]) / 1e-3 * lag
        seen[i] = acting[i] - behind_by + keep * (seen[i - 1] - acting[i - 1] + behind_by)
    told = np.asarray(predict(behind, dataclasses.replace(run, force=seen)))
    slips = ~rest & (time > 0.05) & (np.abs(time - 1.5) > 0.06) & (np.abs(time - 1.0) > 0.06)
    slips &= np.abs(np.gradient(np.asarray(run.position), time)) > 0.01
    np.testing.assert_allclose(told[slips], seen[slips], rtol=0, atol=0.02)
    assert lag < 0.01 or np.abs(acting - seen)[slips].max() > 0.2


@pytest.mark.slow
def test_a_delay_is_predicted_in_whole_inside_each_segment():
    values = {"inertia": 5.0} | {f"{n}{s}": 2.0 for n in ("coulomb", "viscous") for s in "+-"}
    model = models.from_parameters(models.coulomb_viscous(), values)
    late = models.from_parameters(model.term + TransportDelay(), values | {"delay": 0.02})
    time = np.arange(4000) / 1000
    run = Recording(time, 0 * time, 0.1 * np.sin(3 * time), segment=(time >= 2).astype(np.int32))
    at_once, early = (np.asarray(predict(each, run)) for each in (model, late))
    for start in (0, 2000):
        inner = slice(start + 300, start + 1700)
        np.testing.assert_allclose(
            early[inner], at_once[start + 320 : start + 1720], rtol=0, atol=1e-9
        )
    # At the end of a segment there is no later sample of it to know.
    np.testing.assert_array_equal(early[1980:2000], np.full(20, at_once[1999]))
    seen = dataclasses.replace(run, force=early)
    assert float(relative_error(late, seen)) < 0.01 < 0.05 < float(relative_error(model, seen))


@pytest.mark.parametrize("slope", [np.inf, np.nan, 1e308])
def test_a_vertical_friction_curve_gets_the_most_steps_and_no_warning(slope, monkeypatch):
    found = np.array([0.5]), (np.array([slope]), np.array([0.0]))
    monkeypatch.setattr("jaxfric.simulation.substeps.rates", lambda *_: found)
    time = np.arange(10) * 1e-3
    reference = Recording(time, 0 * time, 0 * time)
    values = {"inertia": 1.0, "viscous": 1.0}
    model = models.from_parameters(terms.Inertia() + terms.Viscous(), values)
    steps = default_substeps(model, reference)
    assert steps == (1 if np.isnan(slope) else MOST_SUBSTEPS)
