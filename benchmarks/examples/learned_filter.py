"""A learned velocity filter: its width and delay trained through identification.

A drive logs encoder counts and, some milliseconds late, its force. The velocity filter is a
Gaussian derivative with two parameters, width and delay, both continuous. They are judged by
what matters: friction identified from one recording has to predict the force of another. The
gradient of that error passes through `jf.identify`, whose minimiser is differentiated implicitly.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import optax

import jaxfric as jf

RATE, SECONDS = 1000.0, 6.0
DELAY = 3.4e-3  # s, by which the force is late
RESOLUTION = 2e-5  # m per count: 20 mm/s from one sample to the next
REACH = 40  # samples of the filter to each side
SLIP = 0.01  # m/s
# Width and delay to begin with, s. Descent is local: where the delay is too short, the best bump
# has a negative height, a valley of its own. So it starts later than any drive is.
START = 4e-3, 7e-3
STEPS = 40


def record(seed: int) -> jf.Recording:
    """Counts of an encoder and a late, noisy force; the motion differs with the seed."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(SECONDS * RATE) + 1) / RATE
    phase = rng.uniform(0, 2 * np.pi, 3)
    harmonics, sizes = np.array([2, 5, 9]), np.array([0.04, 0.015, 0.006])
    rate = 2 * np.pi * harmonics / SECONDS

    def motion(t):
        angle = rate[:, None] * t[None, :] + phase[:, None]
        return (
            sizes @ np.sin(angle),
            (sizes * rate) @ np.cos(angle),
            -(sizes * rate**2) @ np.sin(angle),
        )

    x, _, _ = motion(time)
    _, v, a = motion(time - DELAY)
    friction = np.sign(v) * (10 + 5 * np.exp(-((v / 0.02) ** 2))) + 40 * v
    force = friction + 8.0 * a + rng.normal(0, 0.3, time.size)
    counts = RESOLUTION * np.round(x / RESOLUTION)
    return jf.Recording(time, force, counts, source=f"axis {seed}")


def derivative(signal, width, delay, order: int):
    """A derivative of a signal, smoothed by a Gaussian of that width, s, and that much later, s."""
    place = jnp.arange(-REACH, REACH + 1, dtype=float) / RATE - delay
    bell = jnp.exp(-0.5 * (place / width) ** 2)
    bell = bell / jnp.sum(bell)
    hermite = (1.0, -place / width**2, (place**2 - width**2) / width**4)[order]
    return jnp.convolve(signal, hermite * bell, mode="valid")


def filtered(log: jf.Recording, width, delay) -> jf.Recording:
    """The recording with its motion filtered and as late as its force."""
    inner = jax.tree.map(lambda signal: signal[REACH:-REACH], log)
    level, velocity = (derivative(log.position, width, delay, order) for order in (0, 1))
    return dataclasses.replace(inner, velocity=velocity, position=level)


def loss(parameters, train: jf.Recording, held: jf.Recording):
    """Relative error of the held-out force, predicted by friction and mass from the other log."""
    width, delay = jnp.exp(parameters["log_width"]), parameters["delay"]
    found = jf.identify("gaussian", filtered(train, width, delay), projection=jf.ClosedWindows())
    motion = filtered(held, width, delay)
    mass = found.model.parameters["inertia"]
    predicted = found.model.force(motion) + mass * derivative(held.position, width, delay, 2)
    # Judged in slip, by a velocity that is the same whatever the filter.
    judged = jnp.abs(filtered(held, 5e-3, 0.0).velocity) > SLIP
    left = jnp.where(judged, motion.force - predicted, 0.0)
    return jnp.sqrt(jnp.sum(left**2) / jnp.sum(jnp.where(judged, motion.force, 0.0) ** 2))


def main() -> dict[str, float]:
    """Train width and delay; report where they end."""
    train, held = record(0), record(1)
    parameters = {"log_width": jnp.log(START[0]), "delay": jnp.asarray(START[1])}
    slope = jax.jit(jax.value_and_grad(loss))
    scale = {"log_width": 0.1, "delay": 3e-4}
    rule = optax.adam(optax.cosine_decay_schedule(1.0, STEPS))
    state, history = rule.init(parameters), []
    for _ in range(STEPS):
        value, change = slope(parameters, train, held)
        history.append(float(value))
        # In units of a typical step: the two differ by orders of magnitude.
        change, state = rule.update({k: v * scale[k] for k, v in change.items()}, state)
        parameters = {k: v + scale[k] * change[k] for k, v in parameters.items()}
    last = float(slope(parameters, train, held)[0])
    width, delay = float(jnp.exp(parameters["log_width"])), float(parameters["delay"])
    for name, first, end in (("width", START[0], width), ("delay", START[1], delay)):
        print(f"{name} {1e3 * first:.2f} -> {1e3 * end:.2f} ms", end="; ")
    print(f"the true delay is {1e3 * DELAY:.2f} ms")
    print(f"held-out force error {history[0]:.2%} -> {last:.2%}")
    return {"width": width, "delay": delay, "before": history[0], "after": last}


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
