"""Every term of the missing physics has every property, and is found again where it was planted."""

import dataclasses
import json

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric import models, signals, terms as T
from jaxfric.data.recording import Recording, stack
from jaxfric.identification.identifying import identify
from jaxfric.identification.projections import WeakForm
from jaxfric.simulation.control import PD, Encoder
from jaxfric.simulation.simulating import simulate
from jaxfric.terms import effects, transmission
from jaxfric.terms.base import bounds
from jaxfric.terms.effect import ANY, PASSED, Extent, View, scattered
from jaxfric.terms.sample import Scales
from jaxfric.units import Dimension, spell

# Each with nonlinear parameters that suit the axis below, and an amplitude of about a tenth of
# its Coulomb friction.
CASES = {
    "asymmetry": (T.FrictionAsymmetry(), (1.0, 3.0)),
    "coulomb_forwards": (T.CoulombAsymmetry("forwards"), (1.0,)),
    "coulomb_backwards": (T.CoulombAsymmetry("backwards"), (1.0,)),
    "crossing": (T.SmoothCrossing(0.004), (15.0,)),
    "quadratic_drag": (T.QuadraticDrag(), (100.0,)),
    "power_law": (T.PowerLaw(2.5, 0.2), (5.0,)),
    "shear_thinning": (T.ShearThinning(0.05), (60.0,)),
    "unbalance": (T.GravityUnbalance(0.14), (1.5, -0.8)),
    "cogging": (T.Cogging(0.012), (0.6, 1.2)),
    "cogging_3": (T.Cogging(0.012, 3), (0.6, 1.2, 0.3, -0.5, 0.2, 0.4)),
    "force_ripple": (T.ForceRipple(0.012), (0.06, 0.03)),
    "force_constant": (T.PositionDependentForceConstant(-0.04, 0.03), (0.2, 0.1)),
    "force_constant_4": (
        T.PositionDependentForceConstant(-0.025, 0.03, 4), (0.2, 0.05, 0.03, 0.1)
    ),
    "spring": (T.Spring(0.01), (40.0,)),
    "hardening_spring": (T.HardeningSpring(0.005), (2e4,)),
    "end_stop": (T.EndStop(0.02), (80.0,)),
    "lower_end_stop": (T.LowerEndStop(-0.02), (80.0,)),
    "position_friction": (T.PositionDependentFriction(0.05), (0.9, 1.1)),
    "sticky_spot": (T.StickySpot(0.01, 0.003), (2.0,)),
    "local_force": (T.LocalForce(0.01, 0.003), (2.0,)),
    "encoder": (T.EncoderError(0.06, 20.0), (0.4, 0.5)),
    "gain_drift": (T.GainDrift(4.0, start=-1.0), (0.2,)),
    "position_inertia": (T.PositionDependentInertia(0.06), (0.4, 0.5)),
    "load_friction": (T.LoadDependentFriction(), (0.1,)),
    "reaction_friction": (T.ReactionFriction(), (0.1,)),
    "recorded_load": (T.LoadDependentFriction("load"), (0.1,)),
    "cross_axis": (T.CrossAxis(), (0.5, 8.0)),
    "named_cross_axis": (T.CrossAxis(("x", "m")), (0.5, 8.0)),
    "cross_force": (T.CrossForce(("x", "m")), (0.2,)),
    "deadband": (T.ActuatorDeadband(), (1.5,)),
    "saturation": (T.ActuatorSaturation(25.0), (0.2,)),
    "soft_saturation": (T.SoftSaturation(45.0), (0.8,)),
    "gain_asymmetry": (T.GainAsymmetry(), (0.1,)),
    "delay": (T.TransportDelay(), (0.002,)),
    "lag": (T.ActuatorLag(), (0.002,)),
    "clock": (T.ClockOffset(), (0.002,)),
    "filter": (T.SensorFilter(), (0.002,)),
    "dahl": (T.Dahl(0.002), (18.0,)),
    "lugre": (T.LuGre(0.002, 0.02), (18.0, 5.0)),
    "maxwell_slip": (T.MaxwellSlip(0.002, 0.6), (18.0,)),
    "frictional_lag": (T.FrictionalLag(0.05, T.Gaussian(0.05)), (4.0,)),
    "frictional_lag_2": (T.FrictionalLag(0.05, T.Exponential(0.05), 2), (4.0,)),
    "backlash": (T.Backlash(0.003), (3.0,)),
    "elastic_backlash": (T.ElasticBacklash(0.003, 0.001, 2.0), (3.0,)),
    "damped_backlash": (T.DampedBacklash(0.003, 0.001, 2.0, 0.4, 0.3), (3.0,)),
    "oiled_backlash": (T.OiledBacklash(0.003, 0.001, 2.0, 0.4, 0.3, 0.6), (3.0,)),
    "compliance_dry": (T.DryCompliance(4.0, 0.2, 0.5, -0.3), (2.0,)),
    "compliance": (T.Compliance(2.0, 0.1), (3.0,)),
    "compliance_friction": (T.Compliance(2.0, 0.1, "friction"), (1.5,)),
    "compliance_both": (T.Compliance(2.0, 0.1, "both"), (3.0, 1.5)),
    "thermal_viscous": (T.ThermalDrift(T.Viscous(), 4.0), (15.0,)),
    "thermal_coulomb": (T.ThermalDrift(T.Coulomb(), 3.0, start=-1.0), (2.0,)),
    "thermal_stribeck": (T.ThermalDrift(T.Gaussian(0.05), 3.0), (5.0,)),
    "friction_step": (T.FrictionStep(T.Coulomb(), 6.3), (1.5,)),
    "payload": (T.PayloadChange(step_time=3.1), (1.5, 2.0)),
    "payload_ramp": (T.PayloadChange(step_time=3.1, ramp=0.2), (1.5, 2.0)),
    "gain_step": (T.GainStep(6.3, 0.2), (0.2,)),
    "viscous_step": (T.ParameterStep(T.Viscous(), 6.3), (10.0,)),
    "inertia_ramp": (T.ParameterStep(T.Inertia(), 3.1, 0.2), (1.5,)),
    "friction_ramp": (T.FrictionStep(T.Viscous(), 6.3, 0.2), (10.0,)),
    "friction_change": (T.FrictionRamp(T.Coulomb(), 6.3, 1.2), (1.5,)),
    "load_drift": (T.LoadDrift(0.0, 12.0, 3), (1.5, -1.0, 0.7)),
    "tone": (T.PeriodicDisturbance(3.7), (0.7, 0.9)),
    "push": (T.DisturbanceForce(2.2, 3.1), (3.0,)),
    "push_ramps": (T.DisturbanceForce(2.2, 3.1, 0.2), (3.0,)),
    "pulses": (T.DisturbancePulses((2.2, 7.1), 0.2), (3.0, -3.0)),
    "table_position": (T.Table("position", (-0.03, -0.01, 0.01, 0.03)), (1.0, -1.0, 2.0)),
    "table_directional": (
        T.Directional(T.Table("position", (-0.03, 0.0, 0.03))), (1.0, -1.0, 2.0, 1.0)
    ),
}  # fmt: skip
TERMS = {name: term for name, (term, _) in CASES.items()}
SCALES = Scales(*(jnp.asarray(x) for x in (0.001, 0.2, -0.04, 0.04, 20.0, 0.0, 12.0, 1e-3, 60.0)))

each_term = pytest.mark.parametrize("term", TERMS.values(), ids=TERMS)
each_case = pytest.mark.parametrize(("term", "alpha"), CASES.values(), ids=CASES)


def motion(force=1.0, position=1.0, count=12):
    """Both directions, rest and reversals, with every channel, in units of any size."""
    t = np.linspace(0.0, 6.0, count)
    x = 0.03 * position * np.sin(1.3 * t)
    v = 0.039 * position * np.cos(1.3 * t)
    v[4] = 0.0
    channels = {
        "predicted_force": force * 30 * np.sin(2 * t + 1),
        "predicted_reaction": force * 20 * np.sin(3 * t + 1),
        "neighbour_velocity": position * 0.1 * np.sin(2 * t),
        "known_velocity m x": position * 0.1 * np.sin(2 * t),
        "known_needed m x": force * 20 * np.sin(2 * t),
        "known_needed_momentum m x": force * 10 * np.cos(2 * t),
        "load": force * (5 + np.sin(t)),
    }
    return Recording(t, 0 * t, x, v, channels=channels)


# ---- shapes, transformations ----


@each_term
def test_shapes_agree_with_the_names_and_all_is_finite(term):
    recording = motion()
    for value in (term.columns(recording), term.momentum(recording)):
        assert value.shape == (recording.num_samples, len(term.affine))
        assert bool(jnp.all(jnp.isfinite(value)))
    assert not np.any(term.offset(recording))
    assert term.beta().shape == (len(term.nonlinear),)
    assert term.inertial == bool(jnp.any(term.momentum(recording) != 0))
    names = [p.name for p in (*term.affine, *term.nonlinear)]
    assert len(set(names)) == len(names)


@each_term
def test_jit_and_vmap_change_nothing(term):
    rows = [motion(), motion(2.0, 0.5), motion(1.0, 1.3)]
    apart = jnp.stack([term.columns(recording) for recording in rows])
    compiled = eqx.filter_jit(lambda t, r: jax.vmap(lambda one: t.columns(one))(r))
    np.testing.assert_allclose(compiled(term, stack(rows)), apart, rtol=1e-12, atol=1e-14)


@pytest.mark.slow
@each_term
def test_derivative_by_beta_agrees_with_finite_differences(term):
    beta, recording = term.beta(), motion()
    for part in ("columns", "momentum"):
        columns = jax.jit(lambda beta, part=part: getattr(term.with_beta(beta), part)(recording))
        slopes = jax.jacfwd(columns)(beta)
        for i, size in enumerate(beta):
            step = jnp.zeros_like(beta).at[i].set(1e-6 * size)
            expected = (columns(beta + step) - columns(beta - step)) / (2e-6 * size)
            scale = 1 + float(jnp.max(jnp.abs(slopes[..., i])))
            np.testing.assert_allclose(slopes[..., i], expected, rtol=1e-5, atol=1e-6 * scale)


@pytest.mark.slow
@each_term
def test_reverse_mode_is_finite(term):
    slope = jax.grad(lambda b: jnp.sum(term.with_beta(b).columns(motion()) ** 2))(term.beta())
    assert bool(jnp.all(jnp.isfinite(slope)))


@pytest.mark.slow
@each_term
def test_single_precision_stays_single(term):
    with jax.enable_x64(False):
        assert term.columns(motion()).dtype == jnp.float32
        assert term.momentum(motion()).dtype == jnp.float32


# ---- structure ----


@each_case
def test_json_gives_the_term_back(term, alpha):
    model = models.Model(term, jnp.asarray(alpha), (("force", "N·m"), ("position", "rad")))
    again = models.Model.from_dict(json.loads(json.dumps(model.to_dict(), allow_nan=False)))
    assert jax.tree.structure(again.term) == jax.tree.structure(term)
    assert again.term.affine == term.affine
    # Numbers come back as arrays, which XLA may round in another order than Python's floats.
    np.testing.assert_allclose(again.force(motion()), model.force(motion()), 1e-13, 1e-14)
    np.testing.assert_allclose(again.momentum(motion()), model.momentum(motion()), 1e-13, 1e-14)


@each_term
def test_the_leaves_are_the_nonlinear_parameters(term):
    assert len(jax.tree.leaves(term)) == len(term.nonlinear)
    wanted = 0.1 + jnp.arange(len(term.nonlinear), dtype=float)
    np.testing.assert_array_equal(term.with_beta(wanted).beta(), wanted)


@each_term
def test_every_nonlinear_parameter_has_a_compact_set_around_its_value(term):
    lower, upper = bounds(term, SCALES)
    assert bool(jnp.all((lower < upper) & jnp.isfinite(lower) & jnp.isfinite(upper)))
    for parameter, low in zip(term.nonlinear, lower, strict=True):
        assert not parameter.logarithmic or float(low) > 0
    assert bool(jnp.all((term.beta() >= lower) & (term.beta() <= upper)))


@pytest.mark.slow
@each_term
def test_no_term_passes_for_a_function_of_velocity_that_is_none(term):
    """Lemma 1 must not be used where it does not hold: columns at equal velocity must be equal."""
    two = motion()
    other = dataclasses.replace(
        two,
        time=two.time + 0.7,
        position=two.position + 0.011,
        velocity=two.velocity[::-1],
        channels={name: 1.1 * channel for name, channel in two.channels.items()},
    )
    same = np.allclose(term.columns(two), term.columns(other)[::-1], rtol=1e-9)
    same &= np.allclose(term.momentum(two), term.momentum(other)[::-1], rtol=1e-9)
    assert (term.coordinates <= {"velocity"}) == same


# ---- units ----


def rescaled(term, force, position):
    """The term with every nonlinear and given number in units 1/force and 1/position as large."""
    factors = [force**p.dimension.force * position**p.dimension.position for p in term.nonlinear]
    term = term.with_beta(term.beta() * jnp.asarray(factors)) if factors else term
    if isinstance(term, T.Table):
        return T.Table(term.coordinate, tuple(position * k for k in term.knots))
    if isinstance(term, T.Directional):
        return T.Directional(rescaled(term.positive, force, position))
    if isinstance(term, T.Spring):
        return T.Spring(position * term.rest)
    if isinstance(term, T.PositionDependentForceConstant):
        return dataclasses.replace(term, low=position * term.low, high=position * term.high)
    if isinstance(term, T.PowerLaw):
        return T.PowerLaw(term.exponent, position * term.unit_speed)
    return term


@each_case
@pytest.mark.parametrize("factors", [(1e3, 1e6), (1e-3, 57.3)], ids=["mN_um", "kN_deg"])
def test_the_force_is_the_same_in_any_unit(term, alpha, factors):
    force, position = factors
    kinds = [p.dimension for p in term.affine]
    scaled = [a * force**d.force * position**d.position for a, d in zip(alpha, kinds, strict=True)]
    for part in ("columns", "momentum"):
        here = getattr(term, part)(motion()) @ jnp.asarray(alpha)
        there = rescaled(term, force, position)
        there = getattr(there, part)(motion(force, position)) @ jnp.asarray(scaled)
        np.testing.assert_allclose(there, force * here, rtol=1e-9, atol=1e-9 * force)


@each_term
def test_every_unit_can_be_spelled(term):
    for parameter in (*term.affine, *term.nonlinear):
        assert isinstance(parameter.dimension, Dimension)
        assert spell(parameter.dimension)


# ---- limits, by hand ----


def at(t=0.0, x=0.0, v=1.0, **channels):
    return Recording(
        [t], [0.0], [x], [v], channels={name: [float(c)] for name, c in channels.items()}
    )


def column(term, recording, k=0):
    return float(term.columns(recording)[0, k])


def test_a_wave_that_does_not_repeat_within_the_stroke_may_be_an_unbalance():
    recording = Recording(jnp.arange(4.0), jnp.zeros(4), jnp.array([0.0, 0.3, 0.1, 0.2]))
    scales = signals.scales(signals.prepare(recording))
    low, high = (float(x) for x in T.GravityUnbalance().nonlinear[0].bounds(scales))
    extent, slowly = Extent(0.0, 0.3), effects.EFFECTS["cogging"].variant
    assert slowly({"pitch": 1.01 * low}, extent) and not slowly({"pitch": 0.99 * low}, extent)
    assert high > 1.0


@pytest.mark.parametrize("degree", [2, 4, 6])
def test_a_force_constant_along_the_stroke_has_its_values_where_they_are_named(degree):
    """On the way and at the ends of the stroke from −2 to 4, nil in the middle, level beyond."""
    term = T.PositionDependentForceConstant(-2.0, 4.0, degree)
    places = {"low_end": -2.0, "low_two_thirds": -1.0, "low_half": -0.5, "low_third": 0.0}
    places |= {"high_third": 2.0, "high_half": 2.5, "high_two_thirds": 3.0, "high_end": 4.0}
    assert len(term.affine) == degree
    for k, parameter in enumerate(term.affine):
        here = places[parameter.name.removeprefix("command_at_")]
        for p in term.affine:
            x = places[p.name.removeprefix("command_at_")]
            expected = -7.0 if x == here else 0.0
            assert column(term, at(x=x, predicted_force=-7.0), k) == pytest.approx(expected)
        assert column(term, at(x=1.0, predicted_force=-7.0), k) == pytest.approx(0.0)
        for beyond, end in ((-3.0, -2.0), (9.0, 4.0)):
            levels = [column(term, at(x=x, predicted_force=2.0), k) for x in (beyond, end)]
            assert levels[0] == levels[1]


def test_two_parameters_are_any_parabola_of_the_force():
    x = np.linspace(-0.02, 0.04, 31)
    force = np.cos(100 * x)
    recording = Recording(x, 0 * x, x, x, channels={"predicted_force": force})
    columns = np.asarray(T.PositionDependentForceConstant(-0.02, 0.04).columns(recording))
    place = (x - 0.01) / 0.03
    fitted = columns @ [0.3 - 0.1, 0.3 + 0.1]  # 0.1 ξ + 0.3 ξ²
    np.testing.assert_allclose(fitted, force * (0.1 * place + 0.3 * place**2), atol=1e-14)


@pytest.mark.parametrize("wrong", [(1.0, 1.0, 2), (0.0, 1.0, 3), (0.0, 1.0, 0)])
def test_a_force_constant_needs_a_stroke_and_an_even_degree(wrong):
    with pytest.raises(ValueError, match="a low end below the high one, and the degree 2, 4 or 6"):
        T.PositionDependentForceConstant(*wrong)


@pytest.mark.slow
def test_a_stop_acts_over_most_of_the_stroke_at_most():
    run = Recording([0.0, 1.0], [0.0, 0.0], [-1.0, 3.0], [1.0, 1.0])
    limits = signals.scales(run)
    upper, lower = (term.nonlinear[0].bounds(limits) for term in (T.EndStop(), T.LowerEndStop()))
    np.testing.assert_allclose([*upper, *lower], [-0.4, 2.92, -0.92, 2.4])


def test_values_by_hand():
    assert column(T.Cogging(0.01), at(x=0.0025)) == pytest.approx(1.0)
    assert column(T.Cogging(0.01, 2), at(x=0.00125), 2) == pytest.approx(1.0)
    assert column(T.ForceRipple(0.01), at(x=0.0025, predicted_force=-5.0)) == pytest.approx(-5.0)
    assert column(T.Spring(0.5), at(x=2.0)) == 1.5
    assert column(T.HardeningSpring(1.0), at(x=3.0)) == 8.0
    assert [column(T.EndStop(1.0), at(x=x)) for x in (0.5, 1.5)] == [0.0, 0.5]
    assert [column(T.LowerEndStop(1.0), at(x=x)) for x in (0.5, 1.5)] == [-0.5, 0.0]
    assert column(T.StickySpot(1.0, 0.1), at(x=1.0, v=-2.0)) == -1.0
    assert column(T.QuadraticDrag(), at(v=-3.0)) == -9.0
    assert column(T.PowerLaw(3.0, 2.0), at(v=-4.0)) == pytest.approx(-8.0)
    assert column(T.ShearThinning(1.0), at(v=1.0)) == 0.5
    assert column(T.ActuatorSaturation(2.0), at(predicted_force=-5.0)) == -3.0
    soft = [column(T.SoftSaturation(5.0), at(predicted_force=f)) for f in (-3.0, 4.9, 9.8)]
    assert soft == pytest.approx([-0.75, 4.9 * (1 / np.sqrt(0.0396) - 1), 2 * soft[1]])
    assert column(T.GainAsymmetry(), at(predicted_force=-5.0)) == 0.0
    assert column(T.LoadDependentFriction("load"), at(v=-1.0, load=-7.0)) == -7.0
    assert column(T.ReactionFriction(), at(v=-1.0, predicted_reaction=-7.0)) == -7.0
    assert column(T.ThermalDrift(T.Viscous(), 2.0, start=1.0), at(t=3.0, v=2.0)) == pytest.approx(
        2 * np.exp(-1)
    )
    assert [column(T.FrictionStep(T.Coulomb(), 1.0), at(t=t)) for t in (0.9, 1.1)] == [0.0, 1.0]
    ramp = T.FrictionRamp(T.Coulomb(), 1.0, 0.4)
    assert [column(ramp, at(t=t)) for t in (0.7, 1.0, 1.3)] == [0.0, 0.5, 1.0]
    assert column(T.LoadDrift(0.0, 2.0, 2), at(t=1.0), 1) == -0.5
    assert column(T.DisturbancePulses((1.0,), 0.5), at(t=1.25)) == pytest.approx(0.5)


def test_position_dependent_inertia_is_lagrange():
    """d(M₁v)/dt − ½M₁′v² against the Lagrangian of ½M₁(x)v², by automatic differentiation."""
    term, alpha = T.PositionDependentInertia(0.3), jnp.asarray([0.7, -0.4])

    def path(t):
        return jnp.sin(2 * t) + 0.3 * t**2

    def mass(x):
        return alpha[0] * jnp.sin(2 * jnp.pi * x / 0.3) + alpha[1] * jnp.cos(2 * jnp.pi * x / 0.3)

    def energy(x, v):
        return 0.5 * mass(x) * v**2

    def moving(t):
        return (
            at(0.0, 0.0, 0.0)
            if t is None
            else Recording(
                jnp.stack([t]), jnp.zeros(1), jnp.stack([path(t)]), jnp.stack([jax.grad(path)(t)])
            )
        )

    def lagrange(t):
        def momentum(t):
            return jax.grad(energy, argnums=1)(path(t), jax.grad(path)(t))

        return jax.grad(momentum)(t) - jax.grad(energy)(path(t), jax.grad(path)(t))

    t = jnp.asarray(0.37)
    rate = jax.grad(lambda t: (term.momentum(moving(t)) @ alpha)[0])(t)
    force = rate + (term.columns(moving(t)) @ alpha)[0]
    assert float(force) == pytest.approx(float(lagrange(t)), rel=1e-10)


def test_a_table_takes_its_knots_and_stays_constant_outside():
    table = T.Table("position", (0.0, 1.0, 3.0))
    alpha = jnp.asarray([2.0, 5.0])
    x = jnp.asarray([-1.0, 0.0, 0.5, 1.0, 2.0, 3.0, 9.0])
    recording = Recording(x, 0 * x, x, 0 * x)
    np.testing.assert_allclose(table.columns(recording) @ alpha, [0, 0, 1, 2, 3.5, 5, 5])


def test_waste_is_refused_with_a_remedy():
    with pytest.raises(ValueError, match="above the one before"):
        T.Table("position", (0.0, 0.0))
    with pytest.raises(ValueError, match="has momentum"):
        T.ThermalDrift(T.Inertia())
    with pytest.raises(ValueError, match="predicted_force.*channels="):
        T.ActuatorDeadband().columns(at())


def test_presliding_vanishes_far_from_a_reversal_and_starts_at_minus_two():
    t = np.linspace(0.0, 2.0, 4001)
    v = np.where(t < 1.0, -1.0, 1.0)
    recording = Recording(t, 0 * t, velocity=v)
    force = np.asarray(T.Dahl(0.01).columns(recording)[:, 0])
    assert abs(force[1999]) < 1e-12
    # z relaxes as exp(−distance/x_d): −2 e⁻¹ at the distance x_d after the reversal.
    after = np.interp(1.0 + 0.01, t, force)
    assert after == pytest.approx(-2 * np.exp(-1), rel=0.03)
    assert abs(force[-1]) < 1e-12


def test_presliding_depends_on_distance_not_on_speed():
    t = np.linspace(0.0, 2.0, 4001)
    v = np.where(t < 1, -1.0, 1.0)
    slow, fast = Recording(t, 0 * t, velocity=v), Recording(t / 7, 0 * t, velocity=7 * v)
    for term in (T.Dahl(0.01), T.LuGre(0.01, 1e9)):
        np.testing.assert_allclose(term.columns(slow), term.columns(fast), atol=1e-9)


def test_backlash_acts_inside_the_gap_and_nowhere_else():
    t = np.linspace(0.0, 2.0, 4001)
    x = np.abs(t - 1.0)
    recording = Recording(t, 0 * t, x, np.sign(t - 1.0))
    inside = -np.asarray(T.Backlash(0.05).columns(recording)[:, 0]) * np.sign(t - 1.0)
    reversal = (t > 1.0005) & (t < 1.0995)
    assert np.all(inside[t < 0.9995] < 1e-9)
    assert np.all(inside[t > 1.1005] < 1e-9)
    # Of ∫ 1 − (w/δ)⁸ over the gap, 8/9 of its width is left.
    share = np.sum(inside[reversal]) * 0.0005 / 0.1
    assert share == pytest.approx(8 / 9, rel=0.01)


def swung(count=4000, rate=1000.0):
    """A motion with reversals, and its clock."""
    time = np.arange(count) / rate
    speed = 0.2 * np.sin(5 * time) + 0.05 * np.sin(31 * time + 1)
    position = -0.04 * np.cos(5 * time) - 0.05 / 31 * np.cos(31 * time + 1)
    return Recording(time, 0 * time, position, speed)


@pytest.mark.parametrize("poles", [0, 1, 2])
def test_a_friction_that_lags_is_late_by_its_delay(poles):
    """Where the speed is a ramp any memory is late by τ, and at constant speed by nothing."""
    time = np.arange(2000) / 1000
    speed = np.where(time < 1, 0.1, 0.1 + 0.05 * (time - 1))
    term = T.FrictionalLag(0.02, T.Gaussian(0.1), poles)
    found = np.asarray(term.columns(Recording(time, 0 * time, velocity=speed))[:, 0])
    late = np.exp(-(((speed - 0.05 * 0.02) / 0.1) ** 2)) - np.exp(-((speed / 0.1) ** 2))
    np.testing.assert_allclose(found[time < 1], 0.0, atol=1e-12)
    np.testing.assert_allclose(found[time > 1.6], late[time > 1.6], atol=1e-9)


def test_a_filtered_speed_does_not_vanish_at_a_reversal():
    time = np.arange(2000) / 1000
    run = Recording(time, 0 * time, velocity=time - 1.0005)
    terms = [T.FrictionalLag(0.02, T.Gaussian(0.005), poles) for poles in (0, 2)]
    bumps = [
        np.sign(run.velocity) * np.asarray(term.columns(run)[:, 0])
        + np.exp(-((np.asarray(run.velocity) / 0.005) ** 2))
        for term in terms
    ]
    assert np.max(bumps[0]) == pytest.approx(1.0, rel=0.02)
    assert np.max(bumps[1]) < 0.5


# With little friction a load rattles in its gap without end, and no two solutions agree for long.
@pytest.mark.slow
@pytest.mark.parametrize("uneven", [0.0, 0.4])
@pytest.mark.parametrize(("gap", "slow"), [(None, 0.6), (0.004, 3.0)])
def test_a_load_with_dry_friction_moves_as_its_equation_says(gap, slow, uneven):
    """The same, stepped twenty times as finely and explicitly."""
    run, omega, damping, fine = swung(), 40.0, 0.2, 20
    clock = np.arange(run.num_samples * fine) / (1000 * fine)
    place, speed = (np.interp(clock, run.time, x) for x in (run.position, run.velocity))
    way = np.sign(speed[0])
    ahead = (gap or 0.0) + slow * (1 + uneven * way) / omega**2
    load_at, load, log = place[0] - way * ahead, speed[0], []
    for x, v in zip(place, speed, strict=True):
        apart = x - load_at
        over = np.sign(apart) * max(abs(apart) - (gap or 0.0), 0.0)
        push = omega**2 * over + 2 * damping * omega * (v - load)
        if gap is not None and push * over <= 0:
            push = 0.0
        free = load + push / (1000 * fine)
        log.append(load)
        dry = slow * (1 + uneven * np.sign(free))
        load = np.sign(free) * max(abs(free) - dry / (1000 * fine), 0.0)
        load_at += load / (1000 * fine)
    _, found = transmission.load_motion(run, omega, damping, slow, gap, asymmetry=uneven)
    wanted = np.array(log)[::fine]
    apart = np.asarray(found) - wanted
    assert np.sqrt(np.mean(apart**2)) < 0.005 * np.sqrt(np.mean(wanted**2))


@pytest.mark.slow
def test_a_dry_load_in_slip_swings_as_any_other():
    time = np.arange(3000) / 1000
    speed = 0.3 + 0.1 * np.sin(9 * time)
    run = Recording(time, 0 * time, 0.3 * time - np.cos(9 * time) / 90, speed)
    dry, viscous = T.DryCompliance(6.0, 0.2, 0.3), T.Compliance(6.0, 0.2)
    pull = np.asarray(dry.columns(run)[:, 0]) + np.gradient(dry.momentum(run)[:, 0], time)
    wanted = np.gradient(viscous.momentum(run)[:, 0], time)
    settled = time > 1.5  # they start at rest and on a wound-up spring
    np.testing.assert_allclose(pull[settled], wanted[settled], atol=0.02 * np.max(np.abs(wanted)))


def test_a_load_behind_a_gap_never_gains_speed_of_itself():
    """Stiff flanks, of which a load passes through a whole gap and back within a step.

    Struck by a flank that moves against it, it comes back with a restitution of e: never faster
    than (1 + e)/(1 − e) times the motor.
    """
    time = np.arange(4000) / 2000
    speed = 0.15 * np.sign(np.sin(7 * time)) + 1e-4 * np.sin(900 * time)
    run = Recording(time, 0 * time, np.cumsum(speed) / 2000, speed)
    fastest = float(np.max(np.abs(speed)))
    shapes = np.array([1e-8, 1e-8, 0.5]) * 1e4 ** scattered(512, 3)

    def most(shape):
        gap, windup, slow = shape
        omega = jnp.sqrt(slow / windup)
        return jnp.max(jnp.abs(transmission.load_motion(run, omega, 0.2, slow, gap)[1]))

    found = np.asarray(jax.jit(lambda some: jax.lax.map(most, some, batch_size=64))(shapes))
    back = np.exp(-np.pi * 0.2 / np.sqrt(1 - 0.2**2))
    assert np.all(found <= (1 + back) / (1 - back) * fastest)


def test_slow_backlash_unwinds_crosses_and_winds_up_again():
    time = np.linspace(0.0, 20.0, 20001)
    place = np.abs(time - 10.0) * 1e-3
    run = Recording(time, 0 * time, place, np.sign(time - 10.0) * 1e-3)
    term = T.ElasticBacklash(0.002, 0.0005, 5.0)
    since = (time[time > 10.01] - 10.0) * 1e-3
    wanted = np.interp(since, [0, 0.0005, 0.0045, 0.005], [-1, 0, 0, 1]) - 1
    found = np.asarray(term.columns(run)[:, 0])[time > 10.01]
    np.testing.assert_allclose(found, wanted, atol=0.06)


def test_elements_slip_one_by_one():
    """Turned back from slip, each gives way over twice its distance, and remembers no less."""
    place = np.concatenate([np.linspace(0, 5, 51), np.linspace(5, 1, 41)[1:]]) * 1e-3
    time = np.arange(place.size) * 1e-2
    run = Recording(time, 0 * time, place, np.gradient(place, time))
    column = np.asarray(T.MaxwellSlip(1.2e-3, 0.75).columns(run))[:, 0]
    bent = np.stack([np.clip(1 - (5e-3 - place) / d, -1, 1) for d in (1.2e-3, 9e-4, 6e-4, 3e-4)])
    back = slice(52, -1)
    np.testing.assert_allclose(column[back], bent.mean(axis=0)[back] + 1, atol=1e-9)
    # All with the same distance, they are one.
    one = np.asarray(T.MaxwellSlip(1.2e-3, 0.0).columns(run))[back, 0]
    np.testing.assert_allclose(one, bent[0][back] + 1, atol=1e-9)


@pytest.mark.parametrize("damping", [0.1, 0.2, 0.6, 0.95])
def test_a_load_comes_back_off_a_flank_as_its_damping_says(damping):
    """Flanks do not pull: e^(−ζθ/√(1 − ζ²)) of the speed, θ = atan2(2ζ√(1 − ζ²), 2ζ² − 1)."""
    time = np.arange(8000) * 1e-5
    speed = np.where(time < 0.01, -0.1, 0.1)  # it turns round, through its gap of 0.4 mm
    place = np.concatenate([[0.0], np.cumsum(speed[1:]) * 1e-5])
    run = Recording(time, 0 * time, place, speed)
    slow = 0.5
    term = T.OiledBacklash(2e-4, 1e-6, slow, 1e3, 0.0, damping)
    ahead = np.asarray(term.columns_and_momentum(run)[1])[:, 0] * slow  # of the load, m/s
    root = np.sqrt(1 - damping**2)
    turn = np.arctan2(2 * damping * root, 2 * damping**2 - 1)
    assert np.max(ahead[1001:]) == pytest.approx(0.2 * np.exp(-damping * turn / root), rel=0.02)


def test_a_load_with_viscous_friction_is_slowed_by_it_in_its_gap():
    """The motor stops: dw/dt = −d (1 + w/v_s) until the load is at the other flank or at rest."""
    time = np.arange(4000) / 4000
    speed = np.where(time < 0.3, 0.2, 0.2 - 4 * np.clip(time - 0.3, 0, 0.05))
    place = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) / 4000)])
    run = Recording(time, 0 * time, place, speed)
    d, slow, gap = 0.5, 0.1, 0.05

    def force(term):
        """What the load adds to the motor's force, per friction."""
        plain, moved = (np.asarray(each)[:, 0] for each in term.columns_and_momentum(run))
        return plain + np.gradient(moved, time) + np.gradient(speed, time) / d

    found = force(T.DampedBacklash(gap, 1e-5, d, slow))
    flies = (time > 0.31) & (time < 0.34)  # the motor brakes at 4 m/s², the load does not follow
    np.testing.assert_allclose(found[flies], -1 - speed[flies] / slow, rtol=1e-4)
    dry, many = force(T.ElasticBacklash(gap, 1e-5, d)), force(T.DampedBacklash(gap, 1e-5, d, 1e9))
    np.testing.assert_allclose(dry, many, atol=1e-6)


@pytest.mark.parametrize("driven", ["inertia", "friction", "both"])
def test_a_load_swings_as_its_equation_says(driven):
    """r̈ + 2ζω ṙ + ω² r = −a − sign(v), stepped twenty times as finely."""
    time = np.arange(4000) / 1000
    speed = 0.2 * np.sin(5 * time) + 0.05 * np.sin(31 * time + 1)
    run = Recording(time, 0 * time, velocity=speed)
    term = T.Compliance(4.0, 0.15, driven)
    omega, fine = 2 * np.pi * 4.0, 20
    clock = np.arange(4000 * fine) / (1000 * fine)
    rate = np.interp(clock, time[1:] - 0.0005, np.diff(speed) * 1000)
    # Three hundredths of the root-mean-square speed are no direction yet.
    rest = 0.03 * np.sqrt(np.mean(speed**2))
    way = np.clip(np.interp(clock, time, speed) / rest, -1, 1)
    wanted = []
    for pull in {"inertia": [rate], "friction": [way], "both": [rate, way]}[driven]:
        stretch, swing, log = -pull[0] / omega**2 * (pull is way), 0.0, []
        for each in pull:
            log.append(swing)
            swing += (-each - 2 * 0.15 * omega * swing - omega**2 * stretch) / (1000 * fine)
            stretch += swing / (1000 * fine)
        wanted.append(log[::fine])
    found = np.asarray(term.momentum(run))
    for column, log in zip(found.T, wanted, strict=True):
        assert np.max(np.abs(column - log)) < 0.01 * np.max(np.abs(log))
    with pytest.raises(ValueError, match="inertia, friction, both"):
        T.Compliance(4.0, 0.15, "gravity")


@pytest.mark.slow
def test_a_memory_starts_anew_in_each_segment():
    recording = motion(count=40)
    segment = np.arange(40) // 20
    both = dataclasses.replace(recording, segment=segment, num_segments=2)
    second = jax.tree.map(lambda a: a[20:], recording)
    memories = "dahl lugre frictional_lag frictional_lag_2 backlash elastic_backlash compliance_dry"
    for term in (TERMS[name] for name in memories.split()):
        np.testing.assert_allclose(term.columns(both)[20:], term.columns(second), atol=1e-12)


# ---- planted and found ----

BASE = {
    "inertia": 12.0, "coulomb+": 20.0, "viscous+": 60.0, "coulomb-": 18.0, "viscous-": 80.0,
}  # fmt: skip


def reference(rate):
    time = np.arange(0, 12 * rate) / rate
    tones = ((0.03, 0.31, 0.0), (0.012, 0.83, 1.0), (0.004, 4.3, 2.0))
    goal = sum(a * np.sin(2 * np.pi * f * time + p) for a, f, p in tones)
    speed = sum(2 * np.pi * a * f * np.cos(2 * np.pi * f * time + p) for a, f, p in tones)
    return Recording(time, 0 * time, goal, speed)


def with_predictions(run, model):
    """The channels that the explanation derives from a simulation of the base, here from truth."""
    rate = 1.0 / float(signals.interval(run))
    v = np.asarray(run.velocity)
    acceleration = np.gradient(v) * rate
    friction = np.asarray(model.force(run))
    inertia = float(model.parameters["inertia"])
    other = 0.1 * np.sin(2 * np.pi * 0.47 * np.asarray(run.time))
    channels = {
        "predicted_force": inertia * acceleration + friction,
        "predicted_reaction": inertia * acceleration,
        "neighbour_velocity": other,
        "known_velocity m x": other,
        "known_needed m x": 40 * other,
        "known_needed_momentum m x": 3 * other,
        "load": 15 + 10 * np.sin(2 * np.pi * 0.6 * np.asarray(run.time)),
    }
    return dataclasses.replace(run, channels={k: jnp.asarray(c) for k, c in channels.items()})


RATES = [
    pytest.param(1000.0, id="1kHz"),
    pytest.param(4000.0, id="4kHz", marks=pytest.mark.slow),
]


@pytest.fixture(scope="module", params=RATES)
def healthy(request):
    """A closed-loop run of the base, its true motion, and what an encoder of 0.1 µm shows of it."""
    model = models.from_parameters(models.coulomb_viscous(), BASE)
    loop = PD(12.0 * 60.0**2, 2 * 12.0 * 60.0)
    run = simulate(model, reference(request.param), loop)
    run = with_predictions(dataclasses.replace(run, channels={}), model)
    inertial = np.gradient(np.asarray(run.velocity), np.asarray(run.time)) * BASE["inertia"]
    run = dataclasses.replace(run, force=inertial + model.force(run))
    counts = Encoder(1e-7, 5e-8)
    noise = counts.draw(jax.random.key(0), run.num_samples, run.time.dtype)
    seen = dataclasses.replace(run, position=counts.read(run.position, noise), velocity=None)
    return run, signals.prepare(seen)


def planted(healthy, term, alpha, noise=0.5):
    """What would be recorded if the term acted as well; force noise in N."""
    true, seen = healthy
    alpha = jnp.asarray(alpha)
    momentum = np.asarray(term.momentum(true) @ alpha)
    extra = np.gradient(momentum, np.asarray(true.time)) + np.asarray(term.columns(true) @ alpha)
    rng = np.random.default_rng(1)
    force = np.asarray(true.force) + extra + noise * rng.standard_normal(extra.size)
    return dataclasses.replace(seen, force=jnp.asarray(force))


@pytest.mark.slow
@each_case
def test_a_planted_term_comes_back(healthy, term, alpha):
    """Weak form, noisy encoder and force, β known: the term's force to 5 %.

    Only what the base cannot imitate can come back, so both the planted and the found force are
    judged by their part orthogonal to the base.
    """
    base, expected = models.coulomb_viscous(), np.asarray(alpha)
    if isinstance(term, T.FrictionAsymmetry):  # a base with two directions has it already
        base = T.Inertia() + T.Coulomb() + T.Viscous()
        expected = expected + [1.0, -10.0]  # half the difference of BASE's directions
    if isinstance(term, T.CoulombAsymmetry):
        base = T.Inertia() + T.Coulomb() + T.Directional(T.Viscous())
        expected = expected + [
            2.0 if term.side == "forwards" else -2.0
        ]  # of which BASE has 1 N to either side
    recording = planted(healthy, term, alpha)
    width = signals.kernel_half_width(recording)
    rows = WeakForm(width).rows(recording, signals.scales(recording))
    root = np.sqrt(np.asarray(rows.positive + rows.negative))[:, None]
    target = root[:, 0] * np.asarray(rows.target)
    basis = np.linalg.qr(root * np.asarray(rows.columns(base, recording)))[0]
    own = root * np.asarray(rows.columns(term, recording))
    size = np.linalg.norm(own, axis=0)
    own = own - basis @ (basis.T @ own)
    found = np.linalg.lstsq(own / size, target, rcond=None)[0] / size
    # A dead-band is Coulomb friction, a load on the force is a gain, unless braking is harder
    # than friction: without this the test would divide nothing by nothing.
    assert np.linalg.norm(own @ expected) > 1e-3 * np.linalg.norm(size * expected)
    assert np.linalg.norm(own @ (found - expected)) < 0.05 * np.linalg.norm(own @ expected)


# The nonlinear parameter unknown, within bounds; from the default ones: test_grid.py.
SEARCHED = {"cogging": {"pitch": (0.008, 0.02)}, "tone": {"frequency": (3.0, 4.5)}}


@pytest.mark.slow
@pytest.mark.parametrize("healthy", RATES[:1], indirect=True)
@pytest.mark.parametrize("name", SEARCHED)
def test_identify_finds_the_nonlinear_parameters_too(healthy, name):
    term, alpha = CASES[name]
    recording = planted(healthy, term, alpha)
    found = identify(models.coulomb_viscous() + term, recording, bounds=SEARCHED[name])
    for parameter, value in zip(term.affine, alpha, strict=True):
        estimate = found.parameters[parameter.name]
        assert float(estimate.value) == pytest.approx(value, rel=0.1, abs=0.1), parameter.name
    for parameter, value in zip(term.nonlinear, term.beta(), strict=True):
        estimate = found.parameters[parameter.name]
        assert float(estimate.value) == pytest.approx(float(value), rel=0.1), parameter.name
    assert float(found.parameters["inertia"].value) == pytest.approx(BASE["inertia"], rel=0.01)


# ---- the catalogue ----


def test_the_catalogue_holds_together():
    reference_names = (
        "parameter_mismatch asymmetric_friction smooth_friction stribeck viscous_nonlinearity "
        "gravity_unbalance "
        "cogging spring hardening_spring end_stop position_dependent_friction sticky_spot "
        "local_force "
        "position_dependent_inertia load_dependent_friction presliding frictional_lag backlash "
        "compliance force_limit position_zero transport_delay actuator_lag clock sensor_filter "
        "actuator_deadband actuator_saturation "
        "position_dependent_force_constant "
        "encoder_error gain_drift "
        "gain_asymmetry thermal_drift friction_step payload_change gain_step load_drift "
        "periodic_disturbance disturbance_force disturbance_pulses cross_axis parameter_step"
    )
    assert set(effects.EFFECTS) == set(reference_names.split())
    for effect in effects.EFFECTS.values():
        assert set(effect.confusable_with) <= set(effects.EFFECTS) - {effect.name}
        assert effect.equation
        for term in effect.shapes(SCALES):
            assert effects.effect_of(term) == effect.name
            lower, upper = bounds(term, SCALES)
            assert bool(jnp.all(lower < upper))
        known = {"time", "velocity", "acceleration"}
        needed = [term.coordinates - known for term in effect.shapes(SCALES)]
        assert effect.needs == frozenset.intersection(*needed or [frozenset()]), effect.name
    with pytest.raises(ValueError, match="there are .*cogging"):
        effects.effect("gremlins")


def test_terms_of_a_baseline_are_no_effect():
    for term in (T.Inertia(), T.Offset(), T.Coulomb(), T.Viscous(), TERMS["table_position"]):
        assert effects.effect_of(term) is None


def test_a_wave_has_amplitude_and_phase():
    """A sin(θ + φ) from its two columns; errors by the delta method against random draws."""
    rng = np.random.default_rng(0)
    spread = np.asarray([[0.02, 0.01], [0.01, 0.03]])
    found = effects.wave(jnp.asarray(3.0), jnp.asarray(-4.0), jnp.asarray(spread))
    assert float(found.amplitude) == pytest.approx(5.0)
    assert float(found.phase) == pytest.approx(np.arctan2(-4.0, 3.0))
    draws = rng.multivariate_normal([3.0, -4.0], spread, 20000)
    assert float(found.amplitude_error) == pytest.approx(np.std(np.hypot(*draws.T)), rel=0.03)
    phases = np.arctan2(draws[:, 1], draws[:, 0])
    assert float(found.phase_error) == pytest.approx(np.std(phases), rel=0.03)


def test_a_load_swings_below_the_first_zero_of_the_kernel():
    tau = np.linspace(-1, 1, 20_001)
    passed = [np.mean((1 - tau**2) ** 4 * np.cos(2 * np.pi * f * tau)) for f in (0, PASSED, 1.7)]
    assert abs(passed[1]) < 1e-4 * passed[0] and abs(passed[2]) < 0.01 * passed[0]
    view = View(ANY._replace(duration=20.0, interval=1e-3), 0.018, 6, 1.0, 1.0)
    fastest = effects.EFFECTS["compliance"].grid(T.Compliance(), view)[:, 0].max()
    assert fastest == pytest.approx(PASSED / 0.018)
    term = T.Compliance(driven="both")
    assert term.burden(np.array([70.0, 0.1]), np.array([2.0, 8.0])).resonance == 70.0
