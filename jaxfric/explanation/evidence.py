"""A recording as rows of one regression on the host: small, compiled once, for many candidates.

Explaining tries dozens of terms on one recording, each at dozens of parameter values. So the
recording is first reduced to nodes, local means a sixth of the kernel apart, and every row of the
weak form is a weighted sum of thirteen of them: the same linear functional for the force and for
every column, at a cost that follows the record's bandwidth and not its sample rate.
"""

import copy
import dataclasses
import operator
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import programs, signals
from ..data.recording import Recording, pad
from ..terms import KNOWN, KNOWN_FORCE, KNOWN_MOMENTUM, KNOWN_REST, KnownColumns
from ..terms.base import AbstractTerm, summands
from ..terms.sample import Scales

# Nodes in half a kernel: the trapezoidal rule on them errs by the kernel's spectrum at 2π·6/h,
# which is below 1e-4 of its peak.
NODES = 6
# Rows are half a kernel apart: neighbours share a fifth of their weight, and nothing is lost.
STRIDE = 3
# Values of the nonlinear parameters that one compiled call takes: of a grid, or one with the
# neighbour that gives its derivative; of a load that is stepped along the motion many at once, as
# four times as many steps side by side take hardly longer.
BATCH, PAIR, STEPPED = 8, 2, 32


class Motion(NamedTuple):
    """A recording whose velocity has been derived, once for all the rows that are made of it.

    `recording`: as it was read, `(N,)`; `padded`: with its velocity, of one of few lengths, so that
    few programs are compiled; `smoothed`: by how much that velocity has been, in samples², see
    `signals.smoothing`.
    """

    recording: Recording
    padded: Recording
    smoothed: float

    def forced(self, force: Any) -> "Motion":
        """The same motion with another force, N, `(N,)`."""
        other = dataclasses.replace(self.recording, force=jnp.asarray(force))
        longer = pad(other, self.padded.num_samples).force
        return self._replace(recording=other, padded=dataclasses.replace(self.padded, force=longer))


def motion_of(recording: "Recording | Motion") -> Motion:
    """The motion of a recording by its position, where it has one.

    A recorded velocity is late by its filter, which would look like a delay of the force.
    """
    if isinstance(recording, Motion):
        return recording
    return _derived(from_position(recording))


def from_position(recording: Recording) -> Recording:
    """A recording without its velocity, where it has a position to derive one from."""
    if recording.position is None:
        return recording
    return dataclasses.replace(recording, velocity=None)


class Evidence(NamedTuple):
    """Rows of the weak form in slip, and the motion at the nodes they are made of.

    - `motion`: recording of the nodes, padded to one of few lengths, `(M,)`.
    - `nodes`: how many of them are real.
    - `average` and `slope`: weights of the nodes around every third one, 1 and 1/s, `(R, K)`;
      `rows`: which of these lie in slip, `(J,)`.
    - `force`: that of each row, N, `(J,)`; `target`: without what another simulator has computed,
      where the recording brings that; `side`: the direction, ±1.
    - `centre`: the node in the middle of each row, `(J,)`.
    - `elapsed`: time since the start without interruptions, s, at the nodes, `(M,)`.
    - `limits`: magnitudes of the recording, `Scales` of floats; `reach`: the kernel's half-width,
      s; `width`: the same in samples.
    - `clock`: whether the time stamps increase throughout, so that time is a coordinate.
    """

    motion: Recording
    nodes: int
    average: np.ndarray
    slope: np.ndarray
    rows: np.ndarray
    force: np.ndarray
    target: np.ndarray
    side: np.ndarray
    centre: np.ndarray
    elapsed: np.ndarray
    limits: Any
    reach: float
    width: int
    clock: bool

    @property
    def peak(self) -> float:
        """The largest force at the nodes, N."""
        return float(np.nanmax(np.abs(np.asarray(self.motion.force)[: self.nodes])))

    def project(self, plain: Any, momentum: Any = None) -> np.ndarray:
        """Values at the nodes, `(..., M)`, as rows, `(..., J)`; `momentum` is differentiated."""
        rows = _weigh(np.asarray(plain), self.rows, self.average)
        return rows if momentum is None else rows + _weigh(momentum, self.rows, self.slope)

    def columns(self, term: AbstractTerm, betas: np.ndarray) -> np.ndarray:
        """Rows of a term's columns at many β, `(G, d)` to `(G, J, p)`."""
        if not len(term.affine):
            return np.zeros((len(betas), len(self.target), 0))
        if isinstance(term, KnownColumns):
            return np.repeat(self._known(term)[None], len(betas), axis=0)
        if any(isinstance(part, KnownColumns) for part in summands(term)):
            # Each by itself: nothing is compiled for the names of a simulator's parameters.
            apart = [self.columns(part, np.zeros((len(betas), 0))) for part in summands(term)]
            return np.concatenate(apart, axis=2)
        parts = []
        most = STEPPED if term.stepped else BATCH
        for start in range(0, len(betas), most):
            some = betas[start : start + most]
            size = PAIR if len(some) <= PAIR else most
            full = np.concatenate([some, np.repeat(some[-1:], size - len(some), axis=0)])
            plain, momentum = evaluate(term, full, self.motion)
            momentum = None if momentum is None else np.asarray(momentum)[: len(some)]
            parts.append(self.project(np.asarray(plain)[: len(some)], momentum))
        return np.concatenate(parts).transpose(0, 2, 1)

    def _known(self, term: KnownColumns) -> np.ndarray:
        """Rows of what a simulator says its parameters add, `(J, p)`."""
        channels = self.motion.channels
        pairs = term.channels
        plain, momentum = (
            np.stack([channels[n] for n in some]) for some in zip(*pairs, strict=True)
        )
        return self.project(plain, momentum).T

    def with_channels(self, **channels: np.ndarray) -> "Evidence":
        """The same with more signals at the nodes, each `(M,)`."""
        added = {name: jnp.asarray(value) for name, value in channels.items()}
        motion = eqx.tree_at(lambda m: m.channels, self.motion, self.motion.channels | added)
        return self._replace(motion=motion)


def _weigh(values: np.ndarray, rows: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted sums of the nodes around every third one, of which `rows` are kept."""
    around = np.lib.stride_tricks.sliding_window_view(values, weights.shape[1], axis=-1)
    centred = around[..., ::STRIDE, :][..., : len(weights), :]
    return np.einsum("...ck,ck->...c", centred, weights)[..., rows]


def evaluate(term: AbstractTerm, betas: np.ndarray, motion: Recording):
    """Columns, `(B, p, M)`, and momentum, `None` where there is none, at β, `(B, d)`.

    Compiled once for each kind of term and each of the few B: numbers of the recording that are
    built into a term's structure (the middle of the stroke, say) go in as data.
    """
    numbers: list[float] = []

    def take(number: float) -> float:
        numbers.append(number)
        return 1.0

    form = _renumbered(term, take)
    motion = _without_known(motion, term.coordinates)
    return _compiled(form, betas, np.asarray(numbers, betas.dtype), motion)


def _without_known(motion: Recording, kept: frozenset[str] = frozenset()) -> Recording:
    """A motion without what a simulator says of it, for which nothing is to be compiled anew."""
    channels = {k: v for k, v in motion.channels.items() if not k.startswith(KNOWN) or k in kept}
    if len(channels) == len(motion.channels):
        return motion
    return dataclasses.replace(motion, channels=channels)


def _columns(form, betas, numbers, motion):
    def one(beta):
        inside = iter(numbers)
        known = _renumbered(form.with_beta(beta), lambda _: next(inside))
        return known.columns(motion).T, known.momentum(motion).T if form.inertial else None

    if form.nonlinear:
        return jax.vmap(one)(betas)
    alone = one(betas[0])
    return jax.tree.map(lambda x: jnp.broadcast_to(x[None], (len(betas), *x.shape)), alone)


_compiled = programs.compiled(_columns, optimised=programs.LITTLE)


def _renumbered(part: Any, number: Callable[[float], Any]) -> Any:
    """A term whose static floating-point numbers, however deep, are replaced; but zeros, which are
    another form of the law, stay.
    """
    if isinstance(part, float) and part != 0:
        return number(part)
    if isinstance(part, tuple):
        parts = tuple(_renumbered(each, number) for each in part)
        return part if all(map(operator.is_, parts, part)) else parts
    if not isinstance(part, AbstractTerm):
        return part
    changed = {}
    for name, value in vars(part).items():
        if name in _static(type(part)) or isinstance(value, tuple | AbstractTerm):
            new = _renumbered(value, number)
            if new is not value:
                changed[name] = new
    if not changed:
        return part
    other = copy.copy(part)
    for name, value in changed.items():
        object.__setattr__(other, name, value)
    return other


@cache
def _static(kind: type) -> frozenset[str]:
    """The names of a term's fields that are part of its structure."""
    fields = dataclasses.fields(kind)
    return frozenset(field.name for field in fields if field.metadata.get("static"))


def gather(
    recording: Recording | Motion,
    half_width: int | None = None,
    delay: float = 0.0,
    reversals: bool = False,
    reach: float | None = None,
) -> Evidence:
    """The evidence of one recording.

    **Arguments:** `recording`, signals of shape `(N,)`, or its motion, with which many rows take
    little longer than one; `half_width` of the kernel in samples, by
    default [`kernel_half_width`][jaxfric.signals.kernel_half_width], or as near as samples allow to
    `reach`, s, that of another recording; `delay`, s, by which the
    force is taken later; `reversals`: rows that reach across a reversal too, but none at rest,
    for judging a model as [`relative_error`][jaxfric.simulation.prediction.relative_error] does.

    **Raises:** `ValueError` if the axis hardly slips.
    """
    motion = recording if isinstance(recording, Motion) else _derived(recording)
    prepared, count = motion.padded, motion.recording.num_samples
    source = motion.recording.source or "The recording"
    limits = Scales(*(float(x) for x in signals.host_scales(prepared)[0]))
    if reach is not None:
        half_width = max(1, int(round(reach / limits.interval)))
    width = int(half_width or min(signals.kernel_half_width(prepared), _widest(prepared)))
    prepared = jax.tree.map(lambda x: np.asarray(x)[:count], prepared)
    step = max(1, round(width / NODES))
    span = float(step * NODES * limits.interval)
    parts = _node_signals(prepared, limits, step, delay, motion.smoothed)
    index, whole, average, slope = _windows(parts, span)
    speed = parts["velocity"][index]
    moving = np.abs(speed) > limits.slowest
    one_way = (speed > 0).all(axis=1) | (speed < 0).all(axis=1)
    slips = np.sum(average * moving, axis=1) > 0.5 if reversals else moving.all(axis=1) & one_way
    rows = np.flatnonzero(whole & slips)
    if len(rows) < 32:
        raise ValueError(
            f"{source} leaves {len(rows)} independent stretches in "
            "which the axis slips; at least 32 are needed to tell structure from chance. Record "
            "longer, or move more."
        )
    nodes = _padded(parts, prepared)
    centre = index[rows, NODES]
    force = np.sum(average * parts["force"][index], axis=1)[rows]
    whole_known = KNOWN_FORCE if KNOWN_MOMENTUM not in prepared.channels else KNOWN_REST
    known = parts.get(f"channel {whole_known}")
    target = force if known is None else force - np.sum(average * known[index], axis=1)[rows]
    average, slope = _averaged(average), _averaged(slope)
    if known is not None and whole_known == KNOWN_REST:
        moving_known = parts[f"channel {KNOWN_MOMENTUM}"]
        target = target - np.sum(slope * moving_known[index], axis=1)[rows]
    pads = nodes.num_samples - len(parts["time"])
    time = np.asarray(prepared.time)[np.asarray(prepared.mask)]
    return Evidence(
        motion=nodes,
        nodes=len(parts["time"]),
        average=average,
        slope=slope,
        rows=rows,
        force=force,
        target=target,
        side=np.sign(parts["velocity"][centre]),
        centre=centre,
        elapsed=np.pad(parts["elapsed"], (0, pads), mode="edge"),
        limits=limits,
        reach=span,
        width=step * NODES,
        clock=bool(np.all(np.diff(time) > 0)),
    )


def _derived(recording: Recording) -> Motion:
    # The name and the number of segments would be compiled in.
    nameless = dataclasses.replace(recording, source="", sha256="", num_segments=1)
    bare = _without_known(nameless)
    padded, whole = (pad(log, _length(recording.num_samples)) for log in (bare, nameless))
    smoothed = 0.0
    if padded.velocity is None:
        choice = signals.choose(padded)
        padded, smoothed = signals.prepare(padded, choice), signals.smoothing(choice)
    return Motion(recording, dataclasses.replace(padded, channels=whole.channels), smoothed)


# Kernels in a record at least: 24 blocks of eight, on which its significance is judged. Where an
# axis hardly accelerates, the noise of its acceleration would ask for wider ones.
KERNELS = 192


def _widest(recording: Recording) -> int:
    return max(16, int(np.count_nonzero(np.asarray(recording.mask))) // KERNELS)


def _length(count: int) -> int:
    """The next power of two, or three quarters of it, so that few programs are compiled."""
    octave = max(256, 1 << (count - 1).bit_length())
    return octave if count > octave * 3 // 4 else octave * 3 // 4


def _node_signals(
    recording: Recording, limits: Scales, step: int, delay: float, smoothed: float
) -> dict:
    """Local means of every signal, `step` samples apart, with the run that each node lies in.

    `smoothed`: by how much the velocity has been, in samples², see `signals.smoothing`.
    """
    time, mask = np.asarray(recording.time, float), np.asarray(recording.mask)
    linked = _continuous(time, mask, np.asarray(recording.segment), limits.interval)
    run = np.pad(np.cumsum(~linked), (1, 0))
    steps = np.where(linked, np.diff(time), limits.interval)
    series = {
        "time": time,
        "force": np.asarray(recording.force, float),
        "velocity": np.asarray(recording.velocity, float),
        "elapsed": np.pad(np.cumsum(steps), (1, 0)),
    }
    if recording.position is not None:
        series["position"] = np.asarray(recording.position, float)
    series |= {f"channel {k}": np.asarray(v, float) for k, v in recording.channels.items()}
    if delay:
        series["force"] = _shifted(time, series["force"], run, delay)
    centres = np.arange(0, len(time), step)
    offsets = np.arange(-(step - 1), step)
    at = np.clip(centres[:, None] + offsets[None, :], 0, len(time) - 1)
    near = mask[at] & (run[at] == run[centres][:, None])
    near &= centres[:, None] + offsets[None, :] == at
    weight = np.where(near, (step - np.abs(offsets))[None, :], 0.0)
    total = weight.sum(axis=1)
    weight /= np.where(total > 0, total, 1.0)[:, None]
    means = {
        name: np.einsum("ij,ij->i", weight, np.where(near, values[at], 0.0))
        for name, values in series.items()
    }
    label = np.where(total > 0, run[centres], -1 - np.arange(len(centres)))
    # Terms are functions of the motion at an instant, not of its mean: the curvature that the
    # triangle of weights took off (its variance is a sixth of the squared spacing) is put back,
    # and the columns' weights take it off again, so that force and columns are averaged alike. So
    # is what the derivative took off the velocity, which would look like a load on a spring.
    inner = np.flatnonzero((label[1:-1] == label[:-2]) & (label[1:-1] == label[2:])) + 1
    forces = {"force", f"channel {KNOWN_FORCE}", f"channel {KNOWN_REST}"}
    for name in set(means) - forces - {"time", "elapsed"}:
        values = means[name]
        bend = values[inner + 1] - 2 * values[inner] + values[inner - 1]
        means[name] = values.copy()
        derived = name == "velocity" or name.endswith("momentum")
        lost = 1 / 12 + (smoothed / step**2 if derived else 0.0)
        means[name][inner] -= lost * bend
    return means | {"run": label}


def _continuous(time, mask, segment, interval) -> np.ndarray:
    """As [`continuous`][jaxfric.signals.continuous], on the host."""
    steps = np.diff(time)
    together = mask[1:] & mask[:-1] & (segment[1:] == segment[:-1])
    return together & (steps > 0) & (steps <= signals.GAP_FACTOR * interval)


def _shifted(time, force, run, delay):
    """The force `delay` later, s: u(t + delay), inside each run."""
    late = np.interp(time + delay, time, force) if np.all(np.diff(time) > 0) else None
    if late is not None:
        return late
    out = np.empty_like(force)
    for label in np.unique(run):
        own = run == label
        out[own] = np.interp(time[own] + delay, time[own], force[own])
    return out


def _windows(parts: dict, reach: float) -> tuple[np.ndarray, ...]:
    """Nodes of the row around every third node, whether they lie in one run, and their weights."""
    middle = np.arange(NODES, len(parts["time"]) - NODES, STRIDE)
    index = middle[:, None] + np.arange(-NODES, NODES + 1)[None, :]
    whole = parts["run"][index[:, 0]] == parts["run"][index[:, -1]]
    even = np.arange(-NODES, NODES + 1) * reach / NODES
    offset = parts["time"][index] - parts["time"][index[:, NODES]][:, None]
    offset = np.where(whole[:, None], offset, even[None, :])
    tau = offset / reach
    average = np.maximum(1 - tau**2, 0.0) ** 4
    slope = 8 * tau * np.maximum(1 - tau**2, 0.0) ** 3
    average /= average.sum(axis=1, keepdims=True)
    slope -= average * slope.sum(axis=1, keepdims=True)
    slope /= np.sum(slope * offset, axis=1, keepdims=True)
    return index, whole, average, slope


def _averaged(weights: np.ndarray) -> np.ndarray:
    """The weights of a triangle's mean around each node, by its second moment."""
    bend = np.zeros_like(weights)
    bend[:, 1:-1] = weights[:, 2:] - 2 * weights[:, 1:-1] + weights[:, :-2]
    bend[:, 0], bend[:, -1] = weights[:, 1], weights[:, -2]
    return weights + bend / 12


def _padded(parts: dict, recording: Recording) -> Recording:
    """The nodes as a recording, lengthened as [`_length`][] says."""
    count = len(parts["time"])
    length = _length(count)

    def pad(values):
        return jnp.asarray(np.pad(values, (0, length - count), mode="edge"))

    position = pad(parts["position"]) if "position" in parts else None
    channels = {k[8:]: pad(v) for k, v in parts.items() if k.startswith("channel ")}
    labels = np.unique(parts["run"], return_inverse=True)[1].astype(np.int32)
    segment = jnp.asarray(np.pad(labels, (0, length - count), mode="edge"))
    return Recording(
        pad(parts["time"]), pad(parts["force"]), position, pad(parts["velocity"]),
        segment=segment, channels=channels, num_segments=1, units=recording.units,
    )  # fmt: skip
