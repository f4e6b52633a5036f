"""Break-away levels F_slip(0±) of eq. (4), Kim, Kim & Ha (2004), where a recording leaves a dwell.

While the axis rests, the force is below the level; when it slips, the force has been at it. When it
broke away in between is bounded by its momentum: M v = ∫ (u − F) dt since then, where F is no more
than the level with what friction rises by with speed, and no less than the slip curve. So each
transition gives a lower and an upper end of the level, whatever the controller did meanwhile; the
value between them is that of eq. (4), where the slip curve holds as soon as the axis is off.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import jax
import numpy as np

from .. import signals
from ..data.excerpt import excerpt
from ..data.recording import Recording, require
from ..looks import text
from ..models import Model
from ..signals import counted_noise
from ..units import FORCE, spell
from .constant_velocity import beyond, slowest_slip
from .curves import band
from .uncertainty import student_quantile

# Samples to each side that a force is averaged over: a ramp keeps its value.
NEAR = 2
# A dwell has more samples than the averages and derivatives at both of its ends reach.
FEWEST = 16
# The transition is over at twice the slowest slip: there the noise of a velocity is a half of it.
GONE = 2.0
# As for slip: four deviations of noise.
DEVIATIONS = signals.SLIP_DEVIATIONS
# Speeds, and a multiple of them, at which the slip curve is looked at.
SPEEDS = 64
WAYS = {1: "forward", -1: "backward"}


class Transition(NamedTuple):
    """A dwell that ended in slip: `time`, s, at which the axis had broken away; its `direction`, 1
    or −1; `dwell`, how long it had rested, s; the level by the slip curve, `value`, N, and its ends
    `low` and `high`, in magnitude.
    """

    time: float
    direction: int
    dwell: float
    value: float
    low: float
    high: float


class Level(NamedTuple):
    """The break-away level of a direction, N, with its sign.

    - `value`, with the interval `low` to `high`: what a transition leaves open, and the scatter of
      several at 95 %; over `transitions`.
    - `curve`: the slip curve's end there, N, with its 95 % band `curve_low`, `curve_high`.
    """

    direction: int
    value: float
    low: float
    high: float
    transitions: int
    curve: float
    curve_low: float
    curve_high: float

    @property
    def beyond(self) -> bool:
        """Whether the level lies beyond the end of the slip curve, both intervals counted."""
        way = self.direction
        least = min(way * self.low, way * self.high)
        return least > max(way * self.curve_low, way * self.curve_high)


class Curve(NamedTuple):
    """The slip curve of a direction: `speed`, m/s, `force` and its band's `low` and `high` ends,
    N, all in magnitude, `(K,)`.
    """

    speed: np.ndarray
    force: np.ndarray
    low: np.ndarray
    high: np.ndarray


class BreakAway(NamedTuple):
    """The levels that the recording tells, and why not where there is none.

    `model`: the identified one, with those levels that lie beyond the slip curve's end: elsewhere
    that end, which is inside the interval, stands for the level.
    """

    levels: tuple[Level, ...]
    transitions: tuple[Transition, ...]
    model: Model
    why: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The levels as plain data, in the units of the recording."""
        return {
            "levels": [each._asdict() | {"beyond_slip": each.beyond} for each in self.levels],
            "transitions": [each._asdict() for each in self.transitions],
            "why": self.why,
        }

    def __repr__(self) -> str:
        return text.text([[sentence(self, dict(self.model.units)) or f"No level: {self.why}."]])


def breakaway(recording: Recording, found: Any) -> BreakAway:
    """The break-away levels of a recording, from where the axis leaves a dwell.

    A dwell is a stretch of at least 16 samples below the slowest slip; it counts where the axis
    then slips in the direction of its force.

    **Arguments:** `recording`, signals of shape `(N,)`; `found`, an `Identified` with an inertia;
    terms beyond velocity are taken off the force first.

    **Raises:** `ValueError` for a batch, or inside `jax.jit`.
    """
    require(recording, "breakaway")
    if signals.is_traced(recording):
        raise ValueError("breakaway reads values: call it outside of jax.jit.")
    mass = _mass(found)
    if mass is None:
        return BreakAway((), (), found.model, "the inertia is not known")
    recording = excerpt(recording)
    reach = 0
    if recording.velocity is None:  # a derivative rises before the axis does
        reach = signals.choose(recording).half_width
    log = jax.tree.map(np.asarray, signals.prepare(recording))
    force = np.asarray(log.force, float) - beyond(found, log)
    noise = DEVIATIONS * counted_noise(force) / np.sqrt(2 * NEAR + 1)
    smooth = np.convolve(np.pad(force, NEAR, "edge"), np.full(2 * NEAR + 1, 1 / (2 * NEAR + 1)))
    smooth = smooth[2 * NEAR : -2 * NEAR]
    seen = list(_departures(log, slowest_slip(log), reach))
    fastest = np.array([float(log.velocity[gone]) for _, gone, *_ in seen])
    ends = [
        _transition(log, smooth, noise, mass, curve, each)
        for curve, each in zip(_curves(found, fastest), seen, strict=True)
    ]
    transitions = tuple(each for each in ends if each is not None)
    ways = zip((-1, 1), _curves(found, np.array([-1.0, 1.0])), strict=True)
    levels = tuple(level for way, curve in ways if (level := _level(transitions, way, curve)))
    why = "" if levels else _why(seen)
    return BreakAway(levels, transitions, _stated(found.model, levels), why)


def _why(seen: list) -> str:
    if seen:
        return (
            "no dwell ends with a force that is told from zero, as an axis would leave it whose "
            "friction is that of the model"
        )
    return f"the axis never slips after a dwell of {FEWEST} samples or more"


def _mass(found: Any) -> tuple[float, float] | None:
    """The ends of the inertia's interval; `None` where it is not known."""
    estimate = found.parameters.get("inertia")
    if estimate is None or not np.isfinite(float(estimate.standard_error)):
        return None
    low, high = (float(end) for end in estimate.interval())
    return (max(low, 0.0), high) if high > 0 else None


def _departures(log: Recording, slowest: float, reach: int) -> Iterator[tuple[Any, ...]]:
    """First sample of a dwell, the one at which the axis is gone, its direction, the slowest slip.

    Gone is `reach`, a derivative's half-width in samples, behind twice the slowest slip.
    """
    velocity = np.asarray(log.velocity, float)
    linked = signals.host_continuous(log, signals.host_interval(log))
    rest = np.isfinite(velocity) & (np.abs(velocity) <= slowest)
    edge = np.flatnonzero(np.diff(np.pad(rest.astype(int), 1)))
    pieces = np.concatenate([[0], np.cumsum(~linked)])
    for first, end in edge.reshape(-1, 2):
        if end - first < FEWEST or end >= velocity.size:
            continue
        way = int(np.sign(velocity[end]))
        after = np.flatnonzero(way * velocity[end:] >= GONE * slowest)
        if after.size == 0 or (way * velocity[end : end + after[0]] <= 0).any():
            continue
        gone = end + int(after[0]) + reach
        if gone + NEAR >= velocity.size or pieces[gone + NEAR] != pieces[first]:
            continue
        if way * velocity[gone] > slowest:
            yield int(first), gone, way, slowest


def _transition(log, smooth, noise, mass, curve: Curve, departure) -> Transition | None:
    """The ends of the level that a departure leaves open; `None` where nothing fits."""
    first, gone, way, slowest = departure
    inside = slice(first, gone + 1)
    time, force = np.asarray(log.time, float)[inside], way * smooth[inside]
    speed = np.maximum(way * np.asarray(log.velocity, float)[inside], 0.0)
    slip, least = np.interp(speed, curve.speed, curve.force), float(curve.low.min())
    rise = np.maximum(slip - curve.force[0], 0.0)
    step = np.append(np.diff(time), 0.0)
    # From each sample on: ∫ u − rise, ∫ u, the time, and ∫ u − F.
    most, all_of, left, gained = (
        np.cumsum((values * step)[::-1])[::-1]
        for values in (force - rise, force, 1.0, force - slip)
    )
    early = most - left * force <= mass[1] * (speed[-1] + slowest)
    late = all_of - left * least >= mass[0] * (speed[-1] - slowest)
    # At rest the force was below the level all the while.
    reached = force >= np.maximum.accumulate(force) - noise
    fits = np.flatnonzero(early & late & reached)
    if fits.size == 0:
        return None
    # The force between two samples may have been that of the next.
    low, high = max(int(fits[0]) - 1, 0), min(int(fits[-1]) + 1, force.size - 1)
    values = force[low : high + 1]
    ends = float(values.min()) - noise, float(values.max()) + noise
    if ends[0] <= 0:  # a level that may be none is not told
        return None
    nearest = fits[np.argmin(np.abs(gained[fits] - 0.5 * sum(mass) * speed[-1]))]
    dwell = float(time[nearest] - time[0])
    return Transition(float(time[-1]), way, dwell, float(force[nearest]), ends[0], ends[1])


def _curves(found: Any, fastest: np.ndarray) -> list[Curve]:
    """The slip curve up to each of these velocities, `(T,)`, m/s."""
    if not fastest.size:
        return []
    speed = np.geomspace(1e-9, 1.0, SPEEDS) * np.abs(fastest)[:, None]
    way = np.sign(fastest)[:, None]
    force, *ends = (way * x.reshape(speed.shape) for x in band(found, np.ravel(way * speed)))
    low, high = np.sort(np.stack(ends), axis=0)
    return [Curve(*each) for each in zip(speed, force, low, high, strict=True)]


def _level(transitions, way: int, curve: Curve) -> Level | None:
    own = [each for each in transitions if each.direction == way]
    if not own:
        return None
    value, low, high = np.mean([[each.value, each.low, each.high] for each in own], axis=0)
    scatter = 0.0
    if len(own) > 1:
        error = float(np.std([each.value for each in own], ddof=1)) / len(own) ** 0.5
        scatter = student_quantile(0.975, len(own) - 1) * error
    if low <= scatter:  # as of a single one: a level that may be none is not told
        return None
    ends = sorted((float(way * (low - scatter)), float(way * (high + scatter))))
    edge = sorted((float(way * curve.low[0]), float(way * curve.high[0])))
    end = float(way * curve.force[0])
    return Level(way, float(way * value), ends[0], ends[1], len(own), end, edge[0], edge[1])


def _stated(model: Model, levels: tuple[Level, ...]) -> Model:
    known = {level.direction: level.value for level in levels if level.beyond}
    return model.with_breakaway(known.get(-1, np.nan), known.get(1, np.nan)) if known else model


def sentence(test: BreakAway, units: dict[str, str]) -> str:
    """The levels in a line; nothing where there is none."""
    unit, said = spell(FORCE, units), []
    for level in test.levels:
        count = f"{level.transitions} transition{'s' * (level.transitions > 1)}"
        end = 0.5 * (level.curve_high - level.curve_low)
        how = "beyond" if level.beyond else "not told from"
        said.append(
            f"{WAYS[level.direction]} {level.value:.3g} {unit}, between {level.low:.3g} and "
            f"{level.high:.3g} ({count}), {how} the slip curve's end, {level.curve:.3g} ± {end:.2g}"
        )
    return f"Break-away: {'; '.join(said)}." if said else ""
