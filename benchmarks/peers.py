"""One axis as the benchmarks see it, and what users would run on it instead of jaxfric.

The peers get the samples in slip, each direction on its own, which is kind to them; `fit` of each
returns the summed cost of both directions, N²·s, and both Stribeck velocities.
"""

import os

import jax
import jax.numpy as jnp
import numpy as np
import scipy.optimize

from jaxfric.data.recording import Recording
from jaxfric.identification import reduced
from jaxfric.identification.assessment import solve
from jaxfric.identification.projections import ClosedWindows
from jaxfric.identification.search import search
from jaxfric.identification.solving import without_inertia
from jaxfric.models import named
from jaxfric.signals import prepare, scales
from jaxfric.terms.base import bounds

SHORT = bool(os.environ.get("JAXFRIC_BENCH_SHORT"))
TRUTH = 0.015


rows_of = jax.jit(ClosedWindows().rows)


def axis(samples, seed=0):
    """A recording of an axis that swings ten times, with noise of 0.5 N on its force."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) * 1e-3
    velocity = 0.1 * np.sin(20 * np.pi * time / time[-1])
    slip = 10 + 6 * np.exp(-((velocity / TRUTH) ** 2))
    force = np.sign(velocity) * slip + 40 * velocity + rng.normal(0, 0.5, samples)
    return Recording(time=time, force=force, velocity=velocity)


def problem(samples, name="gaussian"):
    """Term, prepared recording, rows and bounds of problem (L)."""
    ready = prepare(axis(samples))
    size = scales(ready)
    rows = rows_of(ready, size)
    term = without_inertia(named(name))
    return term, ready, rows, bounds(term, size)


def again(samples, seed):
    """Prepared recording, rows and bounds of another axis of the same kind."""
    ready = prepare(axis(samples, seed))
    size = scales(ready)
    return (
        ready,
        rows_of(ready, size),
        bounds(without_inertia(named("gaussian")), size),
    )


def directions(ready, rows):
    """Speed, force along the motion and root weight of each direction's samples, as arrays."""
    for weight, sign in ((rows.positive, 1.0), (rows.negative, -1.0)):
        used = np.asarray(weight > 0)
        speed, force = (sign * np.asarray(x)[used] for x in (ready.velocity, rows.target))
        yield speed, force, np.sqrt(np.asarray(weight)[used])


def jaxfric_fit(term, ready, rows, box, grid=None):
    """Grid, refinement and affine parameters in one program."""
    found = search(term, ready, rows, box, grid, True)
    if found.minimum is not None:
        return found.minimum, found.beta, found.alpha
    alpha, _, left = solve(term, found.beta, ready, rows, found.alpha)
    weight = rows.positive + rows.negative
    return jnp.sum(weight * left**2), found.beta, alpha


def naive_costs(speed, force, root, betas):
    """The grid as one writes it first: every β its own (N, 3) basis, D, h and solve."""

    def cost(beta):
        bump = jnp.exp(-((speed / beta) ** 2))
        basis = root[:, None] * jnp.stack([jnp.ones_like(speed), speed, bump], axis=1)
        target = root * force
        gram, along = basis.T @ basis, basis.T @ target
        return target @ target - along @ jnp.linalg.solve(gram, along)

    return jax.vmap(cost)(betas)


def moment_costs(speed, force, root, betas):
    """The same grid by the library."""
    from jaxfric.terms.friction import Gaussian

    columns, slowest = jnp.stack([jnp.ones_like(speed), speed], axis=1), jnp.min(speed)
    rows = reduced.moments(columns, force, root[None, :])
    return reduced.grid_costs(
        lambda b: Gaussian(stribeck_velocity=b[0]).ratio(speed, slowest), betas[:, None], rows
    )[0]


def floor(speed, betas):
    """As many exponentials, and nothing but their sum."""
    return jax.lax.map(lambda beta: jnp.sum(jnp.exp(-((speed / beta) ** 2))), betas)


def model(p, speed):
    bump = np.exp(-((speed / p[3]) ** 2))
    return p[0] + p[1] * speed + p[2] * bump, bump


def residuals(p, speed, force, root):
    return root * (model(p, speed)[0] - force)


def jacobian(p, speed, force, root):
    bump = model(p, speed)[1]
    last = p[2] * bump * 2 * speed**2 / p[3] ** 3
    return root[:, None] * np.stack([np.ones_like(speed), speed, bump, last], axis=1)


def _summed(fits):
    costs, betas = zip(*fits, strict=True)
    return sum(costs), np.array(betas)


def _least_squares(sides, starts, **options):
    def one(side):
        tries = [
            scipy.optimize.least_squares(
                residuals, [10, 40, 5, b], jacobian, args=side, x_scale=[10, 40, 5, b], **options
            )
            for b in starts
        ]
        best = min(tries, key=lambda found: found.cost)
        return 2 * best.cost, abs(best.x[3])

    return _summed(map(one, sides))


def scipy_one_start(sides):
    return _least_squares(sides, [1.3 * TRUTH], method="lm")


def scipy_five_starts(sides):
    box = ([-np.inf] * 3 + [1e-4], [np.inf] * 3 + [0.1])
    return _least_squares(sides, np.geomspace(2e-3, 0.08, 5), method="trf", bounds=box)


def lmfit_five_starts(sides):
    import lmfit

    def one(side):
        tries = []
        for start in np.geomspace(2e-3, 0.08, 5):
            guess = lmfit.Parameters()
            for name, value in zip("acbv", (10, 40, 5, start), strict=True):
                guess.add(name, value, min=1e-4 if name == "v" else -np.inf)
            call = lambda p: residuals(list(p.valuesdict().values()), *side)  # noqa: E731
            tries.append(lmfit.minimize(call, guess))
        best = min(tries, key=lambda found: found.chisqr)
        return best.chisqr, best.params["v"].value

    return _summed(map(one, sides))


def numpy_variable_projection(sides, points=100):
    """A vectorised grid of 100 points by normal equations, then a bounded scalar search."""

    def one(side):
        speed, force, root = side
        linear = root[:, None] * np.stack([np.ones_like(speed), speed], axis=1)
        basis = np.linalg.qr(linear)[0]
        target = root * force
        target = target - basis @ (basis.T @ target)

        def costs(betas):
            bump = root * np.exp(-((speed / betas[:, None]) ** 2))
            bump = bump - (bump @ basis) @ basis.T
            return target @ target - (bump @ target) ** 2 / np.sum(bump**2, axis=1)

        grid = np.geomspace(1e-3, 0.05, points)
        pieces = np.array_split(grid, max(1, points * len(speed) // 10**6))
        i = int(np.clip(np.argmin(np.concatenate([costs(p) for p in pieces])), 1, points - 2))
        found = scipy.optimize.minimize_scalar(
            lambda beta: costs(np.array([beta]))[0],
            bounds=(grid[i - 1], grid[i + 1]),
            method="bounded",
            options={"xatol": 1e-10},
        )
        return found.fun, found.x

    return _summed(map(one, sides))


def root_of_derivative(sides, near):
    """Stribeck velocities where dL/dβ = 0, by Brent's method on an analytic derivative."""

    def one(side, near):
        speed, force, root = side

        def slope(log_beta):
            beta = np.exp(log_beta)
            bump = np.exp(-((speed / beta) ** 2))
            basis = root[:, None] * np.stack([np.ones_like(speed), speed, bump], axis=1)
            alpha = np.linalg.lstsq(basis, root * force)[0]
            left = root * force - basis @ alpha
            # At the best amplitudes dL/dβ is the partial derivative: the envelope theorem.
            return -2 * left @ (root * alpha[2] * bump * 2 * (speed / beta) ** 2)

        low, high = np.log(near) - 1e-3, np.log(near) + 1e-3
        return np.exp(scipy.optimize.brentq(slope, low, high, xtol=1e-15, rtol=1e-14))

    return np.array([one(s, b) for s, b in zip(sides, near, strict=True)])
