"""A swinging load whose inertia, damping and stiffness change along a motion."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


class Swing(NamedTuple):
    """Deflection, m or rad, its rate and its acceleration, `(N,)` each."""

    place: Float[Array, " N"]
    speed: Float[Array, " N"]
    acceleration: Float[Array, " N"]


def swing(
    time: Float[Array, " N"],
    begins: Bool[Array, " N"],
    inertia: Float[Array, " N"],
    damping: Float[Array, " N"],
    stiffness: Float[Array, " N"],
    load: Float[Array, " N"],
    start: Float[Array, "2"] | tuple[float, float] = (0.0, 0.0),
) -> Swing:
    """What s ẍ + d ẋ + g x = r makes of a load r, from rest where r holds the spring.

    Exact for a load that is straight between the samples, and for s, d and g that are there the
    mean of both ends. `begins`: samples at which nothing is known of the time before; `start`: how
    much farther it is bent there, and its rate.
    """
    real = ~begins
    span = jnp.where(real, jnp.diff(time, prepend=time[:1]), 1.0)
    mass, drag, spring = (_mean(values) for values in (inertia, damping, stiffness))
    rate = jnp.where(real, jnp.diff(load, prepend=load[:1]), 0.0) / span
    square, decay = spring / mass, 0.5 * drag / mass
    cosine, sine = _oscillation(square, decay, span)
    drift = rate / spring
    centre = (load - rate * span) / spring - drag * drift / spring
    held = load / stiffness + start[0]

    def step(state, now):
        place, speed = state
        real, cosine, sine, square, decay, centre, drift, span, held = now
        away, pace = place - centre, speed - drift
        after = away * (cosine + decay * sine) + pace * sine + centre + drift * span
        moved = pace * (cosine - decay * sine) - square * away * sine + drift
        state = jnp.where(real, after, held), jnp.where(real, moved, start[1])
        return state, state

    parts = (real, cosine, sine, square, decay, centre, drift, span, held)
    none = jnp.zeros_like(load[0])
    place, speed = jax.lax.scan(step, (none, none), parts)[1]
    return Swing(place, speed, (load - damping * speed - stiffness * place) / inertia)


def _mean(values):
    """Of each sample and the one before."""
    return 0.5 * (values + jnp.concatenate([values[:1], values[:-1]]))


def _oscillation(square, decay, time):
    """e^−κt cos ωt and e^−κt sin(ωt)/ω, ω² = square − κ², of what swings or creeps."""
    own = square - decay**2
    swings = own > 0
    pace = jnp.sqrt(jnp.where(swings, own, jnp.maximum(-own, 1e-9 * square)))
    fade = jnp.exp(-decay * time)
    slow, fast = jnp.exp((pace - decay) * time), jnp.exp(-(pace + decay) * time)
    cosine = jnp.where(swings, fade * jnp.cos(pace * time), 0.5 * (slow + fast))
    sine = jnp.where(swings, fade * jnp.sin(pace * time), 0.5 * (slow - fast))
    return cosine, sine / pace
