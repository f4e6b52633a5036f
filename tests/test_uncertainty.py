"""Do the nominal 95 % intervals hold the truth 95 times of 100?"""

import math
import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.explanation import intervals, parameters
from jaxfric.identification import uncertainty
from jaxfric.identification.identified import result_names


def trajectory(rng, seconds, rate):
    """A multisine of random lines and phases that ends at the velocity at which it began."""
    t = np.arange(int(seconds * rate) + 1) / rate
    lines = np.sort(rng.choice(np.arange(2, 16), 4, replace=False))
    size, phase = rng.uniform(0.3, 1.0, 4) / lines, rng.uniform(0, 2 * np.pi, 4)
    w = 2 * np.pi * lines / seconds
    angle = w[:, None] * t + phase[:, None]
    x = size @ np.sin(angle)
    return t, x, (size * w) @ np.cos(angle), -(size * w**2) @ np.sin(angle)


def coloured(rng, count, correlation, rate):
    """Noise of unit variance and exponential autocorrelation, `correlation` in seconds."""
    white = rng.normal(size=count)
    if correlation == 0:
        return white
    pole = math.exp(-1 / (correlation * rate))
    noise = np.empty(count)
    noise[0] = white[0]
    for i in range(1, count):
        noise[i] = pole * noise[i - 1] + math.sqrt(1 - pole**2) * white[i]
    return noise


def machine(rng, name, seconds=8.0, rate=1000.0):
    """A drawn machine and its recording: units from µN·m to kN, white or coloured disturbance."""
    t, x, v, a = trajectory(rng, seconds, rate)
    force, length = 10.0 ** rng.uniform(-4, 4), 10.0 ** rng.uniform(-4, 2)
    x, v, a = (length * s for s in (x, v, a))
    top = np.max(np.abs(v))
    true = {"inertia": force * rng.uniform(0.3, 3) / np.max(np.abs(a))}
    for sign in "+-":
        true["coulomb" + sign] = force * rng.uniform(0.5, 1.5)
        true["viscous" + sign] = force * rng.uniform(0.3, 1.5) / top
        true["stribeck_force" + sign] = force * rng.uniform(0.3, 0.8)
        true["stribeck_velocity" + sign] = top * rng.uniform(0.04, 0.1)
    term = jf.models.named(name)
    wanted = [p.name for p in (*term.affine, *term.nonlinear)]
    model = jf.models.from_parameters(term, {key: true[key] for key in wanted})
    bare = jf.Recording(time=t, force=0 * t, position=x, velocity=v)
    noise = 0.03 * force * coloured(rng, t.size, rng.choice([0.0, 0.005, 0.02]), rate)
    total = np.asarray(model.force(bare)) + true["inertia"] * a + noise
    return model, jf.Recording(time=t, force=total, position=x, velocity=v)


def coverage(name, projection, count, seed):
    """Share of the intervals that hold the truth, over all parameters of successful rows."""
    rng = np.random.default_rng(seed)
    drawn = [machine(rng, name) for _ in range(count)]
    found = jf.identify(name, jf.stack([r for _, r in drawn]), projection=projection)
    fine = np.asarray(found.result._value) == result_names().index("successful")
    held = []
    for key, estimate in found.parameters.items():
        low, high = (np.asarray(limit) for limit in estimate.interval(0.95))
        truth = np.array([float(model.parameters[key]) for model, _ in drawn])
        held.append(((low <= truth) & (truth <= high))[fine])
    return np.array(held), fine


PROJECTIONS = [
    pytest.param(jf.ClosedWindows(), id="closed", marks=pytest.mark.slow),
    pytest.param(jf.WeakForm(16), id="weak"),
]


@pytest.mark.slow
@pytest.mark.parametrize("projection", PROJECTIONS)
def test_coverage_of_the_affine_model(projection):
    held, fine = coverage("coulomb-viscous", projection, 48, seed=11)
    assert fine.all()
    # 48 machines x 5 parameters; those of one machine are correlated, so count 48 x 2: four
    # binomial deviations of 0.95 are 0.09.
    assert 0.86 <= held.mean() <= 1.0, held.mean(axis=1)


def speeding(rng, rate=500.0):
    """A machine that swings for 2 s and then speeds up for 1 s, far beyond the closed window."""
    t = np.arange(int(3 * rate) + 1) / rate
    w, phase = 2 * np.pi * np.array([1.0, 2.0]), rng.uniform(0, 2 * np.pi, 2)
    size, swings = np.array([1.0, 0.5]), t < 2
    angle = w[:, None] * np.minimum(t, 2.0) + phase[:, None]
    v = size @ np.sin(angle) + np.where(swings, 0.0, 8.0 * (t - 2))
    a = np.where(swings, (size * w) @ np.cos(angle), 8.0)
    unit = 10.0 ** rng.uniform(-4, 4)
    true = {"inertia": unit * rng.uniform(0.3, 3)}
    for sign in "+-":
        true["coulomb" + sign] = unit * rng.uniform(5, 15)
        true["viscous" + sign] = unit * rng.uniform(1, 5)
    model = jf.models.from_parameters(jf.models.named("coulomb-viscous"), true)
    bare = jf.Recording(time=t, force=0 * t, velocity=v)
    force = np.asarray(model.force(bare)) + true["inertia"] * a
    noise = 2 * unit * rng.normal(size=t.size)
    return model, jf.Recording(time=t, force=force + noise, velocity=v)


@pytest.mark.slow
def test_the_mass_is_as_uncertain_as_the_friction_makes_it():
    """The friction, known up to 1.5 m/s, is taken off a run up to 9 m/s to weigh the mass."""
    rng = np.random.default_rng(5)
    drawn = [speeding(rng) for _ in range(48)]
    batch = jf.stack([log for _, log in drawn])
    found = jf.identify("coulomb-viscous", batch, projection=jf.ClosedWindows())
    low, high = found.parameters["inertia"].interval(0.95)
    truth = np.array([float(model.parameters["inertia"]) for model, _ in drawn])
    # With the friction taken for exact, 41 % were measured; 0.95 less three binomial deviations.
    assert np.mean((np.asarray(low) <= truth) & (truth <= np.asarray(high))) >= 0.86
    # And not by being vast.
    assert np.median(found.parameters["inertia"].standard_error / truth) < 0.15
    covariance = np.asarray(found.covariance)
    np.testing.assert_allclose(covariance, np.swapaxes(covariance, 1, 2), rtol=1e-9)
    assert np.all(np.abs(covariance[:, 0, 1:]).max(axis=1) > 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gaussian"])  # it holds what the simpler ones do
@pytest.mark.parametrize("projection", PROJECTIONS, ids=["closed", "weak"])
def test_coverage_over_many_machines(name, projection):
    held, fine = coverage(name, projection, 240, seed=12)
    print(f"\n{name} {projection}: {held.mean():.3f}", held.mean(axis=1).round(3), fine.mean())
    assert fine.mean() > 0.95
    assert 0.90 <= held.mean() <= 0.98, held.mean(axis=1)
    assert held.mean(axis=1).min() >= 0.85, held.mean(axis=1)


def test_what_is_not_seen_is_infinitely_uncertain():
    columns = jnp.stack([jnp.ones(200), jnp.linspace(0, 1, 200), jnp.linspace(0, 2, 200)], 1)
    noise = jnp.asarray(np.random.default_rng(0).normal(size=200))
    weight = jnp.ones(200)
    place = uncertainty.places(weight)
    matrix = jax.jit(uncertainty.deviations)(columns, noise, weight, place).covariance
    assert bool(jnp.isfinite(matrix[0, 0]))
    assert bool(jnp.isinf(matrix[1, 1])) and bool(jnp.isinf(matrix[2, 2]))


def test_the_sandwich_of_white_noise_is_the_classical_covariance():
    rng = np.random.default_rng(1)
    columns = jnp.asarray(rng.normal(size=(6400, 2)) * [1.0, 50.0])
    weight = jnp.ones(6400)
    place = uncertainty.places(weight)
    spread = jax.jit(lambda e: uncertainty.deviations(columns, e, weight, place).covariance)
    draws = [np.diagonal(spread(jnp.asarray(e))) for e in rng.normal(size=(160, 6400))]
    classical = np.diagonal(np.linalg.inv(np.asarray(columns.T @ columns)))
    # 8 cosines, 160 draws: the mean variance is known to sqrt(2 / (8 * 160)) = 4 %.
    np.testing.assert_allclose(np.mean(draws, axis=0), classical, rtol=0.16)


@pytest.mark.parametrize("place", [0.25, 0.9])
def test_what_is_seen_for_a_short_while_is_no_surer_than_classically(place):
    """At 0.9 of the record the variance was 0.4 of the classical one: A² may exceed one there."""
    rng = np.random.default_rng(4)
    time = (np.arange(6400) + 0.5) / 6400
    brief = rng.normal(size=6400) * np.exp(-(((time - place) / 0.02) ** 2))
    columns = jnp.asarray(np.stack([rng.normal(size=6400), brief], axis=1))
    weight = jnp.ones(6400)
    spread = jax.jit(
        lambda e: uncertainty.deviations(columns, e, weight, uncertainty.places(weight)).covariance
    )
    inverse = jnp.linalg.pinv(columns)
    drawn = [jnp.asarray(e) for e in rng.normal(size=(160, 6400))]
    draws = [np.diagonal(spread(e - columns @ (inverse @ e))) for e in drawn]
    classical = np.diagonal(np.linalg.inv(np.asarray(columns.T @ columns)))
    ratio = np.mean(draws, axis=0) / classical
    assert 0.84 < ratio[0] < 1.16 and 0.84 < ratio[1] < 2  # known to 4 %


@pytest.mark.parametrize(
    ("degrees", "expected"),
    [(1, 12.7062), (2, 4.3027), (3, 3.1824), (5, 2.5706), (10, 2.2281), (28, 2.0484)],
)
def test_student_quantile(degrees, expected):
    np.testing.assert_allclose(uncertainty.student_quantile(0.975, degrees), expected, rtol=5e-3)


def test_an_estimate_as_plain_data_has_its_interval():
    seen = uncertainty.Estimate(np.float64(2.0), np.float64(0.1), "N")
    low, high = seen.to_dict()["interval"]
    assert (low + high) / 2 == pytest.approx(2.0) and high - 2.0 == pytest.approx(0.2306, rel=1e-3)
    assert seen.half_width() == pytest.approx(0.2306, rel=1e-3)
    hidden = seen._replace(standard_error=np.inf).to_dict()
    assert hidden == {"value": 2.0, "standard_error": None, "interval": None, "unit": "N"}


def in_blocks(filled, seed, draws=1500, blocks=24, rows=20):
    """Which draws of the noise leave the truth in the interval, and how wide two standard errors
    would: of a column that fills so many blocks, beside three that fill all.
    """
    rng = np.random.default_rng(seed)
    block = np.repeat(np.arange(blocks), rows)
    columns = rng.normal(size=(block.size, 4))
    columns[:, 0] *= np.isin(block, rng.choice(blocks, filled, replace=False))
    inverse, held = np.linalg.pinv(columns), []
    for _ in range(draws):
        noise = rng.normal(size=block.size)
        found = inverse @ noise
        fit = types.SimpleNamespace(jacobian=columns, residual=noise - columns @ found)
        known = intervals.spread(fit, block)
        half = known.half_widths(np.eye(4))[0]
        held.append((abs(found[0]) <= half, abs(found[0]) <= 2 * known.covariance[0, 0] ** 0.5))
    return np.mean(held, axis=0)


@pytest.mark.parametrize("filled", [1, 2, 3, 6, 24])
def test_intervals_of_what_few_blocks_hold_are_wider(filled):
    """Satterthwaite's degrees of freedom: as many as there are blocks that tell.

    Of two blocks one tells the negative of the other: with one degree the interval would be 12.7
    standard errors, and it is 4.3.
    """
    by_degrees, by_two = in_blocks(filled, 7)
    assert (0.87 if filled == 2 else 0.935) < by_degrees < 0.99
    assert by_two < by_degrees and (filled not in (2, 3) or by_two < 0.9)


def test_degrees_of_freedom_follow_the_blocks_that_tell():
    rng = np.random.default_rng(3)
    block = np.repeat(np.arange(24), 20)
    columns = rng.normal(size=(block.size, 3))
    columns[block > 0, 0] = 0.0
    columns[block > 7, 1] = 0.0
    fit = types.SimpleNamespace(jacobian=columns, residual=rng.normal(size=block.size))
    one, eight, all_ = intervals.spread(fit, block).degrees_of_freedom(np.eye(3))
    # What one block holds is judged by the noise of all.
    assert 18 < one < 26 and 5 < eight < 8 and 18 < all_ < 24


def test_a_force_of_few_blocks_is_told_with_its_own_degrees_and_tested_with_those_of_all():
    """Presliding that two reversals hold, 3.9 standard errors from none."""
    own = uncertainty.Estimate(np.float64(3.9), np.float64(1.0), "N", 2.0)
    assert own.interval()[0] < 0 < parameters.tested(own).interval()[0]
    weak = own._replace(value=np.float64(2.0))
    assert parameters.tested(weak).interval()[0] < 0
    sure = own._replace(degrees_of_freedom=60.0)
    assert parameters.tested(sure) == sure
