"""Backward in time, as it were: the force that a recorded motion needs."""

import dataclasses

import equinox as eqx
import jax
from jaxtyping import Array, Float

from . import signals
from .models import Model
from .projections import WeakForm
from .recording import Recording


def predict(model: Model, recording: Recording) -> Float[Array, " N"]:
    """The force that the recorded motion needs, N, shape `(N,)`.

    The model's columns, and the zero-phase smoothing derivative of its momentum, whose width is
    chosen from the noise of the position (of the velocity where there is no position). Pure: may
    stand inside `jax.jit`, `jax.vmap` and `jax.grad`. At v = 0, where friction takes any value up
    to break-away, the value is that of the terms at rest.
    """
    prepared = with_channels(model, signals.prepare(recording))
    traced = any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(prepared))
    reach = signals.TRACED_REACH if traced else signals.HALF_WIDTHS[-1]
    motion = prepared
    if recording.position is None:
        motion = dataclasses.replace(prepared, position=prepared.velocity)
    choose = signals.choose_half_width if traced else signals._choose
    width = jax.lax.stop_gradient(choose(motion, reach))
    span = (width + 0.5) * signals.interval(prepared)
    momentum = model.momentum(prepared)
    rate = signals.local_quadratic(prepared, momentum, span, reach)[1]
    return model.force(prepared) + rate


def with_channels(model: Model, recording: Recording) -> Recording:
    """A prepared recording with the channels `predicted_…` that some terms of the model read.

    Faults of the actuator act on the force f that the motion needs, which the terms without faults
    predict: `predicted_force`, N; `predicted_friction`, the part of it that depends on velocity
    alone, N. Channels that are there already stay.
    """
    read = {name for name in model.term.coordinates if name.startswith("predicted_")}
    if not read - set(recording.channels):
        return recording
    sound = model.without("predicted_")
    span = signals.kernel_half_width(recording) * signals.interval(recording)
    reach = signals.kernel_half_width(recording)

    def rate(signal):
        return signals.local_quadratic(recording, signal, span, reach)[1]

    made = {
        "predicted_force": sound.force(recording) + rate(sound.momentum(recording)),
        "predicted_friction": sound.friction(recording.velocity),
    }
    return dataclasses.replace(recording, channels=made | recording.channels)


def relative_error(
    model: Model, recording: Recording, half_width: int | None = None
) -> Float[Array, ""]:
    """norm(u − û)/norm(u) of a model on a recording, both passed through the same kernel.

    The measure of the EMPS benchmark (Janot, Gautier & Brunot 2019), over everything but rest.
    `half_width` of the kernel in samples; by default that of [`signals.kernel_half_width`][].
    """
    prepared = with_channels(model, signals.prepare(recording))
    width = half_width or signals.kernel_half_width(prepared)
    return _relative_error(model, prepared, width)


@eqx.filter_jit
def _relative_error(model, recording, width):
    rows = WeakForm(width).rows(recording, signals.scales(recording))
    left = rows.target - rows.columns(model.term, recording) @ model.alpha
    return rows.relative(left - rows.offset(model.term, recording))
