"""What a simpler form costs: its force beside the model's, over ranges of speed, place and time.

The ranges are sampled without chance: speeds in narrowing cells towards zero, where friction
bends, each weighted by its cell; places and times by the fractional parts of multiples of an
irrational number, which fill their range evenly whatever its period (Weyl 1916).
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from ..data.recording import Recording
from ..models import Model
from ..terms.base import Directional
from ..units import VELOCITY
from .outcome import ForceError
from .parts import Part, parts

CELLS = 4096
# Irrational, and not a rational multiple of one another.
GOLDEN, SILVER = 0.6180339887498949, 0.41421356237309503
# A Stribeck bump is gone at five of its velocities: exp(−25), and 4 % of a Lorentzian.
BUMP = 5.0
Range = tuple[float, float]


class Motion(NamedTuple):
    """Samples of the ranges: a recording with no force, `(N,)`, and the weight of each, `(N,)`."""

    recording: Recording
    weight: np.ndarray

    def rms(self, force: np.ndarray) -> float:
        """Root mean square of a force over the ranges."""
        return float(np.sqrt(np.sum(self.weight * force**2) / np.sum(self.weight)))


def speed_range(model: Model, given: Range | None = None) -> Range:
    """The given range of speed, or the one that the model's own parameters suggest.

    That is from rest to where the first term that grows with speed has reached the size of
    Coulomb friction, to five Stribeck velocities, or to the last knot of a table over velocity,
    whichever is highest. Coulomb or viscous friction alone bends nowhere: there it is 1.

    **Raises:** `ValueError` unless 0 ≤ low < high.
    """
    if given is not None:
        if not 0 <= given[0] < given[1] < np.inf:
            raise ValueError(
                f"The speed range is {given[0]:g} to {given[1]:g}; it must rise from zero or more, "
                "for instance --speed 0:0.2."
            )
        return float(given[0]), float(given[1])
    slips = [part for part in parts(model) if part.slips]
    values = {name: abs(float(value)) for name, value in model.parameters.items()}
    speeds = [BUMP * values[name] for name in _velocities(model)] + _growing(slips, values)
    spans = (natural(part, values) for part in slips)
    speeds += [max(map(abs, found["velocity"])) for found in spans if "velocity" in found]
    return 0.0, max(filter(None, speeds), default=1.0)


def _velocities(model: Model) -> list[str]:
    return [p.name for p in model.term.nonlinear if p.dimension == VELOCITY]


def _growing(slips: Sequence[Part], values: Mapping[str, float]) -> list[float]:
    """The speed where the first term in a power n of speed equals the constant friction."""
    levels: list[float] = []
    slopes: list[tuple[int, float]] = []
    for part in slips:
        for name, parameter in zip(part.affine, part.term.affine, strict=True):
            if isinstance(parameter.dimension, str):
                continue
            force, position, time = parameter.dimension
            if force == 1 and position == -time and time > 0:
                slopes.append((time, values[name]))
            elif part.law.in_joint == "friction":
                levels.append(values[name])
    level = max(levels, default=0.0)
    reached = [(level / slope) ** (1 / power) for power, slope in slopes if slope > 0]
    return [min(reached)] if reached and level > 0 else []


def natural(part: Part, values: Mapping[str, float]) -> dict[str, Range]:
    """The range of position and of time in which a term shows all that it does, where it says.

    A period of a wave, four widths about a spot, the knots of a table, three time constants of a
    drift; a spring and an end stop know no range.
    """
    found: dict[str, Range] = {}
    names = [p.name for p in part.law.nonlinear]
    own = {n: values[o] for n, o in zip(names, part.nonlinear[: len(names)], strict=True)}
    _join(found, part.law.extent(own))
    if isinstance(part.term, Directional) and type(part.term.negative) is type(part.law):
        own = {n: values[o] for n, o in zip(names, part.nonlinear[len(names) :], strict=True)}
        _join(found, part.term.negative.extent(own))
    return found


def _join(found: dict[str, Range], more: Mapping[str, Range]) -> None:
    for coordinate, span in more.items():
        found[coordinate] = _wider(found.get(coordinate), span)


def _wider(first: Range | None, second: Range) -> Range:
    return second if first is None else (min(first[0], second[0]), max(first[1], second[1]))


def ranges(model: Model, speed: Range | None, position: Range | None) -> dict[str, Range]:
    """The ranges of `velocity` (as speed), `position` and `time` that are known."""
    values = {name: float(value) for name, value in model.parameters.items()}
    found: dict[str, Range] = {}
    for part in parts(model):
        _join(found, natural(part, values))
    found["velocity"] = speed_range(model, speed)
    if position is not None:
        if not position[0] < position[1]:
            raise ValueError(f"The position range {position[0]:g} to {position[1]:g} is empty.")
        found["position"] = position
    return found


def motion(known: Mapping[str, Range]) -> Motion:
    """Samples of the ranges in both directions; a coordinate without a range stays at zero."""
    low, high = known["velocity"]
    edges = low + (high - low) * np.linspace(0.0, 1.0, CELLS + 1) ** 3
    speed, weight = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    count = np.arange(2 * CELLS)
    placed = {}
    for name, step in (("position", GOLDEN), ("time", SILVER)):
        start, end = known.get(name, (0.0, 0.0))
        placed[name] = jnp.asarray(start + (end - start) * ((count * step) % 1.0))
    velocity = jnp.asarray(np.concatenate([speed, -speed]))
    return Motion(
        Recording(force=jnp.zeros_like(velocity), velocity=velocity, **placed),
        np.concatenate([weight, weight]),
    )


def forces(
    model: Model, known: Mapping[str, Range], where: Motion
) -> dict[tuple[str, ...], np.ndarray]:
    """The force of every part, by its key, that the ranges say, `(N,)` each.

    Missing are the parts with acceleration, memory, a channel, or a coordinate of unknown range.
    """
    covered = {"velocity", *known}
    counted = [p for p in parts(model) if p.sampled and p.term.coordinates <= covered]
    return {
        part.key: np.asarray(part.term.columns(where.recording) @ alpha(model, part), float)
        for part in counted
    }


def alpha(model: Model, part: Part):
    """The affine parameters of a part, `(p,)`."""
    return jnp.stack([model.parameters[name] for name in part.affine])


def fit(velocity: np.ndarray, friction: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """The level F ≥ 0 and slope D ≥ 0 of F sign(v) + D v nearest to a friction curve.

    Least squares with the given weights, all `(N,)`.

    **Raises:** `ValueError` for numbers that are too large.
    """
    columns = np.stack([np.sign(velocity), velocity], axis=1)
    root = np.sqrt(weight)
    _check_range(weight, velocity, friction)
    best, least = (0.0, 0.0), float(np.sum(weight * friction**2))
    for kept in ([0, 1], [0], [1]):
        found, *_ = np.linalg.lstsq(columns[:, kept] * root[:, None], friction * root)
        left = float(np.sum(weight * (friction - columns[:, kept] @ found) ** 2))
        if np.all(found >= 0) and left < least:
            full = dict(zip(kept, map(float, found), strict=True))
            best, least = (full.get(0, 0.0), full.get(1, 0.0)), left
    return best


def error(
    where: Motion, wanted: np.ndarray, given: np.ndarray, unit: str, bursts: float = 0.0
) -> ForceError:
    """The cost of giving one force, `(N,)`, for another; `bursts` adds to the worst case."""
    left = wanted - given
    _check_range(where.weight, wanted, left)
    rms, size = where.rms(left), where.rms(wanted)
    relative = rms / size if size > 0 else 0.0
    return ForceError(rms, relative, float(np.max(np.abs(left))) + bursts, unit)


def _check_range(weight: np.ndarray, *forces: np.ndarray) -> None:
    """Raise `ValueError` where the ranges reach so far that no sum of squares can be formed."""
    with np.errstate(over="ignore", invalid="ignore"):
        fine = all(np.isfinite(np.sum(weight * force**2)) for force in forces)
    if not fine:
        raise ValueError(
            "Over this range the model's force is not finite, or too large to be squared: give a "
            "range that the machine reaches (--speed, --position)."
        )
