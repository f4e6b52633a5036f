"""Where nodes stand for the samples badly, or barely, the samples decide."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.identification import compress, search as searching
from jaxfric.identification.projections import Rows
from jaxfric.programs import quick_options
from jaxfric.terms import Coulomb, Directional, Gaussian, Sum, Viscous

SIZE = 2000
SIGN = np.where(np.arange(SIZE) % 2, 1.0, -1.0)


@functools.cache
def searches(on_nodes: bool):
    """A compiled search, and both directions' costs at any widths, on the samples."""
    term = Sum(tuple(Directional(t, t) for t in (Coulomb(), Viscous(), Gaussian())))

    def run(velocity, force, weight, box):
        clock = 1e-3 * jnp.arange(SIZE, dtype=float)
        log = jf.Recording(time=clock, force=force, velocity=velocity)
        positive, one = jnp.where(velocity > 0, weight, 0.0), jnp.ones(())
        rows = Rows(force, positive, weight - positive, weight, clock, one, one)
        return searching.search(term, log, rows, box, None)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compress, "LEAST_POINTS", 100 if on_nodes else 10**9)
        shapes = [jnp.zeros(SIZE)] * 3 + [jnp.zeros((2, 2))]
        return jax.jit(run).lower(*shapes).compile(compiler_options=quick_options())


def cost(beta, velocity, force, weight):
    """The least cost at widths β of the positive and the negative direction."""
    costs = []
    for width, used in zip(beta, (velocity > 0, velocity < 0), strict=True):
        v, root = np.abs(velocity[used]), np.sqrt(weight[used])
        bump = np.expm1((v.min() - v) * (v.min() + v) / width**2)
        basis = root[:, None] * np.stack([np.ones_like(v), v, bump], axis=1)
        basis = basis / np.maximum(np.linalg.norm(basis, axis=0), 1e-300)
        target = root * force[used]
        costs.append(np.sum((target - basis @ np.linalg.lstsq(basis, target)[0]) ** 2))
    return np.array(costs)


def curve(alpha, beta, data):
    """Friction at the samples, N, by affine parameters in the term's order and the widths."""
    velocity = data[0]
    speed, sign, there = np.abs(velocity), np.sign(velocity), data[2] > 0
    bump = np.exp(-((speed / np.where(velocity > 0, *beta)) ** 2))
    sides = np.asarray(alpha).reshape(3, 2).T
    coulomb, viscous, height = np.where(velocity > 0, *sides[..., None])
    return (sign * (coulomb + viscous * speed + height * bump))[there]


def least_squares(beta, data):
    """The affine parameters at the widths, by a singular value decomposition of the samples."""
    alpha = np.zeros((2, 3))
    for side, (width, used) in enumerate(zip(beta, (data[0] > 0, data[0] < 0), strict=True)):
        v, root = np.abs(data[0][used]), np.sqrt(data[2][used])
        columns = root[:, None] * np.stack([np.ones_like(v), v, np.exp(-((v / width) ** 2))], 1)
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        target = root * np.abs(data[1][used]) * np.sign(data[1][used] * data[0][used])
        alpha[side] = np.linalg.lstsq(columns / size, target)[0] / size
    return alpha.T.ravel()


def case(low, high, width, noise=0.3, logarithmic=False):
    rng = np.random.default_rng(1)
    speed = rng.uniform(low, high, SIZE)
    if logarithmic:
        speed = np.exp(rng.uniform(np.log(low), np.log(high), SIZE))
    friction = 10 + 5 * np.exp(-((speed / width) ** 2)) + 40 * speed
    return SIGN * speed, SIGN * friction + noise * rng.normal(size=SIZE), np.full(SIZE, 1e-3)


def few(data, count):
    """The same with weight on the first samples of each direction only."""
    velocity, force, weight = data
    return velocity, force, np.where(np.arange(SIZE) < 2 * count, weight, 0.0)


CASES = {
    "as usual": (case(1e-3, 0.1, 0.02), 1e-3, 0.1),
    "bounds far below the slowest sample": (case(1e-3, 0.1, 0.02), 1e-5, 0.1),
    "bump over five decades": (case(1e-6, 1.0, 2e-5, logarithmic=True), 1e-6, 0.5),
    "bump narrower than the spacing of nodes": (case(0.05, 1.0, 0.06), 5e-4, 0.5),
    "no slow samples": (case(0.09, 0.1, 0.05), 1e-3, 0.1),
    "noise alone": (case(1e-3, 0.1, 0.02, noise=50.0), 1e-4, 0.1),
    "eight samples a direction": (few(case(1e-3, 0.1, 0.02), 8), 1e-3, 0.1),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_nodes_find_what_the_samples_find(name):
    data, low, high = CASES[name]
    box = jnp.asarray([[low, low], [high, high]])
    found, wanted = (searches(on)(*map(jnp.asarray, data), box) for on in (True, False))
    assert bool(found.converged)
    beta = np.asarray(found.beta)
    assert np.all((beta >= low * (1 - 1e-12)) & (beta <= high * (1 + 1e-12)))
    reached, direct = cost(beta, *data), cost(np.asarray(wanted.beta), *data)
    np.testing.assert_allclose(reached, direct, rtol=1e-10)
    np.testing.assert_allclose(found.minimum, np.sum(reached), rtol=1e-10)
    if name != "noise alone":  # there the cost is flat, and its minimum known to its root
        np.testing.assert_allclose(beta, wanted.beta, rtol=1e-8)
    ours, exact = (curve(a, beta, data) for a in (found.alpha, least_squares(beta, data)))
    np.testing.assert_allclose(ours, exact, atol=1e-9 * np.max(np.abs(data[1])))
    assert wanted.alpha is None
    grid = np.geomspace(low, high, 128)
    assert np.all(reached <= np.min([cost((b, b), *data) for b in grid], axis=0) * (1 + 1e-12))


@pytest.mark.slow
def test_beyond_the_range_of_the_panels_digits_go_gradually():
    """Bounds of a hundred nanometres a second: panels grow tenfold, ten digits of L are left."""
    data = case(1e-3, 0.1, 0.02)
    box = jnp.asarray([[1e-7, 1e-7], [0.1, 0.1]])
    found, wanted = (searches(on)(*map(jnp.asarray, data), box) for on in (True, False))
    np.testing.assert_allclose(found.beta, wanted.beta, rtol=1e-4)
    reached, direct = cost(found.beta, *data), cost(wanted.beta, *data)
    np.testing.assert_allclose(reached, direct, rtol=1e-9)
    beta = np.asarray(found.beta)
    ours, exact = (curve(a, beta, data) for a in (found.alpha, least_squares(beta, data)))
    np.testing.assert_allclose(ours, exact, atol=1e-6 * np.max(np.abs(data[1])))


def test_one_direction_alone():
    velocity, force, weight = case(1e-3, 0.1, 0.02)
    data = np.abs(velocity), SIGN * force, weight
    box = jnp.asarray([[1e-3, 1e-3], [0.1, 0.1]])
    found, wanted = (searches(on)(*map(jnp.asarray, data), box) for on in (True, False))
    np.testing.assert_allclose(found.beta[0], wanted.beta[0], rtol=1e-8)
    assert np.all(np.isfinite(found.beta))
    assert np.all(np.asarray(found.alpha).reshape(3, 2)[:, 1] == 0.0)


def test_nodes_that_lie_are_found_out(monkeypatch):
    def lying(*data):
        true, samples = honest(*data)
        against = true.against[..., ::-1]
        return type(true)(true.shared, true.dual, against, true.weights, true.whole), samples

    honest = compress.compressed
    monkeypatch.setattr(compress, "compressed", lying)
    searches.cache_clear()
    try:
        data = case(1e-3, 0.1, 0.02)
        box = jnp.asarray([[1e-3, 1e-3], [0.1, 0.1]])
        found = searches(True)(*map(jnp.asarray, data), box)
    finally:
        searches.cache_clear()
    assert not bool(found.converged) and np.isinf(found.minimum)


@pytest.mark.slow
def test_fewer_nodes_that_lie_do_not_decide(monkeypatch):
    """They see a bump of three times the width, and propose another point of each stretch."""

    def lying(rows, panels):
        places, few = honest(rows, panels)
        return 3 * places, few

    honest = compress.fewer
    data, low, high = CASES["as usual"]
    box = jnp.asarray([[low, low], [high, high]])
    wanted = searches(True)(*map(jnp.asarray, data), box)
    monkeypatch.setattr(compress, "fewer", lying)
    searches.cache_clear()
    try:
        found = searches(True)(*map(jnp.asarray, data), box)
        monkeypatch.setattr(searching, "STRETCH", 128)
        searches.cache_clear()
        astray = searches(True)(*map(jnp.asarray, data), box)
    finally:
        searches.cache_clear()
    np.testing.assert_allclose(found.beta, wanted.beta, rtol=1e-8)
    assert np.any(np.abs(np.log(np.asarray(astray.beta) / np.asarray(wanted.beta))) > 0.1)
