"""Friction with a memory: presliding, and friction that lags behind velocity.

A term with a memory is a function of the whole recording, not of a sample. `simulate` holds the
memory of bristles (Dahl, LuGre), a state that follows the motion; the others cannot stand in it.
"""

import dataclasses
from abc import abstractmethod
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..data.recording import Recording
from ..units import FORCE, POSITION, TIME, VELOCITY
from .base import AbstractTerm, joined, vector
from .friction import AbstractBump, Gaussian
from .sample import Burden, Parameter
from .text import Syntax

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
    """Distance from the sample before, with its sign, m, `(N,)`; zero at a segment's start.

    Of the position where there is one: a derivative that is smoothed rounds off the very reversal.
    """
    velocity, position = recording.velocity, recording.position
    if position is None:
        steps = 0.5 * (velocity[1:] + velocity[:-1]) * jnp.diff(recording.time)
    else:
        steps = jnp.diff(position)
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


class AbstractBristle(AbstractMemory):
    """A term whose columns are functions of the velocity and of Dahl's deflection z."""

    presliding_distance: eqx.AbstractVar[Float[Array, ""] | float]

    @abstractmethod
    def lagging(self, velocity: Float[Array, " N"], deflection: Float[Array, " N"]):
        """The columns at some velocities, m/s, and deflections, −1 to 1, `(N, p)`."""

    def weights(self, s: Syntax, *names: str) -> tuple[str, ...]:
        """What each column is times z − sign v, as text; empty for one."""
        return ("",)

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        deflection = bristle(recording, self.presliding_distance)
        return self.lagging(recording.velocity, deflection)


class Dahl(AbstractBristle):
    """Presliding that Coulomb friction lacks: F = F_p (z − sign v), dz = (dx/x_d)(1 − z sign(dx)).

    `presliding_distance` x_d, m; F_p, equal to the Coulomb level for Dahl's model, is affine, and
    the presliding stiffness is σ₀ = F_p/x_d (Dahl 1968; exponent one).
    """

    presliding_distance: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("presliding_force", FORCE),)
    nonlinear: ClassVar = (_DISTANCE,)

    def lagging(self, velocity, deflection) -> Float[Array, "N 1"]:
        return (deflection - jnp.sign(velocity))[:, None]


def _stribeck_bounds(scales):
    """As for the bump itself: from the slowest slip to half the top speed."""
    return scales.slowest, 0.5 * scales.fastest


class LuGre(AbstractBristle):
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

    def lagging(self, velocity, deflection) -> Float[Array, "N 2"]:
        lagging = deflection - jnp.sign(velocity)
        bump = jnp.exp(-((velocity / self.stribeck_velocity) ** 2))
        return jnp.stack([lagging, bump * lagging], axis=1)

    def weights(self, s, distance, width):
        return ("", s.call("exp", f"-(v / {width}) * (v / {width})"))


def _memory_bounds(scales):
    """From one sample to a fiftieth of the record: what lasts longer is no transient."""
    return scales.interval, 0.02 * scales.duration


class FrictionalLag(AbstractMemory):
    """A Stribeck bump late by a dead time or lags: F = F_b sign(v) (g(s) − g(abs v)), s late abs v.

    `bump` is g, in the steady state; constant and viscous friction have no memory (Armstrong-
    Hélouvry, Dupont & Canudas de Wit 1994, section 2.4). `frictional_lag` τ, s, is the whole delay
    of the memory: a dead time without `poles` (Hess & Soom 1990: a few to tens of milliseconds), so
    many equal first-order lags otherwise. Through a reversal they differ: a filtered speed does not
    vanish there, and the bump is not built up in full. To first order in τ only τ F_b shows.
    """

    frictional_lag: Float[Array, ""] | float = UNKNOWN
    bump: AbstractBump = Gaussian()
    poles: int = eqx.field(static=True, default=0)

    @property
    def affine(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        return self.bump.affine

    @property
    def nonlinear(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        return (Parameter("frictional_lag", TIME, _memory_bounds), *self.bump.nonlinear)

    def beta(self) -> Float[Array, " d"]:
        own = vector([self.frictional_lag])
        return joined([own, self.bump.beta()])

    def with_beta(self, beta: Float[Array, " d"]) -> "FrictionalLag":
        return dataclasses.replace(
            self, frictional_lag=beta[..., 0], bump=self.bump.with_beta(beta[..., 1:])
        )

    def burden(self, beta, alpha) -> Burden:
        return Burden(0.0, float(alpha[0]), curved=True)

    def columns(self, recording: Recording) -> Float[Array, "N 1"]:
        direction, speed = jnp.sign(recording.velocity), jnp.abs(recording.velocity)
        least = jnp.finfo(speed.dtype).tiny
        late = jnp.maximum(self._late(recording, speed), least)
        change = self.bump.shape(late) - self.bump.shape(jnp.maximum(speed, least))
        return (direction * change)[:, None]

    def _late(self, recording, speed):
        begins = starts(recording)
        steps = jnp.pad(jnp.diff(recording.time), (1, 0))
        steps = jnp.where(begins, 0.0, jnp.maximum(steps, 0.0))
        if not self.poles:
            elapsed = jnp.cumsum(steps)
            begin = jax.lax.cummax(jnp.where(begins, elapsed, 0.0))
            return jnp.interp(jnp.maximum(elapsed - self.frictional_lag, begin), elapsed, speed)
        for _ in range(self.poles):
            speed = low_pass(speed, steps * self.poles / self.frictional_lag, begins)
        return speed


def low_pass(
    signal: Float[Array, " N"], steps: Float[Array, " N"], begins: Bool[Array, " N"]
) -> Float[Array, " N"]:
    """A first-order lag, exact for straight lines between samples; at rest where it `begins`.

    `steps`: time since the sample before over the time constant, `(N,)`.
    """
    keep = jnp.where(begins, 0.0, jnp.exp(-steps))
    long = steps > 1e-6
    mean = jnp.where(long, -jnp.expm1(-steps) / jnp.where(long, steps, 1.0), 1.0 - 0.5 * steps)
    before = jnp.pad(signal[:-1], (1, 0))
    push = jnp.where(begins, signal, signal * (1 - mean) + before * (mean - keep))

    def step(state, now):
        share, gain = now
        state = share * state + gain
        return state, state

    return jax.lax.scan(step, jnp.zeros_like(signal[0]), (keep, push), unroll=8)[1]
