"""Derivatives of an identification against closed forms, finite differences, and their cost."""

import dataclasses
import functools
import time

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxfric as jf
from jaxfric.identification.assessment import solve
from jaxfric.identification.projections import Rows
from jaxfric.identification.search import search
from jaxfric.programs import quick_options
from jaxfric.terms import Coulomb, Directional, Gaussian, Lorentzian, Sum, Viscous

# Many programs that run once: compiled quickly.
jit = functools.partial(jax.jit, compiler_options=quick_options())
SIZE = 400
BOX = np.array([[0.004, 0.004], [0.1, 0.1]])


def affine():
    """Each direction's Coulomb and viscous friction."""
    return Sum(tuple(Directional(t, t) for t in (Coulomb(), Viscous())))


def bumped(kind=Gaussian):
    return Sum(tuple(Directional(t, t) for t in (Coulomb(), Viscous(), kind())))


@pytest.fixture(scope="module")
def data():
    """Velocity, force and weights of rows in both directions of slip."""
    rng = np.random.default_rng(3)
    sign = np.where(np.arange(SIZE) % 2, 1.0, -1.0)
    velocity = sign * rng.uniform(0.003, 0.15, SIZE)
    force = sign * (10 + 5 * np.exp(-((velocity / 0.03) ** 2))) + 40 * velocity
    force = force + 0.3 * rng.normal(size=SIZE)
    return tuple(map(jnp.asarray, (velocity, force, rng.uniform(0.5, 1.5, SIZE) * 1e-3)))


def fit(term, velocity, force, weight, box=BOX):
    """Affine parameters and Stribeck velocities of problem (L) on those rows."""
    clock = 1e-3 * jnp.arange(velocity.shape[0], dtype=float)
    log = jf.Recording(time=clock, force=force, velocity=velocity)
    positive = jnp.where(velocity > 0, weight, 0.0)
    one = jnp.ones(())
    box = jnp.asarray(box)
    rows = Rows(force, positive, weight - positive, weight, clock, one, one)
    found = search(term, log, rows, box[:, : len(term.nonlinear)], None)
    return jnp.concatenate([solve(term, found.beta, log, rows)[0], found.beta])


def slopes(term, data):
    """∂(α, β) by velocity, force and weight, each `(p, N)`, in reverse."""
    return jit(jax.jacrev(lambda *d: fit(term, *d), argnums=(0, 1, 2)))(*data)


@pytest.fixture(scope="module")
def gaussian(data):
    return slopes(bumped(), data)


def test_affine_models_against_the_closed_form(data):
    """α = (AᵀWA)⁻¹ AᵀW u, eq. (19): by u it is that matrix, by a weight (AᵀWA)⁻¹ aᵢ rᵢ."""
    velocity, force, weight = map(np.asarray, data)
    up, down = velocity > 0, velocity < 0
    columns = np.stack([1.0 * up, -1.0 * down, velocity * up, velocity * down], axis=1)
    inverse = np.linalg.inv(columns.T @ (weight[:, None] * columns))
    alpha = inverse @ columns.T @ (weight * force)
    left = force - columns @ alpha
    # By a velocity: of the column that holds it, 1 in the viscous one of its direction.
    moved = np.stack([0 * up, 0 * down, 1.0 * up, 1.0 * down], axis=1)
    by_velocity = inverse @ (moved * (weight * left)[:, None] - columns * weight[:, None] * (
        moved @ alpha)[:, None]).T  # fmt: skip
    assert [p.name for p in affine().affine] == ["coulomb+", "coulomb-", "viscous+", "viscous-"]
    found = slopes(affine(), data)
    exact = (by_velocity, inverse @ (weight[:, None] * columns).T, inverse @ (columns.T * left))
    for a, b in zip(found, exact, strict=True):
        scale = np.abs(b).max(axis=1, keepdims=True)
        np.testing.assert_allclose(a / scale, b / scale, atol=1e-9)


def stationary(velocity, force, weight, theta):
    """∂θ/∂u of one direction's Gaussian model: H⁻¹ JᵀW, H the full Hessian of the cost."""
    shape = np.exp(-((velocity / theta[3]) ** 2))
    slope = 2 * velocity**2 / theta[3] ** 3
    first = np.stack([np.ones_like(velocity), velocity, shape, theta[2] * shape * slope], 1)
    left = force - first[:, :3] @ theta[:3]
    hessian = first.T @ (weight[:, None] * first)
    mixed = np.sum(weight * left * shape * slope)
    curved = np.sum(weight * left * theta[2] * shape * (slope**2 - 3 * slope / theta[3]))
    hessian[2, 3] -= mixed
    hessian[3, 2] -= mixed
    hessian[3, 3] -= curved
    inverse = np.linalg.inv(hessian)
    return inverse @ (first * weight[:, None]).T, inverse @ (first * left[:, None]).T


@pytest.mark.slow
def test_the_bump_against_the_implicit_function_theorem(data, gaussian):
    """The same derivative from all four normal equations of a direction, written by hand."""
    term = bumped()
    _, by_force, by_weight = gaussian
    names = [p.name for p in (*term.affine, *term.nonlinear)]
    theta = dict(zip(names, np.asarray(jit(lambda *d: fit(term, *d))(*data)), strict=True))
    velocity, force, weight = map(np.asarray, data)
    kinds = ("coulomb", "viscous", "stribeck_force", "stribeck_velocity")
    for sign, used in (("+", velocity > 0), ("-", velocity < 0)):
        along = 1.0 if sign == "+" else -1.0
        values = np.array([theta[kind + sign] for kind in kinds])
        exact, exact_weight = stationary(
            along * velocity[used], along * force[used], weight[used], values
        )
        index = [names.index(kind + sign) for kind in kinds]
        for found, wanted in ((by_force, along * exact), (by_weight, exact_weight)):
            part = np.asarray(found)[index]
            scale = np.abs(wanted).max(axis=1, keepdims=True)
            np.testing.assert_allclose(part[:, used] / scale, wanted / scale, atol=1e-7)
            np.testing.assert_allclose(part[:, ~used] / scale, 0.0, atol=1e-9)


@pytest.mark.parametrize("kind", [Gaussian, pytest.param(Lorentzian, marks=pytest.mark.slow)])
def test_every_argument_against_finite_differences(data, gaussian, kind):
    term, rng = bumped(kind), np.random.default_rng(0)
    run = jit(lambda *d: fit(term, *d))
    found = gaussian if kind is Gaussian else slopes(term, data)
    for i, size in enumerate((1e-4, 1e-3, 1e-6)):
        direction = size * rng.uniform(-1, 1, SIZE)
        if i == 0:
            direction = direction * np.asarray(data[0])  # no row changes its direction of slip

        def moved(amount, i=i, direction=direction):
            return run(*(d + amount * direction if i == j else d for j, d in enumerate(data)))

        # Richardson's extrapolation of central differences.
        coarse, fine = ((moved(h) - moved(-h)) / (2 * h) for h in (1.0, 0.5))
        np.testing.assert_allclose(found[i] @ direction, (4 * fine - coarse) / 3, rtol=1e-5)


@pytest.mark.slow
def test_on_the_border_the_parameter_does_not_move_and_the_others_do(data):
    box = jnp.asarray([[0.05, 0.004], [0.1, 0.1]])  # above the positive direction's 0.03
    term = bumped()
    names = [p.name for p in (*term.affine, *term.nonlinear)]
    velocity, force, weight = data
    by_force = jit(jax.jacrev(lambda f: fit(term, velocity, f, weight, box)))(force)
    held, free = (names.index(f"stribeck_velocity{sign}") for sign in "+-")
    assert float(jit(lambda *d: fit(term, *d, box))(*data)[held]) == pytest.approx(0.05, rel=1e-12)
    np.testing.assert_array_equal(by_force[held], 0.0)
    assert float(jnp.max(jnp.abs(by_force[free]))) > 0
    # With β given, the positive direction is an affine model.
    up = np.asarray(velocity) > 0
    v = np.asarray(velocity)[up]
    columns = np.stack([np.ones_like(v), v, np.exp(-((v / 0.05) ** 2))], axis=1)
    inner = np.asarray(weight)[up][:, None] * columns
    exact = np.linalg.solve(columns.T @ inner, inner.T)
    index = [names.index(f"{kind}+") for kind in ("coulomb", "viscous", "stribeck_force")]
    scale = np.abs(exact).max(axis=1, keepdims=True)
    np.testing.assert_allclose(np.asarray(by_force)[index][:, up] / scale, exact / scale, atol=1e-8)


@pytest.mark.slow
def test_the_bounds_move_the_parameter_on_the_border_and_no_other(data):
    term = bumped()

    def betas(low, high):
        return fit(term, *data, jnp.stack([low, high]))[-2:]

    low, high = jnp.asarray([0.05, 0.004]), jnp.asarray([0.1, 0.1])
    by_low, by_high = jit(jax.jacfwd(betas, argnums=(0, 1)))(low, high)
    np.testing.assert_allclose(by_low, [[1.0, 0.0], [0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(by_high, 0.0, atol=1e-9)


@pytest.mark.slow
def test_transformations_agree(data):
    term = bumped()
    velocity, force, weight = data

    def total(force):
        return jnp.sum(jnp.log(fit(term, velocity, force, weight)))

    slope = jit(jax.grad(total))(force)
    forces = jnp.stack([force, force + 0.1])
    np.testing.assert_allclose(jit(jax.vmap(jax.grad(total)))(forces)[0], slope, rtol=1e-9)
    direction = jnp.cos(jnp.arange(SIZE, dtype=float))
    forward = jit(lambda f, d: jax.jvp(total, (f,), (d,))[1])(force, direction)
    np.testing.assert_allclose(forward, slope @ direction, rtol=1e-9)


@pytest.mark.slow
def test_second_derivatives_follow_the_minimiser(data):
    velocity, force, weight = data
    direction = jnp.cos(jnp.arange(SIZE, dtype=float))

    def along(amount):
        moved = fit(bumped(), velocity, force + amount * direction, weight * jnp.exp(amount))
        return jnp.sum(moved)

    slope, step = jit(jax.grad(along)), 1e-4
    numeric = (slope(step) - slope(-step)) / (2 * step)
    np.testing.assert_allclose(jit(jax.hessian(along))(0.0), numeric, rtol=1e-6)


@pytest.mark.slow
def test_a_gradient_costs_a_few_evaluations(data):
    """No loop of the search is differentiated: a fit on nodes beside its value and gradient."""
    term, count = bumped(), 20_000
    data = tuple(jnp.resize(x, count) for x in data)

    def total(*data):
        return jnp.sum(fit(term, *data))

    # The data are arguments: of constants XLA would do a part of one program when it compiles it.
    plain, graded = (
        jax.jit(f).lower(*data).compile() for f in (total, jax.value_and_grad(total, (0, 1, 2)))
    )

    def seconds(program):
        start = time.process_time()
        jax.block_until_ready(program(*data))
        return time.process_time() - start

    pairs = [(seconds(plain), seconds(graded)) for _ in range(7)]
    once, both = np.min(pairs, axis=0)
    assert both < 10 * once, (once, both)


def swing(seconds=3.0, rate=500.0):
    t = np.arange(int(seconds * rate) + 1) / rate
    x = 0.05 * np.sin(2 * np.pi * t / seconds) + 0.02 * np.sin(6 * np.pi * t / seconds)
    v = np.gradient(x, t)
    force = np.sign(v) * (10 + 5 * np.exp(-((v / 0.03) ** 2))) + 40 * v
    force = force + 0.2 * np.random.default_rng(0).normal(size=t.size)
    # Not a whole period: where first and last velocity are equal, the longest window has a kink.
    return jf.Recording(*(signal[65:-110] for signal in (t, force, x, v)))


@pytest.mark.slow
@pytest.mark.parametrize("signal", ["force", "velocity", "position"])
def test_identify_by_its_signals(signal):
    """`identify` as users call it: windows, weights and scales depend on the velocity too."""
    log = swing()
    if signal == "position":  # the velocity is then its smoothing derivative
        log = dataclasses.replace(log, velocity=None)
    wave = jnp.sin(40 * log.time) * {"force": 1.0, "velocity": 1e-3, "position": 1e-4}[signal]

    def parameters(amount):
        moved = eqx.tree_at(lambda r: getattr(r, signal), log, getattr(log, signal) + amount * wave)
        found = jf.identify("gaussian", moved, projection=jf.ClosedWindows())
        return jnp.concatenate([found.model.alpha[1:], found.model.term.beta()])

    run, slope = jit(parameters), jit(jax.jacfwd(parameters))(0.0)
    coarse, fine = ((run(h) - run(-h)) / (2 * h) for h in (2e-3, 1e-3))
    np.testing.assert_allclose(slope, (4 * fine - coarse) / 3, rtol=5e-3, atol=1e-3)
    np.testing.assert_allclose(jit(jax.jacrev(parameters))(0.0), slope, rtol=1e-7, atol=1e-9)
