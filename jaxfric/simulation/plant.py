"""The axis as a dynamical system: the terms at one state, and one step exact about sticking."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..models import Model
from ..terms.actuator import REACTION
from ..terms.base import AbstractTerm, summands

Scalar = Float[Array, ""]


class Plant(eqx.Module):
    """M(x) dv/dt = u − F(x, v), read off a model's columns and momentum.

    `reaction`: friction that is a share of what it carries, apart from the rest of the model.

    **Arguments:** `model`; `smooth`, the velocity of the smooth approximation of stick-slip, m/s,
    or `None` for the exact law. The break-away levels of the model, where it has them, stand for
    F_slip(0±) at rest, if they are no lower: an axis that broke away at less would stop at once.
    """

    model: Model
    reaction: Model | None
    smooth: Scalar | None

    def __init__(self, model: Model, smooth: Scalar | None = None):
        self.model, self.reaction, self.smooth = *split(model), smooth

    def resistance(self, position: Scalar, velocity: Float[Array, " k"], rest: "Surroundings"):
        """Force without acceleration at one position and several velocities, N, shape `(k,)`."""
        if self.smooth is None:
            return _force(self.model, rest.motion(position, velocity))
        least = slowest(velocity.dtype)
        sided = jnp.stack([jnp.maximum(velocity, least), jnp.minimum(velocity, -least)])
        laws = _force(self.model, rest.motion(position, jnp.ravel(sided)))
        forward, backward = jnp.reshape(laws, sided.shape)
        share = 0.5 * (1 + jnp.tanh(velocity / self.smooth))
        return share * forward + (1 - share) * backward

    def driving(self, left, drift, position: Scalar, velocity: Float[Array, " k"], rest):
        """What accelerates the axis, N, `(k,)`: of what the actuator has `left` beside drift and
        resistance, as much as friction that is a share of the load leaves of it.

        Friction carries r, drift and weight and springs and what accelerates, and is μ abs(r).
        """
        if self.reaction is None:
            return left
        still = [not own for term in summands(self.model.term) for own in term.frictional]
        motion = rest.motion(position, velocity)
        sizes = jnp.where(jnp.asarray(still), self.model.alpha, 0.0)
        borne = drift + self.model.term.columns(motion) @ sizes
        whole = left + borne
        way = jnp.sign(whole)
        motion = eqx.tree_at(lambda r: r.channels, motion, motion.channels | {REACTION: way})
        share = way * _force(self.reaction, motion)
        if self.smooth is not None:
            share = share * jnp.abs(jnp.tanh(velocity / self.smooth))
        return whole / (1 + share) - borne

    def inertia(self, position: Scalar, velocity: Scalar, rest: "Surroundings"):
        """Effective inertia ∂p/∂v, and the force (∂p/∂x) v + ∂p/∂t of a momentum that varies."""

        def momentum(x, v, t):
            motion = rest.at(t).motion(x, v[None])
            return (self.model.term.momentum(motion) @ self.model.alpha)[0]

        by_position, mass, by_time = jax.grad(momentum, argnums=(0, 1, 2))(
            position, velocity, rest.time
        )
        return mass, by_position * velocity + by_time

    def rates(self, position: Scalar, velocity: Scalar, rest: "Surroundings"):
        """Inertia, and how fast the resistance changes: M, (∂F/∂v, ∂F/∂x)."""

        def force(x, v):
            return self.resistance(x, v[None], rest)[0]

        stiffness, damping = jax.grad(force, argnums=(0, 1))(position, velocity)
        return self.inertia(position, velocity, rest)[0], (damping, stiffness)

    def start(self, position: Scalar, velocity: Scalar) -> tuple[Scalar, ...]:
        """The state that begins with a position and a velocity."""
        return position, velocity

    def step(self, state: tuple[Scalar, Scalar], force: Scalar, span: Scalar, rest: "Surroundings"):
        """Position and velocity after `span` seconds under a constant force.

        `force` may be two, `(2,)`: what arrives where the axis moves forward, and backward.
        Two phases: the second is what is left of the time after a stop in the first. A second
        stop within one step would be chatter, and ends the step at rest.
        """
        *state, left = self._phase(*state, force, span, rest)
        *state, _ = self._phase(*state, force, left, rest)
        return tuple(state)

    def _phase(self, x, v, force, span, rest):
        """One midpoint step on one side of zero velocity, ended where the velocity is zero."""
        side, first = self._start(x, v, force, rest)
        force = self.on_side(force, side, v)
        middle = self._beside(side, v + 0.5 * span * first)
        rate = self._acceleration(x + 0.5 * span * v, middle, force, rest)
        rate = rate if self.smooth is not None else jnp.where(side == 0, 0.0, rate)
        end = v + span * rate
        # Stops at the fraction of the step where the straight line to `end` meets zero.
        stops = jnp.zeros_like(end, bool) if self.smooth is not None else side * end < 0
        taken = jnp.where(stops, v / jnp.where(stops, v - end, 1.0), 1.0) * span
        end = jnp.where(stops, 0.0, end)
        return x + 0.5 * taken * (v + end), end, span - taken

    def _start(self, x, v, force, rest):
        """Direction of motion, 0 where the axis sticks (Kim, Kim & Ha 2004, eq. 4), and dv/dt."""
        if self.smooth is not None:
            along = self.on_side(force, jnp.zeros_like(v), v)
            return jnp.zeros_like(v), self._acceleration(x, v, along, rest)
        least = slowest(v.dtype)
        mass, drift = self.inertia(x, v, rest)
        ways = jnp.stack([v, least, -least])
        ahead, back = jnp.broadcast_to(force, (2,))
        given = jnp.stack([self.on_side(force, jnp.sign(v), v), ahead, back])
        left = given - drift - self.resistance(x, ways, rest)
        moving, forward, backward = self.driving(left, drift, x, ways, rest)
        below, above = self.beyond_slip(v.dtype)
        up, down = forward > above, backward < below
        breaks = jnp.where(up, 1.0, jnp.where(down, -1.0, 0.0))
        side = jnp.where(v == 0, breaks.astype(v.dtype), jnp.sign(v))
        resting = jnp.where(side > 0, forward, jnp.where(side < 0, backward, 0.0))
        return side, jnp.where(v == 0, resting, moving) / mass

    def on_side(self, force, side, v):
        """The force that arrives on a side of zero velocity; both, as they blend."""
        if jnp.ndim(force) == 0:
            return force
        if self.smooth is not None:
            share = 0.5 * (1 + jnp.tanh(v / self.smooth))
            return share * force[0] + (1 - share) * force[1]
        return jnp.where(side < 0, force[1], force[0])

    def beyond_slip(self, dtype):
        """By how much the break-away levels lie beyond the slip curve's ends, N; backwards < 0."""
        if self.model.breakaway is None:
            return jnp.zeros(2, dtype)
        least = slowest(dtype)
        ends = self.model.friction(jnp.stack([-least, least]))
        beyond = jnp.nan_to_num(self.model.breakaway.astype(dtype) - ends)
        return jnp.minimum(beyond[0], 0.0), jnp.maximum(beyond[1], 0.0)

    def _beside(self, side, v):
        """The velocity, kept on its side of zero: a law for one direction ends at zero."""
        return v if self.smooth is not None else side * jnp.maximum(side * v, slowest(v.dtype))

    def _acceleration(self, x, v, force, rest):
        mass, drift = self.inertia(x, v, rest)
        left = force - drift - self.resistance(x, v[None], rest)
        return self.driving(left, drift, x, v[None], rest)[0] / mass


def split(model: Model) -> tuple[Model, Model | None]:
    """A model without friction that is a share of its load, and that friction, if any."""

    def own(term: AbstractTerm) -> bool:
        return REACTION in term.coordinates

    if not any(map(own, summands(model.term))):
        return model, None
    return model.only(lambda term: not own(term)), model.only(own)


def _force(model: Model, motion: Recording) -> Float[Array, " k"]:
    """As the model's own, but with every parameter known: this is done at every step."""
    return model.term.columns(motion) @ model.alpha + model.term.offset(motion)


class Surroundings(eqx.Module):
    """What else a term may look at: time, s, and the other channels, each a scalar."""

    time: Scalar
    channels: dict[str, Scalar]

    def at(self, time: Scalar) -> "Surroundings":
        """The same at another time."""
        return Surroundings(time, self.channels)

    def motion(self, position: Scalar, velocity: Float[Array, " k"]) -> Recording:
        """A recording of one position with several velocities, as terms read it."""
        like = jnp.zeros_like(velocity)
        channels: dict[str, Any] = {name: like + value for name, value in self.channels.items()}
        return Recording(like + self.time, like, like + position, velocity, channels=channels)


def slowest(dtype) -> Scalar:
    """The velocity that stands for the limit v → 0±.

    The root of the smallest normal number: its square does not underflow, and viscous friction at
    it is lost in rounding beside any force, in any unit.
    """
    return jnp.sqrt(jnp.finfo(dtype).tiny).astype(dtype)
