"""What lies between motor and load, as far as one mass can tell."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..units import ACCELERATION
from .presliding import Instant, States, starts
from .sample import Parameter, Resolution


def _coasting(scales):
    """From a load that coasts for the whole record to one that stops within a sample."""
    return scales.fastest / scales.duration, scales.fastest / scales.interval


# Three together: a factor of two from one to the next, and the refinement goes on from there.
OCTAVES = Resolution(0, 1, None, 12)
DECELERATION = Parameter("load_deceleration", ACCELERATION, _coasting, resolution=OCTAVES)

# Steps between samples.
_STEPS = 4


def pushed(
    recording: Recording,
    omega: Float[Array, ""],
    damping: Float[Array, ""] | float,
    deceleration: Float[Array, ""],
    half_gap: Float[Array, ""] | float | None = None,
    decay: Float[Array, ""] | float = 0.0,
) -> Float[Array, " N"]:
    """What a load with friction is pushed by, per mass, m/s², `(N,)`.

    For its speed w, dw/dt = p − d sign(w) − κ w, and at rest it sticks. Without `half_gap`
    p = ω² s + 2ζω ds/dt, s, m, the way by which the motor, at the recording's position, is ahead;
    with it, δ, the spring has a dead zone from −δ to δ, and flanks do not pull. `omega` ω, 1/s;
    `damping` ζ; `deceleration` d, m/s²; `decay` κ, 1/s. Stepped semi-implicitly, stable for any
    stiffness. A segment starts in slip.
    """
    begins, speed = starts(recording), recording.velocity
    span = jnp.where(begins, 0.0, jnp.pad(jnp.diff(recording.time), (1, 0))) / _STEPS
    way = jnp.where(begins, 0.0, jnp.pad(jnp.diff(recording.position), (1, 0))) / _STEPS
    last = jnp.where(begins, speed, jnp.roll(speed, 1))
    stiffness, drag = omega**2, 2 * damping * omega
    gap = 0.0 if half_gap is None else half_gap

    def substep(state, span, way, speed):
        ahead, load = state
        ahead = ahead + way - span * load
        over = jnp.sign(ahead) * jnp.maximum(jnp.abs(ahead) - gap, 0.0)
        push = stiffness * over + drag * (speed - load)
        push = push if half_gap is None else jnp.where(push * over > 0, push, 0.0)
        push = push / (1 + span * drag + span**2 * stiffness)
        free = load + span * push
        left = jnp.maximum(jnp.abs(free) - span * deceleration, 0.0)
        return (ahead, jnp.sign(free) * left / (1 + span * decay)), push

    def step(state, now):
        span, way, last, speed, begin = now
        total = jnp.zeros_like(speed)
        for number in range(_STEPS):
            at = last + (number + 0.5) / _STEPS * (speed - last)
            state, push = substep(state, span, way, at)
            total = total + push / _STEPS
        ahead, load = state
        side = jnp.sign(speed)
        slips = side * deceleration + decay * speed
        wound = side * gap + slips / stiffness
        state = jnp.where(begin, wound, ahead), jnp.where(begin, speed, load)
        return state, jnp.where(begin, slips, total)

    zero = jnp.zeros_like(speed[0])
    push = jax.lax.scan(step, (zero, zero), (span, way, last, speed, begins))[1]
    # Means over the spans before the samples; what is wanted belongs to the samples.
    return 0.5 * (push + jnp.where(jnp.roll(begins, -1), push, jnp.roll(push, -1)))


class DryLoad(NamedTuple):
    """The load of [`pushed`][] as states of the axis, of the same parameters.

    `flow` is (s, w): the way by which the motor is ahead, m, and the load's speed, m/s. `kept` is
    what holds for a step: the direction of the load's friction, and the flank in touch, 0 for none.
    """

    omega: Float[Array, ""]
    damping: Float[Array, ""] | float
    deceleration: Float[Array, ""]
    half_gap: Float[Array, ""] | float | None = None
    decay: Float[Array, ""] | float = 0.0

    def start(self, velocity: Float[Array, ""]) -> States:
        """In slip, wound up by the load's friction."""
        side = jnp.sign(velocity)
        gap = 0.0 if self.half_gap is None else self.half_gap
        slips = side * self.deceleration + self.decay * velocity
        wound = side * gap + slips / self.omega**2
        return States(jnp.stack([wound, velocity]), jnp.stack([side, side]))

    def push(self, states: States, velocity: Float[Array, ""]) -> Float[Array, ""]:
        """p, m/s²."""
        ahead, load = states.flow
        flank = states.kept[1]
        over = ahead if self.half_gap is None else ahead - flank * self.half_gap
        push = self.omega**2 * over + 2 * self.damping * self.omega * (velocity - load)
        if self.half_gap is None:
            return push
        return jnp.where(push * flank > 0, push, 0.0)

    def rates(self, states: States, now: Instant) -> Float[Array, " 2"]:
        """The derivative of `flow`."""
        side = states.kept[0]
        load = states.flow[1]
        slowed = self.push(states, now.velocity) - self.deceleration * side - self.decay * load
        slip = now.velocity - load
        return jnp.stack([slip, jnp.where(side == 0, 0.0, slowed)])

    def ready(self, states: States, now: Instant) -> States:
        """With the direction in which the load slips or is about to, and the flank it is at."""
        ahead, load = states.flow
        flank = jnp.zeros_like(ahead)
        if self.half_gap is not None:
            flank = jnp.where(jnp.abs(ahead) >= self.half_gap, jnp.sign(ahead), 0.0)
        at = States(states.flow, jnp.stack([flank, flank]))
        push = self.push(at, now.velocity)
        breaks = jnp.where(jnp.abs(push) > self.deceleration, jnp.sign(push), 0.0)
        side = jnp.where(load == 0, breaks, jnp.sign(load))
        return States(states.flow, jnp.stack([side, flank]))

    def settled(self, states: States) -> States:
        """A load that would turn back is at rest first; a gap that is crossed ends at its flank."""
        ahead, load = states.flow
        side, flank = states.kept
        load = jnp.where(side * load < 0, 0.0, load)
        if self.half_gap is not None:
            # Beyond the flank that it was at, it winds up.
            above = jnp.where(flank > 0, jnp.maximum(ahead, self.half_gap), self.half_gap)
            below = jnp.where(flank < 0, jnp.minimum(ahead, -self.half_gap), -self.half_gap)
            ahead = jnp.clip(ahead, below, above)
        return States(jnp.stack([ahead, load]), states.kept)
