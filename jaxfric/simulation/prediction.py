"""Backward in time, as it were: the force that a recorded motion needs."""

import dataclasses
import math
from collections.abc import Callable, Iterator
from functools import cached_property, partial
from typing import TypeGuard

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .. import programs, signals
from ..data.excerpt import MOST, SPARE, excerpt, pieces
from ..data.recording import Recording, pad, require, uniform
from ..models import Model, require as require_model, weighed
from ..terms import KNOWN_FRICTION, at_other_times
from ..terms.actuator import PREDICTED, REACTION, carried
from ..terms.base import AbstractLaw, AbstractTerm, Directional, summands
from ..terms.presliding import AbstractStates, starts
from .lateness import at_once, filtered, later, unfiltered

# Of a long recording so many samples are predicted together, with those on either side.
BLOCK = 1 << 16
# A clock that runs so many times as fast as it typically does is none.
FASTEST = 4


def predict(model: Model, recording: Recording) -> Float[Array, " N"]:
    """The force that the recorded motion needs, N, shape `(N,)`.

    The model's columns, and the zero-phase smoothing derivative of its momentum, whose width is
    chosen from the noise of the velocity; or of the position, where that tells the acceleration
    better, as beside a velocity that a drive has taken from its encoder. Pure: may stand inside
    `jax.jit`, `jax.vmap` and `jax.grad`; there the recorded velocity is kept. At v = 0, where
    friction takes any value up to break-away, the value is that of the terms at rest. A
    [`TransportDelay`][jaxfric.terms.TransportDelay] is taken in whole, u(t) = f(t + τ), and not to
    first order, as are a [`ClockOffset`][jaxfric.terms.ClockOffset] and a
    [`SensorFilter`][jaxfric.terms.SensorFilter], which holds the recorded force where the axis
    starts. What a load pushes that is stepped along the motion (`DryCompliance`, `ElasticBacklash`)
    is smoothed as the motor's acceleration is, which it swings. NaN where a parameter counts that
    the model has no value for. A model that reads the position takes the integral of the velocity,
    from zero, where no position is recorded.
    """
    require_model(model, "predict")
    require(recording, "predict")
    recording = located(model, recording)
    first, *others = (force for _, force in forces(model, Prepared(recording)))
    return jnp.asarray(np.concatenate([first, *others]) if others else first)


def located(model: Model, recording: Recording) -> Recording:
    """The recording with a position, if only the integral of its velocity, where the model reads
    one.
    """
    return signals.placed(recording) if "position" in model.term.coordinates else recording


class Prepared:
    """A recording with its velocity, and the derivative of its momentum: once for many models."""

    @classmethod
    def of(cls, recording: Recording) -> "Prepared":
        """The same, of one of few lengths, so that few programs serve all recordings; a long one,
        of which a copy counts, as it is.
        """
        return cls(recording, padded=recording.num_samples <= MOST)

    def __init__(self, recording: Recording, whole: "Prepared | None" = None, padded: bool = False):
        self._whole = whole  # of which it is a part
        # By which the acceleration is taken, outside jit.
        self._chosen: tuple[signals.Choice, ...] = ()
        if whole is not None:
            self._chosen = whole._chosen
        elif not signals.is_traced(recording):
            # The noise of a late velocity is that of the corrected one, too.
            self._chosen = signals.of_acceleration(recording)
            recording = signals.with_timely_velocity(recording)
        self._derived = recording.velocity is None
        self.recorded = uniform(recording) if padded else recording
        # By which the momentum's velocity is derived from the position.
        self._slope = self._chosen[0] if len(self._chosen) > 1 else None

    @cached_property
    def recording(self) -> Recording:
        """The recording with its velocity."""
        if self._derived:
            return signals.prepare(self.recorded, self._slope, self.step)
        return self.recorded

    @cached_property
    def velocity(self) -> Array | np.ndarray:
        """The velocity that momentum is taken with, m/s, `(N,)`.

        That of the position, where it tells the acceleration better. Friction has the recorded one,
        which says where the axis rests.
        """
        if self._derived or self._slope is None:
            return self.recording.velocity
        bare = dataclasses.replace(self.recorded, velocity=None)
        return signals.prepare(bare, self._slope, self.step).velocity

    @cached_property
    def step(self) -> float | None:
        """The typical interval, s; `None` inside jit."""
        if self._whole is not None:
            return self._whole.step
        traced = signals.is_traced(self.recorded)
        return None if traced else signals.host_interval(self.recorded)

    @property
    def choices(self) -> tuple[signals.Choice | None, ...]:
        """The local polynomials by which the acceleration is taken, one after the other; `None` for
        parabolas, inside jit.
        """
        return self._chosen or ((None, None) if self._derived else (None,))

    @property
    def choice(self) -> signals.Choice:
        """The local polynomial that differentiates momentum, outside jit."""
        return self._chosen[-1]

    @property
    def _reach(self) -> int:
        """From how many samples on either side a velocity that is derived follows."""
        return 0 if self._slope is None else self._slope.reach

    def around(self, own: slice, reach: int = 0) -> tuple["Prepared", slice]:
        """A part of it that has the velocity of the whole in the samples `own` and in `reach` more
        on either side, of one of few lengths; and where in it those are.
        """
        source = self.recorded if self._derived else self.recording
        part = signals.part_of(source, own, reach + self._reach)
        some = jax.tree.map(lambda x: np.asarray(x)[part], source)
        some = uniform(pad(some, max(BLOCK, some.num_samples)))
        return Prepared(some, self), slice(own.start - part.start, own.stop - part.start)

    def pieces(self, reach: int = 0) -> Iterator[tuple[slice, "Prepared", slice]]:
        """Samples one after the other, with what [`around`][] gives; all at once where few."""
        count = self.recorded.num_samples
        if count <= MOST:
            yield slice(0, count), self, slice(0, count)
            return
        beside = 2 * (reach + self._reach)
        length = max(BLOCK - beside, beside)
        for start in range(0, count, length):
            own = slice(start, min(start + length, count))
            yield own, *self.around(own, reach)

    def excerpt(self) -> Recording:
        """The [`excerpt`][jaxfric.data.excerpt] of it."""
        if not self._derived or self.recorded.num_samples <= SPARE * MOST:
            return excerpt(self.recording)
        parts = [self.around(own) for own in pieces(np.asarray(self.recorded.mask))]
        velocity = [np.asarray(part.recording.velocity)[own] for part, own in parts]
        return dataclasses.replace(excerpt(self.recorded), velocity=np.concatenate(velocity))


def forces(
    model: Model, motion: Prepared
) -> Iterator[tuple[slice, Float[Array, " n"] | np.ndarray]]:
    """What [`predict`][] gives, N, of samples one after the other, and which these are: all at once
    but of a long recording, and a model whose force at a sample follows from the motion around it.
    """
    recorded = motion.recorded
    count = recorded.num_samples
    if signals.is_traced(recorded) or count <= MOST or not _by_samples(model):
        yield slice(0, count), force_along(model, motion)
        return
    delay = at_once(model)[1]
    reach = motion.choice.reach + samples_of(0.0 if delay is None else float(delay), motion.step)
    for own, part, inside in motion.pieces(reach):
        yield own, np.asarray(force_along(model, part))[inside]


def samples_of(delay: float, step: float) -> int:
    """How many samples a delay, s, is at most; `step`, the typical interval, s."""
    return math.ceil(FASTEST * abs(delay) / step)


def force_along(model: Model, motion: Prepared) -> Float[Array, " N"]:
    """What [`predict`][] gives, N, `(N,)`, of a recording that is prepared."""
    model, delay = at_once(model)
    model, lag = unfiltered(model)
    prepared = dataclasses.replace(with_channels(model, motion.recording), units=())
    momentum: Callable[[Recording], Array | np.ndarray] = partial(_momentum_of, model)
    force: Callable[[Recording], Array | np.ndarray] = partial(_force_of, model)
    lagging = jnp.zeros_like(prepared.time)
    if any(map(_late, summands(model.term))):
        # The derivative of a force that holds an acceleration needs more smoothing than that of a
        # speed: as much as the force has had.
        lagging = _by_kernel(prepared, model.only(_late).momentum(prepared))
        momentum = partial(_momentum_of, model.only(lambda term: not _late(term)))
    driven = dataclasses.replace(prepared, velocity=motion.velocity)
    moved = momentum(driven)
    if len(motion.choices) > 1 and any(map(_stepped, summands(model.term))):
        moved = moved + _smoothing_of_loads(model, motion, driven)
    rate = _rate(moved, prepared, motion.choices[-1], motion.step)
    whole = force(prepared) + rate + lagging
    if lag is not None:
        whole = at_other_times(prepared, whole, lambda part: filtered(prepared, part, lag))
    return at_other_times(prepared, whole, lambda part: later(prepared, part, delay))


def inertial(model: Model, motion: Prepared) -> tuple[Float[Array, " N"], Float[Array, " N"]]:
    """Momentum of a model along a recording that is prepared, N·s, and its derivative, N, as
    [`predict`][] smooths it, `(N,)` each.
    """
    driven = dataclasses.replace(motion.recording, velocity=motion.velocity, units=())
    momentum = _momentum_of(model, driven)
    return momentum, _rate(momentum, motion.recording, motion.choices[-1], motion.step)


@programs.compiled
def _force_of(model: Model, recording: Recording) -> Float[Array, " N"]:
    return model.force(recording)


@programs.compiled
def _momentum_of(model: Model, recording: Recording) -> Float[Array, " N"]:
    return model.momentum(recording)


def _late(term: AbstractTerm) -> bool:
    """Whether the derivative of the whole force is taken, as of a lag."""
    return term.inertial and PREDICTED in term.coordinates


def _by_kernel(recording: Recording, signal: Float[Array, " N"]) -> Float[Array, " N"]:
    """The derivative of a signal, smoothed over the kernel that the recording suggests."""
    reach = signals.kernel_half_width(recording)
    span = reach * signals.interval(recording)
    return signals.local_quadratic(recording, signal, span, reach)[1]


def _stepped(term: AbstractTerm) -> TypeGuard[AbstractStates]:
    """Whether it is a load that is stepped along the motion."""
    return isinstance(term, AbstractStates) and term.stepped


def _smoothing_of_loads(model: Model, motion: Prepared, prepared: Recording):
    """What smoothing takes of the loads' momentum, N·s, `(N,)`, where the motor's speed is derived.

    A load that swings swings the motor. What of that is not seen in the motor's speed, since its
    derivative is smoothed, must not be left in the load's either.
    """
    total = jnp.zeros_like(prepared.time)
    between = jnp.where(starts(prepared), 0.0, jnp.diff(prepared.time, prepend=prepared.time[:1]))
    for term, alpha in model.pairs():
        if not _stepped(term):
            continue
        inertia = jnp.stack([*map(jnp.asarray, term.shed)]) @ alpha
        load = weighed(term.momentum(prepared), alpha) + inertia * prepared.velocity
        smooth = load
        for choice in motion.choices[:-1]:
            mean = 0.5 * (smooth + jnp.concatenate([smooth[:1], smooth[:-1]]))
            smooth = _rate(jnp.cumsum(mean * between), prepared, choice, motion.step)
        total = total + smooth - load
    return total


def _by_samples(model: Model) -> bool:
    """Whether the force at a sample follows from the motion at it: the model has no memory, and
    its terms read no force that it predicts.
    """
    laws = all(isinstance(part, AbstractLaw) for part in _parts(model.term))
    return laws and model.bristles is None and not model.term.coordinates & {PREDICTED, REACTION}


def _parts(term: AbstractTerm) -> Iterator[AbstractTerm]:
    """The single terms of a sum, of those with a direction both."""
    for part in summands(term):
        if isinstance(part, Directional):
            yield from (*_parts(part.positive), *_parts(part.negative))
        else:
            yield part


def _rate(
    momentum: Float[Array, " N"], prepared: Recording, choice: signals.Choice | None,
    step: float | None,
):  # fmt: skip
    """The zero-phase smoothing derivative of the momentum, `(N,)`; inside jit by parabolas."""
    traced = signals.is_traced(prepared) or isinstance(momentum, jax.core.Tracer)
    if traced or choice is None:
        motion = prepared
        if prepared.position is None:
            motion = dataclasses.replace(prepared, position=prepared.velocity)
        width = jax.lax.stop_gradient(signals.choose_half_width(motion, signals.TRACED_REACH))
        span = (width + 0.5) * signals.interval(prepared)
        return signals.local_quadratic(prepared, momentum, span, signals.TRACED_REACH)[1]
    rate = signals.derivative(prepared, momentum, choice.half_width, choice.degree, step=step)
    return rate.astype(momentum.dtype, copy=False)


def with_channels(model: Model, recording: Recording) -> Recording:
    """A prepared recording with what the model predicts and terms of it read.

    Faults of the actuator act on the force f that the motion needs, N, which the terms without
    faults predict: `predicted_force`; friction by its load on what of that is no friction:
    `predicted_reaction`. A channel that is there already stays.
    """
    wanted = model.term.coordinates & {PREDICTED, REACTION} - set(recording.channels)
    if not wanted:
        return recording
    sound = model.without("predicted_")
    channels = dict(recording.channels)
    for name in wanted:
        if name == REACTION and not any(map(carried, summands(sound.term))):
            channels[name] = jnp.zeros_like(recording.time)
            continue
        part = sound if name == PREDICTED else _borne(sound)
        force = part.force(recording) + _by_kernel(recording, part.momentum(recording))
        known = recording.channels.get(KNOWN_FRICTION) if name == REACTION else None
        channels[name] = force if known is None else force - known
    return dataclasses.replace(recording, channels=channels)


def _borne(model: Model) -> Model:
    """The model of what guide and screw carry: without the friction in it."""
    own = [own for term in summands(model.term) for own in term.frictional]
    return dataclasses.replace(model, alpha=jnp.where(jnp.asarray(own), 0.0, model.alpha))
