"""How far a model's force is from the recorded one, and over which samples that is told."""

import dataclasses
from collections.abc import Collection, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .. import checks, signals
from ..data.excerpt import excerpt
from ..data.recording import Recording
from ..identification.projections import WeakForm
from ..models import Model, require as require_model, weighed
from .prediction import Prepared, at_once, force_along, later, with_channels


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
        moving &= np.asarray(later(recording, jnp.asarray(moving, float), delay)) == 1
        moving &= _within(recording, delay)
    return moving & ~outliers(recording)


def _within(recording: Recording, delay: float) -> Bool[np.ndarray, " N"]:
    """Whether the motion that much later is in the recording: at its end it is not."""
    time = jnp.asarray(recording.time)
    shift = np.asarray(later(recording, time, delay) - time)
    return np.abs(shift - delay) < 0.5 * float(signals.host_interval(recording))


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
    delay = at_once(model)[1]
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
    predicted = np.asarray(force_along(model, motion), float)[: recording.num_samples]
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
    model, delay = at_once(model)
    if model.force_limit is not None:
        recording = dataclasses.replace(recording, force=model.arriving(recording.force))
    prepared = with_channels(model, signals.prepare(recording))
    if delay is not None:
        prepared = dataclasses.replace(prepared, force=later(prepared, prepared.force, -delay))
    width = half_width or signals.kernel_half_width(prepared)
    return _relative_error(model, prepared, width)


@eqx.filter_jit
def _relative_error(model, recording, width):
    rows = WeakForm(width).rows(recording, signals.scales(recording))
    left = rows.target - weighed(rows.columns(model.term, recording), model.alpha)
    return rows.relative(left - rows.offset(model.term, recording))
