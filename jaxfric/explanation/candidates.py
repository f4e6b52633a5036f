"""The terms that compete for a residual, with the places of their nonlinear parameters to try."""

import dataclasses
import functools
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from .. import terms as laws
from ..data.recording import Recording
from ..simulators.known import TURNS
from ..terms.base import AbstractTerm, Directional, Sum, summands
from ..terms.catalogue import CATALOGUE, Effect
from ..terms.effects import EFFECTS
from ..terms.friction import AbstractBump
from .evidence import NODES, Evidence
from .lines import Lines, line_frequencies
from .predictions import PREDICTED
from .regression import Space
from .threads import begin
from .tones import tones_to_try

# Points of a grid over one nonlinear parameter, where nothing finer is needed below.
GRID = 24
# Terms of one moment, which is told to within a ramp only.
STEPS = (laws.FrictionStep, laws.PayloadChange, laws.GainStep)
# Effects that time alone drives: another recording need not show them.
OF_THE_MOMENT = frozenset(
    {
        "friction_step",
        "load_drift",
        "disturbance_pulses",
        "thermal_drift",
        "periodic_disturbance",
        "payload_change",
        "gain_step",
    }
)


class Candidate(NamedTuple):
    """A term of an effect, and the places of β to try: `betas`, `(G, d)`.

    `lines`: how its waves are computed; `least`: the part of what is left that it must take.
    """

    effect: Effect
    term: AbstractTerm
    betas: np.ndarray
    lines: Lines | None = None
    least: float = 0.0

    def columns(self, evidence: Evidence) -> np.ndarray:
        """The rows of its columns at every place, `(G, J, k)`."""
        if self.lines is not None:
            return self.lines.columns(evidence, self.betas[:, 0])
        return evidence.columns(self.term, self.betas)


class Field:
    """The candidates for one recording, and their columns, kept from round to round.

    Those of the motion are computed from the start, while the caller goes on; columns of what a fit
    predicts belong to a round.
    """

    def __init__(self, evidence: Evidence, base: AbstractTerm):
        self.candidates = candidates(evidence, base)
        self._motion, self._rows, self._reach = evidence.motion, evidence.rows, evidence.reach
        # With all the signals that there will be, since programs are compiled for these.
        none = np.zeros(evidence.motion.num_samples)
        seen = evidence.with_channels(**dict.fromkeys(PREDICTED, none))
        self._kept = {
            id(candidate): begin(functools.partial(_columns, seen), candidate)
            for candidate in self.candidates
            if not candidate.term.coordinates & PREDICTED
        }

    def serves(self, evidence: Evidence) -> bool:
        """Whether the columns are those of other evidence too: the same rows of the same motion.

        Of the force only its magnitude enters, by the compact sets, and a shift in time leaves it.
        """
        ours, theirs = _signals(self._motion), _signals(evidence.motion)
        known = ours.keys() == theirs.keys() and self._reach == evidence.reach
        pairs = ((ours[name], theirs[name]) for name in ours if known)
        return known and all(np.array_equal(*p) for p in [(self._rows, evidence.rows), *pairs])

    def columns(self, candidate: Candidate, evidence: Evidence) -> np.ndarray:
        """The columns of one candidate at all its places, `(G, k, J)`, scaled to about one."""
        known = self._kept.get(id(candidate))
        return _columns(evidence, candidate) if known is None else known.result()

    def close(self) -> None:
        """Begin no more columns."""
        for columns in self._kept.values():
            columns.cancel()


def _columns(evidence: Evidence, candidate: Candidate) -> np.ndarray:
    return scaled(candidate.columns(evidence))


def _signals(motion: Recording) -> dict[str, Any]:
    """All that a term may read of a motion, by name."""
    named = {name: getattr(motion, name) for name in ("time", "position", "velocity", "segment")}
    return named | motion.channels


def scaled(raw: np.ndarray) -> np.ndarray:
    """Columns `(G, J, k)` with largest value one, as a judge reads them: `(G, k, J)`, float32."""
    columns = np.ascontiguousarray(raw.transpose(0, 2, 1))
    size = np.maximum(columns.max(axis=2), -columns.min(axis=2))[..., None]
    return (columns / np.where(size > 0, size, 1.0)).astype(np.float32, copy=False)


def candidates(evidence: Evidence, base: AbstractTerm) -> list[Candidate]:
    """Every term of the catalogue that this recording has the signals for."""
    limits = type(evidence.limits)(*map(np.asarray, evidence.limits))
    have = {"predicted_force", *evidence.motion.channels}
    if evidence.motion.position is not None:
        have.add("position")
    found = []
    for effect in CATALOGUE:
        if effect.needs - have or (effect.name in OF_THE_MOMENT and not evidence.clock):
            continue
        for term in effect.shapes(limits):
            if "position" in term.coordinates and "position" not in have:
                continue
            if isinstance(term, laws.FrictionalLag):
                term = dataclasses.replace(term, bump=_bump(base))
            turn = TURNS.get(dict(evidence.motion.units).get("position", ""))
            if isinstance(term, laws.PayloadChange) and turn and "position" in have:
                load = Sum((laws.Inertia(), laws.Gravity(turn)))
                term = dataclasses.replace(term, load=load)
            found += list(_with_places(effect, term, evidence))
    present = {type(t) for t in leaves(base)}
    return [c for c in found if not (set(map(type, leaves(c.term))) <= present)]


def _bump(base: AbstractTerm) -> AbstractBump:
    """The kind of bump that the baseline has, or a Gaussian one."""
    return next((t for t in leaves(base) if isinstance(t, AbstractBump)), laws.Gaussian())


def leaves(term: AbstractTerm) -> Iterator[AbstractTerm]:
    """The single terms of a sum, of those with a direction the positive one."""
    for part in summands(term):
        if isinstance(part, Directional):
            yield from leaves(part.positive)
        else:
            yield part


def _with_places(effect: Effect, term: AbstractTerm, evidence: Evidence) -> Iterator[Candidate]:
    kind = type(term)
    if isinstance(term, laws.Cogging | laws.PositionDependentFriction):
        sided = isinstance(term, laws.PositionDependentFriction)
        harmonics = term.harmonics if isinstance(term, laws.Cogging) else 1
        periods = 1 / line_frequencies(evidence, "position")
        if not sided:
            longest = Space([term], evidence).beta(np.ones(1))[0]
            periods = periods[periods <= longest]
        else:
            stroke = evidence.limits.high - evidence.limits.low
            periods = np.concatenate([stroke * 2.0 ** np.arange(3, 0, -0.5), periods])
        yield Candidate(effect, term, periods[:, None], Lines("position", True, sided, harmonics))
    elif kind is laws.PeriodicDisturbance:
        for tones, least in tones_to_try(evidence):
            yield from at_tones(tones, least)
    elif kind is laws.StickySpot:
        yield Candidate(effect, term, _spots(evidence))
    elif kind is laws.Compliance:
        yield Candidate(effect, term, _resonances(term, evidence))
    elif kind is laws.DryCompliance:
        found = [(*place, d) for place in _resonances(term, evidence) for d in _coasting(evidence)]
        yield Candidate(effect, term, np.array(found))
    elif kind is laws.FrictionalLag:
        along = [(np.arange(n) + 0.5) / n for n in _MEMORIES[: len(term.nonlinear)]]
        yield Candidate(effect, term, Space([term], evidence).beta(_product(along)))
    elif kind is laws.ElasticBacklash:
        yield Candidate(effect, term, _gaps(term, evidence))
    elif kind is laws.PositionDependentInertia:
        stroke = evidence.limits.high - evidence.limits.low
        periods = stroke / np.concatenate([2.0 ** np.arange(-3, 0, 0.5), np.arange(1, 8, 0.25)])
        yield Candidate(effect, term, periods[:, None])
    else:
        yield Candidate(effect, term, _grid(term, evidence))


def at_tones(tones: np.ndarray, least: float = 0.0) -> list[Candidate]:
    """A force periodic in time at some frequencies, Hz, `(G,)`; none where there are none."""
    effect, lines = EFFECTS["periodic_disturbance"], Lines("time", False)
    term = laws.PeriodicDisturbance()
    return [Candidate(effect, term, tones[:, None], lines, least)] if len(tones) else []


def _grid(term: AbstractTerm, evidence: Evidence) -> np.ndarray:
    """Places over the compact set: all nonlinear parameters together along its diagonal."""
    space = Space([term], evidence)
    count = len(term.nonlinear)
    if not count:
        return np.zeros((1, 0))
    fine = 8 * GRID if isinstance(term, STEPS) else GRID
    along = (np.arange(fine) + 0.5) / fine
    return space.beta(np.repeat(along[:, None], count, axis=1))


# Damping ratios tried: a drive train's, a belt's, a soft coupling's.
_DAMPING = (0.05, 0.15, 0.45)

# Times and widths of a bump that is late (a factor of 1.7 in either changes little), and exponents.
_MEMORIES = (12, 8, 3)


def _product(axes) -> np.ndarray:
    """All combinations of values along several axes, `(G, d)`."""
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)


# A load's friction in parts of what its inertia asks for, where it shows at all.
_COASTING = (0.2, 0.6, 2.0, 6.0)


def _gaps(term: AbstractTerm, evidence: Evidence) -> np.ndarray:
    """Gaps and windups from what is crossed in a twentieth of the kernel's reach to the widest."""
    low, high = Space([term], evidence).beta(np.array([[0.0] * 3, [1.0] * 3]))
    least = 0.25 * _acceleration(evidence) * (evidence.reach / 20) ** 2
    least = np.clip(least, low[0], 0.1 * high[0])
    gaps, windups = (np.geomspace(least, high[0], n) for n in (10, 7))
    return _product([gaps, windups, _coasting(evidence)])


def _coasting(evidence: Evidence) -> np.ndarray:
    return _acceleration(evidence) * np.array(_COASTING)


def _acceleration(evidence: Evidence) -> float:
    """98 % of the accelerations are below it, m/s²."""
    velocity = np.asarray(evidence.motion.velocity)[: evidence.nodes]
    return float(np.quantile(np.abs(np.diff(velocity)), 0.98)) * NODES / evidence.reach


def _resonances(term: AbstractTerm, evidence: Evidence) -> np.ndarray:
    """Frequencies up to what the nodes still resolve, with a few dampings each."""
    count = len(term.nonlinear)
    low, most = Space([term], evidence).beta(np.array([[0.0] * count, [1.0] * count]))[:, 0]
    high = max(min(most, 0.5 * NODES / evidence.reach), 2 * low)
    return np.array([(f, z) for z in _DAMPING for f in np.geomspace(low, high, GRID)])


def _spots(evidence: Evidence) -> np.ndarray:
    """Places one width apart, for widths by factors of 1.6 from what the kernel resolves."""
    limits = evidence.limits
    stroke = limits.high - limits.low
    speed = np.median(np.abs(np.asarray(evidence.motion.velocity)[evidence.centre]))
    widths = np.geomspace(
        np.clip(0.5 * speed * evidence.reach, stroke / 100, stroke / 8), stroke / 4, 6
    )
    return np.array(
        [(at, w) for w in widths for at in np.arange(limits.low + w / 2, limits.high, w)]
    )
