"""Backward in time, as it were: the force that a recorded motion needs."""

import dataclasses

import jax
from jaxtyping import Array, Float

from . import signals
from .models import Model
from .recording import Recording


def predict(model: Model, recording: Recording) -> Float[Array, " N"]:
    """The force that the recorded motion needs, N, shape `(N,)`.

    The model's columns, and the zero-phase smoothing derivative of its momentum, whose width is
    chosen from the noise of the position (of the velocity where there is no position). Pure: may
    stand inside `jax.jit`, `jax.vmap` and `jax.grad`. At v = 0, where friction takes any value up
    to break-away, the value is that of the terms at rest.
    """
    prepared = signals.prepare(recording)
    traced = any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(prepared))
    reach = signals.TRACED_REACH if traced else signals.HALF_WIDTHS[-1]
    motion = prepared
    if recording.position is None:
        motion = dataclasses.replace(prepared, position=prepared.velocity)
    choose = signals.choose_half_width if traced else signals._choose
    width = jax.lax.stop_gradient(choose(motion, reach))
    span = width * signals.interval(prepared)
    momentum = model.momentum(prepared)
    rate = signals.local_quadratic(prepared, momentum, span, reach)[1]
    return model.force(prepared) + rate
