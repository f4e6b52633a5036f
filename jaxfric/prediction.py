"""Backward in time, as it were: the force that a recorded motion needs."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from . import signals
from .models import Model
from .projections import WeakForm
from .recording import Recording
from .terms import TransportDelay
from .terms.base import summands


def predict(model: Model, recording: Recording) -> Float[Array, " N"]:
    """The force that the recorded motion needs, N, shape `(N,)`.

    The model's columns, and the zero-phase smoothing derivative of its momentum, whose width is
    chosen from the noise of the position (of the velocity where there is no position). Pure: may
    stand inside `jax.jit`, `jax.vmap` and `jax.grad`. At v = 0, where friction takes any value up
    to break-away, the value is that of the terms at rest. A [`TransportDelay`][jaxfric.terms] is
    taken in whole, u(t) = f(t + τ), and not to first order.
    """
    model, delay = _at_once(model)
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
    return _later(prepared, model.force(prepared) + rate, delay)


def _at_once(model: Model) -> tuple[Model, Float[Array, ""] | None]:
    """The model with a delay of zero, and its delay, s; `None` where it has none."""
    if not any(isinstance(term, TransportDelay) for term in summands(model.term)):
        return model, None
    return model.with_parameters({"delay": 0.0}), model.parameters["delay"]


def _later(recording: Recording, signal: Float[Array, " N"], delay) -> Float[Array, " N"]:
    """A signal at t + `delay`, straight between the samples; held at the ends of a segment."""
    if delay is None:
        return signal
    time, segment = recording.time, recording.segment
    steps = jnp.where(segment[1:] == segment[:-1], jnp.diff(time), 0.0)
    elapsed = jnp.concatenate([jnp.zeros(1, time.dtype), jnp.cumsum(jnp.maximum(steps, 0.0))])
    # Segments far enough apart that none reaches the next one.
    apart = elapsed + segment.astype(time.dtype) * (elapsed[-1] + 1)
    ends = jnp.searchsorted(segment, segment, side="right") - 1
    starts = jnp.searchsorted(segment, segment, side="left")
    wanted = jnp.clip(apart + delay, apart[starts], apart[ends])
    return jnp.interp(wanted, apart, signal)


def with_channels(model: Model, recording: Recording) -> Recording:
    """A prepared recording with the channel `predicted_force`, if terms of the model read it.

    Faults of the actuator act on the force f that the motion needs, N, which the terms without
    faults predict. A channel that is there already stays.
    """
    if "predicted_force" not in model.term.coordinates - set(recording.channels):
        return recording
    sound = model.without("predicted_")
    span = signals.kernel_half_width(recording) * signals.interval(recording)
    reach = signals.kernel_half_width(recording)

    def rate(signal):
        return signals.local_quadratic(recording, signal, span, reach)[1]

    force = sound.force(recording) + rate(sound.momentum(recording))
    channels = recording.channels | {"predicted_force": force}
    return dataclasses.replace(recording, channels=channels)


def relative_error(
    model: Model, recording: Recording, half_width: int | None = None
) -> Float[Array, ""]:
    """norm(u − û)/norm(u) of a model on a recording, both passed through the same kernel.

    The measure of the EMPS benchmark (Janot, Gautier & Brunot 2019), over everything but rest.
    `half_width` of the kernel in samples; by default that of [`signals.kernel_half_width`][].
    """
    model, delay = _at_once(model)
    prepared = with_channels(model, signals.prepare(recording))
    if delay is not None:
        prepared = dataclasses.replace(prepared, force=_later(prepared, prepared.force, -delay))
    width = half_width or signals.kernel_half_width(prepared)
    return _relative_error(model, prepared, width)


@eqx.filter_jit
def _relative_error(model, recording, width):
    rows = WeakForm(width).rows(recording, signals.scales(recording))
    left = rows.target - rows.columns(model.term, recording) @ model.alpha
    return rows.relative(left - rows.offset(model.term, recording))
