"""Grids whose resolution belongs to the parameter: how many points, and where they lie.

How many is decided on the host, from the scales of the recording, and rounded up to few numbers,
so that few programs are compiled; where they lie follows from the bounds, which may be traced.
"""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..terms.base import AbstractTerm, bounds
from ..terms.effect import scattered
from ..terms.sample import Parameter, Resolution, Scales

# Without a resolution of its own a cost is smooth: a bump's width shows within an octave or so.
SMOOTH = Resolution(0, 4, None, 32)
# Nor has it more than a few turns over a range that is no ratio.
EVEN = Resolution(1, 16, None, 16)
# Grid points times samples of one parameter, a few seconds' work. Above it the grid takes fewer
# samples, and begins at what those can tell.
WORK = 4e7
# Combinations of the parameters of one law, where each is smooth. A grid of more would be coarse
# along each parameter and take minutes: as many places spread evenly tell more.
TOGETHER = 2**12
# Points along one parameter; more would take minutes. Shorter periods are then not searched for.
MOST = 2**16


class Axis(NamedTuple):
    """The grid along one parameter: points, and which share of the range of β^p they cover.

    The share begins at the slow end: the longest period, the lowest frequency.
    """

    points: int
    share: float = 1.0


class Plan(NamedTuple):
    """A grid for each nonlinear parameter, and of how many samples the grid takes one."""

    axes: tuple[Axis, ...]
    thin: int = 1


def resolution(parameter: Parameter) -> Resolution:
    """The parameter's resolution, or that of a smooth cost."""
    return parameter.resolution or (SMOOTH if parameter.logarithmic else EVEN)


def thinning(half_width: int, work: float) -> int:
    """Of how many samples the grid takes one, for a kernel of that half-width in samples.

    The first step that lowers `work`, points times samples, below [`WORK`][]: both fall by it. At
    most a fourth of the half-width: nine samples a kernel, which averages away what is faster than
    two turns in its half-width ((1 − τ²)⁴ leaves 0.2 % of it). Only divisors keep the rows where
    they are.
    """
    common = np.gcd(half_width, max(1, half_width // 2))
    steps = [s for s in range(1, max(1, half_width // 4) + 1) if common % s == 0]
    return next((s for s in steps if work <= WORK * s**2), steps[-1])


def plan(
    term: AbstractTerm,
    given: Mapping[str, tuple[float, float]],
    scales: Scales | None,
    half_width: int | None,
) -> Plan:
    """The grids for the nonlinear parameters of a term.

    **Arguments:** `given`, bounds by name, as for [`bounds`][jaxfric.terms.base.bounds]; `scales`
    of the recording, of shape `()` or `(B,)`, or `None` where they are traced: then the
    resolution's usual number; `half_width` of the weak form's kernel, in samples, if any.
    """
    if scales is None:
        return Plan(tuple(Axis(resolution(p).usual + 1) for p in term.nonlinear))
    box, axes = _box(term, scales, given), []
    needed = [_steps(i, term, scales, box) for i in range(len(term.nonlinear))]
    names = {p.name for p in term.nonlinear} | {p.name.rstrip("+-") for p in term.nonlinear}
    thin = 1
    # What the user bounds is looked at on all samples and wholly.
    if half_width is not None and not names & set(given):
        many = [n for n, p in zip(needed, term.nonlinear, strict=True) if resolution(p).over]
        samples = float(np.max(np.asarray(scales.duration) / np.asarray(scales.interval)))
        thin = thinning(half_width, max(many, default=0) * samples)
    coarse = _box(term, scales._replace(interval=thin * np.asarray(scales.interval)), given)
    for i, (parameter, steps) in enumerate(zip(term.nonlinear, needed, strict=True)):
        share = _share(parameter, box[:, i], coarse[:, i])
        if share * steps > MOST and resolution(parameter).over is not None:
            share = 2.0 ** np.floor(np.log2(MOST / steps))
        axes.append(Axis(rounded(share * steps), float(share)))
    return Plan(tuple(axes), thin)


def rounded(steps: float) -> int:
    """Points for at least so many steps: 2ᵏ or 3·2ᵏ steps, and one point more."""
    steps = min(max(float(np.nan_to_num(steps)), 4.0), MOST)
    power = 2 ** int(np.ceil(np.log2(steps)))
    return (3 * power // 4 if steps <= 3 * power // 4 else power) + 1


def _box(term, scales, given):
    """Bounds `(2, d, ...)` on the host, one for each recording of a batch."""
    limits = Scales(*(np.atleast_1d(np.asarray(value)) for value in scales))
    rows = [Scales(*(jnp.asarray(v[i]) for v in limits)) for i in range(limits.fastest.size)]
    return np.stack([np.asarray(bounds(term, row, given)) for row in rows], axis=-1)


def _steps(number, term, scales, box) -> float:
    """The most steps that any recording of a batch needs along a parameter."""
    names = [p.name for p in term.nonlinear]
    how, (low, high) = resolution(term.nonlinear[number]), box[:, number]
    with np.errstate(all="ignore"):
        if how.power == 0:
            return float(np.max(how.per * np.log2(high / low)))
        if how.beside:  # the next parameter of that name: those of one law stand together
            other = next(i for i in range(number, len(names)) if how.beside in names[i])
            return float(np.max(how.per * (high - low) / box[0, other]))
        if how.over is None:
            return how.per
        return float(np.max(how.per * features(how, scales, low, high)))


def features(how: Resolution, scales: Scales, low, high) -> np.ndarray:
    """How many features, as a wave's cycles over the stroke, a parameter passes between two ends.

    Of a resolution with `over`; `scales` and the ends of any one shape, that of the result.
    """
    return np.abs(np.asarray(how.over(scales)) * (high**how.power - low**how.power))


def _share(parameter, box, coarse) -> float:
    """The share of the range that fewer samples can tell apart, in sixteenths: few programs."""
    how = resolution(parameter)
    if how.over is None:
        return 1.0
    whole, part = (np.abs(high**how.power - low**how.power) for low, high in (box, coarse))
    return float(np.ceil(16 * np.clip(np.max(part / whole), 1 / 16, 1.0)) / 16)


def fractions(
    parameters: Sequence[Parameter], axes: Sequence[Axis]
) -> tuple[np.ndarray, np.ndarray]:
    """Points of the grid over the parameters of one law and half the distance to their neighbours.

    Both `(G, d)`, in fractions of the range of each β^p from the lower bound on: all combinations,
    but fewer places where what they are told apart by is wider; above [`TOGETHER`][] of them places
    spread evenly.
    """
    names = [p.name for p in parameters]
    smooth = all(resolution(p).over is None and not resolution(p).beside for p in parameters)
    if smooth and math.prod(axis.points for axis in axes) > TOGETHER:
        places = scattered(TOGETHER, len(names))
        sizes = np.array([1 / (axis.points - 1) for axis in axes])
        return places, np.broadcast_to(sizes, places.shape)
    free = [i for i, p in enumerate(parameters) if not resolution(p).beside]
    tied = [i for i in range(len(parameters)) if i not in free]
    lines = [_line(parameters[i], axes[i]) for i in free]
    mesh = np.stack([m.ravel() for m in np.meshgrid(*lines, indexing="ij")], axis=1)
    points, cells = [], []
    for row in mesh:
        cell = np.array([axes[i].share / (axes[i].points - 1) for i in free])
        counts = []
        for i in tied:
            other = next(j for j in free if resolution(parameters[i]).beside in names[j])
            octaves = (axes[other].points - 1) / resolution(parameters[other]).per
            wider = 2.0 ** (octaves * row[free.index(other)])
            counts.append(max(5, int(np.ceil(axes[i].points / wider))))
        along = np.meshgrid(*(np.linspace(0.0, 1.0, n) for n in counts), indexing="ij")
        inner = np.stack([m.ravel() for m in along], axis=1) if counts else np.zeros((1, 0))
        point, size = np.zeros((len(inner), len(names))), np.zeros((len(inner), len(names)))
        point[:, free], point[:, tied] = row, inner
        size[:, free], size[:, tied] = cell, [1 / (n - 1) for n in counts]
        points.append(point)
        cells.append(size)
    return np.concatenate(points), np.concatenate(cells)


def _line(parameter, axis: Axis):
    line = np.linspace(0.0, axis.share, axis.points)
    return 1 - line[::-1] if resolution(parameter).power < 0 else line


def to_unit(
    fraction: Float[Array, "*n"],
    parameter: Parameter,
    low: Float[Array, ""],
    high: Float[Array, ""],
) -> Float[Array, "*n"]:
    """Where a fraction of the range of β^p lies in the unit cube of the search."""
    power = resolution(parameter).power
    fraction = jnp.clip(fraction, 0.0, 1.0)
    if (power == 0) == parameter.logarithmic and power >= 0:
        return fraction
    if power == 0:
        beta = low * (high / low) ** fraction
    else:
        beta = (low**power + fraction * (high**power - low**power)) ** (1 / power)
    if not parameter.logarithmic:
        return (beta - low) / jnp.where(high > low, high - low, 1.0)
    span = jnp.log(high / low)
    return jnp.clip(jnp.log(beta / low) / jnp.where(span > 0, span, 1.0), 0.0, 1.0)


def in_unit(
    parameters: Sequence[Parameter], axes: Sequence[Axis], box: Float[Array, "2 d"]
) -> tuple[Float[Array, "G d"], Float[Array, "G d"]]:
    """The grid over the parameters of one law in the unit cube, `(G, d)`, and its cells."""
    points, cells = (jnp.asarray(x, box.dtype) for x in fractions(parameters, axes))
    units, sizes = [], []
    for i, parameter in enumerate(parameters):
        at = [to_unit(points[:, i] + k * cells[:, i], parameter, *box[:, i]) for k in (-1, 0, 1)]
        units.append(at[1])
        sizes.append(jnp.maximum(at[2] - at[1], at[1] - at[0]))
    return jnp.stack(units, axis=1), jnp.stack(sizes, axis=1)
