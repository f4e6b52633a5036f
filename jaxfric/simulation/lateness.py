"""A predicted force that acts, or is recorded, late as a whole: a dead time, a clock, a filter."""

import dataclasses

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .. import programs, signals
from ..data.recording import Recording
from ..models import Model
from ..terms.base import AbstractTerm, summands
from ..terms.effects import traits
from ..terms.known import KNOWN_FEEDBACK
from ..terms.presliding import starts


def at_once(model: Model) -> tuple[Model, Float[Array, ""] | None]:
    """The model with no delay, and by how much later its force acts, s; `None` for at once.

    Without its units' names, for which nothing is to be compiled anew.
    """
    delay, values = model.force_delay, model.parameters
    for effect in (traits(term) for term in summands(model.term)):
        if effect.shift:
            own = -values[effect.shift] if effect.logged else values[effect.shift]
            delay = own if delay is None else delay + own
            model = model.with_parameters({effect.shift: 0.0})
    return dataclasses.replace(model, force_delay=None, units=()), delay


def unfiltered(model: Model) -> tuple[Model, Float[Array, ""] | None]:
    """The model without the filter of a force's sensor, and its time constant, s."""
    if not any(map(_filters, summands(model.term))):
        return model, None
    lag = next(alpha[0] for term, alpha in model.pairs() if _filters(term))
    return model.only(lambda term: not _filters(term)), lag


def _filters(term: AbstractTerm) -> bool:
    effect = traits(term)
    return effect.logged and not effect.shift


def filtered(recording: Recording, signal: Float[Array, " N"], lag) -> Float[Array, " N"]:
    """A signal behind 1/(1 + T s), exact for straight lines between the samples; `lag`: T, s.

    At rest friction takes any value, so that what the filter holds when the axis starts is what was
    recorded last; so it is at the start of a segment.
    """
    feedback = recording.channels.get(KNOWN_FEEDBACK)
    seen = recording.force if feedback is None else recording.force - feedback
    rests = jnp.abs(recording.velocity) <= signals.scales(recording).slowest
    return _filtered(dataclasses.replace(recording, force=seen, channels={}), signal, rests, lag)


@programs.compiled
def _filtered(recording: Recording, signal, rests, lag):
    step = jnp.diff(recording.time, prepend=recording.time[:1])
    last, before = (jnp.concatenate([x[:1], x[:-1]]) for x in (signal, recording.force))
    begins, linked = starts(recording), (lag > 0) & (step > 0)
    safe = jnp.where(linked, step, 1.0)
    keep = jnp.exp(-safe / jnp.where(lag > 0, lag, 1.0))
    # What is recorded less the signal: a part of it is kept, and a slope adds to it.
    added = -lag * (signal - last) / safe * (1 - keep)
    away = jnp.where(jnp.isfinite(before), keep * (before - signal), 0.0)
    fresh = rests | jnp.concatenate([rests[:1], rests[:-1]])
    added = jnp.where(fresh, away, added)
    added = jnp.where(begins & jnp.isfinite(recording.force), recording.force - signal, added)

    def both(first, second):
        return first[0] * second[0], second[0] * first[1] + second[1]

    pair = jnp.where(fresh | begins | ~linked, 0.0, keep), jnp.where(linked | begins, added, 0.0)
    return signal + jnp.where(rests, 0.0, jax.lax.associative_scan(both, pair)[1])


def later(recording: Recording, signal: Float[Array, " N"], delay) -> Float[Array, " N"]:
    """A signal at t + `delay`, straight between the samples; held at the ends of a segment."""
    return signal if delay is None else _shifted(recording.time, recording.segment, signal, delay)


@programs.compiled
def _shifted(time, segment, signal, delay):
    steps = jnp.where(segment[1:] == segment[:-1], jnp.diff(time), 0.0)
    elapsed = jnp.concatenate([jnp.zeros(1, time.dtype), jnp.cumsum(jnp.maximum(steps, 0.0))])
    # What a recording is padded with has the time of its last sample, which holds.
    own = jnp.append(True, (steps > 0) | (segment[1:] != segment[:-1]))
    signal = signal[jax.lax.cummax(jnp.where(own, jnp.arange(time.size), 0))]
    # Segments far enough apart that none reaches the next one.
    apart = elapsed + segment.astype(time.dtype) * (elapsed[-1] + 1)
    ends = jnp.searchsorted(segment, segment, side="right") - 1
    starts = jnp.searchsorted(segment, segment, side="left")
    wanted = jnp.clip(apart + delay, apart[starts], apart[ends])
    return jnp.interp(wanted, apart, signal)
