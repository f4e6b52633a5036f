"""Friction inside a larger pipeline: an unknown load, a small network, trained around the fit.

Something pushes an axis along its travel (a cable carrier, a valve spring), so that friction is
identified wrongly. A network of the position models the push; in every optax step `jf.identify`
gives the friction that is best beside it, and only the network is trained (variable projection
over the border between a library and a network). What is left of the force is the loss.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import optax

import jaxfric as jf

RATE, SECONDS, TRAVEL = 500.0, 12.0, 0.08
TRUTH = {"coulomb+": 12.0, "viscous+": 30.0, "stribeck_force+": 4.0, "stribeck_velocity+": 0.02}
TRUTH |= {"coulomb-": 11.0, "viscous-": 36.0, "stribeck_force-": 5.0, "stribeck_velocity-": 0.03}
UNITS, STEPS = 12, 200


def push(x):
    """The true load, N: stiff at one end of the travel, a bump in the middle; mean taken off."""
    return 6 * np.exp((x - TRAVEL) / 0.02) - 3 * np.exp(-((x / 0.015) ** 2))


def record(seed: int = 0) -> tuple[jf.Recording, np.ndarray]:
    """A recording with friction, a little mass, noise and the load; and the load alone."""
    time = np.arange(round(SECONDS * RATE) + 1) / RATE
    base = 2 * np.pi / SECONDS
    parts = ((3, 0.06, 0.3), (7, 0.012, 1.1), (17, 0.006, 2.0))
    x = sum(a * np.sin(n * base * time + p) for n, a, p in parts)
    v = sum(a * n * base * np.cos(n * base * time + p) for n, a, p in parts)
    dv = -sum(a * (n * base) ** 2 * np.sin(n * base * time + p) for n, a, p in parts)
    term = jf.models.gaussian()
    model = jf.models.from_parameters(term, TRUTH | {"inertia": 3.0})
    bare = jf.Recording(time, np.zeros_like(time), x, v)
    noise = np.random.default_rng(seed).normal(0, 0.3, time.size)
    force = np.asarray(model.force(bare)) + 3.0 * dv + push(x) + noise
    return dataclasses.replace(bare, force=jnp.asarray(force)), push(x)


def start(key):
    """Weights of a network with one hidden layer, small at first."""
    inner, outer = jax.random.split(key)
    return {
        "slope": 4 * jax.random.normal(inner, (UNITS,)),
        "shift": jnp.linspace(-3.0, 3.0, UNITS),
        "height": 0.1 * jax.random.normal(outer, (UNITS,)),
    }


def network(weights, x):
    """The load at positions, N; without its mean, which Coulomb friction cannot be told from."""
    hidden = jnp.tanh(x[:, None] / TRAVEL * weights["slope"][None, :] + weights["shift"][None, :])
    load = 10 * hidden @ weights["height"]
    return load - jnp.mean(load)


def fit(weights, log: jf.Recording) -> jf.Identified:
    """The friction beside a load."""
    rest = log.force - network(weights, log.position)
    left = dataclasses.replace(log, force=rest)
    # A load that depends on position is not orthogonal to acceleration: the mass is fitted too.
    return jf.identify("gaussian", left, projection=jf.WeakForm(12))


def worst(found: jf.Identified) -> float:
    """The largest relative error of the friction force over the speeds of the record."""
    speeds = np.concatenate([-np.geomspace(0.14, 0.004, 30), np.geomspace(0.004, 0.14, 30)])
    true = jf.models.from_parameters(jf.models.gaussian(), TRUTH | {"inertia": 3.0})
    exact = np.asarray(true.friction(jnp.asarray(speeds)))
    return float(np.max(np.abs(np.asarray(found.model.friction(jnp.asarray(speeds))) / exact - 1)))


def main() -> dict[str, float]:
    """Train the load around the friction; report both before and after."""
    log, load = record()
    weights = start(jax.random.key(0))
    slope = jax.jit(jax.value_and_grad(lambda w: jnp.log(fit(w, log).cost)))
    rule = optax.adam(optax.cosine_decay_schedule(0.05, STEPS))
    state = rule.init(weights)
    for _ in range(STEPS):
        _, change = slope(weights)
        change, state = rule.update(change, state)
        weights = optax.apply_updates(weights, change)
    nothing = jax.tree.map(jnp.zeros_like, weights)
    before, after = (worst(fit(w, log)) for w in (nothing, weights))
    wanted = load - np.mean(load)
    error = np.asarray(network(weights, log.position)) - wanted
    share = float(np.sqrt(np.mean(error**2) / np.mean(wanted**2)))
    print(f"friction wrong by at most {before:.1%} without, {after:.1%} with the load trained")
    print(f"root mean square error of the load {share:.1%} of its own")
    return {"before": before, "after": after, "load": share}


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
