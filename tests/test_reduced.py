"""The reduced cost L(β) against brute force, and the refinement against the root of its slope."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import jaxfric as jf
from jaxfric.identification import reduced, refine
from jaxfric.identification.identified import result_names
from jaxfric.identification.projections import Rows
from jaxfric.identification.search import search
from jaxfric.programs import quick_options


def exact_cost(columns, target, weight):
    """Least-squares cost in extended precision: Gram-Schmidt, repeated, on weighted rows."""
    root = np.sqrt(np.asarray(weight, np.longdouble))
    rest = root * np.asarray(target, np.longdouble)
    basis = []
    for column in np.asarray(columns, np.longdouble).T:
        left = root * column
        for _ in range(3):
            for unit in basis:
                left = left - unit * (unit @ left)
        basis.append(left / np.sqrt(left @ left))
    for _ in range(3):
        for unit in basis:
            rest = rest - unit * (unit @ rest)
    return rest @ rest


def bump(velocity, beta):
    return np.exp(-((np.asarray(velocity, np.longdouble) / np.longdouble(beta)) ** 2))


# name: speeds from, to; offset of the force; Stribeck velocities; relative tolerance.
# Forming the normal equations loses far more on the hard ones (see the test below).
CASES = {
    "plain": (0.002, 0.2, 0.0, (0.005, 0.02, 0.08), 1e-12),
    "wide bump": (0.002, 0.2, 0.0, (0.5, 2.0, 10.0), 1e-10),
    "narrow range": (0.1, 0.101, 0.0, (0.02, 0.08, 0.3), 1e-10),
    "large offset": (0.002, 0.2, 1e6, (0.005, 0.02, 0.08), 1e-8),
}


def case(name, size=2000):
    low, high, offset, betas, tolerance = CASES[name]
    rng = np.random.default_rng(7)
    velocity = rng.uniform(low, high, size)
    force = 10 + 40 * velocity + 5 * np.exp(-((velocity / 0.02) ** 2)) + offset
    force = force + 0.1 * rng.normal(size=size)
    weight = 1e-3 * rng.uniform(0.5, 1.0, size)
    columns = np.stack([np.ones(size), velocity], 1)
    return velocity, force, weight, columns, np.array(betas), tolerance


def reference(velocity, force, weight, columns, betas):
    both = [np.concatenate([columns, bump(velocity, b)[:, None]], 1) for b in betas]
    return np.array([exact_cost(c, force, weight) for c in both]).astype(float)


@pytest.mark.parametrize("name", CASES)
def test_the_reduced_cost_is_the_least_squares_cost(name):
    velocity, force, weight, columns, betas, tolerance = case(name)
    root = jnp.sqrt(jnp.asarray(weight))
    basis = reduced.orthonormal(root[:, None] * columns)
    target = reduced.project_out(basis, (root * force)[:, None])[:, 0]
    shapes = [jnp.asarray(bump(velocity, b).astype(float))[:, None] for b in betas]
    found = [float(reduced.cost(basis, target, root[:, None] * s)) for s in shapes]
    np.testing.assert_allclose(found, reference(*case(name)[:5]), rtol=tolerance)


@pytest.mark.parametrize("kind", ["contrast", "ratio"])
@pytest.mark.parametrize("name", CASES)
def test_the_grid_of_a_contrast_is_the_least_squares_cost(name, kind):
    velocity, force, weight, columns, betas, tolerance = case(name)
    roots = jnp.sqrt(jnp.asarray(np.stack([weight, np.flip(weight)])))
    rows = reduced.moments(jnp.asarray(columns), jnp.asarray(force), roots)
    slowest = jnp.min(jnp.asarray(velocity))

    def bump(beta):
        return getattr(jf.terms.Gaussian(beta[0]), kind)(jnp.asarray(velocity), slowest)

    found = reduced.grid_costs(bump, jnp.asarray(betas)[:, None], rows)
    for row, each in zip(found, (weight, np.flip(weight)), strict=True):
        exact = reference(velocity, force, each, columns, betas)
        np.testing.assert_allclose(row, exact, rtol=tolerance)


@pytest.mark.parametrize("name", [name for name in CASES if name != "plain"])
def test_the_hard_cases_are_hard(name):
    """Normal equations fail on them, so the tests above would notice a slip back to those.

    By how much is rounding, another with every BLAS.
    """
    velocity, force, weight, columns, betas, tolerance = case(name)
    lost = []
    for beta, exact in zip(betas, reference(velocity, force, weight, columns, betas), strict=True):
        full = np.concatenate([columns, bump(velocity, beta)[:, None].astype(float)], 1)
        gram, moment = full.T @ (weight[:, None] * full), full.T @ (weight * force)
        naive = weight @ force**2 - moment @ np.linalg.solve(gram, moment)
        lost.append(abs(naive / exact - 1))
    assert max(lost) > 100 * tolerance


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 5, 63, 64, 65, 200])
def test_tiles_cover_every_grid(count):
    velocity, force, weight, columns, *_ = case("plain", 300)
    rows = reduced.moments(
        jnp.asarray(columns), jnp.asarray(force), jnp.sqrt(jnp.asarray(weight))[None]
    )
    grid = jnp.asarray(np.geomspace(0.003, 0.1, count))[:, None]

    def shape(beta):
        return jnp.exp(-((jnp.asarray(velocity) / beta[0]) ** 2))

    found = reduced.grid_costs(shape, grid, rows)
    assert found.shape == (1, count)
    some = sorted({0, count // 2, count - 1})
    alone = [rows.costs(shape(grid[i])[None])[0, 0] for i in some]
    np.testing.assert_allclose(found[0, np.asarray(some)], jnp.stack(alone), rtol=1e-12)


@pytest.mark.slow
def test_memory_does_not_grow_with_the_grid():
    velocity, force, weight, columns, *_ = case("plain", 20000)
    rows = reduced.moments(
        jnp.asarray(columns), jnp.asarray(force), jnp.sqrt(jnp.asarray(weight))[None]
    )

    def temporaries(count):
        grid = jnp.asarray(np.geomspace(0.003, 0.1, count))[:, None]
        run = jax.jit(
            lambda g, r, v: reduced.grid_costs(lambda b: jnp.exp(-((v / b[0]) ** 2)), g, r)
        )
        compiled = run.lower(grid, rows, jnp.asarray(velocity)).compile()
        return compiled.memory_analysis().temp_size_in_bytes

    # The mark of the speed page: under 10 MB at any grid; the costs themselves are 8 bytes each.
    assert temporaries(10000) < 10e6
    assert temporaries(10000) <= temporaries(1000) + 16 * 9000


def quadratic_well(centre):
    """Residuals with one minimum of their square at `centre`, curved and with a large remainder."""

    def residuals(unit):
        x = unit - jnp.asarray(centre)
        return jnp.concatenate([jnp.sinh(2 * x), jnp.ones(3) + 0.1 * jnp.sum(x**2)])

    return residuals


@pytest.mark.slow
@pytest.mark.parametrize("centre", [0.3, 0.003, -0.2, 0.0, 1.0, 1.4])
def test_refinement_stays_in_its_cell_and_never_worsens(centre):
    residuals, cell = quadratic_well([centre]), jnp.asarray([0.05])
    start = jnp.asarray([round(float(np.clip(centre, 0, 1)) / 0.05) * 0.05])
    found, converged = refine.refine(residuals, start, cell)
    assert bool(converged)
    assert 0 <= float(found[0]) <= 1 and abs(float((found - start)[0])) <= 0.05 + 1e-15
    cost = [float(jnp.sum(residuals(x) ** 2)) for x in (found, start)]
    assert cost[0] <= cost[1] * (1 + 1e-14)
    np.testing.assert_allclose(found[0], np.clip(centre, 0, 1), atol=1e-7)


def problem(name, beta, seed=0, noise=0.1, size=3000):
    """Rows on samples of one direction and the other, and the bounds of the two widths."""
    rng = np.random.default_rng(seed)
    velocity = rng.uniform(0.002, 0.2, size) * np.where(np.arange(size) % 2, 1, -1)
    friction = jf.terms.Sum(jf.models.named(name).terms[1:])  # without inertia
    names = [p.name for p in (*friction.affine, *friction.nonlinear)]
    known = {"coulomb": 10.0, "viscous": 40.0, "stribeck_force": 5.0, "stribeck_velocity": beta}
    model = jf.models.from_parameters(friction, {n: known[n.rstrip("+-")] for n in names})
    bare = jf.Recording(time=np.arange(size) / 1e3, force=0 * velocity, velocity=velocity)
    force = model.force(bare) + noise * rng.normal(size=size)
    weight = jnp.full(size, 1e-3)
    positive = jnp.where(bare.velocity > 0, weight, 0.0)
    rows = Rows(force, positive, weight - positive, weight, bare.time, jnp.ones(()), jnp.ones(()))
    return friction, bare, rows, velocity, np.asarray(force)


def shape_of(name):
    return {
        "gaussian": lambda v, b: np.exp(-((v / b) ** 2)),
        "lorentzian": lambda v, b: 1 / (1 + (v / b) ** 2),
        "exponential": lambda v, b: np.exp(-v / b),
    }[name]


def slope_of_cost(name, speed, force, log_beta):
    """∂L/∂log β in extended precision, by central differences of Richardson."""
    columns = np.stack([np.ones(speed.size), speed], 1)
    weight = np.full(speed.size, 1e-3)

    def cost(at):
        shape = shape_of(name)(np.asarray(speed, np.longdouble), np.exp(np.longdouble(at)))
        return exact_cost(np.concatenate([columns, shape[:, None]], 1), force, weight)

    def central(h):
        return (cost(log_beta + h) - cost(log_beta - h)) / (2 * h)

    h = np.longdouble(2e-3)
    a, b, c = central(h), central(h / 2), central(h / 4)
    d, e = (4 * b - a) / 3, (4 * c - b) / 3
    return float((16 * e - d) / 15)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gaussian", "lorentzian", "exponential"])
@pytest.mark.parametrize(("noise", "points"), [(0.1, None), (1.0, None), (1.0, 64)])
def test_the_minimiser_is_the_root_of_the_derivative(name, noise, points):
    """On the nodes that stand for the samples and, with few grid points, on the samples."""
    friction, bare, rows, velocity, force = problem(name, 0.02, noise=noise)
    box = jnp.asarray([[0.002, 0.002], [0.1, 0.1]])
    found = search(friction, bare, rows, box, points)
    assert bool(found.converged) and not bool(found.on_border)
    for beta, side in zip(
        np.log(np.asarray(found.beta)), (velocity > 0, velocity < 0), strict=True
    ):
        speed, push = np.abs(velocity[side]), np.sign(velocity[side]) * force[side]

        def slope(at, speed=speed, push=push):
            return slope_of_cost(name, speed, push, at)

        root = brentq(slope, beta - 0.02, beta + 0.02, xtol=1e-14, rtol=1e-14)
        assert abs(beta - root) <= 1e-10, (beta, root, beta - root)


@pytest.mark.slow
def test_a_minimum_on_the_border_is_reported_there():
    friction, bare, rows, *_ = problem("gaussian", 0.02)
    for low, high, wanted in ((0.05, 0.1, 0.05), (0.002, 0.01, 0.01)):
        box = jnp.asarray([[low, low], [high, high]])
        found = search(friction, bare, rows, box, None)
        assert bool(found.on_border)
        np.testing.assert_allclose(found.beta, wanted, rtol=1e-12)


@pytest.mark.slow
def test_never_worse_than_the_grid_on_noise_alone():
    """Without a bump the cost is a rugged line: the worst case for a refinement."""
    for seed in range(6):
        friction, bare, rows, velocity, force = problem("gaussian", 0.02, seed, noise=50.0)
        box = jnp.asarray([[0.002, 0.002], [0.1, 0.1]])
        found = search(friction, bare, rows, box, 50)
        assert bool(
            jnp.all((found.beta >= 0.002 * (1 - 1e-12)) & (found.beta <= 0.1 * (1 + 1e-12)))
        )
        for beta, side in zip(found.beta, (velocity > 0, velocity < 0), strict=True):
            speed, push = np.abs(velocity[side]), np.sign(velocity[side]) * force[side]
            columns = np.stack([np.ones(speed.size), speed], 1)
            grid = [*np.geomspace(0.002, 0.1, 50), float(beta)]
            weight = np.full(speed.size, 1e-3)
            costs = reference(speed, push, weight, columns, grid)
            assert costs[-1] <= costs[:-1].min() * (1 + 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gaussian", pytest.param("generalised", marks=pytest.mark.slow)])
def test_single_precision_is_sane(name):
    rng = np.random.default_rng(5)
    time = np.arange(4001) / 1000
    velocity = 0.1 * np.sin(2 * np.pi * time / 4) + 0.03 * np.sin(6 * np.pi * time / 4)
    friction = 10 * np.sign(velocity) + 40 * velocity
    friction = friction + 5 * np.sign(velocity) * np.exp(-((velocity / 0.02) ** 2))
    force = friction + 0.05 * rng.normal(size=time.size)

    def fit(dtype):
        log = jf.Recording(
            time=jnp.asarray(time, dtype),
            force=jnp.asarray(force, dtype),
            velocity=jnp.asarray(velocity, dtype),
        )
        return jf.identify(name, log, projection=jf.ClosedWindows())

    single, double = fit(jnp.float32), fit(jnp.float64)
    assert single.model.alpha.dtype == jnp.float32
    assert result_names()[int(single.result._value)] in ("successful", "on_border")
    for key, estimate in double.parameters.items():
        if key != "inertia":
            gap = abs(float(single.parameters[key].value) - float(estimate.value))
            # The cost is flat to rounding within √ε of its minimum: well inside the uncertainty.
            assert gap <= 0.3 * float(estimate.standard_error) + 1e-3 * abs(float(estimate.value))


@pytest.mark.slow
@pytest.mark.parametrize(
    "points",
    [pytest.param(None, id="nodes"), pytest.param(64, id="samples", marks=pytest.mark.slow)],
)
def test_each_direction_is_searched_inside_its_own_bounds(points):
    friction, bare, rows, *_ = problem("gaussian", 0.02)
    wide, odd = ([[0.002, low], [0.1, high]] for low, high in ((0.002, 0.1), (0.011, 0.3)))
    same = search(friction, bare, rows, jnp.asarray(wide), points)
    other = search(friction, bare, rows, jnp.asarray(odd), points)
    assert not bool(other.on_border)
    np.testing.assert_allclose(other.beta, same.beta, rtol=1e-9)
    held = search(friction, bare, rows, jnp.asarray([[0.002, 0.03], [0.1, 0.3]]), points)
    assert bool(held.on_border)
    np.testing.assert_allclose(held.beta, [same.beta[0], 0.03], rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("points", [None, 64])
def test_the_bumps_of_one_direction_serve_both(points):
    friction, bare, rows, *_ = problem("gaussian", 0.02)
    box = jnp.asarray([[0.002, 0.002], [0.1, 0.1]])
    apart, once = (search(friction, bare, rows, box, points, alike) for alike in (False, True))
    np.testing.assert_allclose(once.beta, apart.beta, rtol=1e-12)


quickly = functools.partial(jax.jit, compiler_options=quick_options())


def tall(kind, rows=6000):
    """Columns some of which products of columns alone do not tell apart."""
    speed = np.random.default_rng(2).uniform(0.1, 0.101 if kind == "narrow" else 1.0, rows)
    columns = [np.ones(rows), speed, np.exp(-((speed / 0.2) ** 2)), np.zeros(rows)]
    if kind == "spanned":
        columns[3] = 3 * columns[0] - 2e-5 * columns[1]
    elif kind == "hidden":
        columns[3] = np.where(np.arange(rows) == 7, 1.0, 0.0)
    elif kind == "close":
        columns[3] = columns[2] + 1e-9 * speed**3
    scales = np.array([1e-6, 1.0, 1e6, 1e3])
    return jnp.asarray(np.stack(columns, axis=1) * scales)


def gram_schmidt(columns):
    """The orthonormal basis, column by column, in more digits than the other way has."""
    rest = np.array(columns, np.longdouble).T
    for i, column in enumerate(rest):
        for _ in range(2):
            column -= rest[:i].T @ (rest[:i] @ column)
        size = np.sqrt(column @ column)
        spanned = size <= 100 * np.finfo(float).eps * np.linalg.norm(columns[:, i])
        rest[i] = 0.0 if spanned else column / size
    return rest.T.astype(float)


@pytest.mark.parametrize("kind", ["plain", "narrow", "spanned", "hidden", "close"])
@pytest.mark.parametrize("rows", [600, 6000])
def test_columns_are_orthonormalised_as_by_gram_schmidt(kind, rows):
    columns = tall(kind, rows)
    basis, slow = quickly(reduced.orthonormal)(columns), gram_schmidt(columns)
    own = np.ones(4) if kind in ("hidden", "close") else np.array([1.0, 1.0, 1.0, 0.0])
    np.testing.assert_allclose(basis.T @ basis, np.diag(own), atol=1e-13)
    # A direction is known as well as what is left of its column: a narrow range leaves 1e-6.
    np.testing.assert_allclose(basis.T @ slow, np.diag(own), atol=1e-7)
    target = columns @ jnp.asarray([1e6, 2.0, 3e-6, 0.0]) + 1e-3
    alpha = quickly(reduced.least_squares)(columns, target)
    np.testing.assert_allclose(columns.T @ (target - columns @ alpha) / 1e6, 0.0, atol=1e-6)
    if own[3] == 0:
        assert alpha[3] == 0


@pytest.mark.parametrize("kind", ["plain", "spanned"])
def test_derivatives_of_a_basis_are_those_of_the_fit(kind):
    columns, few = tall(kind), np.random.default_rng(3)
    target, turn = few.normal(size=len(columns)), jnp.asarray(few.normal(size=columns.shape))
    turn = turn.at[:, 3].set(0.0 if kind == "spanned" else turn[:, 3])

    def explained(step):
        changed = columns * (1 + step * turn)
        changed = changed.at[:, 3].set(changed[:, 0]) if kind == "spanned" else changed
        return jnp.sum((reduced.orthonormal(changed).T @ target) ** 2)

    slope = jax.jit(jax.grad(explained))(0.0)
    ends = [float(jax.jit(explained)(x)) for x in (-1e-4, 1e-4)]
    np.testing.assert_allclose(slope, (ends[1] - ends[0]) / 2e-4, rtol=1e-4)
