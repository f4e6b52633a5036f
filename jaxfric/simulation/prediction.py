"""Backward in time, as it were: the force that a recorded motion needs."""

import dataclasses
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import cached_property, partial
from typing import TypeGuard

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .. import checks, programs, signals
from ..data.excerpt import MOST, excerpt
from ..data.recording import Recording, pad, require, uniform
from ..identification.projections import WeakForm
from ..models import Model, require as require_model, weighed
from ..terms.actuator import PREDICTED, REACTION, carried
from ..terms.base import AbstractLaw, AbstractTerm, Directional, summands
from ..terms.effects import traits
from ..terms.presliding import AbstractStates, starts

# So many samples are predicted together.
BLOCK = 1 << 16


def predict(model: Model, recording: Recording) -> Float[Array, " N"]:
    """The force that the recorded motion needs, N, shape `(N,)`.

    The model's columns, and the zero-phase smoothing derivative of its momentum, whose width is
    chosen from the noise of the position (of the velocity where there is no position). Pure: may
    stand inside `jax.jit`, `jax.vmap` and `jax.grad`. At v = 0, where friction takes any value up
    to break-away, the value is that of the terms at rest. A
    [`TransportDelay`][jaxfric.terms.TransportDelay] is taken in whole, u(t) = f(t + τ), and not to
    first order. What a load pushes that is stepped along the motion (`DryCompliance`,
    `ElasticBacklash`) is smoothed as the motor's acceleration is, which it swings. NaN where a
    parameter counts that the model has no value for.
    """
    require_model(model, "predict")
    require(recording, "predict")
    return jnp.asarray(_force(model, Prepared(recording)))


class Prepared:
    """A recording with its velocity, and the derivative of its momentum: once for many models."""

    @classmethod
    def of(cls, recording: Recording) -> "Prepared":
        """The same, of one of few lengths, so that few programs serve all recordings; a long one,
        of which a copy counts, as it is.
        """
        return cls(uniform(recording) if recording.num_samples <= MOST else recording)

    def __init__(self, recording: Recording):
        self._recorded = recording  # whose noise is that of a velocity taken earlier too
        self._derived = recording.velocity is None
        self._slope: signals.Choice | None = None  # by which the velocity was derived, outside jit
        if self._derived and not signals.is_traced(recording):
            self._slope = signals.choose(recording)
        self.recording = signals.prepare(recording, self._slope)

    @cached_property
    def choices(self) -> tuple[signals.Choice | None, ...]:
        """The local polynomials by which the acceleration is taken, one after the other; `None` for
        parabolas, inside jit.
        """
        if signals.is_traced(self.recording):
            return (None, None) if self._derived else (None,)
        return (self._slope, self.choice) if self._derived else (self.choice,)

    @cached_property
    def choice(self) -> signals.Choice:
        """The local polynomial that differentiates momentum, outside jit.

        That which is best for a recorded velocity; for a derived one the wider of those that are
        best for the first and the second derivative of the position.
        """
        if self._slope is None:
            return signals.choose(self._recorded, self._recorded.velocity)
        both = self._slope, signals.choose(self.recording, order=2)
        return max(both, key=lambda each: each.half_width)


def _force(model: Model, motion: Prepared) -> Float[Array, " N"]:
    model, delay = _at_once(model)
    prepared = dataclasses.replace(with_channels(model, motion.recording), units=())
    momentum: Callable[[Recording], Array | np.ndarray] = partial(_momentum_of, model)
    force: Callable[[Recording], Array | np.ndarray] = partial(_force_of, model)
    lagging = jnp.zeros_like(prepared.time)
    if any(map(_late, summands(model.term))):
        # The derivative of a force that holds an acceleration needs more smoothing than that of a
        # speed: as much as the force has had.
        lagging = _by_kernel(prepared, model.only(_late).momentum(prepared))
        momentum = partial(_momentum_of, model.only(lambda term: not _late(term)))
    if prepared.num_samples > MOST and not signals.is_traced(prepared) and _by_samples(model):
        momentum, force = (partial(_in_blocks, of) for of in (momentum, force))
    elif any(map(_stepped, summands(model.term))):
        force = partial(_with_smooth_pushes, model, motion)
    rate = _rate(momentum(prepared), prepared, motion.choices[-1])
    return _later(prepared, force(prepared) + rate + lagging, delay)


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


def _with_smooth_pushes(model: Model, motion: Prepared, prepared: Recording):
    """The force without the rate of the momentum, N, `(N,)`, what loads push being smoothed.

    A load that swings swings the motor. Of that the derivative of the motor's momentum holds what
    it does not smooth, and as much has to be left of the push. The friction that the load takes
    from the motor jumps as the motor's own does, and is not smoothed.
    """
    total = jnp.zeros_like(prepared.time)
    if not all(map(_stepped, summands(model.term))):
        total = model.only(lambda term: not _stepped(term)).force(prepared)
    side = jnp.sign(prepared.velocity)
    for term, alpha in zip(summands(model.term), model.alphas(), strict=True):
        if _stepped(term):
            friction = side * (jnp.stack([*map(jnp.asarray, term.relief)]) @ alpha)
            push = weighed(term.columns(prepared), alpha) + friction
            total = total + _smoothed(push, prepared, motion) - friction
    return total


def _smoothed(signal: Float[Array, " N"], prepared: Recording, motion: Prepared):
    """A signal as smooth as the acceleration, `(N,)`: each derivative by which that is taken, of
    the signal's integral.
    """
    between = jnp.where(starts(prepared), 0.0, jnp.diff(prepared.time, prepend=prepared.time[:1]))
    for choice in motion.choices:
        mean = 0.5 * (signal + jnp.concatenate([signal[:1], signal[:-1]]))
        signal = _rate(jnp.cumsum(mean * between), prepared, choice)
    return signal


def _by_samples(model: Model) -> bool:
    """Whether the model has no memory: its force at a sample follows from that sample alone."""
    return model.bristles is None and all(isinstance(p, AbstractLaw) for p in _parts(model.term))


def _parts(term: AbstractTerm) -> Iterator[AbstractTerm]:
    """The single terms of a sum, of those with a direction both."""
    for part in summands(term):
        if isinstance(part, Directional):
            yield from (*_parts(part.positive), *_parts(part.negative))
        else:
            yield part


def _in_blocks(of: Callable[[Recording], Array], recording: Recording) -> np.ndarray:
    """A function of each sample of a long recording, `(N,)`: its columns at once would be large."""
    count = recording.num_samples
    values = np.empty(count, recording.time.dtype)
    for start in range(0, count, BLOCK):
        stop = min(start + BLOCK, count)
        part = jax.tree.map(lambda x, own=slice(start, stop): np.asarray(x)[own], recording)
        values[start:stop] = np.asarray(of(pad(part, BLOCK)))[: stop - start]
    return values


def _rate(momentum: Float[Array, " N"], prepared: Recording, choice: signals.Choice | None):
    """The zero-phase smoothing derivative of the momentum, `(N,)`; inside jit by parabolas."""
    traced = signals.is_traced(prepared) or isinstance(momentum, jax.core.Tracer)
    if traced or choice is None:
        motion = prepared
        if prepared.position is None:
            motion = dataclasses.replace(prepared, position=prepared.velocity)
        width = jax.lax.stop_gradient(signals.choose_half_width(motion, signals.TRACED_REACH))
        span = (width + 0.5) * signals.interval(prepared)
        return signals.local_quadratic(prepared, momentum, span, signals.TRACED_REACH)[1]
    rate = signals.derivative(prepared, momentum, choice.half_width, choice.degree)
    return rate.astype(momentum.dtype, copy=False)


def _at_once(model: Model) -> tuple[Model, Float[Array, ""] | None]:
    """The model with no delay, and by how much later its force acts, s; `None` for at once.

    Without its units' names, for which nothing is to be compiled anew.
    """
    name = next(filter(None, (traits(term).shift for term in summands(model.term))), None)
    delay = model.force_delay
    if name is not None:
        late = model.parameters[name]
        delay = late if delay is None else delay + late
        model = model.with_parameters({name: 0.0})
    return dataclasses.replace(model, force_delay=None, units=()), delay


def _later(recording: Recording, signal: Float[Array, " N"], delay) -> Float[Array, " N"]:
    """A signal at t + `delay`, straight between the samples; held at the ends of a segment."""
    return signal if delay is None else _shifted(recording.time, recording.segment, signal, delay)


@programs.compiled
def _shifted(time, segment, signal, delay):
    steps = jnp.where(segment[1:] == segment[:-1], jnp.diff(time), 0.0)
    elapsed = jnp.concatenate([jnp.zeros(1, time.dtype), jnp.cumsum(jnp.maximum(steps, 0.0))])
    # Segments far enough apart that none reaches the next one.
    apart = elapsed + segment.astype(time.dtype) * (elapsed[-1] + 1)
    ends = jnp.searchsorted(segment, segment, side="right") - 1
    starts = jnp.searchsorted(segment, segment, side="left")
    wanted = jnp.clip(apart + delay, apart[starts], apart[ends])
    return jnp.interp(wanted, apart, signal)


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
        part = sound if name == PREDICTED else sound.only(carried)
        channels[name] = part.force(recording) + _by_kernel(recording, part.momentum(recording))
    return dataclasses.replace(recording, channels=channels)


def outliers(recording: Recording) -> Bool[np.ndarray, " N"]:
    """Samples whose force no actuator made, by [`lone`][jaxfric.checks], `(N,)`.

    At most three in a row, far beyond all others: a fault of the sensor, the bus or the file. A
    push or an impact lasts, and stays.
    """
    force, valid = np.asarray(recording.force, float), np.asarray(recording.mask)
    valid = valid & np.isfinite(force)
    found = np.zeros_like(valid)
    if np.count_nonzero(valid) > 2 * checks.LONE:
        found[valid] = checks.lone(force[valid])
    return found


def in_motion(
    recording: Recording, delay: float = 0.0, prepared: Prepared | None = None
) -> Bool[np.ndarray, " N"]:
    """The samples that a force error is taken over, `(N,)`.

    Valid ones, without [`outliers`][], that are faster than the slowest speed that is told from
    rest, by [`signals.scales`][]; of a model with a `delay`, s, also that much later, which is what
    its force is for. At rest friction takes any value up to break-away, and at a reversal it jumps,
    and the acceleration with it: where the derivative of the momentum reaches into one of these, it
    is of both sides. Beside an end of the recording, or a gap in it, the derivative is seen from
    one side, and is that of a few samples. `prepared`: as in [`residual`][].
    """
    motion = Prepared.of(recording) if prepared is None else prepared
    slowest = float(signals.host_scales(excerpt(motion.recording))[0].slowest)
    velocity = np.asarray(motion.recording.velocity)[: recording.num_samples]
    moving = np.abs(velocity) > slowest
    valid = np.asarray(motion.recording.mask)[: recording.num_samples]
    width = motion.choice.half_width
    turns = _turns(np.sign(velocity) * moving, valid)
    moving &= valid & ~_beside([(turns, width), (_ends(motion, valid), width // 2)], moving & valid)
    if delay:
        moving &= np.asarray(_later(recording, jnp.asarray(moving, float), delay)) == 1
        moving &= _within(recording, delay)
    return moving & ~outliers(recording)


def _within(recording: Recording, delay: float) -> Bool[np.ndarray, " N"]:
    """Whether the motion that much later is in the recording: at its end it is not."""
    time = jnp.asarray(recording.time)
    later = np.asarray(_later(recording, time, delay) - time)
    return np.abs(later - delay) < 0.5 * float(signals.host_interval(recording))


# Of both sides of a stop, a reversal or an end: the last sample before it and the first behind it.
Sides = tuple[np.ndarray, np.ndarray]
# An axis that is nearer to a stop or a reversal in most of its motion has no other samples.
MOSTLY = 0.5


def _turns(side: Float[np.ndarray, " N"], valid: Bool[np.ndarray, " N"]) -> Sides:
    """Both sides of every stop and reversal.

    **Arguments:** `side`, the direction of motion, 0 at rest, `(N,)`; `valid` samples, which alone
    have one.
    """
    known = np.flatnonzero(valid)
    changes = np.flatnonzero(np.diff(side[known]))
    return known[changes], known[changes + 1]


def _ends(motion: Prepared, valid: Bool[np.ndarray, " N"]) -> Sides:
    """Both sides of every end of the recording and of every gap in it."""
    recording = motion.recording
    linked = signals.host_continuous(recording, signals.host_interval(recording))
    apart = np.flatnonzero(~linked[: valid.size - 1])
    return np.append(apart, valid.size - 1), np.insert(apart + 1, 0, 0)


def _beside(
    edges: Sequence[tuple[Sides, int]], moving: Bool[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """The samples within so many of each kind of edge, `(N,)`, but of a kind with which they would
    be most of those that are `moving`.
    """
    near = np.zeros_like(moving)
    for (lasts, firsts), reach in edges:
        beside = np.zeros(moving.size + 1, int)  # so many more edges are near from here on
        for first in (lasts + 1 - reach, firsts):
            np.add.at(beside, np.maximum(first, 0), 1)
            np.add.at(beside, np.minimum(first + reach, moving.size), -1)
        more = near | (np.cumsum(beside[:-1]) > 0)
        if np.count_nonzero(more & moving) < MOSTLY * np.count_nonzero(moving):
            near = more
    return near


def unseen(names: Collection[str], prepared: Prepared, moving: Bool[np.ndarray, " N"]) -> list[str]:
    """The names of parameters (`+`, `-`) of a direction in which a recording does not move.

    `moving`: the samples [`in_motion`][], `(N,)`.
    """
    velocity = np.asarray(prepared.recording.velocity)[: moving.size][moving]
    idle = [s for s, ways in (("+", velocity > 0), ("-", velocity < 0)) if not ways.any()]
    return [name for name in names if name.endswith(tuple(idle))]


def delay_of(model: Model) -> float:
    """By how much later a model's force acts, s: its dead time, and its log's `force_delay`."""
    delay = _at_once(model)[1]
    return 0.0 if delay is None else float(delay)


def residual(
    model: Model, recording: Recording, prepared: Prepared | None = None
) -> Float[np.ndarray, " N"]:
    """The force that arrived less the one by [`predict`][], N, `(N,)`, on the host.

    `prepared`: the recording made [`uniform`][jaxfric.data.recording] and prepared, where that has
    been done.
    """
    require_model(model, "predict")
    motion = Prepared.of(recording) if prepared is None else prepared
    predicted = np.asarray(_force(model, motion), float)[: recording.num_samples]
    return arrived(model, recording) - predicted


def arrived(model: Model, recording: Recording) -> Float[np.ndarray, " N"]:
    """What arrived of the recorded force, N, `(N,)`: no more than a force limit of the model."""
    force, limit = np.asarray(recording.force, float), model.force_limit
    return force if limit is None else np.clip(force, -float(limit), float(limit))


def force_error(model: Model, recording: Recording) -> float:
    """norm(u − û)/norm(u) over the samples [`in_motion`][], with û by [`predict`][], u the recorded
    force, of a command no more than the model's force limit.

    No filter but the derivative in û: the noise of the recorded force is in it. NaN where nothing
    moves or no force is recorded.
    """
    prepared = Prepared.of(recording)
    moving = in_motion(recording, delay_of(model), prepared)
    left = residual(model, recording, prepared)[moving]
    del prepared
    return relative(left, arrived(model, recording)[moving])


def relative(left: Float[np.ndarray, " M"], force: Float[np.ndarray, " M"]) -> float:
    """norm(left)/norm(force); NaN where there is no force."""
    size = float(np.linalg.norm(force))
    return float(np.linalg.norm(left)) / size if size > 0 else float("nan")


def relative_error(
    model: Model, recording: Recording, half_width: int | None = None
) -> Float[Array, ""]:
    """norm(u − û)/norm(u) of a model on a recording, both passed through the same kernel.

    The measure of the EMPS benchmark (Janot, Gautier & Brunot 2019), over everything but rest.
    `half_width` of the kernel in samples; by default that of [`signals.kernel_half_width`][].
    """
    model, delay = _at_once(model)
    if model.force_limit is not None:
        recording = dataclasses.replace(recording, force=model.arriving(recording.force))
    prepared = with_channels(model, signals.prepare(recording))
    if delay is not None:
        prepared = dataclasses.replace(prepared, force=_later(prepared, prepared.force, -delay))
    width = half_width or signals.kernel_half_width(prepared)
    return _relative_error(model, prepared, width)


@eqx.filter_jit
def _relative_error(model, recording, width):
    rows = WeakForm(width).rows(recording, signals.scales(recording))
    left = rows.target - weighed(rows.columns(model.term, recording), model.alpha)
    return rows.relative(left - rows.offset(model.term, recording))
