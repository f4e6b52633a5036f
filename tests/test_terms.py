"""Every term has every property: a new term is tested by being listed in CASES."""

import dataclasses
import json
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, strategies as st
from jaxtyping import Array, Float

from jaxfric import models, terms
from jaxfric.data.recording import Recording, stack
from jaxfric.identification.identifying import identify
from jaxfric.terms import (  # fmt: skip
    Coulomb,
    Directional,
    Exponential,
    Gaussian,
    Generalised,
    Inertia,
    Lorentzian,
    Offset,
    Sum,
    Viscous,
)
from jaxfric.terms.base import bounds, changed_columns, summands
from jaxfric.terms.sample import Scales
from jaxfric.units import FORCE, VELOCITY

CASES = {
    "coulomb": Coulomb(),
    "viscous": Viscous(),
    "gaussian": Gaussian(0.3),
    "lorentzian": Lorentzian(0.3),
    "exponential": Exponential(0.3),
    "generalised": Generalised(0.3, 1.4),
    "crossing": terms.SmoothCrossing(0.3),
    "inertia": Inertia(),
    "offset": Offset(),
    "gravity": terms.Gravity(),
    "sum": Sum((Coulomb(), Gaussian(0.3), Generalised(0.2, 0.7))),
    "directional": Directional(Coulomb() + Gaussian(0.3), Coulomb() + Lorentzian(0.2)),
    "nested": Inertia() + Directional(Coulomb() + Viscous() + Generalised(0.3, 1.4)) + Offset(),
}
SCALES = Scales(*(jnp.asarray(x) for x in (0.01, 2.0, -1.0, 1.0, 5.0, 0.0, 10.0, 1e-3, 15.0)))

each_term = pytest.mark.parametrize("term", CASES.values(), ids=CASES)


def motion(scale=1.0):
    """Both directions, rest, a hair above rest, and fast: what a law has to stand."""
    v = scale * np.array([-3.0, -0.5, -0.1, -1e-12, 0.0, 1e-12, 0.1, 0.2, 0.5, 3.0])
    t = np.arange(v.size, dtype=float)
    return Recording(time=t, force=np.zeros_like(v), position=0.1 * t, velocity=v)


# ---- shapes, transformations ----


@each_term
def test_shapes_agree_with_the_names(term):
    recording = motion()
    n, p = recording.num_samples, len(term.affine)
    assert term.columns(recording).shape == (n, p)
    assert term.momentum(recording).shape == (n, p)
    assert term.offset(recording).shape == (n,)
    assert term.beta().shape == (len(term.nonlinear),)


@each_term
def test_everything_is_finite_in_both_directions_and_at_rest(term):
    recording = motion()
    for value in (term.columns(recording), term.momentum(recording), term.offset(recording)):
        assert bool(jnp.all(jnp.isfinite(value)))


@each_term
def test_a_term_without_momentum_says_so(term):
    assert term.inertial == bool(jnp.any(term.momentum(motion()) != 0))


@each_term
def test_jit_changes_nothing(term):
    recording = motion()
    fast = eqx.filter_jit(lambda term, recording: term.columns(recording))(term, recording)
    np.testing.assert_allclose(fast, term.columns(recording), rtol=1e-14, atol=0)


@each_term
def test_vmap_over_a_batch_is_the_rows(term):
    rows = [motion(), motion(0.5), motion(-2.0)]
    together = jax.vmap(lambda recording: term.columns(recording))(stack(rows))
    apart = jnp.stack([term.columns(recording) for recording in rows])
    np.testing.assert_allclose(together, apart, rtol=1e-14, atol=0)


@each_term
def test_vmap_over_parameters_is_the_rows(term):
    factors = jnp.asarray([0.5, 1.0, 1.1])
    betas = factors[:, None] * term.beta()[None, :]
    batch = jax.vmap(lambda beta: term.with_beta(beta).columns(motion()))(betas)
    for beta, columns in zip(betas, batch, strict=True):
        np.testing.assert_allclose(columns, term.with_beta(beta).columns(motion()), rtol=1e-14)


@pytest.mark.slow
@each_term
def test_derivative_by_beta_agrees_with_finite_differences(term):
    beta, recording = term.beta(), motion()

    def columns(beta):
        return term.with_beta(beta).columns(recording)

    slopes = jax.jacrev(columns)(beta)
    np.testing.assert_allclose(slopes, jax.jacfwd(columns)(beta), rtol=1e-12, atol=1e-14)
    for i, size in enumerate(beta):
        step = jnp.zeros_like(beta).at[i].set(1e-5 * size)
        expected = (columns(beta + step) - columns(beta - step)) / (2e-5 * size)
        np.testing.assert_allclose(slopes[..., i], expected, rtol=1e-6, atol=1e-8)


@each_term
def test_a_nonlinear_parameter_changes_its_own_columns_and_no_others(term):
    beta, recording = term.beta(), motion()
    before = np.asarray(term.columns(recording))
    for i, own in enumerate(changed_columns(term)):
        moved = term.with_beta(beta.at[i].multiply(1.1)).columns(recording)
        changed = np.flatnonzero(np.any(np.asarray(moved) != before, axis=0))
        assert len(changed) and set(changed) <= set(own)


# ---- structure ----


@each_term
def test_the_leaves_are_the_nonlinear_parameters(term):
    leaves, structure = jax.tree.flatten(term)
    assert len(leaves) == len(term.nonlinear)
    again = jax.tree.unflatten(structure, leaves)
    assert eqx.tree_equal(again, term)
    np.testing.assert_array_equal(jnp.asarray(leaves), term.beta())


@each_term
def test_with_beta_of_beta_is_the_same_term(term):
    again = term.with_beta(term.beta())
    np.testing.assert_array_equal(again.beta(), term.beta())
    np.testing.assert_array_equal(again.columns(motion()), term.columns(motion()))
    assert jax.tree.structure(again) == jax.tree.structure(term)


@each_term
def test_with_beta_takes_every_parameter_to_its_place(term):
    wanted = 0.1 + jnp.arange(len(term.nonlinear), dtype=float)
    np.testing.assert_array_equal(term.with_beta(wanted).beta(), wanted)


@each_term
def test_json_gives_the_term_back(term):
    alpha = 1.0 + jnp.arange(len(term.affine), dtype=float)
    model = models.Model(term, alpha, (("force", "N·m"), ("position", "rad")))
    again = models.Model.from_dict(json.loads(json.dumps(model.to_dict(), allow_nan=False)))
    assert type(again.term) is type(term)
    assert again.units == model.units
    assert again.term.affine == term.affine
    assert again.term.nonlinear == term.nonlinear
    np.testing.assert_array_equal(again.alpha, model.alpha)
    np.testing.assert_array_equal(again.force(motion()), model.force(motion()))
    np.testing.assert_array_equal(again.momentum(motion()), model.momentum(motion()))


@each_term
def test_names_are_unique(term):
    names = [p.name for p in (*term.affine, *term.nonlinear)]
    assert len(set(names)) == len(names)


@each_term
def test_every_nonlinear_parameter_has_a_compact_set(term):
    lower, upper = bounds(term, SCALES)
    assert lower.shape == upper.shape == (len(term.nonlinear),)
    assert bool(jnp.all((lower > 0) & (lower < upper) & jnp.isfinite(upper)))


def test_given_bounds_win_with_and_without_the_sign():
    term = Directional(Gaussian())
    given_bounds = {"stribeck_velocity": (0.1, 0.2), "stribeck_velocity-": (0.3, 0.4)}
    found = bounds(term, SCALES, given_bounds)
    np.testing.assert_allclose(found, [[0.1, 0.3], [0.2, 0.4]])


def test_a_parameter_yet_to_be_identified_is_nan():
    assert bool(jnp.isnan(Gaussian().beta())[0])
    assert bool(jnp.all(jnp.isnan(models.generalised().beta())))


def test_beta_takes_the_dtype_of_the_recording_in_single_precision():
    with jax.enable_x64(False):
        recording = motion()
        assert recording.velocity.dtype == jnp.float32
        for term in CASES.values():
            assert term.columns(recording).dtype == jnp.float32


# ---- the physics ----

BUMPS = [Gaussian(0.3), Lorentzian(0.3), Exponential(0.3), Generalised(0.3, 1.4)]


@pytest.mark.parametrize("term", [Coulomb(), Viscous(), *BUMPS], ids=lambda t: type(t).__name__)
def test_friction_opposes_motion_and_is_odd(term):
    v = motion().velocity
    force = term.columns(motion())[:, 0]
    assert bool(jnp.all(force * v >= 0))
    np.testing.assert_allclose(term.columns(motion(-1.0))[:, 0], -force, rtol=1e-14)
    assert float(force[v == 0][0]) == 0.0


@pytest.mark.parametrize("bump", BUMPS, ids=lambda t: type(t).__name__)
def test_a_bump_is_one_at_rest_and_vanishes_at_speed(bump):
    speeds = jnp.asarray([1e-12, 0.1, 0.3, 1.0, 1e6])
    recording = dataclasses.replace(
        stack([Recording(time=speeds, force=speeds, velocity=speeds)]), units=()
    )
    force = jax.vmap(bump.columns)(recording)[0, :, 0]
    assert float(force[0]) == pytest.approx(1.0, abs=1e-10)
    assert float(force[-1]) == pytest.approx(0.0, abs=1e-10)
    assert bool(jnp.all(jnp.diff(force) < 0))


@pytest.mark.parametrize("bump", BUMPS, ids=lambda t: type(t).__name__)
def test_a_contrast_is_the_bump_over_its_value_at_the_slowest_speed(bump):
    slowest, speed = jnp.asarray(0.02), jnp.geomspace(0.02, 3.0, 30)
    expected = bump.shape(speed) / bump.shape(slowest) - 1
    np.testing.assert_allclose(bump.contrast(speed, slowest), expected, atol=1e-14)
    np.testing.assert_allclose(bump.ratio(speed, slowest), 1 + expected, atol=1e-14)


def test_values_by_hand_at_the_stribeck_velocity():
    at = Recording(time=[0.0], force=[0.0], velocity=[0.3])
    by_hand = {Gaussian: np.exp(-1), Lorentzian: 0.5, Exponential: np.exp(-1)}
    for law, value in by_hand.items():
        assert float(law(0.3).columns(at)[0, 0]) == pytest.approx(value, rel=1e-14)
    twice = Recording(time=[0.0], force=[0.0], velocity=[-0.6])
    assert float(Gaussian(0.3).columns(twice)[0, 0]) == pytest.approx(-np.exp(-4), rel=1e-14)
    assert float(Lorentzian(0.3).columns(twice)[0, 0]) == pytest.approx(-0.2, rel=1e-14)
    assert float(Exponential(0.3).columns(twice)[0, 0]) == pytest.approx(-np.exp(-2), rel=1e-14)
    general = float(Generalised(0.3, 1.5).columns(twice)[0, 0])
    assert general == pytest.approx(-np.exp(-(2**1.5)), rel=1e-14)


def test_the_generalised_bump_holds_the_gaussian_and_the_exponential():
    for special, exponent in ((Gaussian(0.3), 2.0), (Exponential(0.3), 1.0)):
        general = Generalised(0.3, exponent).columns(motion())
        np.testing.assert_allclose(general, special.columns(motion()), rtol=1e-12)


def test_inertia_is_momentum_and_offset_is_constant():
    recording = motion()
    np.testing.assert_array_equal(Inertia().momentum(recording)[:, 0], recording.velocity)
    np.testing.assert_array_equal(Inertia().columns(recording), jnp.zeros((10, 1)))
    np.testing.assert_array_equal(Offset().columns(recording), jnp.ones((10, 1)))


# ---- directions ----

velocities = st.lists(st.floats(-1e3, 1e3, allow_subnormal=False), min_size=1, max_size=12).map(
    lambda v: np.array(v + [0.0] * (12 - len(v)))
)  # one length: one compiled program


def moving(v):
    return Recording(time=np.arange(v.size, dtype=float), force=np.zeros_like(v), velocity=v)


@given(v=velocities, low=st.floats(0.01, 10.0), high=st.floats(0.01, 10.0))
def test_mirror_law(v, low, high):
    """Reversing the motion exchanges the sides: g±(v; a, b) = −g∓(−v; b, a) for odd laws."""
    law, other = Coulomb() + Viscous() + Gaussian(low), Coulomb() + Viscous() + Gaussian(high)
    count = len(law.affine)
    forward = np.asarray(Directional(law, other).columns(moving(v)))
    backward = -np.asarray(Directional(other, law).columns(moving(-v)))
    np.testing.assert_array_equal(forward[:, :count], backward[:, count:])
    np.testing.assert_array_equal(forward[:, count:], backward[:, :count])


@given(v=velocities)
def test_no_sample_lies_on_both_sides(v):
    columns = np.asarray(Directional(Viscous() + Offset()).columns(moving(v)))
    assert not np.any((columns[:, :2] != 0).any(axis=1) & (columns[:, 2:] != 0).any(axis=1))
    assert not np.any(columns[v == 0])


@given(v=velocities)
def test_equal_sides_add_up_to_the_undirected_term(v):
    law = Coulomb() + Viscous() + Lorentzian(0.3)
    columns = np.asarray(Directional(law).columns(moving(v)))
    np.testing.assert_array_equal(columns[:, :3] + columns[:, 3:], law.columns(moving(v)))


# ---- sums ----


def test_sums_are_flat_and_keep_their_order():
    total = (Inertia() + Coulomb()) + (Viscous() + Offset())
    assert [type(t) for t in total.terms] == [Inertia, Coulomb, Viscous, Offset]
    nested = Sum((Inertia(), Sum((Coulomb(), Sum((Viscous(),))))))
    assert [type(t) for t in summands(nested)] == [Inertia, Coulomb, Viscous]


def test_columns_of_a_sum_are_those_of_its_summands():
    parts = [CASES["gaussian"], CASES["directional"], CASES["offset"]]
    total = parts[0] + parts[1] + parts[2]
    side_by_side = jnp.concatenate([t.columns(motion()) for t in parts], axis=1)
    np.testing.assert_array_equal(total.columns(motion()), side_by_side)
    assert total.coordinates == {"velocity"}


def test_two_equal_terms_get_names_of_their_own():
    total = Gaussian(0.1) + Gaussian(0.2) + Directional(Gaussian(0.3) + Gaussian(0.4))
    names = [p.name for p in total.affine]
    assert names[:2] == ["stribeck_force", "stribeck_force_2"]
    assert names[2:] == [
        "stribeck_force+", "stribeck_force_2+", "stribeck_force-", "stribeck_force_2-"
    ]  # fmt: skip
    values = {p.name: 1.0 + i for i, p in enumerate((*total.affine, *total.nonlinear))}
    model = models.from_parameters(total, values)
    assert {name: float(value) for name, value in model.parameters.items()} == values


def test_equal_directional_terms_keep_the_sign_last():
    total = Directional(Coulomb()) + Directional(Coulomb())
    assert [p.name for p in total.affine] == ["coulomb+", "coulomb-", "coulomb_2+", "coulomb_2-"]


@given(counts=st.lists(st.sampled_from([Gaussian, Coulomb, Directional]), min_size=1, max_size=9))
def test_names_are_unique_in_any_sum(counts):
    total = Sum(tuple(kind(Gaussian()) if kind is Directional else kind() for kind in counts))
    names = [p.name for p in (*total.affine, *total.nonlinear)]
    assert len(set(names)) == len(names)


def test_a_recording_without_velocity_is_refused_with_a_remedy():
    unready = Recording(time=[0.0, 1.0], force=[0.0, 0.0], position=[0.0, 1.0])
    with pytest.raises(ValueError, match=r"no velocity yet.*signals\.prepare"):
        Coulomb().columns(unready)


# ---- a law of one's own ----


class Cubic(terms.AbstractLaw):
    """Air drag with a corner: F = F_c v³ / (v_c² + v²)."""

    corner: Float[Array, ""] | float = float("nan")
    affine: ClassVar = (terms.Parameter("cubic", FORCE._replace(position=-1, time=1)),)
    nonlinear: ClassVar = (
        terms.Parameter("corner", VELOCITY, lambda scales: (scales.slowest, scales.fastest)),
    )

    def law(self, sample):
        return (sample.velocity**3 / (self.corner**2 + sample.velocity**2),)


def test_a_law_written_in_ten_lines_is_identified():
    t = np.linspace(0.0, 2.0, 2001)
    v = np.sin(np.pi * t)
    recording = Recording(time=t, force=np.zeros_like(t), velocity=v)
    term = Inertia() + Coulomb() + Cubic()
    truth = {"inertia": 2.0, "coulomb": 3.0, "cubic": 5.0, "corner": 0.4}
    model = models.from_parameters(term, truth)
    force = model.force(recording) + truth["inertia"] * np.pi * np.cos(np.pi * t)
    found = identify(term, dataclasses.replace(recording, force=force))
    for name, value in truth.items():
        assert float(found.parameters[name].value) == pytest.approx(value, rel=2e-3), name
