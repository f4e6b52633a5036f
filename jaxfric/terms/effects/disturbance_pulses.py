"""Isolated pushes, whose places the residual itself has to say."""

from collections.abc import Iterator, Mapping, Sequence
from math import comb
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from ...units import FORCE
from ..base import AbstractLaw, AbstractTerm
from ..effect import Effect, Extent, Residual
from ..sample import Parameter, Sample
from ..text import TURN, literal, signed


class DisturbancePulses(AbstractLaw):
    """Isolated pushes: F = Σ_i A_i cos²(π (t − t_i)/(2w)) for abs(t − t_i) < w.

    `times` t_i and `width` w, s, are given numbers.
    """

    times: tuple[float, ...] = eqx.field(static=True, converter=lambda t: tuple(map(float, t)))
    width: float = eqx.field(static=True)
    coordinates: ClassVar = frozenset({"time"})

    @property
    def affine(self):
        return tuple(Parameter(f"pulse_{i + 1}", FORCE) for i in range(len(self.times)))

    @property
    def chosen(self) -> int:
        return len(self.times) + 1

    def law(self, sample: Sample):
        places = [jnp.clip((sample.time - at) / self.width, -1.0, 1.0) for at in self.times]
        return tuple(jnp.cos(0.5 * jnp.pi * place) ** 2 for place in places)

    def text(self, s):
        half = literal(0.25 * TURN)
        shapes = []
        for at in self.times:
            place = s.clip(f"(t - {signed(at)}) / {literal(self.width)}", "-1.0", "1.0")
            wave = s.call("cos", f"{half} * {place}")
            shapes.append(f"{wave} * {wave}")
        return tuple(shapes)

    def extent(self, values):
        return {"time": (min(self.times) - self.width, max(self.times) + self.width)}


# Standard deviations that a push must stand out by: of ten thousand places, noise reaches five in
# one record of two hundred.
OUTSTANDING = 5.0
# More pushes than this, or more of the time than that, are no isolated ones; but those are that
# are four times as high as the first one too many: one of the many would not reach so far.
MOST, LARGEST_PART, APART_FROM_MANY = 12, 0.2, 4.0
# Noise reaches three times its size, the answers to counts of an encoder too.
REACHED = 3.0
# Harmonics of the counts that are looked at: by the second, counts that pass one in two samples.
HARMONICS = (1, 2)
# A push is isolated if there is none of the other sign within its own breadth on either side, two
# widths and as much of the kernel: what pushes and at once pulls is how a shock ends, or counts of
# the encoder that come and go in the controller's velocity.
APART = 4


def pulses(left: Residual) -> Iterator[AbstractTerm]:
    """The pushes that stand out of a residual, for each width of them.

    A matched filter with the pulse's shape at each width; its spread is taken from the median, so
    that the pushes themselves do not raise it (Hampel 1974).
    """
    time, spacing = left.time, 0.5 * left.reach
    widths = spacing * np.geomspace(2.0, max(4.0, 0.02 * len(time)), 14)
    for width in widths:
        places = _outstanding(left.values, time, width, spacing)
        if 2 * width * len(places) > LARGEST_PART * (time[-1] - time[0]):
            continue
        places = [place for place in places if not _beats(left, place, width)]
        if places and not _at_reversals(left, places, width):
            yield DisturbancePulses(tuple(places), float(width))


def _beats(left: Residual, place: float, width: float) -> bool:
    """Whether a push is no higher than what counts of the encoder make where they keep step with
    the samples.

    A controller answers each count, and at most speeds the samples of its answers are noise. Where
    a whole or a half number of counts pass from sample to sample, all samples see the same part of
    the answer: it does not average out any more, and while the speed passes by, that is a push. A
    count's answer is no more than noise of the samples reaches, times the part that is in step.
    """
    if left.counts is None:
        return False
    shape = np.cos(0.5 * np.pi * (left.time - place).clip(-width, width) / width) ** 2
    height = abs(shape @ left.values) / (shape @ shape)
    samples = np.arange(place - width, place + width, left.interval)
    weight = np.cos(0.5 * np.pi * (samples - place) / width) ** 2
    turns = 2 * np.pi * np.cumsum(np.interp(samples, left.time, left.counts))
    step = max(abs(weight @ np.exp(1j * n * turns)) for n in HARMONICS)
    return bool(height <= REACHED * left.noise * step / (weight @ weight))


def _at_reversals(left: Residual, places: list[float], width: float) -> bool:
    """Whether the pushes seek the reversals: then they are what a reversal does, no isolated ones.

    Had they nothing to do with reversals, as many as that would lie beside one by chance in one
    case of a hundred.
    """
    turns = left.turns
    if not len(turns):
        return False
    near = width + 2 * left.reach

    def beside(moments):
        after = np.searchsorted(turns, moments)
        around = turns[np.clip(np.stack([after - 1, after]), 0, len(turns) - 1)]
        return np.min(np.abs(around - moments), axis=0) < near

    chance = float(np.mean(beside(left.elapsed)))
    count = int(np.sum(beside(np.interp(places, left.clock, left.run))))
    total = len(places)
    tail = [
        comb(total, k) * chance**k * (1 - chance) ** (total - k) for k in range(count, total + 1)
    ]
    return sum(tail) <= left.level


def _outstanding(residual, time, width, spacing) -> list[float]:
    """Times of the isolated pushes of one width that are seen from begin to end, s."""
    reach = int(np.ceil(width / spacing))
    shape = (
        np.cos(0.5 * np.pi * np.clip(np.arange(-reach, reach + 1) * spacing / width, -1, 1)) ** 2
    )
    if 2 * len(shape) > len(residual):
        return []
    height = np.convolve(residual, shape / np.sqrt(shape @ shape), "same")
    spread = np.median(np.abs(height)) / 0.6745
    left = np.abs(height) / max(spread, 1e-300)
    found: list[tuple[float, float]] = []
    sizes: list[float] = []
    while left[peak := int(np.argmax(left))] >= OUTSTANDING:
        if len(found) == MOST:
            many = APART_FROM_MANY * left[peak]
            found = found[: sum(size >= many for size in sizes)]
            break
        sizes.append(left[peak])
        found.append((_summit(time, left, peak), float(np.sign(height[peak]))))
        left[max(0, peak - 2 * reach) : peak + 2 * reach + 1] = 0.0
    near = APART * (width + 2 * spacing)
    return sorted(
        place
        for place, sign in found
        if time[0] + width <= place <= time[-1] - width
        and not any(abs(place - at) < near and sign != other for at, other in found)
    )


def _summit(time, height, peak) -> float:
    """Where the parabola through a peak and its neighbours is highest, s."""
    if not 0 < peak < len(height) - 1:
        return float(time[peak])
    before, at, after = height[peak - 1 : peak + 2]
    bend = before - 2 * at + after
    share = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(time[peak] + share * 0.5 * (time[peak + 1] - time[peak - 1]))


def _some(term: DisturbancePulses, numbers: Sequence[int]) -> DisturbancePulses:
    return DisturbancePulses(tuple(term.times[n] for n in numbers), term.width)


def _dates(term: DisturbancePulses) -> dict[str, float]:
    return {f"pulse_{i + 1}_time": at for i, at in enumerate(term.times)}


# More in a row nobody reads.
NAMED = 6


def listed(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence with the largest pushes and their times, in the order of time."""
    sizes = {n: abs(v) for n, v in values.items() if f"{n}_time" in values}
    if not sizes:
        return None
    largest = sorted(sizes, key=lambda name: -sizes[name])[:NAMED]
    largest = sorted(largest, key=lambda name: values[f"{name}_time"])
    said = ", ".join(f"{{{name}}} at t = {{{name}_time}}" for name in largest)
    others = f", and {len(sizes) - NAMED} smaller" if len(sizes) > NAMED else ""
    return f"Isolated pushes at single times: {said}{others}"


DISTURBANCE_PULSES = Effect(
    "disturbance_pulses",
    "Σ A_i pulse(t − t_i)",
    "time",
    "Isolated pushes at single times",
    laws=(DisturbancePulses,),
    scaled=lambda scales: (),
    coordinates=("time",),
    confusable_with=("sticky_spot",),
    separate_by="Repeat the motion: what belongs to the machine comes again.",
    momentary=True,
    leftover=True,
    isolated=True,
    outstanding=pulses,
    parts=_some,
    variant=listed,
    dates=_dates,
)
