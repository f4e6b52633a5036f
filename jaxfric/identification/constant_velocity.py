"""The constant-velocity test of Kim, Kim & Ha (2004), section IV, fig. 8.

At constant velocity the force is the friction. Here the mean force is taken over stretches whose
velocity stays in a narrow band and ends at the level at which it began, so that acceleration has no
part in it, whatever the mass. No model enters. The paper holds each speed in runs of their own; in
the recording that was identified the fit saw the same samples, so another one is better evidence.
"""

import dataclasses
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

import jax
import numpy as np

from .. import signals
from ..checks import Remark
from ..data.excerpt import excerpt
from ..data.recording import Recording, require
from ..looks import text
from ..models import Model
from ..signals import counted_noise
from ..units import VELOCITY, spell
from .curves import band, tangent
from .stretches import BAND, Stretch, steady, unsteady
from .uncertainty import COSINES, student_quantile

# From three stretches on their scatter is told well enough to be used (two have a t of 13).
SEVERAL = 3
# A bump's flank takes an octave of speed (`grids.SMOOTH`): a point speaks for half of one each way.
SPEAKS_FOR = 2**0.5
# As in `checks`: a difference below a twentieth of the friction is no matter.
MATTERS = 0.05


class Point(NamedTuple):
    """The mean force at one speed.

    - `velocity`, m/s; `force`, N, the mean over `stretches`, `seconds` in all.
    - `standard_error`, N, with its `degrees_of_freedom`; `low`, `high`: the 95 % interval, N.
    - `curve`, `curve_low`, `curve_high`: the identified friction there with its 95 % band, N; NaN
      without one. `contradicts`: whether the two lie apart beyond both intervals.
    """

    velocity: float
    force: float
    standard_error: float
    degrees_of_freedom: int
    low: float
    high: float
    stretches: int
    seconds: float
    curve: float = np.nan
    curve_low: float = np.nan
    curve_high: float = np.nan
    contradicts: bool = False


# So many means are told where there is no curve.
TOLD = 4

# The reason where nothing was tried.
NONE_THERE = "no stretch of constant velocity there"


class Unevaluated(NamedTuple):
    """Speeds of one direction, m/s, low and high with their sign, that no point speaks for."""

    low: float
    high: float
    reason: str


class ConstantVelocity(NamedTuple):
    """The points by rising velocity, and the speeds that could not be evaluated."""

    points: tuple[Point, ...]
    not_evaluated: tuple[Unevaluated, ...]

    @property
    def contradicted(self) -> tuple[Point, ...]:
        """The points that contradict the identified curve."""
        return tuple(point for point in self.points if point.contradicts)

    def to_dict(self) -> dict[str, Any]:
        """The test as plain data, SI units or those of the recording."""
        return {
            "points": [point._asdict() for point in self.points],
            "not_evaluated": [gap._asdict() for gap in self.not_evaluated],
        }

    def __repr__(self) -> str:
        table = [["velocity", "force", "± 95 %", "curve", "seconds", ""]]
        for p in self.points:
            numbers = (p.velocity, p.force, 0.5 * (p.high - p.low), p.curve, p.seconds)
            table.append([*map("{:.4g}".format, numbers), "contradicts" if p.contradicts else ""])
        gaps = [
            f"not evaluated {g.low:.3g} to {g.high:.3g}: {g.reason}" for g in self.not_evaluated
        ]
        return text.text([text.Table(table, range(5)), gaps])


def constant_velocity(recording: Recording, found: Any = None) -> ConstantVelocity:
    """The constant-velocity test of a recording (Kim, Kim & Ha 2004, fig. 8).

    A stretch is where the velocity stays within 5 % of a level, from its first to its last crossing
    of its median there. Its mean force has the interval of slow cosines (as the parameters have,
    `uncertainty`), or of the scatter between three and more stretches of one speed, the wider one.

    **Arguments:** `recording`, signals of shape `(N,)`; `found`, an `Identified`, to compare with.
    Of a model with terms beyond velocity these are taken off the force first.

    **Raises:** `ValueError` for a batch, or inside `jax.jit`.
    """
    require(recording, "constant_velocity")
    if signals.is_traced(recording):
        raise ValueError("constant_velocity reads values: call it outside of jax.jit.")
    log, stretches, points = _points(recording, found)
    points = _compared(points, found)
    return ConstantVelocity(tuple(points), tuple(_gaps(log, stretches, points, slowest_slip(log))))


def held(recording: Recording, model: Model) -> list[dict[str, float]]:
    """The points of a recording, less what a model says beyond velocity, beside no curve."""
    points = _points(recording, SimpleNamespace(model=model))[2]
    return [
        {"velocity": p.velocity, "force": p.force, "half": 0.5 * (p.high - p.low)} for p in points
    ]


def _points(recording: Recording, found: Any) -> tuple[Recording, list[Stretch], list[Point]]:
    """The prepared recording, its stretches, and a point for each speed."""
    log = jax.tree.map(np.asarray, signals.prepare(excerpt(recording)))
    force = np.asarray(log.force, float) - beyond(found, log)
    stretches = steady(log, force, slowest_slip(log))
    mass = _mass(found)
    return log, stretches, [_point(group, mass) for group in _groups(stretches)]


def slowest_slip(log: Recording) -> float:
    """The smallest speed resolved as slip, m/s, as `signals.scales` has it, on the host."""
    velocity = np.asarray(log.velocity, float)[np.asarray(log.mask)]
    velocity = velocity[np.isfinite(velocity)]
    if velocity.size < 2:
        return 0.0
    fastest = float(np.quantile(np.abs(velocity), 0.98))
    noise = counted_noise(velocity)
    return max(signals.SLIP_DEVIATIONS * noise, signals.SLIP_SHARE * fastest)


def _mass(found: Any) -> float:
    """The identified inertia; none where there is none. It widens intervals only."""
    value = 0.0 if found is None else float(found.model.parameters.get("inertia", 0.0))
    return abs(value) if np.isfinite(value) else 0.0


def beyond(found: Any, log: Recording) -> np.ndarray | float:
    """What the terms beyond velocity say, N, `(N,)`."""
    if found is None or found.model.term.coordinates <= {"velocity", "acceleration"}:
        return 0.0
    model: Model = found.model
    return np.asarray(model.force(log)) - np.asarray(model.friction(log.velocity))


def _groups(stretches: Sequence[Stretch]) -> list[list[Stretch]]:
    """Stretches of one speed together: within a band of the group's slowest."""
    groups: list[list[Stretch]] = []
    for stretch in sorted(stretches, key=lambda s: s.velocity):
        near = groups and abs(stretch.velocity - groups[-1][0].velocity) <= BAND * abs(
            groups[-1][0].velocity
        )
        if near:
            groups[-1].append(stretch)
        else:
            groups.append([stretch])
    return groups


def _point(group: Sequence[Stretch], mass: float) -> Point:
    """One point of the stretches at one speed, longer ones weighing more."""
    seconds = np.array([s.seconds for s in group])
    share, values = seconds / seconds.sum(), np.array([s.force for s in group])
    mean = float(share @ values)
    errors = [(float(np.sqrt(share**2 @ np.square([s.error for s in group]))), COSINES)]
    count = len(group)
    if count >= SEVERAL:
        scatter = share**2 @ (values - mean) ** 2 * count / (count - 1)
        errors.append((float(np.sqrt(scatter)), count - 1))
    error, freedom = max(errors, key=lambda e: student_quantile(0.975, e[1]) * e[0])
    # A velocity that is known with noise may still rise: by so much the mass could have pulled.
    rise = mass * float(abs(share @ [s.rise for s in group]))
    half = student_quantile(0.975, freedom) * error + rise
    velocity = float(share @ [s.velocity for s in group])
    total = float(seconds.sum())
    return Point(velocity, mean, error, freedom, mean - half, mean + half, count, total)


def _compared(points: Sequence[Point], found: Any) -> list[Point]:
    """The points beside the identified curve, where there is one.

    A point contradicts where it lies off the curve by more than its interval, with the chance of
    5 % shared by all points, by more than a twentieth of the force, and by more than the curve's
    band too, unless no parameters at all lead the model through the points: a model that is too
    simple widens its band by what it misses.
    """
    if found is None or not points:
        return list(points)
    count = len(points)
    velocity, force = (np.array([getattr(p, n) for p in points]) for n in ("velocity", "force"))
    curve, low, high = band(found, velocity)
    shared = np.array([_quantile(count, p) / _quantile(1, p) for p in points])
    half = shared * np.array([0.5 * (p.high - p.low) for p in points])
    off = np.abs(force - curve)
    matters = (off > half) & (off > MATTERS * np.abs(force))
    # Where the recording does not show a parameter the curve has no value or no band.
    known = np.isfinite(curve) & (high > low)
    beyond = off > half + shared * 0.5 * (high - low)
    wrong = matters & known & (beyond | _misshapen(found.model, velocity, force, half))
    return [
        p._replace(curve=float(c), curve_low=float(a), curve_high=float(b), contradicts=bool(w))
        for p, c, a, b, w in zip(points, curve, low, high, wrong, strict=True)
    ]


def _quantile(count: int, point: Point) -> float:
    return student_quantile(1 - 0.025 / count, point.degrees_of_freedom)


def _misshapen(model: Model, velocity, force, half) -> bool:
    """Whether the model misses a point by more than its interval whatever its parameters.

    To first order in the nonlinear ones. Of weighted least squares the residual varies less than
    the point itself, so that the interval is wide enough.
    """
    # Points without any scatter are of a force that was not measured.
    if not model.term.coordinates <= {"velocity", "acceleration"} or not half.all():
        return False
    known = dataclasses.replace(model, alpha=np.nan_to_num(np.asarray(model.alpha)))
    design = tangent(known, velocity)[1] / half[:, None]
    if not np.isfinite(design).all():
        return False
    solved = np.linalg.lstsq(design, force / half, rcond=1e-9)[0]
    left = np.abs(force / half - design @ solved)
    return bool(np.any((left > 1) & (left * half > MATTERS * np.abs(force))))


def _gaps(
    log: Recording, stretches: Sequence[Stretch], points: Sequence[Point], slowest: float
) -> list[Unevaluated]:
    """The speeds that were recorded and that no point speaks for, per direction."""
    velocity, tried = np.asarray(log.velocity, float), unsteady(log, stretches, slowest)
    gaps = []
    for sign in (-1, 1):
        speed = sign * velocity[np.asarray(log.mask) & (sign * velocity > slowest)]
        if speed.size < 2:
            continue
        low, high = slowest, max(float(np.quantile(speed, 0.98)), slowest)
        own = sorted(sign * p.velocity for p in points if sign * p.velocity > 0)
        for at in [*own, np.inf]:
            end = min(at / SPEAKS_FOR, high)
            if end > low:
                gaps.append(_gap(sign, low, end, tried))
            low = max(low, at * SPEAKS_FOR)
    return sorted(gaps, key=lambda gap: gap.low)


def _gap(sign: int, low: float, high: float, tried: Sequence[Stretch]) -> Unevaluated:
    least, most = sorted((sign * low, sign * high))
    there = [s for s in tried if least <= s.velocity <= most]
    if not there:
        return Unevaluated(least, most, NONE_THERE)
    worst = max(there, key=lambda s: s.seconds)
    return Unevaluated(
        least,
        most,
        f"the mean velocity was held at {worst.velocity:.3g}, but it varied by "
        f"{worst.spread:.0%} (rms), too much to call it constant",
    )


def sentence(test: ConstantVelocity, units: dict[str, str]) -> str:
    """What the test says in a line; nothing where nothing moved."""
    if not test.points and not test.not_evaluated:
        return ""
    speed = spell(VELOCITY, units)
    if not test.points:
        tried = [g.reason for g in test.not_evaluated if g.reason != NONE_THERE]
        reason = tried[0] if tried else "none was held long enough"
        return f"Constant-velocity test: no speed could be evaluated; {reason}."
    wrong = len(test.contradicted)
    compared = [p for p in test.points if np.isfinite(p.curve) and p.curve_high > p.curve_low]
    if not compared:
        means = ", ".join(
            f"{p.force:.4g} ± {0.5 * (p.high - p.low):.2g} {units['force']} at {p.velocity:.3g} "
            f"{speed}"
            for p in test.points[:TOLD]
        )
        more = f" and at {len(test.points) - TOLD} more speeds" * (len(test.points) > TOLD)
        return f"Constant-velocity test: the mean force is {means}{more}."
    count = len(compared)
    agree = f"{count - wrong} of {count} speeds agree" if wrong else f"all {count} speeds agree"
    if count == 1:
        agree = "the one speed disagrees" if wrong else "the one speed agrees"
    rest = [f"{g.low:.3g} to {g.high:.3g}" for g in test.not_evaluated]
    gaps = f"; not evaluated: {', '.join(rest)} {speed}" if rest else ""
    return f"Constant-velocity test: {agree} with the curve{gaps}."


def remark(test: ConstantVelocity, units: dict[str, str]) -> Remark | None:
    """The warning that points contradict the curve; `None` where none does."""
    wrong = test.contradicted
    if not wrong:
        return None
    speed = spell(VELOCITY, units)
    worst = max(wrong, key=lambda p: abs(p.force - p.curve) / abs(p.force))
    half = 0.5 * (worst.high - worst.low)
    return Remark(
        "constant_velocity",
        f"At constant velocity the force contradicts the curve at {len(wrong)} of "
        f"{len(test.points)} speeds: at {worst.velocity:.3g} {speed} its mean is {worst.force:.4g} "
        f"± {half:.2g} {units['force']}, on the curve {worst.curve:.4g}. The model is too simple "
        "there, or a load differs between the stretches: look at --plot, try jaxfric select.",
        False,
    )
