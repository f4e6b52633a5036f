"""Forward in time: an axis, its friction exact about sticking, in closed or open loop."""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PRNGKeyArray

from .. import signals
from ..data.recording import Recording, anonymous
from ..models import Model
from . import actuator as faults
from .checking import check, check_memory
from .control import AbstractController, Encoder, Feedback
from .plant import Surroundings
from .setpoint import set_point
from .substeps import cast, default_substeps, plant_of


class _Held(NamedTuple):
    """What is constant from one sample to the next, as arrays of shape `(N,)` before the scan."""

    time: Array
    interval: Array
    force: Array
    reference: Array
    reference_velocity: Array
    channels: dict[str, Array]
    restart: Array
    initial_position: Array
    initial_velocity: Array
    noise: Array


class _State(NamedTuple):
    motion: tuple[Array, ...]
    measured: Array
    elapsed: Array
    memory: Any
    history: Any


def simulate(
    model: Model,
    reference: Recording,
    controller: AbstractController | None = None,
    *,
    encoder: Encoder | None = None,
    force_noise: float | Float[Array, ""] = 0.0,
    key: PRNGKeyArray | None = None,
    substeps: int | None = None,
    smooth: float | Float[Array, ""] | None = None,
    initial: tuple[Any, Any] | None = None,
) -> Recording:
    """The motion of an axis that obeys the model, on the clock of a recording.

    M(x) dv/dt = u − F, with slip and stick friction as in Kim, Kim & Ha (2004), eqs. 1 to 4: at
    rest the axis stays until the other forces exceed F_slip(0±), and a step that would cross zero
    velocity stops there and goes on from rest for the time that is left. So there is no smoothing
    constant. Elsewhere the explicit midpoint rule (order two, stopping times included).

    **Arguments:**

    - `model`: any [`Model`][jaxfric.models.Model] with inertia, whose terms are functions of one
      sample, or have a memory that is a few states of the axis: bristles, a load on a spring or
      behind a gap, frictional lag, and your own (`jaxfric.terms.AbstractStates`); units are those
      of the recording. Terms that read `predicted_force` are the actuator between the command and
      the axis: `force` is the command, and the axis feels what arrives of it.
    - `reference`: a recording, signals of shape `(N,)`. With a `controller`, the set-point is its
      channel `reference`, else its position; the set-point's velocity is the channel
      `reference_velocity`, else the velocity that belongs to the position, else differences.
      Without, its force drives the axis.
    - `controller`: [`PD`][], [`PID`][], [`Cascade`][] or one of your own. It reads the motion at
      a sample and holds its force until the next.
    - `encoder`: what controller and result see instead of the true position; the controller's
      velocity is then the backward difference of the counts, else the true velocity.
    - `force_noise`: standard deviation of noise on the force returned, N. It is not applied to
      the axis.
    - `key`: for the noise of force and encoder.
    - `substeps`: integration steps a sample; from the model's rates by default (inside `jax.jit`,
      where they are unknown, 8).
    - `smooth`: a velocity ε, m/s: replaces stick-slip by the blend (1 ± tanh(v/ε))/2 of the laws
      for the two directions. An approximation (the axis creeps where it should stick), for
      gradients that must also see how sticking depends on the parameters; it is stiff, so give
      `substeps` above 5 Δt F/(M ε) inside `jax.jit`. The exact simulation is differentiable too,
      almost everywhere.
    - `initial`: position and velocity at the start, by default those of the set-point (of the
      recorded motion in open loop). Every segment of the recording starts anew.

    **Returns:** a recording on the same clock: `force`, held from its sample to the next, N;
    `position`, m, and `velocity`, m/s, at the sample (no velocity if there is an encoder); all
    channels, and `reference` in closed loop.

    **Raises:** `ValueError` for fewer than two samples, without a set-point or an inertia, for
    noise without a key, an actuator that gives next to nothing of its command, a load that is
    heavier than the axis, or for a term with a memory of another kind.
    """
    check(model, reference, controller, encoder, force_noise, key)
    check_memory(model, smooth)
    if substeps is None:
        substeps = default_substeps(model, reference, smooth)
    force_key, encoder_key = (None, None) if key is None else jax.random.split(key)
    model, controller, encoder = cast((model, controller, encoder), reference.time.dtype)
    model, actuator = faults.parted(model, _shortest(model, reference))
    smooth = None if smooth is None else jnp.asarray(smooth, reference.time.dtype)
    parts = model, actuator, controller, encoder
    begin = jax.tree.map(lambda x: jnp.asarray(x, reference.time.dtype), initial)
    given = anonymous(reference), encoder_key, begin
    (force, position, velocity), goal = _integrate(*parts, *given, substeps, smooth)
    if force_key is not None:
        noise = jax.random.normal(force_key, force.shape, force.dtype)
        force = force + jnp.asarray(force_noise, force.dtype) * noise
    channels = dict(reference.channels)
    if controller is not None:
        channels["reference"] = goal
    return dataclasses.replace(
        reference,
        force=force,
        position=position,
        velocity=velocity if encoder is None else None,
        channels=channels,
    )


def _held(reference, controller, encoder, key, initial) -> _Held:
    time, dtype = reference.time, reference.time.dtype
    together = reference.segment[1:] == reference.segment[:-1]
    steps = jnp.where(together, jnp.diff(time), 0.0)
    # The last force of a segment moves nothing that is recorded.
    interval = jnp.pad(steps, (0, 1))
    zeros = jnp.zeros_like(time)
    goal, goal_velocity = set_point(reference, controller, together)
    first, first_velocity = (goal, goal_velocity) if initial is None else initial
    restart = jnp.pad(~together, (1, 0), constant_values=True)
    return _Held(
        time,
        interval,
        jnp.where(reference.mask, reference.force, 0.0),
        goal,
        goal_velocity,
        dict(reference.channels),
        restart,
        zeros + first,
        zeros + first_velocity,
        zeros if encoder is None else encoder.draw(key, time.shape[0], dtype),
    )


def _shortest(model, reference: Recording) -> float | None:
    """The shortest time between two samples, s; `None` inside `jax.jit`."""
    if signals.is_traced((model, reference)):
        return None
    steps = np.diff(reference.time)[np.diff(reference.segment) == 0]
    return float(np.min(steps[steps > 0], initial=np.max(steps, initial=0.0)))


@eqx.filter_jit
def _integrate(model, actuator, controller, encoder, reference, key, initial, substeps, smooth):
    """Force, position and velocity at every sample, and the set-point, each `(N,)`: one scan."""
    held = _held(reference, controller, encoder, key, initial)
    plant = plant_of(model, smooth)

    def advance(state, now):
        fresh = _fresh(plant, actuator, controller, encoder, now)
        state = jax.tree.map(lambda new, old: jnp.where(now.restart, new, old), fresh, state)
        position, velocity = state.motion[:2]
        measured = position if encoder is None else encoder.read(position, now.noise)
        force, memory = now.force, state.memory
        if controller is not None:
            seen_velocity = _seen_velocity(state, measured, encoder, now)
            seen = (now.interval, now.reference, now.reference_velocity, measured, seen_velocity)
            force, memory = controller(memory, Feedback(*seen))
        span, rest = now.interval / substeps, Surroundings(now.time, now.channels)

        def substep(i, state):
            motion, history = state
            since = span * i.astype(span.dtype)
            clock, acting = rest.at(now.time + since), force
            if actuator is not None:
                acting, history = actuator.acting(history, force, since, span)
                acting = actuator.arriving(acting, motion[0], clock)
            return plant.step(motion, acting, span, clock), history

        history = state.history
        if actuator is not None:
            history = actuator.begin(history, now.restart, force, now.interval)
        moving = state.motion, history
        motion, history = jax.lax.fori_loop(0, substeps, substep, moving, unroll=min(substeps, 2))
        if actuator is not None:
            history = actuator.pass_on(history, force, now.interval)
        following = _State(motion, measured, now.interval, memory, history)
        return following, (force, measured, velocity)

    first = _fresh(plant, actuator, controller, encoder, jax.tree.map(lambda x: x[0], held))
    return jax.lax.scan(advance, first, held)[1], held.reference


def _fresh(plant, actuator, controller, encoder, now):
    """The state at the start of a segment."""
    x, v = now.initial_position, now.initial_velocity
    measured = x if encoder is None else encoder.read(x, now.noise)
    memory = () if controller is None else controller.start()
    history = () if actuator is None else actuator.start()
    return _State(plant.start(x, v), measured, jnp.zeros_like(x), memory, history)


def _seen_velocity(state, measured, encoder, now):
    """The true velocity, or with an encoder the backward difference of its counts."""
    if encoder is None:
        return state.motion[1]
    elapsed = state.elapsed
    known = elapsed > 0
    difference = (measured - state.measured) / jnp.where(known, elapsed, 1.0)
    return jnp.where(known, difference, now.initial_velocity)
