"""How far a model's force is from the recorded one, and over which samples that is told."""

import math
from collections.abc import Collection, Iterator, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from .. import signals
from ..data.cleaning.lone import far_forces
from ..data.cleaning.pieces import some
from ..data.excerpt import MOST
from ..data.recording import Recording
from ..models import Model, require as require_model
from .lateness import at_once, later
from .prediction import Prepared, forces, located, samples_of


def outliers(recording: Recording) -> Bool[np.ndarray, " N"]:
    """Samples whose force no actuator made, `(N,)`.

    At most three in a row, far beyond all others: a fault of the sensor, the bus or the file. A
    push or an impact lasts, and stays.
    """
    force, valid = np.asarray(recording.force, float), np.asarray(recording.mask)
    valid = valid & np.isfinite(force)
    return far_forces(force, valid)


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
    side, valid, ends = _course(motion, recording.num_samples)
    moving = np.abs(side) == 1
    width = motion.choice.half_width
    moving &= valid & ~_beside([(_turns(side, valid), width), (ends, width // 2)], moving & valid)
    del side, valid
    if delay:
        moving &= _so_much_later(recording, moving, delay, motion.step)
    return moving & ~outliers(recording)


def _so_much_later(
    recording: Recording, moving: Bool[np.ndarray, " N"], delay: float, step: float
) -> Bool[np.ndarray, " N"]:
    """Whether the axis is moving that much later, and that is in the recording: beyond its end it
    is not. `step`: the typical interval, s.
    """
    found, reach = np.zeros_like(moving), samples_of(delay, step)
    for start in range(0, moving.size, MOST):
        first, stop = max(0, start - reach), min(start + MOST, moving.size)
        near = slice(first, stop + reach)
        part = jax.tree.map(lambda x, near=near: x[near], recording)
        time = jnp.asarray(part.time)
        late = np.asarray(later(part, jnp.asarray(moving[near], float), delay)) == 1
        late &= np.abs(np.asarray(later(part, time, delay) - time) - delay) < 0.5 * step
        found[start:stop] = late[start - first : stop - first]
    return found


# Of both sides of a stop, a reversal or an end: the last sample before it and the first behind it.
Sides = tuple[np.ndarray, np.ndarray]
# An axis that is nearer to a stop or a reversal in most of its motion has no other samples.
MOSTLY = 0.5


def _course(motion: Prepared, count: int) -> tuple[np.ndarray, np.ndarray, Sides]:
    """The direction of motion of so many samples, 0 at rest and 2 where it is not known, `(N,)`;
    which are valid, `(N,)`; and both sides of every end of the recording and of every gap in it.
    """
    slowest = float(signals.host_scales(motion.excerpt())[0].slowest)
    side, valid, apart = np.zeros(count, np.int8), np.zeros(count, bool), list[np.ndarray]()
    for own, part, inside in motion.pieces(1):
        velocity = np.asarray(part.recording.velocity)[inside][: count - own.start]
        known = slice(own.start, own.start + velocity.size)
        way = np.sign(velocity) * (np.abs(velocity) > slowest)
        side[known] = np.where(np.isnan(velocity), 2, way)
        valid[known] = np.asarray(part.recording.mask)[inside][: velocity.size]
        linked = signals.host_continuous(part.recording, motion.step)[inside]
        apart.append(own.start + np.flatnonzero(~linked[: velocity.size]))
    last = np.concatenate(apart)
    last = last[last < count - 1]
    return side, valid, (np.append(last, count - 1), np.insert(last + 1, 0, 0))


def _turns(side: Int[np.ndarray, " N"], valid: Bool[np.ndarray, " N"]) -> Sides:
    """Both sides of every stop and reversal.

    **Arguments:** `side`, the direction of motion, 0 at rest, `(N,)`; `valid` samples, which alone
    have one.
    """
    changes = np.flatnonzero(np.diff(some(side, valid)))
    if valid.all():
        return changes, changes + 1
    known = np.flatnonzero(valid)
    return known[changes], known[changes + 1]


def _beside(
    edges: Sequence[tuple[Sides, int]], moving: Bool[np.ndarray, " N"]
) -> Bool[np.ndarray, " N"]:
    """The samples within so many of each kind of edge, `(N,)`, but of a kind with which they would
    be most of those that are `moving`.
    """
    near = np.zeros_like(moving)
    for (lasts, firsts), reach in edges:
        beside = np.zeros(moving.size + 1, np.int32)  # so many more edges are near from here on
        for first in (lasts + 1 - reach, firsts):
            np.add.at(beside, np.maximum(first, 0), 1)
            np.add.at(beside, np.minimum(first + reach, moving.size), -1)
        more = near | (np.cumsum(beside, dtype=np.int32, out=beside)[:-1] > 0)
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
    delay = at_once(model)[1]
    return 0.0 if delay is None else float(delay)


def residual(
    model: Model, recording: Recording, prepared: Prepared | None = None
) -> Float[np.ndarray, " N"]:
    """The force that arrived less the one by [`predict`][], N, `(N,)`, on the host.

    `prepared`: the recording made [`uniform`][jaxfric.data.recording] and prepared, where that has
    been done.
    """
    left = np.empty(recording.num_samples)
    for own, part in _residuals(model, recording, prepared):
        left[own] = part
    return left


def _residuals(
    model: Model, recording: Recording, prepared: Prepared | None
) -> Iterator[tuple[slice, Float[np.ndarray, " n"]]]:
    """[`residual`][] of samples one after the other, and which these are."""
    require_model(model, "predict")
    motion = Prepared.of(located(model, recording)) if prepared is None else prepared
    force = arrived(model, recording)
    for own, predicted in forces(model, motion):
        measured = force[own]  # without what the motion is padded with
        yield own, measured - np.asarray(predicted, float)[: measured.size]


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
    recording = located(model, recording)
    prepared = Prepared.of(recording)
    moving = in_motion(recording, delay_of(model), prepared)
    parts = _residuals(model, recording, prepared)
    left = sum(power(part, moving[own]) for own, part in parts)
    size = power(arrived(model, recording), moving)
    return math.sqrt(left / size) if size > 0 else float("nan")


def relative(
    left: Float[np.ndarray, " N"], force: Float[np.ndarray, " N"], chosen: Bool[np.ndarray, " N"]
) -> float:
    """norm(left)/norm(force) of the chosen samples; NaN where there is no force."""
    size = power(force, chosen)
    return math.sqrt(power(left, chosen) / size) if size > 0 else float("nan")


def power(values: Float[np.ndarray, " N"], chosen: Bool[np.ndarray, " N"]) -> float:
    """The square sum of the chosen values; of a long recording a copy of them counts."""
    pieces = (slice(start, start + MOST) for start in range(0, len(values), MOST))
    parts = (values[piece][chosen[piece]] for piece in pieces)
    return float(sum(part @ part for part in parts))
