"""Friction with a memory: presliding, and friction that lags behind velocity.

A term with a memory is a function of the whole recording, not of a sample, so it cannot stand in
`simulate`, which asks terms about single states.
"""

from abc import abstractmethod
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..recording import Recording
from ..units import FORCE, POSITION, TIME, VELOCITY
from .base import AbstractTerm, Parameter

UNKNOWN = float("nan")


class AbstractMemory(AbstractTerm):
    """A term whose columns are computed along the recording; its force holds no acceleration.

    `coordinates` name the time, for the past is more than velocity and Lemma 1 does not apply.
    """

    coordinates: ClassVar[frozenset[str]] = frozenset({"time", "velocity"})  # type: ignore[misc]
    nonlinear: ClassVar[tuple[Parameter, ...]] = ()  # type: ignore[misc]

    @property
    def inertial(self) -> bool:
        return False

    @abstractmethod
    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        """The columns along the recording, `(N, p)`."""

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        return jnp.zeros((recording.num_samples, len(self.affine)), recording.time.dtype)

    def offset(self, recording: Recording) -> Float[Array, " N"]:
        return jnp.zeros_like(recording.time)

    def beta(self) -> Float[Array, " d"]:
        values = [jnp.asarray(getattr(self, p.name)) for p in self.nonlinear]
        return jnp.stack(values, axis=-1) if values else jnp.zeros((0,))

    def with_beta(self, beta: Float[Array, " d"]) -> "AbstractMemory":
        names = [p.name for p in self.nonlinear]
        where = lambda term: [getattr(term, name) for name in names]  # noqa: E731
        return eqx.tree_at(where, self, list(beta))


def starts(recording: Recording) -> Array:
    """Whether a sample is the first of its segment, `(N,)`."""
    changes = recording.segment[1:] != recording.segment[:-1]
    return jnp.pad(changes, (1, 0), constant_values=True)


def travel(recording: Recording) -> Float[Array, " N"]:
    """Distance from the sample before, with its sign, m, `(N,)`; zero at a segment's start."""
    velocity = recording.velocity
    steps = 0.5 * (velocity[1:] + velocity[:-1]) * jnp.diff(recording.time)
    return jnp.where(starts(recording), 0.0, jnp.pad(steps, (1, 0)))


def bristle(recording: Recording, distance: Float[Array, ""]) -> Float[Array, " N"]:
    """Deflection z of Dahl's bristle, from −1 to 1, `(N,)`: dz = (dx/x_d)(1 − z sign(dx)).

    Exact for each straight piece of the motion: z − s shrinks by exp(−abs(Δx)/x_d). A segment
    starts with the deflection of steady slip in its direction.
    """
    moved, begins = travel(recording), starts(recording)
    keep = jnp.where(begins, 0.0, jnp.exp(-jnp.abs(moved) / distance))
    goal = jnp.where(begins, jnp.sign(recording.velocity), jnp.sign(moved))

    def relax(deflection, step):
        share, direction = step
        deflection = share * deflection + (1 - share) * direction
        return deflection, deflection

    # One multiply-add a sample: a sequential scan is faster than a parallel one on a CPU, and it
    # compiles in a tenth of the time. Unrolled, since a step costs less than the loop around it.
    return jax.lax.scan(relax, jnp.zeros_like(moved[0]), (keep, goal), unroll=8)[1]


def _distance_bounds(scales):
    """From one sample's way at the slowest slip to a tenth of the stroke.

    A shorter transient is over before the first sample in slip. One longer than a tenth of the
    stroke leaves no steady slip to compare with: it is a function of position.
    """
    return scales.slowest * scales.interval, 0.1 * (scales.high - scales.low)


_DISTANCE = Parameter("presliding_distance", POSITION, _distance_bounds)


class Dahl(AbstractMemory):
    """Presliding that Coulomb friction lacks: F = F_p (z − sign v), dz = (dx/x_d)(1 − z sign(dx)).

    `presliding_distance` x_d, m; F_p, equal to the Coulomb level for Dahl's model, is affine, and
    the presliding stiffness is σ₀ = F_p/x_d (Dahl 1968; exponent one).
    """

    presliding_distance: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("presliding_force", FORCE),)
    nonlinear: ClassVar = (_DISTANCE,)

    def columns(self, recording: Recording) -> Float[Array, "N 1"]:
        lagging = bristle(recording, self.presliding_distance) - jnp.sign(recording.velocity)
        return lagging[:, None]


def _stribeck_bounds(scales):
    """As for the bump itself: from the slowest slip to half the top speed."""
    return scales.slowest, 0.5 * scales.fastest


class LuGre(AbstractMemory):
    """Presliding with a Stribeck curve: F = (F_p + F_b exp(−(v/v_s)²)) (z − sign v), z as in Dahl.

    The LuGre model (Canudas de Wit, Olsson, Åström & Lischinsky 1995) for a bristle whose
    stiffness scales with the friction level, so that `presliding_distance` x_d is constant, and
    without micro-damping σ₁, which acts in presliding only. `stribeck_velocity` v_s, m/s.
    """

    presliding_distance: Float[Array, ""] | float = UNKNOWN
    stribeck_velocity: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (
        Parameter("presliding_force", FORCE),
        Parameter("presliding_stribeck_force", FORCE),
    )
    nonlinear: ClassVar = (_DISTANCE, Parameter("stribeck_velocity", VELOCITY, _stribeck_bounds))

    def columns(self, recording: Recording) -> Float[Array, "N 2"]:
        lagging = bristle(recording, self.presliding_distance) - jnp.sign(recording.velocity)
        bump = jnp.exp(-((recording.velocity / self.stribeck_velocity) ** 2))
        return jnp.stack([lagging, bump * lagging], axis=1)


def _memory_bounds(scales):
    """From one sample to a fiftieth of the record: what lasts longer is no transient."""
    return scales.interval, 0.02 * scales.duration


class FrictionalLag(AbstractMemory):
    """Friction that follows speed late: F = T sign(v) (abs f(t − τ) − abs f(t))/τ.

    f is the channel `predicted_friction`, what the model says friction is, N. All of it τ late is
    T = τ (Hess & Soom 1990: a few to tens of milliseconds); to first order only T shows, which is
    why it is the parameter. `frictional_lag` T, s; `friction_memory` τ, s. Its constant part has
    no rate and its viscous part is T F_v off the inertia, so the Stribeck curve alone shows it.
    """

    friction_memory: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("frictional_lag", TIME),)
    nonlinear: ClassVar = (Parameter("friction_memory", TIME, _memory_bounds),)
    coordinates: ClassVar = frozenset({"time", "velocity", "predicted_friction"})

    def columns(self, recording: Recording) -> Float[Array, "N 1"]:
        begins, direction = starts(recording), jnp.sign(recording.velocity)
        level = direction * recording.channels["predicted_friction"]
        steps = jnp.pad(jnp.diff(recording.time), (1, 0))
        elapsed = jnp.cumsum(jnp.where(begins, 0.0, jnp.maximum(steps, 0.0)))
        begin = jax.lax.cummax(jnp.where(begins, elapsed, 0.0))
        late = jnp.interp(jnp.maximum(elapsed - self.friction_memory, begin), elapsed, level)
        return (direction * (late - level) / self.friction_memory)[:, None]
