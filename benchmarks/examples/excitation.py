"""Excitation design: the motion from which friction is best identified, found by gradient descent.

What a motion will tell about the friction is known before it is made: the covariance of the
parameters is σ² (∫ J Jᵀ dt)⁻¹, J the derivative of the friction force by them, all of it library
columns. The amplitudes of a multisine are trained (A-optimal: the sum of the relative variances)
under limits of speed, acceleration and travel; then both motions are "recorded" and identified.
"""

import jax
import jax.numpy as jnp
import numpy as np
import optax

import jaxfric as jf

PERIOD, RATE, HARMONICS = 4.0, 500.0, 8
FASTEST, HARDEST, TRAVEL = 0.2, 2.0, 0.05  # m/s, m/s², m to each side
NOISE = 0.5  # N
TRUTH = {"coulomb": 12.0, "viscous": 45.0, "stribeck_force": 5.0, "stribeck_velocity": 0.012}
STEPS, REPEATS = 150, 24


def axis() -> jf.Model:
    """A symmetric axis, its parameters as good as a first guess has to be."""
    values = {"offset": 0.0, "inertia": 5.0} | TRUTH
    return jf.models.from_parameters(jf.models.named("symmetric-gaussian"), values)


def motion(coefficients):
    """Position, velocity and acceleration of a multisine, scaled so that it just keeps its limits.

    `coefficients`: of cosines and sines, `(2, HARMONICS)`.
    """
    time = jnp.arange(round(PERIOD * RATE) + 1, dtype=float) / RATE
    rate = 2 * jnp.pi / PERIOD * jnp.arange(1, HARMONICS + 1, dtype=float)[:, None]
    phase = rate * time[None, :]
    cosine, sine = jnp.cos(phase), jnp.sin(phase)
    a, b = coefficients[0] @ cosine, coefficients[1] @ sine
    v = coefficients[1] @ (rate * cosine) - coefficients[0] @ (rate * sine)
    dv = -(coefficients[0] @ (rate**2 * cosine)) - coefficients[1] @ (rate**2 * sine)
    x = a + b
    scale = 1 / jnp.max(
        jnp.stack([jnp.max(jnp.abs(x)) / TRAVEL, jnp.max(jnp.abs(v)) / FASTEST,
                   jnp.max(jnp.abs(dv)) / HARDEST])
    )  # fmt: skip
    return time, scale * x, scale * v, scale * dv


def relative_errors(coefficients, model: jf.Model):
    """Standard error of each friction parameter over its value, expected from a motion."""
    time, x, v, _ = motion(coefficients)
    log = jf.Recording(time, jnp.zeros_like(time), x, v)
    names = [p.name for p in model.term.affine]
    kept = np.array([names.index(name) for name in list(TRUTH)[:3]])

    def force(beta):
        return model.term.with_beta(beta).columns(log) @ model.alpha

    affine = model.term.columns(log)[:, kept]
    offset = jnp.ones_like(v)[:, None]  # identified too, and not judged
    jacobian = jnp.concatenate([affine, jax.jacfwd(force)(model.term.beta()), offset], axis=1)
    size = jnp.asarray([*TRUTH.values(), 1.0])
    scaled = jacobian * size[None, :] / NOISE
    return jnp.sqrt(jnp.diagonal(jnp.linalg.inv(scaled.T @ scaled)))[:-1]


def design(start, model: jf.Model):
    """Coefficients after gradient descent on the logarithm of the summed relative variances."""

    def cost(coefficients):
        return jnp.log(jnp.sum(relative_errors(coefficients, model) ** 2))

    rule = optax.adam(optax.cosine_decay_schedule(0.05, STEPS))

    def step(carry, _):
        coefficients, state = carry
        change, state = rule.update(jax.grad(cost)(coefficients), state)
        return (optax.apply_updates(coefficients, change), state), None

    return jax.lax.scan(step, (start, rule.init(start)), length=STEPS)[0][0]


def scatter(coefficients, model: jf.Model):
    """Relative root mean square error of each parameter over identified noisy recordings."""
    time, x, v, acceleration = motion(coefficients)
    bare = jf.Recording(time, jnp.zeros_like(time), x, v)
    force = model.force(bare) + model.parameters["inertia"] * acceleration
    noise = NOISE * jax.random.normal(jax.random.key(0), (REPEATS, time.size))
    logs = jf.stack([jf.Recording(time, force + each, x, v) for each in noise])
    found = jf.identify(model, logs, projection=jf.ClosedWindows()).parameters
    off = [np.asarray(found[name].value) / value - 1 for name, value in TRUTH.items()]
    return np.sqrt(np.mean(np.square(off), axis=1))


def main() -> dict[str, np.ndarray]:
    """Design, and compare with the start: a plain sine."""
    model = axis()
    start = jnp.zeros((2, HARMONICS)).at[1, 0].set(1.0).at[0, 1:].set(0.01)
    best = jax.jit(lambda start: design(start, model))(start)
    expected = [np.asarray(relative_errors(c, model)) for c in (start, best)]
    seen = [scatter(c, model) for c in (start, best)]
    print(
        f"{'relative error':18} {'sine':>18} {'designed':>18}   expected (over {REPEATS} records)"
    )
    for i, name in enumerate(TRUTH):
        cells = [f"{e[i]:8.2%} ({s[i]:6.2%})" for e, s in zip(expected, seen, strict=True)]
        print(f"{name:18} {cells[0]:>18} {cells[1]:>18}")
    return {"coefficients": best, "expected": np.stack(expected), "seen": np.stack(seen)}


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
