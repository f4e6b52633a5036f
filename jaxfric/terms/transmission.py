"""What lies between motor and load, as far as one mass can tell."""

from abc import abstractmethod
from typing import ClassVar, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..units import ACCELERATION, DIMENSIONLESS
from .presliding import AbstractStates, Instant, States, starts
from .sample import Parameter, Resolution


def _coasting(scales):
    """From a load that coasts for the whole record to one that stops within a sample."""
    return scales.fastest / scales.duration, scales.fastest / scales.interval


# Three together: a factor of two from one to the next, and the refinement goes on from there.
OCTAVES = Resolution(0, 1, None, 12)
DECELERATION = Parameter("load_deceleration", ACCELERATION, _coasting, resolution=OCTAVES)


def _sided(scales):
    """Up to nine times as much one way; at one, a load that nothing touches would not stay."""
    return -0.8, 0.8


# None, and much of it either way; the refinement goes on from there.
ASYMMETRY = Parameter(
    "load_asymmetry", DIMENSIONLESS, _sided, logarithmic=False, resolution=Resolution(1, 2, None, 3)
)


class _Flank(NamedTuple):
    """A load on a spring and a damper: dw/dt = p − d sign(w) − κ w, p = ω² o + 2ζω do/dt.

    `omega` ω, 1/s; `damping` ζ; `forward` and `backward`, d where w > 0 and where w < 0, m/s²;
    `decay` κ, 1/s; `swings`: ζ is known to be below one, and the load swings in touch, however
    large its viscous friction. All within a step is along the way in which the spring is wound up
    by o, m.
    """

    omega: Float[Array, ""]
    damping: Float[Array, ""] | float
    forward: Float[Array, ""]
    backward: Float[Array, ""]
    decay: Float[Array, ""] | float
    swings: bool

    def dry(self, side):
        """d, m/s², without a sign, of a load that goes or is pushed to a side."""
        return jnp.where(side < 0, self.backward, self.forward)

    def push(self, over, slip):
        """p, m/s², where the motor is faster by `slip`, m/s."""
        return self.omega * (self.omega * over + 2 * self.damping * slip)

    @property
    def viscous(self):
        """κ in touch, 1/s."""
        most = 2 * (1 - self.damping) * self.omega
        return jnp.minimum(self.decay, 0.98 * most) if self.swings else self.decay

    @property
    def rate(self):
        """By how much a second a swing fades, 1/s."""
        return self.damping * self.omega + 0.5 * self.viscous

    def swing(self, time):
        """The damped oscillation after a time t, s: e^−rt cos ω₁t and e^−rt sin ω₁t/ω₁."""
        rate = self.rate
        fade, square = jnp.exp(-rate * time), self.omega**2 - rate**2
        if self.swings:
            own = jnp.sqrt(square)
            return fade * jnp.cos(own * time), fade * jnp.sin(own * time) / own
        own = jnp.sqrt(jnp.maximum(jnp.abs(square), 1e-6 * self.omega**2))
        slow, fast = jnp.exp(-(self.omega**2) / (rate + own) * time), jnp.exp(-(rate + own) * time)
        cosine = jnp.where(square > 0, fade * jnp.cos(own * time), 0.5 * (slow + fast))
        sine = jnp.where(square > 0, fade * jnp.sin(own * time), 0.5 * (slow - fast))
        return cosine, sine / own

    def touching(self, over, load, motor, gain, side, dry, time, swing):
        """What o and w are after a time in touch, and the impulse of p, m/s.

        `motor`, m/s, and `gain`, m/s², its speed and acceleration; `side`, that of the friction, 0
        of a load that sticks; `dry`, d; `swing`, of that time.
        """
        cosine, sine = swing
        rate, slip = self.rate, motor - load
        mean = motor + 0.5 * gain * time
        steady = gain + dry * side + self.viscous * mean
        from_rest = over - steady / self.omega**2
        change = from_rest * (cosine + rate * sine - 1) + slip * sine
        slips = slip * (cosine - rate * sine) - self.omega**2 * sine * from_rest
        after = motor + gain * time - slips
        # Held by its friction.
        held = self.push((over + 0.5 * mean * time) * time, mean * time)
        sticks = side == 0
        return (
            over + jnp.where(sticks, mean * time, change),
            jnp.where(sticks | (after * side < 0), 0.0, after),
            jnp.where(sticks, held, steady * time - (slips - slip) - self.viscous * change),
        )

    def flying(self, ahead, load, motor, gain, time):
        """By how much the motor is ahead, and w, after a time without touch."""
        speed = jnp.abs(load)
        slowed = self.dry(load) + 0.5 * self.decay * speed
        after = jnp.maximum(speed - time * slowed, 0.0) / (1 + 0.5 * self.decay * time)
        after = jnp.sign(load) * after
        way = 0.5 * (load + after) * jnp.minimum(time, speed / slowed)
        return ahead + time * (motor + 0.5 * gain * time) - way, after


def _swung(flank: _Flank, state, motor, gain, span, swing):
    """One step of a load on a spring that pushes and pulls."""
    ahead, load = state
    push = flank.push(ahead, motor - load)
    breaks = jnp.where(jnp.abs(push) > flank.dry(push), jnp.sign(push), 0.0)
    side = jnp.where(load == 0, breaks, jnp.sign(load))
    ahead, load, impulse = flank.touching(
        ahead, load, motor, gain, side, flank.dry(side), span, swing
    )
    return (ahead, load), impulse


def _struck(flank: _Flank, half_gap, state, motor, gain, span, swing):
    """One step of a load behind a gap, whose flanks do not pull.

    A load in touch swings until the flank would pull, and then it flies; one that flies may strike
    a flank, and swings from then on. One that has left a flank is stopped by the opposite one until
    the next step: from inside of it, it would come back with more speed than it had.
    """
    ahead, load = state
    place = jnp.sign(ahead)
    over = jnp.abs(ahead) - half_gap
    push = flank.push(over, place * (motor - load))
    touches = (over >= 0) & (push >= 0)
    breaks = jnp.where(touches & (push > flank.dry(place)), place, 0.0)
    side = jnp.where(load == 0, breaks, jnp.sign(load))
    # In touch throughout: when it would pull.
    along = place * load, place * motor, place * gain, place * side, flank.dry(side)
    last, speed, _ = flank.touching(over, *along, span, swing)
    pulls = flank.push(last, place * (motor + gain * span) - speed)
    leaves = touches & (pulls < 0) & (side != 0)
    left = span * push / jnp.where(leaves, push - pulls, 1.0)
    # In flight throughout: when it would strike.
    beyond, slowed = flank.flying(ahead, load, motor, gain, span)
    strikes = ~touches & (jnp.abs(ahead) <= half_gap) & (jnp.abs(beyond) > half_gap)
    facing = jnp.sign(beyond)
    room, nearing = half_gap - facing * ahead, facing * (motor - load)
    bend = facing * (gain - (slowed - load) / jnp.where(span > 0, span, 1.0))
    square = nearing**2 + 2 * bend * room
    root = nearing + jnp.sqrt(jnp.where(square > 0, square, 1.0))
    strikes &= (square > 0) & (root > 0)
    reached = jnp.clip(2 * room / jnp.where(strikes, root, 1.0), 0.0, span)
    # Flight up to the flank, touch, and flight from it.
    before = jnp.where(touches, 0.0, jnp.where(strikes, reached, span))
    ahead, load = flank.flying(ahead, load, motor, gain, before)
    facing = jnp.where(touches, place, facing)
    time = jnp.where(leaves, left, span - before)
    now = motor + gain * before
    slips = jnp.where(load == 0, facing, jnp.sign(load))
    side = jnp.where(touches, side, slips)
    along = facing * load, facing * now, facing * gain, facing * side, flank.dry(side)
    over = facing * ahead - half_gap
    # Where no time passes nothing swings; that this is a branch spares XLA from computing the
    # swing anew in each of the sums that it is in.
    swung = jax.lax.cond(span > 0, flank.swing, lambda time: (1 + 0 * time, 0 * time), time)
    over, speed, impulse = flank.touching(over, *along, time, swung)
    met = touches | strikes
    ahead = jnp.where(met, facing * (over + half_gap), ahead)
    load = jnp.where(met, facing * speed, load)
    impulse = jnp.where(met, facing * impulse, 0.0)
    rest = jnp.where(leaves, span - time, 0.0)
    begun = jnp.where(met | (place == 0), facing, place)
    ahead, load = flank.flying(ahead, load, now + gain * time, gain, rest)
    ahead = begun * jnp.maximum(begun * ahead, -half_gap)
    return (ahead, load), impulse


def load_motion(
    recording: Recording,
    omega: Float[Array, ""],
    damping: Float[Array, ""] | float,
    deceleration: Float[Array, ""],
    half_gap: Float[Array, ""] | float | None = None,
    decay: Float[Array, ""] | float = 0.0,
    asymmetry: Float[Array, ""] | float = 0.0,
    swings: bool = False,
) -> tuple[Float[Array, " N"], Float[Array, " N"]]:
    """What a load's friction takes of its push, per mass, f, m/s², and its speed w, m/s, `(N,)`.

    The push p = f + dw/dt, with f = d sign(w) + κ w, and p itself where the load sticks. So what
    strikes the load is in w, and is smoothed as the motor's own speed is. Without `half_gap`
    p = ω² s + 2ζω ds/dt, s, m, the way by which the motor, at the recording's position, is ahead;
    with it, δ, the spring has a dead zone from −δ to δ, and flanks do not pull. `omega` ω, 1/s;
    `damping` ζ, `swings` if it is known to be below one; `deceleration` d, m/s², of which there is
    1 + `asymmetry` forwards and 1 − that backwards; `decay` κ, 1/s. The motor's speed is straight
    between the samples; touch and flight are solved exactly, to where the one ends and the other
    begins, once between two samples, for any stiffness. A segment starts in slip.
    """
    begins, speed = starts(recording), recording.velocity
    span = jnp.where(begins, 0.0, jnp.pad(jnp.diff(recording.time), (1, 0)))
    way = jnp.where(begins, 0.0, jnp.pad(jnp.diff(recording.position), (1, 0)))
    last = jnp.where(begins, speed, jnp.roll(speed, 1))
    real = jnp.where(span > 0, span, 1.0)
    gain = jnp.where(span > 0, (speed - last) / real, 0.0)
    # So that the motor goes the way that its position says.
    first = jnp.where(span > 0, way / real - 0.5 * gain * span, speed)
    sides = deceleration * (1 + asymmetry), deceleration * (1 - asymmetry)
    flank = _Flank(omega, damping, *sides, decay, swings)
    gap = 0.0 if half_gap is None else half_gap
    dtype = jnp.result_type(omega, *sides, gap)
    span, first, gain, speed = (each.astype(dtype) for each in (span, first, gain, speed))

    def step(state, now):
        span, first, gain, speed, begin, swing = now
        before = state[1]
        motion = first, gain, span, swing
        if half_gap is None:
            (ahead, load), impulse = _swung(flank, state, *motion)
        else:
            (ahead, load), impulse = _struck(flank, half_gap, state, *motion)
        side = jnp.sign(speed)
        slips = side * flank.dry(side) + decay * speed
        wound = side * gap + slips / omega**2
        state = jnp.where(begin, wound, ahead), jnp.where(begin, speed, load)
        held = (impulse - (load - before)) / jnp.where(span > 0, span, 1.0)
        return state, (jnp.where(begin, slips, held), state[1])

    start = 2 * (jnp.zeros((), dtype),)
    steps = span, first, gain, speed, begins, flank.swing(span)
    held, load = jax.lax.scan(step, start, steps)[1]
    # Means over the spans before the samples; what is wanted belongs to the samples.
    return 0.5 * (held + jnp.where(jnp.roll(begins, -1), held, jnp.roll(held, -1))), load


class DryLoad(NamedTuple):
    """The load of [`load_motion`][] as states of the axis, of the same parameters.

    `flow` is (s, w): the way by which the motor is ahead, m, and the load's speed, m/s. `kept` is
    what holds for a step: the direction of the load's friction, and the flank in touch, 0 for none.
    """

    omega: Float[Array, ""]
    damping: Float[Array, ""] | float
    deceleration: Float[Array, ""]
    half_gap: Float[Array, ""] | float | None = None
    decay: Float[Array, ""] | float = 0.0
    asymmetry: Float[Array, ""] | float = 0.0
    swings: bool = False

    def friction(self, side):
        """The dry friction of a load that goes or is pushed to a side, per mass, signed, m/s²."""
        return (jnp.sign(side) + self.asymmetry * jnp.abs(jnp.sign(side))) * self.deceleration

    def start(self, velocity: Float[Array, ""]) -> States:
        """In slip, wound up by the load's friction."""
        side = jnp.sign(velocity)
        gap = 0.0 if self.half_gap is None else self.half_gap
        slips = self.friction(side) + self.decay * velocity
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
        slowed = self.push(states, now.velocity) - self.friction(side) - self.decay * load
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
        breaks = jnp.where(jnp.abs(push) > jnp.abs(self.friction(push)), jnp.sign(push), 0.0)
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


class AbstractDryLoad(AbstractStates):
    """A term that steps a load with friction of its own along the motion."""

    coordinates: ClassVar = frozenset({"position", "velocity", "time"})
    stepped: ClassVar = True
    swings: ClassVar = True

    @property
    @abstractmethod
    def load(self) -> DryLoad:
        """The load, with the term's parameters."""

    @property
    def inertial(self) -> bool:
        return True

    def columns(self, recording: Recording) -> Float[Array, "N 1"]:
        return self.columns_and_momentum(recording)[0]

    def momentum(self, recording: Recording) -> Float[Array, "N 1"]:
        return self.columns_and_momentum(recording)[1]

    def start(self, position, velocity) -> States:
        return self.load.start(velocity)

    def rates(self, states, now):
        return self.load.rates(states, now)

    def ready(self, states, now, span):
        return self.load.ready(states, now)

    def settled(self, states, now, span):
        return self.load.settled(states)
