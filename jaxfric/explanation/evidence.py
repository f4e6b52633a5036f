"""A recording as rows of one regression on the host: small, compiled once, for many candidates.

A search tries dozens of terms on one recording, each at dozens of parameter values. So the
recording is first reduced to nodes, local means a sixth of the kernel apart, and every row of the
weak form is a weighted sum of thirteen of them: the same linear functional for the force and for
every column, at a cost that follows the record's bandwidth and not its sample rate.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import signals
from ..data.excerpt import MOST, SPARE, excerpt
from ..data.recording import Recording
from ..terms import KNOWN_FORCE, KNOWN_MOMENTUM, KNOWN_REST, KnownColumns
from ..terms.base import AbstractTerm, summands
from ..terms.sample import Scales
from .evaluation import BATCH, PAIR, evaluate, in_batches
from .motion import Motion, derived, motion_of
from .nodes import NODES, Means, averaged, node_signals, padded, stride, windows


class Evidence(NamedTuple):
    """Rows of the weak form in slip, and the motion at the nodes they are made of.

    - `motion`: recording of the nodes, padded to one of few lengths, `(M,)`.
    - `nodes`: how many of them are real.
    - `average` and `slope`: weights of the nodes around every third one (farther apart beside a
      wider kernel on the same nodes), 1 and 1/s, `(R, K)`;
      `rows`: which of these lie in slip, `(J,)`.
    - `force`: that of each row, N, `(J,)`; `target`: without what another simulator has computed,
      where the recording brings that; `side`: the direction, ±1.
    - `centre`: the node in the middle of each row, `(J,)`.
    - `elapsed`: time since the start without interruptions, s, at the nodes, `(M,)`.
    - `limits`: magnitudes of the recording, `Scales` of floats; `reach`: the kernel's half-width,
      s; `width`: the same in samples.
    - `pieces`: numbers of the stretches in which the force is compared throughout, `(M,)`.
    - `clock`: whether the time stamps increase throughout, so that time is a coordinate.
    - `located`: whether a position was recorded; else there is none, or the velocity's integral.
    - `counted`: the step of the recorded position, m; zero where it is not counted.
    - `noise`: standard deviation of the white noise of the force's samples, N.
    - `repeats`: the time, s, after which the motion repeats itself to a count; zero for never.
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
    pieces: np.ndarray
    limits: Any
    reach: float
    width: int
    clock: bool
    located: bool
    counted: float
    noise: float
    repeats: float

    @property
    def half(self) -> int:
        """Nodes in half a kernel."""
        return self.average.shape[1] // 2

    @property
    def peak(self) -> float:
        """The largest force at the nodes, N."""
        return float(np.nanmax(np.abs(np.asarray(self.motion.force)[: self.nodes])))

    @property
    def both_ways(self) -> bool:
        """Whether the axis moves in both directions."""
        return bool(np.ptp(self.side) > 0)

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
        if term.switched is not None:
            return self._switched(term, betas)
        parts = [self.project(*both) for both in in_batches(term, betas, self.read_by(term))]
        return np.concatenate(parts).transpose(0, 2, 1)

    def read_by(self, term: AbstractTerm) -> Recording:
        """The nodes as a term reads them: for a load, in pieces.

        A bristle bends with the position, which is known where a simulator's force is masked. A
        load begins to swing by the acceleration, which jumps there and is derived.
        """
        if not term.stepped:
            return self.motion
        return eqx.tree_at(lambda m: m.segment, self.motion, jnp.asarray(self.pieces))

    def _known(self, term: KnownColumns) -> np.ndarray:
        """Rows of what a simulator says its parameters add, `(J, p)`."""
        return self.project(*self._said(term)).T

    def _said(self, term: KnownColumns) -> tuple[np.ndarray, ...]:
        """Rest and momentum of a simulator's parameters at the nodes, `(p, M)` each."""
        channels = self.motion.channels
        pairs = zip(*term.channels, strict=True)
        return tuple(np.stack([np.asarray(channels[n]) for n in some]) for some in pairs)

    def _switched(self, term: AbstractTerm, betas: np.ndarray) -> np.ndarray:
        """Rows of another term that comes and goes: its columns at the nodes are computed once."""
        pairs = [self._at_nodes(part) for part in summands(term.switched)]
        plain, momentum = (np.concatenate(some) for some in zip(*pairs, strict=True))
        time, parts = np.asarray(self.motion.time), []
        for start in range(0, len(betas), BATCH):
            share, rate = (
                each[:, None] for each in term.course(betas[start : start + BATCH], time)
            )
            if term.inertial:
                parts.append(self.project(share * plain - rate * momentum, share * momentum))
            else:
                parts.append(self.project(share * plain))
        return np.concatenate(parts).transpose(0, 2, 1)

    def _at_nodes(self, term: AbstractTerm) -> tuple[np.ndarray, ...]:
        """Columns and momentum at the nodes, `(p, M)` each, of a term without β."""
        if isinstance(term, KnownColumns):
            return self._said(term)
        plain, momentum = evaluate(term, np.zeros((PAIR, 0)), self.motion)
        first = np.asarray(plain)[0]
        return first, np.zeros_like(first) if momentum is None else np.asarray(momentum)[0]

    def only(self, kept: np.ndarray) -> "Evidence":
        """Some of the rows, `(J,)` booleans."""
        names = ("rows", "force", "target", "side", "centre")
        return self._replace(**{name: getattr(self, name)[kept] for name in names})

    def stretch(self, first: int, nodes: int) -> "tuple[Evidence, np.ndarray]":
        """The rows within so many nodes from one on, and which these are, `(J,)`."""
        step = stride(self.half)
        first -= first % step
        chosen = slice(first, first + nodes)
        windows = slice(first // step, (first + nodes - 2 * self.half - 1) // step + 1)
        inside = (self.rows >= windows.start) & (self.rows < windows.stop)
        motion = jax.tree.map(lambda values: values[chosen], self.motion)
        rows = {name: getattr(self, name)[inside] for name in ("force", "target", "side")}
        return self._replace(
            motion=motion,
            nodes=len(motion.time),
            average=self.average[windows],
            slope=self.slope[windows],
            rows=self.rows[inside] - windows.start,
            centre=self.centre[inside] - first,
            elapsed=self.elapsed[chosen],
            pieces=self.pieces[chosen],
            **rows,
        ), inside

    def with_channels(self, **channels: np.ndarray) -> "Evidence":
        """The same with more signals at the nodes, each `(M,)`."""
        added = {name: jnp.asarray(value) for name, value in channels.items()}
        motion = eqx.tree_at(lambda m: m.channels, self.motion, self.motion.channels | added)
        return self._replace(motion=motion)


def _weigh(values: np.ndarray, rows: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Weighted sums of the nodes around those that are a [`stride`][] apart, at numbers `rows`."""
    around = np.lib.stride_tricks.sliding_window_view(values, weights.shape[1], axis=-1)
    centred = around[..., :: stride(weights.shape[1] // 2), :][..., : len(weights), :]
    return np.einsum("...ck,ck->...c", centred, weights)[..., rows]


# Fewer rows cannot tell structure from chance.
FEWEST_ROWS = 32


def gather(
    recording: Recording | Motion,
    half_width: int | None = None,
    delay: float = 0.0,
    reversals: bool = False,
    reach: float | None = None,
    half: int = NODES,
) -> Evidence:
    """The evidence of one recording.

    **Arguments:** `recording`, signals of shape `(N,)`, or its motion, with which many rows take
    little longer than one; `half_width` of the kernel in samples, by default
    [`kernel_half_width`][jaxfric.signals.kernel_half_width], or as near as samples allow to
    `reach`, s, that of another recording; `delay`, s, by which the force is taken later;
    `reversals`: rows that reach across a reversal too, but none at rest, for judging a model as
    [`relative_error`][jaxfric.simulation.errors.relative_error] does; `half`: nodes in half a
    kernel.

    **Raises:** `ValueError` if the axis hardly slips.
    """
    motion = recording if isinstance(recording, Motion) else derived(recording)
    prepared = motion.padded
    limits = Scales(*(float(x) for x in signals.host_scales(prepared)[0]))
    if reach is not None:
        half_width = max(1, int(round(reach / limits.interval)))
    # Of a position that comes seldom no two nodes lie between the same two updates.
    usual = half_width or _usual(prepared, limits.slowest)
    width = max(int(usual), half * motion.recording.position_every)
    prepared = motion.on_host()
    step = max(1, round(width / half))
    span = float(step * half * limits.interval)
    means = Means.of(motion, limits.interval, step)
    parts = node_signals(motion, means, limits.interval, delay)
    index, whole, average, slope = windows(parts, span, half)
    rows = _moving(parts["velocity"][index], whole, average, limits.slowest, reversals)
    if prepared.position is not None:
        rows = _known_from(parts, index[rows, 0], rows, MEMORY * (limits.high - limits.low))
    if len(rows) < FEWEST_ROWS:
        raise ValueError(
            f"{motion.recording.source or 'The recording'} leaves {len(rows)} independent "
            f"stretches in which the axis slips; at least {FEWEST_ROWS} are needed to tell "
            "structure from chance. Record longer, or move more."
        )
    nodes = padded(parts, prepared)
    centre = index[rows, half]
    force = np.sum(average * parts["force"][index], axis=1)[rows]
    target = _without_simulated(force, parts, index, rows, average, averaged(slope))
    pads = nodes.num_samples - len(parts["time"])
    time = np.asarray(prepared.time)[np.asarray(prepared.mask)]
    located = prepared.position is not None and motion.recording.position_every > 0
    first = np.asarray(prepared.force, float)[:MOST]
    linked = signals.host_continuous(prepared, limits.interval)[: len(first) - 1]
    return Evidence(
        motion=nodes,
        nodes=len(parts["time"]),
        average=averaged(average),
        slope=averaged(slope),
        rows=rows,
        force=force,
        target=target,
        side=np.sign(parts["velocity"][centre]),
        centre=centre,
        elapsed=np.pad(parts["elapsed"], (0, pads), mode="edge"),
        pieces=_pieces(parts, pads),
        limits=limits,
        reach=span,
        width=step * half,
        clock=bool(np.all(np.diff(time) > 0)),
        located=located,
        counted=signals.count_of(np.asarray(prepared.position, float)[:MOST]) if located else 0.0,
        noise=signals.host_white_noise(first, linked),
        repeats=motion.repeats,
    )


def reduced(
    motion: Motion, evidence: Evidence, parts: Iterable[tuple[np.ndarray, np.ndarray]]
) -> tuple[np.ndarray, np.ndarray]:
    """Rest and momentum of forces, `(N,)` each, at the nodes of the evidence of a motion, `(p, M)`:
    as its recording's channels, but nothing else has to hold them.
    """
    step = evidence.width // evidence.half
    means = Means.of(motion, evidence.limits.interval, step)
    pairs = [(means.instant(rest), means.instant(more, derived=True)) for rest, more in parts]
    plain, momentum = np.array(pairs).reshape(-1, 2, len(means.label)).swapaxes(0, 1)
    pads = (0, 0), (0, evidence.motion.num_samples - len(means.label))
    return np.pad(plain, pads, mode="edge"), np.pad(momentum, pads, mode="edge")


def _usual(prepared: Recording, slowest: float) -> int:
    """The half-width of the kernel, in samples, that a prepared recording suggests.

    Noise may ask for a few samples only. Of a fast log that is more nodes than anything needs.
    """
    by_noise = min(signals.kernel_half_width(prepared), _widest(prepared))
    count = int(np.count_nonzero(np.asarray(prepared.mask)))
    return max(by_noise, min(NODES * count // ENOUGH, _stroke(prepared, slowest) // STROKE))


# Nodes that are enough, some four thousand rows whatever the rate: hundreds for each parameter of
# a model. They are made fewer by a wider kernel, but of no more than a thirty-second of a stroke,
# over which the speed of a sine changes by a tenth of its peak.
ENOUGH, STROKE = 3 << 12, 64


def _stroke(recording: Recording, slowest: float) -> int:
    """How many samples the axis slips in one direction, in the mean."""
    speed = np.asarray(recording.velocity)[np.asarray(recording.mask)]
    side = np.sign(speed[np.abs(speed) > slowest])
    return len(side) // (1 + np.count_nonzero(np.diff(side)))


# Nodes at most, some ten thousand rows: columns of all candidates at more would fill the memory,
# and what ten thousand rows do not show is below what any law is off from a machine.
LONGEST = 3 << 13


def shortened(recording: Recording) -> Recording:
    """The recording, or as much of it, evenly spread, as makes so many nodes."""
    if recording.num_samples <= SPARE * LONGEST:
        return recording
    motion = motion_of(excerpt(recording))
    slowest = float(signals.host_scales(motion.padded)[0].slowest)
    most = LONGEST * max(1, round(_usual(motion.padded, slowest) / NODES))
    return excerpt(recording, min(most, MOST))


# Kernels in a record at least: 24 blocks of eight, for its significance. Where an axis
# hardly accelerates, the noise of its acceleration would ask for wider ones.
KERNELS = 192


def _widest(recording: Recording) -> int:
    return max(16, int(np.count_nonzero(np.asarray(recording.mask))) // KERNELS)


def _moving(speed: np.ndarray, whole: np.ndarray, average: np.ndarray, slowest: float, reversals):
    """Numbers of the windows in slip of one direction; with `reversals` all but those at rest."""
    moving = np.abs(speed) > slowest
    one_way = (speed > 0).all(axis=1) | (speed < 0).all(axis=1)
    slips = np.sum(average * moving, axis=1) > 0.5 if reversals else moving.all(axis=1) & one_way
    return np.flatnonzero(whole & slips)


# What a machine remembers of the time before a record, how far its bristles are bent or where its
# load stands in a gap, is gone after a thirtieth of the stroke: a longer memory is no presliding.
MEMORY = 1 / 30
# Where that would take a twentieth of the rows, of a short record or of many segments, each is
# needed more than it can spoil: a servo's cogging, seen on 323 rows, was not on 302.
FORGOTTEN = 0.05


def _known_from(parts: dict, first: np.ndarray, rows: np.ndarray, way: float) -> np.ndarray:
    """The rows before which the axis has moved by some way, m, since its run of nodes began.

    `first`: the first node of each row.
    """
    begins = np.diff(parts["run"], prepend=parts["run"][0] - 1) != 0
    moved = np.abs(np.diff(parts["position"], prepend=parts["position"][0]))
    total = np.cumsum(np.where(begins, 0.0, moved))
    start = np.maximum.accumulate(np.where(begins, total, 0.0))
    kept = rows[(total - start)[first] > way]
    return kept if len(kept) > (1 - FORGOTTEN) * len(rows) else rows


def _pieces(parts: dict, pads: int) -> np.ndarray:
    """Numbers of the stretches of nodes in one run that are compared, or are not, `(M,)`."""
    begins = np.diff(parts["run"]) != 0
    begins |= np.diff(parts["compared"])
    return np.pad(np.cumsum(begins, dtype=np.int32), (1, pads), mode="edge")


def _without_simulated(force: np.ndarray, parts: dict, index, rows, average, slope) -> np.ndarray:
    """The force of the rows without what another simulator has computed, where there is that."""
    momentum = parts.get(f"channel {KNOWN_MOMENTUM}")
    known = parts.get(f"channel {KNOWN_FORCE if momentum is None else KNOWN_REST}")
    if known is None:
        return force
    target = force - np.sum(average * known[index], axis=1)[rows]
    if momentum is None:
        return target
    return target - np.sum(slope * momentum[index], axis=1)[rows]
