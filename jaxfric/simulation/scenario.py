"""The closed-loop experiment of Kim, Kim & Ha (2004), section IV, on a machine of our own.

The paper's tables are lost, so the machine is ours: one axis of a ball-screw positioning table
whose friction is an asymmetric Lorentzian model (ALM, eq. 29), under the PD controller of fig. 2.

| parameter              | forward (+) | backward (−) | unit  |
|------------------------|-------------|--------------|-------|
| Coulomb                | 20          | 18           | N     |
| viscous                | 60          | 80           | N·s/m |
| Stribeck force         | 8           | 10           | N     |
| Stribeck velocity      | 0.008       | 0.012        | m/s   |
| mass                   | 5                          || kg    |

The reference, in place of the paper's (28), is x_r = 0.03 m sin(2πt/T) + 0.01 m sin(6πt/T), period
T = 2 s: up to 0.19 m/s, with slow stretches on both sides of a reversal. The loop has the gains
kp = M ω², kd = 2 M ω with ω = 60 rad/s (a double pole). Two periods pass before the record starts.
"""

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from .. import models
from ..data.recording import Recording
from ..models import Model
from .control import PD, Encoder
from .simulating import simulate

TRUTH = {
    "inertia": 5.0,
    "coulomb+": 20.0,
    "viscous+": 60.0,
    "stribeck_force+": 8.0,
    "stribeck_velocity+": 0.008,
    "coulomb-": 18.0,
    "viscous-": 80.0,
    "stribeck_force-": 10.0,
    "stribeck_velocity-": 0.012,
}
PERIOD = 2.0
SETTLING_PERIODS = 2
BANDWIDTH = 60.0


def machine() -> Model:
    """The axis of the table above: inertia and the asymmetric Lorentzian friction model."""
    return models.from_parameters(models.lorentzian(), TRUTH)


def reference(time: Float[Array, " N"]) -> tuple[Float[Array, " N"], Float[Array, " N"]]:
    """The periodic set-point and its velocity, m and m/s, at the times, s."""
    rate = 2 * jnp.pi / PERIOD
    position = 0.03 * jnp.sin(rate * time) + 0.01 * jnp.sin(3 * rate * time)
    return position, 0.03 * rate * (jnp.cos(rate * time) + jnp.cos(3 * rate * time))


def record(
    model: Model,
    periods: int = 1,
    encoder: Encoder | None = None,
    force_noise: float | Float[Array, ""] = 0.0,
    key: PRNGKeyArray | None = None,
    sample_rate: float = 5000.0,
) -> Recording:
    """A record of whole periods in steady oscillation, so that v(ti) = v(tf), eq. (14).

    **Arguments:** `model`, an axis (the gains are those for [`machine`][]); `periods`, how many;
    `encoder`, `force_noise` (standard deviation, N) and `key` as in
    [`simulate`][jaxfric.simulation.simulating.simulate]; `sample_rate`, Hz.

    **Returns:** `periods * PERIOD * sample_rate + 1` samples, with the set-point as the channel
    `reference`. The force of a sample is the mean of what was held before and after it, which is
    the force at that instant to second order; its noise is drawn afterwards.

    **Raises:** `ValueError` unless there is a whole period and a whole number of samples in it.
    """
    each = PERIOD * sample_rate
    if periods < 1 or abs(each - round(each)) > 1e-6:
        raise ValueError(
            f"record(periods={periods}, sample_rate={sample_rate}): needs at least one period, "
            f"and a whole number of samples in {PERIOD} s."
        )
    first, length = SETTLING_PERIODS * round(each), periods * round(each) + 1
    time = jnp.arange(first + length, dtype=float) / sample_rate
    goal, goal_velocity = reference(time)
    channels = {"reference": goal, "reference_velocity": goal_velocity}
    clock = Recording(time, jnp.zeros_like(time), goal, source="scenario", channels=channels)
    mass = TRUTH["inertia"]
    loop = PD(kp=mass * BANDWIDTH**2, kd=2 * mass * BANDWIDTH)  # type: ignore[call-arg]
    run = simulate(model, clock, loop, encoder=encoder, key=key)
    return _noisy(_last(run, first), force_noise, key)


def _last(run: Recording, first: int) -> Recording:
    """The samples from `first` on, the clock from zero, each force centred on its sample."""
    centred = 0.5 * (run.force[first:] + run.force[first - 1 : -1])
    cut = jax.tree.map(lambda x: x[first:], run)
    return dataclasses.replace(cut, time=cut.time - cut.time[0], force=centred)


def _noisy(run: Recording, deviation, key) -> Recording:
    if key is None:
        return run
    noise = jax.random.normal(jax.random.fold_in(key, 1), run.force.shape, run.force.dtype)
    return dataclasses.replace(run, force=run.force + deviation * noise)
