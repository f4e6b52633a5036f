"""The terms that compete for a residual, with grids of their nonlinear parameters."""

import functools
from collections.abc import Hashable, Iterator
from itertools import chain
from typing import Any, NamedTuple

import jax
import numpy as np

from ..data.recording import Recording
from ..terms import KNOWN_FORCE, KNOWN_FRICTION
from ..terms.actuator import REACTION
from ..terms.base import AbstractTerm, leaves
from ..terms.effect import Effect, View, inside
from ..terms.effects import EFFECTS
from ..terms.effects.gravity_unbalance import STROKES
from ..units import TURNS
from .evidence import Evidence
from .nodes import NODES
from .predictions import PREDICTED
from .spectral_lines import SpectralLines, line_frequencies, time_frequencies
from .threads import begin

# Bytes of columns that are kept from round to round; those beyond are computed in each.
KEPT = 1 << 28


# Signals that a recording may lack, of which some laws of an effect are functions.
CHANNELS = frozenset({"position", "load", REACTION})


class Candidate(NamedTuple):
    """A term of an effect, and its grid of β: `betas`, `(G, d)`.

    `lines`: how its waves are computed; `least`: the part of what is left that it must take at each
    grid point, `(G,)`, or at all of them.
    """

    effect: Effect
    term: AbstractTerm
    betas: np.ndarray
    lines: SpectralLines | None = None
    least: np.ndarray | float = 0.0

    @property
    def form(self) -> Hashable:
        """The form of its law: what of it is no value."""
        return jax.tree.structure(self.term)

    def columns(self, evidence: Evidence) -> np.ndarray:
        """The rows of its columns at every grid point, `(G, J, k)`."""
        if self.lines is not None:
            return self.lines.columns(evidence, self.betas[:, 0])
        return evidence.columns(self.term, coarse(self.term, self.betas))


def coarse(term: AbstractTerm, betas: np.ndarray) -> np.ndarray:
    """β as columns are computed for that only have to be ranked: a load that is stepped along the
    motion takes half the time in single precision.
    """
    return betas.astype(np.float32) if term.stepped else betas


# Shapes that are scattered over a whole set, and no more than so many steps of them along a motion:
# some seconds.
SCATTERED, STEPS = 1024, 2e7


class CandidateSet:
    """The candidates for one recording, and their columns, kept from round to round.

    Those of the motion are computed from the start, while the caller goes on; columns of what a fit
    predicts belong to a round.
    """

    def __init__(
        self, evidence: Evidence, base: AbstractTerm, before: "CandidateSet | None" = None
    ):
        self.groups = _sharing(candidates(evidence, base))
        self._motion, self._rows, self._reach = evidence.motion, evidence.rows, evidence.reach
        # With all the signals that there will be, since programs are compiled for these.
        none = np.zeros(evidence.motion.num_samples)
        seen = evidence.with_channels(**dict.fromkeys(PREDICTED, none))
        own = [_widest(some) for some in self.groups]
        own = [each for each in own if not each.term.coordinates & PREDICTED]
        # What a search has kept of a law's β, `(G, d)` each, by a key of its own.
        self.kept_betas: dict[Hashable, np.ndarray] = {} if before is None else before.kept_betas
        own = _within(own, len(evidence.target))
        started = begin(functools.partial(_columns, seen), own)
        self._kept = dict(zip(map(id, own), started, strict=True))

    @property
    def candidates(self) -> list[Candidate]:
        """All of them, group by group."""
        return list(chain.from_iterable(self.groups))

    def serves(self, evidence: Evidence) -> bool:
        """Whether the columns are those of other evidence too: the same rows of the same motion.

        Of the force only its magnitude enters, by the compact sets, and a shift in time leaves it.
        """
        ours, theirs = _signals(self._motion), _signals(evidence.motion)
        known = ours.keys() == theirs.keys() and self._reach == evidence.reach
        pairs = ((ours[name], theirs[name]) for name in ours if known)
        return known and all(np.array_equal(*p) for p in [(self._rows, evidence.rows), *pairs])

    def columns(self, group: list[Candidate], evidence: Evidence) -> Iterator[np.ndarray]:
        """The columns of each of a group on its grid, `(G, k, J)`, scaled to about one."""
        wide = _widest(group)
        known = self._kept.get(id(wide))
        columns = _columns(evidence, wide) if known is None else known.result()
        for each in group:
            yield columns if each.lines is None else columns[:, : 2 * each.lines.harmonics]

    def scattered(self, candidate: Candidate, evidence: Evidence) -> np.ndarray:
        """β, `(G, d)`, scattered over the whole set of a candidate whose energy has minima between
        those of its grid; none of others.
        """
        if candidate.effect.scatter is None:
            return np.zeros((0, candidate.betas.shape[1]))
        count = min(SCATTERED, int(STEPS // evidence.nodes))
        return candidate.effect.scatter(candidate.term, view(evidence), count)

    def close(self) -> None:
        """Begin no more columns."""
        for columns in self._kept.values():
            columns.cancel()

    def forget(self) -> None:
        """Hold no columns any more: they are computed when needed."""
        self.close()
        self._kept = {}


def _sharing(candidates: list[Candidate]) -> list[list[Candidate]]:
    """The candidates by groups: waves whose columns begin those of others, with more harmonics."""
    found: dict[Any, list[Candidate]] = {}
    for each in candidates:
        key = id(each) if each.lines is None else (each.lines[:3], each.betas.tobytes())
        found.setdefault(key, []).append(each)
    return list(found.values())


def _widest(group: list[Candidate]) -> Candidate:
    return max(group, key=lambda each: 0 if each.lines is None else each.lines.harmonics)


def _within(candidates: list[Candidate], rows: int) -> list[Candidate]:
    """Those of the candidates, of so many rows, whose columns are kept; waves are soon computed."""
    ordered = sorted(candidates, key=lambda c: c.lines is not None)
    sizes = [4 * rows * len(c.betas) * max(1, len(c.term.affine)) for c in ordered]
    return [c for c, whole in zip(ordered, np.cumsum(sizes), strict=True) if whole <= KEPT]


def _columns(evidence: Evidence, candidate: Candidate) -> np.ndarray:
    return scaled(candidate.columns(evidence))


def _signals(motion: Recording) -> dict[str, Any]:
    """All that a term may read of a motion, by name."""
    named = {name: getattr(motion, name) for name in ("time", "position", "velocity", "segment")}
    return named | motion.channels


def scaled(raw: np.ndarray) -> np.ndarray:
    """Columns `(G, J, k)` as the bootstrap reads them: largest value one, `(G, k, J)`, float32.

    In place where they are float32. Where a law has no finite force it adds nothing.
    """
    columns = raw.transpose(0, 2, 1)
    size = np.maximum(columns.max(axis=2), -columns.min(axis=2))[..., None]
    nowhere = ~np.isfinite(size).all(axis=(1, 2))
    if nowhere.any():
        columns[nowhere], size[nowhere] = 0.0, 0.0
    result = columns if columns.dtype == np.float32 else np.empty(columns.shape, np.float32)
    return np.divide(columns, np.where(size > 0, size, 1.0), out=result, casting="same_kind")


def candidates(evidence: Evidence, base: AbstractTerm) -> list[Candidate]:
    """Every term of every effect that this recording has the signals for."""
    seen = view(evidence)
    have = {"predicted_force", *evidence.motion.channels}
    # Of another program's force it has to be known what of it is friction.
    if KNOWN_FORCE not in have or KNOWN_FRICTION in have:
        have.add(REACTION)
    if evidence.motion.position is not None:
        have.add("position")
    turn = (seen.turn or None) if "position" in have else None
    stroke = float(evidence.limits.high - evidence.limits.low)

    def shows(term: AbstractTerm) -> bool:
        """Whether a wave of a given period is told from a parabola within the stroke."""
        low, high = (0.0, 0.0) if term.nonlinear else term.extent({}).get("position", (0.0, 0.0))
        return high - low <= STROKES * stroke

    found: list[Candidate] = []
    for effect in EFFECTS.values():
        if effect.momentary and not evidence.clock:
            continue
        own = () if effect.needs - have else effect.shapes(seen.limits)
        for term in (*own, *effect.recorded(evidence.motion)):
            if term.coordinates & CHANNELS - have:
                continue
            for suited in filter(shows, effect.suited(term, base, turn)):
                found += _placed(effect, suited, evidence, seen)
    present = {type(t) for t in leaves(base)}
    return [c for c in found if not (set(map(type, leaves(c.term))) <= present)]


# Of a force whose sign follows the weight and not the motion, friction says nothing.
LOPSIDED = 0.5


def view(evidence: Evidence) -> View:
    """What the grids of the candidates are made from."""
    velocity = np.asarray(evidence.motion.velocity)
    change = np.abs(np.diff(velocity[: evidence.nodes]))
    ways = [evidence.target[side * velocity[evidence.centre] > 0] for side in (1, -1)]
    forward, backward = (float(np.median(way)) if len(way) else 0.0 for way in ways)
    apart = forward - backward
    asymmetry = (forward + backward) / apart if evidence.both_ways and apart > 0 else 0.0
    return View(
        type(evidence.limits)(*map(np.asarray, evidence.limits)),
        evidence.reach,
        NODES,
        float(np.median(np.abs(velocity[evidence.centre]))),
        float(np.quantile(change, 0.98)) * NODES / evidence.reach,
        float(np.clip(asymmetry, -LOPSIDED, LOPSIDED)),
        TURNS.get(dict(evidence.motion.units).get("position", ""), 0.0),
    )


def _placed(
    effect: Effect, term: AbstractTerm, evidence: Evidence, seen: View
) -> Iterator[Candidate]:
    waves = effect.waves(term)
    if waves is None:
        yield Candidate(effect, term, effect.grid(term, seen))
    elif waves.coordinate == "time":
        for tones, least in time_frequencies(evidence):
            yield from at_frequencies(effect, term, tones, least)
    else:
        periods = 1 / line_frequencies(evidence, "position")
        longest = float(inside(term, seen.limits, np.ones(1))[0])
        stroke = evidence.limits.high - evidence.limits.low
        if longest > stroke:
            octaves = np.log2(longest / stroke)
            long = stroke * 2.0 ** np.arange(np.round(octaves, 6), 0, -0.5)
            periods = np.concatenate([long, periods])
        periods = periods[periods <= longest * (1 + 1e-12)]
        yield from at_frequencies(effect, term, periods if waves.inverse else 1 / periods)


def at_frequencies(
    effect: Effect, term: AbstractTerm, values: np.ndarray, least: np.ndarray | float = 0.0
) -> list[Candidate]:
    """A wave at some periods or frequencies, `(G,)`; none where there are none."""
    lines = SpectralLines(*effect.waves(term))
    return [Candidate(effect, term, values[:, None], lines, least)] if len(values) else []


def tones(evidence: Evidence) -> Iterator[tuple[Effect, AbstractTerm]]:
    """The effects that are waves over time, with their terms."""
    for effect in EFFECTS.values():
        for term in effect.shapes(evidence.limits):
            waves = effect.waves(term)
            if waves is not None and waves.coordinate == "time":
                yield effect, term
