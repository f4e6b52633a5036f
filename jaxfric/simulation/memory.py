"""The axis with bristles: friction with a memory that is a state of the plant, implicit in time.

Bristles are stiff (σ₀ of 1e5 to 1e9 N/m on a few kg), so that position, velocity and deflections
take one step of the two-stage Rosenbrock method ROS2 with γ = 1 + 1/√2 together: order two, and
L-stable, so that a vibration of bristles that the step does not resolve dies out and cannot grow
(Verwer, Spee, Blom & Hundsdorfer 1999).
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..models import Model
from ..terms import bristles
from ..terms.base import AbstractTerm, Sum, summands
from ..terms.presliding import AbstractBristle, AbstractMemory
from .plant import Plant, Scalar, Surroundings, slowest

GAMMA = 1 + 1 / 2**0.5


def holds(model: Model) -> bool:
    """Whether a model has bristles, whose deflection is a state."""
    return model.bristles is not None or any(map(_bristle, summands(model.term)))


def lost(model: Model) -> list[str]:
    """The names of the terms with another memory, which no state here holds."""
    return [
        type(term).__name__
        for term in summands(model.term)
        if any(isinstance(x, AbstractMemory) for x in _leaves(term)) and not _bristle(term)
    ]


def _bristle(term) -> bool:
    return isinstance(term, AbstractBristle)


def _leaves(term):
    """A term and the terms inside it."""
    yield term
    for field in dataclasses.fields(term):
        inner = getattr(term, field.name)
        if isinstance(inner, AbstractTerm):
            yield from _leaves(inner)


class Bristled(eqx.Module):
    """The axis of a model with bristles; the same verbs as [`Plant`][], with deflections beside.

    `Dahl` and `LuGre` terms have each a deflection ζ from −1 to 1, `Model.bristles` one of z, m.
    Where terms take more off the friction at rest than there is, which would drive the axis, they
    count as far as there is.
    """

    model: Model

    @property
    def still(self) -> Plant:
        """The axis without its bristles."""
        kept = [
            (t, a)
            for t, a in zip(summands(self.model.term), self.model.alphas(), strict=True)
            if not _bristle(t)
        ]
        alpha = jnp.concatenate([a for _, a in kept])
        return Plant(Model(Sum(tuple(t for t, _ in kept)), alpha, self.model.units))

    def _terms(self):
        pairs = zip(summands(self.model.term), self.model.alphas(), strict=True)
        return [(t, a) for t, a in pairs if _bristle(t)]

    def stiffness(self) -> Scalar:
        """The stiffness of all bristles near rest, N/m."""
        total = jnp.zeros((), self.model.alpha.dtype)
        for term, alpha in self._terms():
            total = total + jnp.sum(jnp.abs(alpha)) / term.presliding_distance
        return total if self.model.bristles is None else total + self.model.bristles[0]

    def start(self, position: Scalar, velocity: Scalar):
        """Position, velocity, and the deflections of steady slip; without slip none."""
        found = [jnp.sign(velocity)] * len(self._terms())
        if self.model.bristles is not None:
            level = bristles.dry(self.model.term, self.model.alpha, velocity[None])[0]
            found.append(jnp.where(velocity == 0, 0.0, level / self.model.bristles[0]))
        return position, velocity, jnp.stack(found).astype(velocity.dtype)

    def step(self, state, force: Scalar, span: Scalar, rest: Surroundings):
        """The state after `span` seconds under a constant force: two phases, as in [`Plant`][]."""
        x, v, z, left = self._phase(*state, force=force, span=span, rest=rest)
        return self._phase(x, v, z, force, left, rest)[:3]

    def _resistance(self, x, velocity: Float[Array, " k"], z, rest) -> Float[Array, " k"]:
        """Force without acceleration at several velocities, N."""
        total = self.still.resistance(x, velocity, rest)
        total = total + self._share(velocity.dtype) * self._lagging(velocity, z)
        if self.model.bristles is None:
            return total
        stiffness, damping = self.model.bristles
        own = bristles.dry(self.model.term, self.model.alpha, velocity)
        turning = bristles.rate(velocity, jnp.abs(own), z[-1], stiffness)
        return total + stiffness * z[-1] + damping * turning - own

    def _lagging(self, velocity: Float[Array, " k"], z) -> Float[Array, " k"]:
        """What `Dahl` and `LuGre` terms add to slip friction, N."""
        total = jnp.zeros_like(velocity)
        for i, (term, alpha) in enumerate(self._terms()):
            total = total + term.lagging(velocity, jnp.full_like(velocity, z[i])) @ alpha
        return total

    def _share(self, dtype) -> Scalar:
        """The part of the terms' lag that friction at rest is enough for in each direction."""
        ends = jnp.stack([slowest(dtype), -slowest(dtype)])
        there = bristles.dry(self.model.term, self.model.alpha, ends)
        taken = self._lagging(ends, jnp.zeros(len(self._terms()), dtype))
        least = jnp.maximum(jnp.minimum(there[0], -there[1]), 0.0)
        # A few roundings more, lest the terms drive the axis by what two sums of the same differ.
        most = jnp.maximum(-taken[0], taken[1]) * (1 + 16 * jnp.finfo(dtype).eps)
        return jnp.where(most > least, least / jnp.where(most > 0, most, 1.0), 1.0)

    def _turning(self, v, beside, z) -> Float[Array, " m"]:
        """dz/dt; `beside`, the velocity kept on its side of zero."""
        found = [
            v / term.presliding_distance * (1 - z[i] * jnp.sign(beside))
            for i, (term, _) in enumerate(self._terms())
        ]
        if self.model.bristles is not None:
            own = bristles.dry(self.model.term, self.model.alpha, beside[None])
            way = v * jnp.ones(1, v.dtype)
            turned = bristles.rate(way, jnp.abs(own), z[-1], self.model.bristles[0])
            found.append(turned[0])
        return jnp.stack(found)

    def _phase(self, x, v, z, force, span, rest):
        """One step on one side of zero velocity, ended where the velocity is zero."""
        least = slowest(v.dtype)
        forward, backward = self._resistance(x, jnp.stack([least, -least]), z, rest)
        free = force - self.still.inertia(x, v, rest)[1]
        breaks = jnp.where(free > forward, 1.0, jnp.where(free < backward, -1.0, 0.0))
        side = jnp.where(v == 0, breaks.astype(v.dtype), jnp.sign(v))

        def slope(y):
            beside = side * jnp.maximum(side * y[1], least)
            drag = self._resistance(y[0], beside[None], y[2:], rest)[0]
            mass, drift = self.still.inertia(y[0], beside, rest)
            turning = self._turning(y[1], beside, y[2:])
            return jnp.concatenate([jnp.stack([y[1], (force - drift - drag) / mass]), turning])

        first = jnp.concatenate([jnp.stack([x, v]), z])
        last = jnp.where(side == 0, first, _ros2(slope, first, span))
        stops = side * last[1] < 0
        # What swings through zero within a step from rest is at rest again, some way on.
        share = jnp.where(stops & (v != 0), v / jnp.where(stops, v - last[1], 1.0), 1.0)
        end = first + share * (last - first)
        velocity = jnp.where(stops | (side == 0), 0.0, end[1])
        return end[0], velocity, end[2:], span * (1 - share)


def _ros2(slope, y: Float[Array, " n"], span: Scalar) -> Float[Array, " n"]:
    """One step of ROS2: (1 − γhJ) k₁ = f(y), (1 − γhJ) k₂ = f(y + h k₁) − 2 k₁."""
    matrix = jnp.eye(y.size, dtype=y.dtype) - GAMMA * span * jax.jacfwd(slope)(y)
    first = jnp.linalg.solve(matrix, slope(y))
    second = jnp.linalg.solve(matrix, slope(y + span * first) - 2 * first)
    return y + span * (1.5 * first + 0.5 * second)
