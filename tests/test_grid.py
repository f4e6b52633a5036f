"""Grids as fine as their parameter needs, several nonlinear terms at once, rivals of a minimum."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import jaxfric as jf
from jaxfric import models, terms as T
from jaxfric.identification import blocks, grids, reduced
from jaxfric.identification.identified import result_names
from jaxfric.identification.projections import WeakForm
from jaxfric.signals import scales as scales_of
from jaxfric.terms.sample import Scales

from .test_effects import BASE, CASES, with_predictions

# ---- the grid ----

lengths = st.floats(-6.0, 3.0).map(lambda x: 10.0**x)


def limits(stroke=0.1, speed=0.2, interval=1e-3, duration=20.0):
    numbers = (0.006 * speed, speed, -0.3 * stroke, 0.7 * stroke, 20.0, 5.0, duration)
    return Scales(*(np.asarray(x) for x in (*numbers, interval, 60.0)))


def grid_of(term, scales, half_width=None, given=None):
    """Values of the grid over the parameters of one law, `(G, d)`."""
    plan = grids.plan(term, given or {}, scales, half_width)
    box = T.base.bounds(term, Scales(*map(jnp.asarray, scales)), given or {})
    unit, cells = grids.in_unit(term.nonlinear, plan.axes, box)
    logarithmic = tuple(p.logarithmic for p in term.nonlinear)
    values = jax.vmap(lambda u: reduced.decode(u, box, logarithmic))(unit)
    assert bool(jnp.all((cells > 0) & (unit >= 0) & (unit <= 1)))
    return np.asarray(values), np.asarray(box)


@pytest.mark.slow
@settings(max_examples=3)
@given(unit=lengths, cycles=st.floats(20, 900), harmonics=st.sampled_from([1, 3]))
def test_a_pitch_has_four_points_a_cycle_and_harmonic(unit, cycles, harmonics):
    stroke = 0.1 * unit
    scales = limits(stroke, speed=stroke / (2 * cycles) / 1e-3)
    found, box = grid_of(T.Cogging(harmonics=harmonics), scales)
    turns = np.sort(stroke / found[:, 0])
    assert np.max(np.diff(turns)) <= 1 / (4 * harmonics) * (1 + 1e-9)
    np.testing.assert_allclose([turns[0], turns[-1]], stroke / box[::-1, 0], rtol=1e-9)


@settings(max_examples=2)
@given(duration=st.floats(2.0, 60.0))
def test_a_tone_has_four_points_a_turn_of_the_record(duration):
    found, _ = grid_of(T.PeriodicDisturbance(), limits(duration=duration, interval=duration / 2000))
    assert np.max(np.diff(np.sort(found[:, 0]))) <= 0.25 / duration * (1 + 1e-9)


@settings(max_examples=2)
@given(widest=st.floats(20, 400))
def test_every_spot_has_a_neighbour_that_overlaps_it(widest):
    scales = limits(0.1, speed=0.1 / (2 * widest) / 1e-3)
    found, box = grid_of(T.StickySpot(), scales)
    rng = np.random.default_rng(0)
    at = rng.uniform(*box[:, 0], 300)
    width = np.exp(rng.uniform(*np.log(box[:, 1]), 300))
    # ∫ of the product of two Gaussians of unit norm.
    both = found[None, :, 1] ** 2 + width[:, None] ** 2
    overlap = np.sqrt(2 * found[None, :, 1] * width[:, None] / both)
    overlap = overlap * np.exp(-0.5 * (found[None, :, 0] - at[:, None]) ** 2 / both)
    assert np.min(np.max(overlap, axis=1)) > 0.9
    # A product of both grids would be several times as many.
    assert len(found) < 12 * widest


def test_few_sizes_of_grids_are_compiled():
    sizes = {grids.rounded(steps) for steps in np.geomspace(4, 5000, 400)}
    assert len(sizes) <= 22
    for steps in (4.0, 5.0, 97.0, 1000.0):
        assert steps + 1 <= grids.rounded(steps) <= 1.5 * steps + 1.5
    assert grids.rounded(np.inf) == grids.rounded(1e12) == grids.MOST + 1


def test_beyond_the_most_points_the_shortest_periods_go_not_the_resolution():
    scales = limits(duration=1e6)
    plan = grids.plan(T.PeriodicDisturbance(), {}, scales, None)
    (axis,) = plan.axes
    assert axis.points == grids.MOST + 1 and axis.share < 0.1
    found, _ = grid_of(T.PeriodicDisturbance(), scales)
    assert np.max(np.diff(np.sort(found[:, 0]))) <= 0.25 / 1e6 * (1 + 1e-6)


def test_a_long_record_is_looked_at_in_fewer_samples_but_for_given_bounds():
    widths = (2, 3, 4, 8, 9, 12, 16, 48, 256)
    assert [grids.thinning(h, 0.0) for h in widths] == [1] * 9
    assert [grids.thinning(h, np.inf) for h in widths] == [1, 1, 1, 2, 1, 3, 4, 12, 64]
    assert [grids.thinning(16, k * grids.WORK) for k in (1, 1.1, 4.1, 100)] == [1, 2, 4, 4]
    slow, long = limits(duration=2.0), limits(duration=200.0)
    whole, thin = (grids.plan(T.Cogging(), {}, scales, 16) for scales in (slow, long))
    assert whole == grids.plan(T.Cogging(), {}, long, None)
    assert (whole.thin, thin.thin) == (1, 4) and 0.25 <= thin.axes[0].share < 0.35
    assert thin.axes[0].points < 0.4 * whole.axes[0].points
    bounded = grids.plan(T.Cogging(), {"pitch": (0.002, 0.003)}, long, 16)
    assert bounded.thin == 1 and bounded.axes[0].share == 1.0
    # What is slow anyway is not cut.
    both = grids.plan(T.GravityUnbalance() + T.Cogging(), {}, long, 16)
    assert both.thin == 4 and both.axes[0].share == 1.0


def test_inside_jit_a_parameter_has_its_usual_number_of_points():
    plan = grids.plan(T.Cogging() + T.Dahl(), {}, None, None)
    assert [a.points for a in plan.axes] == [1025, 33]


def test_the_blocks_hold_beta_in_its_order():
    term = models.generalised() + T.Cogging() + T.StickySpot()
    parts = blocks.blocks(term)
    names = [p.name for b in parts for p in b.law.nonlinear]
    assert [n.rstrip("+-") for n in (p.name for p in term.nonlinear)] == names
    assert [b.side for b in parts] == [1, -1, 0, 0]
    assert [(b.start, b.stop) for b in parts] == [(0, 2), (2, 4), (4, 5), (5, 7)]


def test_the_models_of_one_bump_keep_their_own_way():
    for name in models.names():
        assert not blocks.staged(models.named(name)), name
    for added in (T.Cogging(), T.Dahl(), T.Directional(T.Cogging())):
        assert blocks.staged(models.gaussian() + added)


# ---- the resolution of the grid ----


def motion(rate=500.0, duration=12.0, slow=1.0):
    """Three sines: the true motion, without force."""
    t = np.arange(round(duration * rate)) / rate
    tones = ((0.03, 0.31, 0.0), (0.012, 0.83, 1.0), (0.004, 4.3, 2.0))
    x = sum(a * np.sin(2 * np.pi * f * slow * t + p) for a, f, p in tones)
    v = sum(2 * np.pi * a * f * slow * np.cos(2 * np.pi * f * slow * t + p) for a, f, p in tones)
    return jf.Recording(t, 0 * t, x, v)


def with_force(run, model, noise=0.0, seed=0):
    """The force that a model needs along a motion, with noise of that deviation, N."""
    momentum = np.asarray(model.momentum(run))
    force = np.asarray(model.force(run)) + np.gradient(momentum, np.asarray(run.time))
    force = force + noise * np.random.default_rng(seed).standard_normal(force.size)
    return dataclasses.replace(run, force=jnp.asarray(force))


@pytest.mark.slow
def test_thinned_rows_are_the_rows():
    run = with_force(motion(), models.from_parameters(models.coulomb_viscous(), BASE))
    rows = WeakForm(16).rows(run, scales_of(run))
    thin, some = rows.thinned(run, 4)
    assert some.num_samples == run.num_samples // 4
    used = np.asarray(rows.positive + rows.negative) > 0
    for term in (T.Inertia(), T.Viscous(), T.Cogging(0.01), T.PositionDependentInertia(0.05)):
        full, part = rows.columns(term, run), thin.columns(term, some)
        assert part.shape == full.shape
        size = np.sqrt(np.mean(np.asarray(full)[used] ** 2))
        np.testing.assert_allclose(part[used], full[used], atol=0.02 * size)


@pytest.mark.parametrize("kind", ["apart", "close", "spanned", "equal"])
def test_what_columns_gain_is_the_fall_of_the_cost(kind):
    rng = np.random.default_rng(3)
    basis = reduced.orthonormal(jnp.asarray(rng.normal(size=(500, 4))))
    columns = rng.normal(size=(500, 3)) * np.array([1e-6, 1.0, 1e6])
    if kind == "close":
        columns[:, 2] = columns[:, 1] + 1e-3 * rng.normal(size=500)
    elif kind == "spanned":
        columns[:, 2] = np.asarray(basis) @ rng.normal(size=4)
    elif kind == "equal":
        columns[:, 2] = 5 * columns[:, 1]
    target = reduced.project_out(basis, jnp.asarray(rng.normal(size=(500, 1))))[:, 0]
    found = blocks.gained(basis, target, jnp.asarray(columns))
    own = jnp.asarray(columns[:, :2] if kind == "spanned" else columns)
    exact = jnp.sum(target**2) - reduced.cost(basis, target, own)
    np.testing.assert_allclose(found, exact, rtol=1e-5)


# ---- planted and found ----


def ended(found):
    return result_names()[int(found.result._value)]


def misses(found, model, share=0.01):
    """Nonlinear parameters further from the truth than four standard errors and 1 %.

    The weak form's rows treat velocity as straight over a kernel, a bias that noise cannot hide.
    """
    off = []
    for p, value in zip(model.term.nonlinear, model.term.beta(), strict=True):
        estimate = found.parameters[p.name]
        room = 4 * float(estimate.standard_error) + share * abs(float(value))
        if not abs(float(estimate.value) - float(value)) <= room:
            off.append((p.name, float(value), estimate))
    return off


def machine(base, term, alpha):
    """A named model with a further term, all parameters known."""
    stribeck = {"stribeck_force": 8.0, "stribeck_velocity": 0.03, "stribeck_exponent": 1.3}
    known = {"coulomb": 19.0, "viscous": 70.0, "offset": 1.0} | BASE | stribeck
    values = {p.name: known.get(p.name, known.get(p.name.rstrip("+-"))) for p in base.affine}
    values |= {p.name: stribeck[p.name.rstrip("+-")] for p in base.nonlinear}
    whole = base + term
    own = [p.name for p in whole.affine[len(base.affine) :]]
    values |= dict(zip(own, map(float, alpha), strict=True))
    own = [p.name for p in whole.nonlinear[len(base.nonlinear) :]]
    values |= dict(zip(own, map(float, term.beta()), strict=True))
    return models.from_parameters(whole, values)


def pitch_again(turns, phase, seed):
    """From 1/300 of the stroke to most of it, sampled so that the shortest can be seen."""
    run = motion(duration=24.0, slow=0.25)
    pitch = float(np.ptp(run.position)) / np.exp(turns)
    term, alpha = T.Cogging(pitch), (np.cos(phase), np.sin(phase))
    model = machine(models.coulomb_viscous(), term, alpha)
    found = jf.identify(models.coulomb_viscous() + T.Cogging(), with_force(run, model, 0.5, seed))
    assert ended(found) == "successful"
    assert not misses(found, model)
    assert not np.any(np.isfinite(found.rival))


PITCHES = {
    "turns": st.floats(np.log(1.5), np.log(300)),
    "phase": st.floats(0, 6.28),
    "seed": st.integers(0, 99),
}


@pytest.mark.slow
@settings(max_examples=8)
@given(**PITCHES)
def test_any_pitch_is_found_from_the_default_bounds(turns, phase, seed):
    pitch_again(turns, phase, seed)


@pytest.mark.slow
def test_a_pitch_that_only_noise_suggests_has_rivals():
    """The best of many pitches in noise is as good as the next best, and both are told."""
    run = motion(duration=24.0, slow=0.25)
    model = models.from_parameters(models.coulomb_viscous(), BASE)
    for seed in range(2):
        log = with_force(run, model, 0.5, seed)
        found = jf.identify(models.coulomb_viscous() + T.Cogging(), log)
        assert ended(found) == "ambiguous"
        estimate, rival = found.parameters["pitch"], float(found.rival[0])
        assert abs(rival - float(estimate.value)) > 2 * float(estimate.standard_error)
        assert f"The other one: pitch = {rival:.6g} m." in found.diagnosis


# Beside coulomb-viscous. Left out: what names no nonlinear parameter (nothing is searched for).
SEARCHED = {n: case for n, case in CASES.items() if case[0].nonlinear}


def found_again(name, base, noise=0.5, seed=1):
    term, alpha = SEARCHED[name]
    run = with_predictions(
        with_force(motion(), models.from_parameters(models.coulomb_viscous(), BASE)),
        models.from_parameters(models.coulomb_viscous(), BASE),
    )
    model = machine(base, term, alpha)
    return jf.identify(base + term, with_force(run, model, noise, seed)), model


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sticky_spot", "friction_step"])
def test_a_further_term_is_found_from_the_default_bounds(name):
    found, model = found_again(name, models.coulomb_viscous())
    assert ended(found) == "successful"
    assert not misses(found, model)


@pytest.mark.slow
# Of the loads behind a gap the most general one, of which the others are a part.
@pytest.mark.parametrize(
    "name",
    [
        name
        for name in SEARCHED
        if name not in ("sticky_spot", "friction_step", "elastic_backlash", "damped_backlash")
    ],
)
def test_any_term_is_found_from_the_default_bounds(name):
    found, model = found_again(name, models.coulomb_viscous())
    assert not misses(found, model)


def test_a_law_of_many_numbers_has_few_places_spread_evenly():
    parameters = T.DampedBacklash().nonlinear
    axes = [grids.Axis(points) for points in (13, 17, 17, 5, 5)]  # 94 000 combinations
    places, cells = grids.fractions(parameters, axes)
    assert places.shape == cells.shape == (grids.TOGETHER, 5)
    assert 0 <= places.min() and places.max() <= 1
    # Each quarter of each parameter has its share of them.
    counts = [np.histogram(each, 4, (0, 1))[0] / len(places) for each in places.T]
    np.testing.assert_allclose(counts, 0.25, atol=0.005)
    few, _ = grids.fractions(parameters[:3], axes[:3])
    assert len(few) == 13 * 17 * 17


def test_each_direction_keeps_its_own_parameters_of_two_laws():
    """β is sorted by laws, the search by directions."""
    gaussian = models.gaussian()
    run, term = motion(), T.Directional(T.SmoothCrossing(0.003), T.SmoothCrossing(0.02))
    model = machine(gaussian, term, (25.0, 12.0))
    found = jf.identify(gaussian + T.Directional(T.SmoothCrossing()), with_force(run, model, 0.1))
    assert not misses(found, model, share=0.02)


def test_the_directions_may_obey_different_laws():
    run = motion()
    sides = T.Coulomb() + T.Viscous() + T.Gaussian(), T.Coulomb() + T.Viscous()
    for order, name in ((sides, "stribeck_force+"), (sides[::-1], "stribeck_force-")):
        structure = T.Inertia() + T.Directional(*order)
        model = machine(structure, T.Offset(), (0.0,))
        found = jf.identify(structure, with_force(run, model, 0.1))
        assert not misses(found, model, share=0.02)
        assert float(found.parameters[name].value) == pytest.approx(8.0, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(
    "base, name",
    [
        ("gaussian", "cogging"), ("lorentzian", "sticky_spot"), ("generalised", "dahl"),
        ("symmetric-exponential", "friction_ramp"),
    ],
)  # fmt: skip
def test_any_model_is_found_beside_a_further_term(base, name):
    found, model = found_again(name, models.named(base), noise=0.2)
    assert not misses(found, model, share=0.05)


@pytest.mark.slow
def test_a_batch_and_jit_find_what_a_call_finds():
    run = motion()
    base, term = models.coulomb_viscous(), T.Cogging()
    model = machine(base, T.Cogging(0.012), (0.6, 1.2))
    logs = [with_force(run, model, 0.5, seed) for seed in range(2)]

    def fit(log):
        # Inside jit the kernel's width is another one by default.
        return jf.identify(base + term, log, projection=WeakForm(8))

    apart, together, traced = [fit(log) for log in logs], fit(jf.stack(logs)), jax.jit(fit)(logs[0])
    assert together.rival.shape == (2, 1)
    for i, one in enumerate(apart):
        pitch = float(one.parameters["pitch"].value)
        assert float(together.parameters["pitch"].value[i]) == pytest.approx(pitch, rel=1e-6)
    assert float(traced.parameters["pitch"].value) == pytest.approx(
        float(apart[0].parameters["pitch"].value), rel=1e-6
    )
