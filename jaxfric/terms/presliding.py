"""Friction with a memory: presliding, and friction that lags behind velocity.

A term with a memory is a function of the whole recording, not of a sample. One whose memory is a
few states that follow the motion says how they follow it, and `simulate` holds it.
"""

from abc import abstractmethod
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..data.recording import Recording
from .base import AbstractTerm
from .sample import Parameter
from .text import Syntax


class AbstractMemory(AbstractTerm):
    """A term whose columns are computed along the recording; its force holds no acceleration.

    `coordinates` name the time, for the past is more than velocity and Lemma 1 does not apply.
    """

    coordinates: ClassVar[frozenset[str]] = frozenset({"time", "velocity"})  # type: ignore[misc]
    nonlinear: ClassVar[tuple[Parameter, ...]] = ()  # type: ignore[misc]

    @abstractmethod
    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        """The columns along the recording, `(N, p)`."""


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


class Instant(NamedTuple):
    """The motor at one instant: `position`, m, `velocity`, m/s, `side` ±1 or 0 where it sticks.

    `slip` is the velocity kept on its side of zero, where friction that jumps has a value.
    """

    position: Float[Array, ""]
    velocity: Float[Array, ""]
    slip: Float[Array, ""]
    side: Float[Array, ""]


class States(NamedTuple):
    """States beside position and velocity: `flow` `(k,)` obeys rates, `kept` is set in steps."""

    flow: Float[Array, " k"]
    kept: Float[Array, "*n"]


class AbstractStates(AbstractMemory):
    """A memory that is a few states of the axis, so that `simulate` holds it.

    With α the force is Σ α_j (`present`_j − `shed`_j dv/dt); `flow` has the derivative `rates`. A
    step is `ready`, the motion in one direction with `kept` as it is, `settled`.
    """

    @abstractmethod
    def start(self, position: Float[Array, ""], velocity: Float[Array, ""]) -> States:
        """The states at the start of a segment, as along a recording."""

    @abstractmethod
    def present(self, states: States, now: Instant) -> Float[Array, " p"]:
        """The columns at one instant, without the part of the acceleration."""

    def rates(self, states: States, now: Instant) -> Float[Array, " k"]:
        """d(flow)/dt."""
        return jnp.zeros_like(states.flow)

    def ready(self, states: States, now: Instant, span: Float[Array, ""]) -> States:
        """The states with `kept` set for the `span`, s, that follows."""
        return states

    def settled(self, states: States, now: Instant, span: Float[Array, ""]) -> States:
        """The states after a `span`, s, at the end of which the motor is where `now` says."""
        return states

    @property
    def shed(self) -> tuple[Float[Array, ""] | float, ...]:
        """What each column takes off the motor's inertia."""
        return (0.0,) * len(self.affine)

    @property
    def relief(self) -> tuple[Float[Array, ""] | float, ...]:
        """What each column takes off the friction of a motor near rest at most."""
        return (0.0,) * len(self.affine)

    @property
    def stiffness(self) -> tuple[Float[Array, ""] | float, ...]:
        """How fast each column changes with the motor's position, 1/m times its unit."""
        return (0.0,) * len(self.affine)

    @property
    def pace(self) -> Float[Array, ""] | float:
        """How fast the states change of themselves, 1/s."""
        return 0.0


class AbstractBristle(AbstractStates):
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

    def start(self, position, velocity) -> States:
        return States(jnp.sign(velocity)[None], jnp.zeros((0,), velocity.dtype))

    def present(self, states, now):
        return self.lagging(now.slip[None], states.flow)[0]

    def rates(self, states, now):
        return now.velocity / self.presliding_distance * (1 - states.flow * now.side)

    @property
    def relief(self):
        return (1.0,) * len(self.affine)

    @property
    def stiffness(self):
        return (1 / self.presliding_distance,) * len(self.affine)


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
