"""The grid's moments against extended precision, and the compressed nodes against the samples."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxfric.identification import compress, reduced
from jaxfric.terms.friction import Exponential, Gaussian, Generalised, Lorentzian

MOMENTS = jax.jit(reduced.moments)
COSTS = jax.jit(lambda moments, values: moments.costs(values[None, :])[:, 0])
COMPRESSED = jax.jit(compress.compressed)
BUMPS = [Gaussian, Lorentzian, Exponential]


def sample(count, low, high, offset, noise=0.1, seed=0):
    """Speeds and forces of both directions, weights uneven as in a real record."""
    rng = np.random.default_rng(seed)
    speed = low + (high - low) * np.abs(np.sin(rng.uniform(0, np.pi, count)))
    sign = np.where(rng.uniform(size=count) < 0.6, 1.0, -1.0)
    width = 0.2 * high
    force = sign * (3 + 2 * np.exp(-((speed / width) ** 2))) + 5 * sign * speed / high + offset
    force = force + noise * rng.normal(size=count)
    return speed, sign, force, rng.uniform(0.5, 1.0, count)


def rows(speed, sign, force, weight):
    columns = np.stack([sign, sign * speed], axis=1)
    roots = np.sqrt(np.stack([weight * (sign > 0), weight * (sign < 0)]))
    return MOMENTS(*map(jnp.asarray, (columns, force, roots, sign)))


def along(speed, sign, force, weight):
    """Speeds, forces along the motion, and the weights of both directions."""
    weights = np.stack([weight * (sign > 0), weight * (sign < 0)])
    return map(jnp.asarray, (speed, sign * force, weights))


def shape(kind, speed, beta):
    """The bumps in extended precision, written apart from the library."""
    if kind is Gaussian:
        return np.exp(-((speed / beta[0]) ** 2))
    if kind is Lorentzian:
        return 1 / (1 + (speed / beta[0]) ** 2)
    if kind is Exponential:
        return np.exp(-speed / beta[0])
    return np.exp(-((speed / beta[0]) ** beta[1]))


def exact(kind, speed, sign, force, weight, beta):
    """L(β) of both directions by Gram-Schmidt in extended precision, the shape's part last."""
    costs = []
    for side in (1.0, -1.0):
        v, u, w = (x[sign == side].astype(np.longdouble) for x in (speed, side * force, weight))
        least, ratio = v.min(), [np.longdouble(b) for b in beta]
        # The bump less its value at the slowest speed, relative to it: the span is the same, and
        # extended precision is not spent on a common factor.
        bump = shape(kind, v, ratio) / shape(kind, least, ratio) - 1
        if kind is Gaussian:
            bump = np.expm1((least - v) * (least + v) / ratio[0] ** 2)
        basis = []
        for column in (np.ones_like(v), v, bump, u):
            left = column * np.sqrt(w)
            for _ in range(3):
                for q in basis:
                    left = left - q * np.sum(q * left)
            basis.append(left / np.sqrt(np.sum(left**2)))
        costs.append(np.sum(left**2))
    return np.array(costs, float)


@pytest.mark.parametrize("kind", BUMPS)
@pytest.mark.parametrize(
    ("low", "high", "offset", "beta"),
    [
        (1e-3, 0.1, 0.0, 0.02),
        (1e-3, 0.1, 0.0, 3.0),
        (1e-3, 0.1, 1e4, 0.05),
        (0.09, 0.1, 0.0, 0.05),
        (0.02, 0.1, 0.0, 0.003),
    ],
    ids=["plain", "wide bump", "large offset", "narrow speed range", "no slow samples"],
)
def test_cost_keeps_its_digits(kind, low, high, offset, beta):
    data = sample(3000, low, high, offset)
    bump, speed = kind(stribeck_velocity=jnp.asarray(beta)), jnp.asarray(data[0])
    values = bump.contrast(speed, jnp.min(speed))
    found = COSTS(rows(*data), values)
    np.testing.assert_allclose(found, exact(kind, *data, (beta,)), rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [*BUMPS, Generalised])
@pytest.mark.parametrize("count", [2000, 30_000])
@pytest.mark.parametrize(
    ("low", "narrowest"), [(1e-4, 1e-4), (1e-3, 1e-3), (0.02, 0.01)], ids=["3 decades", "2", "fast"]
)
def test_nodes_stand_for_samples(kind, count, low, narrowest):
    data = sample(count, low, 0.1, 0.0, noise=1.0)
    moments, speed = rows(*data), jnp.asarray(data[0])
    slowest = jnp.min(speed)
    panels = compress.edges(slowest, jnp.max(speed), jnp.asarray(narrowest))
    (few, _), places = COMPRESSED(*along(*data), panels), compress.nodes(panels)
    fewer, least = compress.fewer(few, panels)
    assert len(fewer) < 0.5 * len(places)

    def costs(at, moments, beta):
        bump = kind().with_beta(beta)
        return COSTS(moments, bump.contrast(at, slowest))

    widths = np.geomspace(narrowest, 0.1, 9)
    exponents = np.linspace(0.5, 2.0, 9)
    for beta in np.stack([widths, exponents], axis=1)[:, : len(kind.nonlinear)]:
        beta = jnp.asarray(beta)
        np.testing.assert_allclose(
            costs(places, few, beta), costs(speed, moments, beta), rtol=1e-11
        )
        if kind is not Generalised or beta[0] > 2 * narrowest:
            np.testing.assert_allclose(
                costs(fewer, least, beta), costs(speed, moments, beta), rtol=1e-5
            )


@pytest.mark.slow
def test_samples_without_weight_do_not_matter():
    speed, sign, force, weight = sample(2000, 1e-3, 0.1, 0.0)
    panels = compress.edges(*map(jnp.asarray, (1e-3, 0.1, 1e-3)))
    values = jnp.asarray(np.stack([weight, weight * force]))
    side = jnp.asarray((sign < 0).astype(np.int32))
    more = jnp.concatenate([jnp.asarray(speed), jnp.asarray([0.0, 5.0])])
    padded = jnp.pad(values, ((0, 0), (0, 2)))
    np.testing.assert_allclose(
        compress.compress(jnp.asarray(speed), side, values, panels),
        compress.compress(more, jnp.pad(side, (0, 2)), padded, panels),
        rtol=1e-12,
        atol=1e-12,
    )


def test_a_bump_inside_the_span_gains_nothing():
    speed, sign, force, weight = sample(2000, 1e-3, 0.1, 0.0)
    moments = rows(speed, sign, force, weight)
    straight = jnp.asarray(np.stack([np.ones_like(speed), 2 - 7 * speed]))
    np.testing.assert_array_equal(
        moments.costs(straight), np.broadcast_to(moments.whole[:, None], (2, 2))
    )


@pytest.mark.slow
@pytest.mark.parametrize("points", [1, 7, 64, 130])
def test_grid_of_any_size_is_the_same_as_point_by_point(points):
    data = sample(500, 1e-3, 0.1, 0.0)
    moments, speed = rows(*data), jnp.asarray(data[0])
    grid = jnp.linspace(0.01, 0.1, points)[:, None]

    def bump(beta):
        return Gaussian(stribeck_velocity=beta[0]).contrast(speed, jnp.min(speed))

    tiled = reduced.grid_costs(bump, grid, moments)
    single = jax.vmap(lambda b: moments.costs(bump(b)[None, :])[:, 0])(grid).T
    np.testing.assert_allclose(tiled, single, rtol=1e-12)
