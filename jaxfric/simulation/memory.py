"""The axis with a memory: states beside position and velocity, implicit in time.

Bristles and loads on a coupling are stiff (σ₀ of 1e5 to 1e9 N/m on a few kg), so that position,
velocity and what flows with them take one step of the two-stage Rosenbrock method ROS2 with
γ = 1 − 1/√2 together: order two, and L-stable, so that a vibration that the step does not resolve
dies out and cannot grow (Verwer, Spee, Blom & Hundsdorfer 1999).
"""

import dataclasses
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float

from ..models import Model
from ..terms import bristles
from ..terms.base import AbstractTerm, Sum, summands
from ..terms.presliding import AbstractBristle, AbstractMemory, AbstractStates, Instant, States
from .plant import Plant, Scalar, Surroundings, slowest

GAMMA = 1 - 1 / 2**0.5


def holds(model: Model) -> bool:
    """Whether a model has a memory that is a state of the axis."""
    return model.bristles is not None or any(map(_held, summands(model.term)))


def lost(model: Model) -> list[str]:
    """The names of the terms with another memory, which no state here holds."""
    return [
        type(term).__name__
        for term in summands(model.term)
        if any(isinstance(x, AbstractMemory) for x in _leaves(term)) and not _held(term)
    ]


def carried(model: Model) -> float:
    """The inertia of the loads that the motor does not carry rigidly, kg."""
    with jax.ensure_compile_time_eval():
        return float(Augmented(model).shed()) if rigid(model) else 0.0


def rigid(model: Model) -> bool:
    """Whether a term without states has inertia."""
    return any(term.inertial for term in summands(model.term) if not _held(term))


def _held(term) -> bool:
    return isinstance(term, AbstractStates)


def _leaves(term):
    """A term and the terms inside it."""
    yield term
    for field in dataclasses.fields(term):
        inner = getattr(term, field.name)
        if isinstance(inner, AbstractTerm):
            yield from _leaves(inner)


class Augmented(eqx.Module):
    """The axis of a model with a memory; the same verbs as [`Plant`][], with states beside.

    Each [`AbstractStates`][jaxfric.terms.AbstractStates] has its own, `Model.bristles` one of z, m.
    Where terms take more off the friction at rest than there is, which would drive the axis, they
    count as far as there is.
    """

    model: Model
    still: Plant
    parts: tuple[tuple[AbstractStates, Float[Array, " p"]], ...]

    def __init__(self, model: Model):
        pairs = model.pairs()
        kept = [(t, a) for t, a in pairs if not _held(t)]
        alpha = jnp.concatenate([a for _, a in kept])
        # Bristles stand for the break-away levels.
        bristled = model.bristles is not None or any(
            isinstance(t, AbstractBristle) for t, _ in pairs
        )
        levels = None if bristled else model.breakaway
        self.model = model
        self.still = Plant(Model(Sum(tuple(t for t, _ in kept)), alpha, model.units, levels))
        self.parts = _counting(model, [(t, a) for t, a in pairs if isinstance(t, AbstractStates)])

    def shed(self) -> Scalar:
        """The inertia that the motor does not carry rigidly, kg."""
        parts = [_vector(term.shed, alpha) @ alpha for term, alpha in self.parts]
        return sum(parts, jnp.zeros((), self.model.alpha.dtype))

    def rates(self, position: Scalar, velocity: Scalar, rest: Surroundings):
        """As [`Plant.rates`][], of the motor, with the states' own among them."""
        mass, (damping, stiffness) = self.still.rates(position, velocity, rest)
        mass, stiffness = mass - self.shed(), jnp.abs(stiffness)
        for term, alpha in self.parts:
            stiffness = stiffness + _vector(term.stiffness, alpha) @ jnp.abs(alpha)
            stiffness = stiffness + mass * term.pace**2
        if self.model.bristles is not None:
            stiffness = stiffness + self.model.bristles[0]
        return mass, (damping, stiffness)

    def start(self, position: Scalar, velocity: Scalar):
        """Position, velocity, and the states of a segment's start; bristles as in steady slip."""
        found = [term.start(position, velocity) for term, _ in self.parts]
        if self.model.bristles is not None:
            level = bristles.dry(self.model.term, self.model.alpha, velocity[None])
            z = jnp.where(velocity == 0, 0.0, level / self.model.bristles[0])
            found.append(States(z, z[:0]))
        return position, velocity, jax.tree.map(lambda x: x.astype(velocity.dtype), tuple(found))

    def step(self, state, force: Scalar, span: Scalar, rest: Surroundings):
        """The state after `span` seconds under a constant force: two phases, as in [`Plant`][]."""
        x, v, states, left = self._phase(*state, force=force, span=span, rest=rest)
        return self._phase(x, v, states, force, left, rest)[:3]

    def _resistance(self, states, now: Instant, rest) -> Scalar:
        """Force without acceleration, N."""
        total = self.still.resistance(now.position, now.slip[None], rest)[0]
        for (term, alpha), own in zip(self.parts, states, strict=False):
            total = total + term.present(own, now) @ alpha
        if self.model.bristles is None:
            return total
        stiffness, damping = self.model.bristles
        own, turning = self._bristles(states, now.slip, now.slip)
        return total + stiffness * states[-1].flow[0] + damping * turning - own

    def _bristles(self, states, velocity, slip):
        """The friction that bristles stand for, N, and how fast they turn, m/s."""
        own = bristles.dry(self.model.term, self.model.alpha, slip[None])
        z, way = states[-1].flow[0], velocity[None]
        return own[0], bristles.rate(way, jnp.abs(own), z, self.model.bristles[0])[0]

    def _flowing(self, states, now: Instant) -> list[Float[Array, " k"]]:
        """The derivatives of the states' `flow`."""
        found = [t.rates(own, now) for (t, _), own in zip(self.parts, states, strict=False)]
        if self.model.bristles is not None:
            found.append(self._bristles(states, now.velocity, now.slip)[1][None])
        return found

    def _each(self, act: Callable, states):
        """The states of each term as `act` of the term and them gives them."""
        done = [act(term, own) for (term, _), own in zip(self.parts, states, strict=False)]
        return (*done, *states[len(done) :])

    def _side(self, x, v, states, force, rest):
        """The direction of motion, 0 where the axis sticks."""
        one, least = jnp.ones_like(v), slowest(v.dtype)
        ways = [Instant(x, way * least, way * least, way) for way in (one, -one)]
        needed = jnp.stack([self._resistance(states, way, rest) for way in ways])
        drift = self.still.inertia(x, v, rest)[1]
        left = jnp.broadcast_to(force, (2,)) - drift - needed
        slow = jnp.stack([least, -least])
        forward, backward = self.still.driving(left, drift, x, slow, rest)
        below, above = self.still.beyond_slip(v.dtype)
        up, down = forward > above, backward < below
        breaks = jnp.where(up, 1.0, jnp.where(down, -1.0, 0.0))
        return jnp.where(v == 0, breaks.astype(v.dtype), jnp.sign(v))

    def _phase(self, x, v, states, force, span, rest):
        """One step on one side of zero velocity, ended where the velocity is zero."""
        least = slowest(v.dtype)
        begin = Instant(x, v, v, jnp.sign(v))
        states = self._each(lambda term, own: term.ready(own, begin, span), states)
        side = self._side(x, v, states, force, rest)
        force = self.still.on_side(force, side, v)
        flows, again = ravel_pytree([own.flow for own in states])

        def slope(y):
            slip = jnp.where(side == 0, least, side * jnp.maximum(side * y[1], least))
            now = Instant(y[0], y[1], slip, side)
            flowing = [own._replace(flow=f) for own, f in zip(states, again(y[2:]), strict=True)]
            mass, drift = self.still.inertia(y[0], slip, rest)
            left = force - drift - self._resistance(flowing, now, rest)
            driving = self.still.driving(left[None], drift, y[0], slip[None], rest)[0]
            rate = driving / (mass - self.shed())
            motion = jnp.stack([y[1], jnp.where(side == 0, 0.0, rate)])
            return jnp.concatenate([motion, *self._flowing(flowing, now)])

        first = jnp.concatenate([jnp.stack([x, v]), flows])
        last = _ros2(slope, first, span)
        stops = side * last[1] < 0
        # What swings through zero within a step from rest is at rest again, some way on.
        share = jnp.where(stops & (v != 0), v / jnp.where(stops, v - last[1], 1.0), 1.0)
        end = first + share * (last - first)
        velocity = jnp.where(stops | (side == 0), 0.0, end[1])
        moved = [own._replace(flow=f) for own, f in zip(states, again(end[2:]), strict=True)]
        now, taken = Instant(end[0], velocity, velocity, side), share * span
        states = self._each(lambda term, own: term.settled(own, now, taken), moved)
        return end[0], velocity, states, span * (1 - share)


def _counting(model: Model, pairs):
    """The terms with states, and as much of each as there is friction at rest for."""
    dtype = model.alpha.dtype
    there = bristles.dry(model.term, model.alpha, jnp.stack([slowest(dtype), -slowest(dtype)]))
    least = jnp.maximum(jnp.minimum(there[0], -there[1]), 0.0)
    reliefs = [_vector(term.relief, alpha) for term, alpha in pairs]
    most = sum((r @ a for r, (_, a) in zip(reliefs, pairs, strict=True)), jnp.zeros((), dtype))
    # A few roundings more, lest the terms drive the axis by what two sums of the same differ.
    most = most * (1 + 16 * jnp.finfo(dtype).eps)
    share = jnp.where(most > least, least / jnp.where(most > 0, most, 1.0), 1.0)
    scaled = [jnp.where(r > 0, share, 1.0) * a for r, (_, a) in zip(reliefs, pairs, strict=True)]
    return tuple((term, alpha) for (term, _), alpha in zip(pairs, scaled, strict=True))


def _vector(values, like: Float[Array, " p"]) -> Float[Array, " p"]:
    return jnp.stack([jnp.asarray(value, like.dtype) for value in values])


def _ros2(slope, y: Float[Array, " n"], span: Scalar) -> Float[Array, " n"]:
    """One step of ROS2: (1 − γhJ) k₁ = f(y), (1 − γhJ) k₂ = f(y + h k₁) − 2 k₁."""
    matrix = jnp.eye(y.size, dtype=y.dtype) - GAMMA * span * jax.jacfwd(slope)(y)
    first = jnp.linalg.solve(matrix, slope(y))
    second = jnp.linalg.solve(matrix, slope(y + span * first) - 2 * first)
    return y + span * (1.5 * first + 0.5 * second)
