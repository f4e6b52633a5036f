"""Where a residual has structure: free curves over every coordinate, and lines.

Along a coordinate c runs a free curve Σ_k F_k Λ_k(c) with hats Λ_k on knots, times a factor: one,
the direction, or the velocity. For changing inertia the curve is M₁(x), its force that of
Lagrange's equation; for a late force it is one constant times the rate of the predicted force.
"""

from typing import NamedTuple

import numpy as np

from .candidates import scaled
from .evidence import Evidence
from .regression import Fit, fit
from .significance import LEVEL, BlockBootstrap, Scan, adjusted, witnesses
from .spectral_lines import OVERSAMPLING, SpectralLines, line_frequencies
from .threads import each

# Knots of a curve: two periods in the stroke with six knots each, where the lines take over.
KNOTS = 12
# Quantiles of the slip time at the knots: even, so that every cell holds as much of the record;
# or doubling from 1/256, since what follows a reversal is over soon.
_EVEN = np.linspace(0.0, 1.0, KNOTS)
_EARLY = np.concatenate([[0.0], 2.0 ** np.linspace(-8.0, 0.0, KNOTS - 1)])


class Structure(NamedTuple):
    """What the residual shows against one coordinate.

    - `share`: part of the residual's mean square that the curve removes, less the mean of the
      draws.
    - `size`: root mean square of that, N; `p_value`, paid for by the number of coordinates.
    - `peak`: the strongest line's frequency, 1/m or Hz; NaN for curves.
    - `curve`: knots and force at them, N; empty for lines.
    """

    coordinate: str
    share: float
    size: float
    p_value: float
    peak: float
    curve: tuple[np.ndarray, np.ndarray]


def locate(evidence: Evidence, current: Fit, seed: int = 0, lines: bool = True) -> list[Structure]:
    """Every coordinate, the largest share first; `evidence` with the fit's predictions.

    `lines`: spectral lines too, and not curves alone.
    """
    bootstrap = BlockBootstrap(current, witnesses(evidence), seed)

    def over(coordinate) -> _Scanned:
        name, (value, factor, kind) = coordinate
        knots = _knots(name, value[evidence.centre])
        raw = _hats(evidence, value, factor, kind, knots)
        return _Scanned(name, bootstrap(scaled(raw[None])), raw, knots)

    def along(name: str) -> _Scanned:
        grid = line_frequencies(evidence, name)
        scan = bootstrap(scaled(SpectralLines(name, False).columns(evidence, grid)))
        return _Scanned(f"{name}_lines", scan, peak=float(grid[scan.best]))

    available = {"position": evidence.motion.position is not None, "time": evidence.clock}
    waves = each(along, [name for name, known in available.items() if known and lines])
    seen = [*each(over, coordinates(evidence).items()), *waves]
    gains = np.array([s.scan.gain.max() for s in seen])
    p_values = adjusted(gains, np.array([s.scan.drawn for s in seen]))
    found = [_structure(s, float(p), current) for s, p in zip(seen, p_values, strict=True)]
    return sorted(found, key=lambda each: -each.share)


class _Scanned(NamedTuple):
    """The scan of a coordinate; the curve's hats `(J, K)` with their knots, or a line's peak."""

    name: str
    scan: Scan
    raw: np.ndarray | None = None
    knots: np.ndarray = np.zeros(0)
    peak: float = float("nan")


def _structure(seen: _Scanned, p_value: float, current: Fit) -> Structure:
    scan, knots = seen.scan, seen.knots
    share = max(float(scan.gain[scan.best] - scan.drawn.mean()), 0.0)
    size = float(np.sqrt(share * current.energy / len(current.residual)))
    curve = (knots, np.zeros_like(knots))
    if seen.raw is not None and len(knots):
        basis = current.basis()
        own = seen.raw - basis @ (basis.T @ seen.raw)
        curve = (knots, np.linalg.lstsq(own, current.residual, rcond=1e-3)[0])
    return Structure(seen.name, share, size, p_value, seen.peak, curve)


def repeated(
    found: list[Structure], current: Fit, held: Evidence, seed: int = 0
) -> list[Structure]:
    """The structure whose curve lowers the residual of a fit on another recording.

    The fit's parameters may move there; `held` with the fit's predictions. A line over position is
    looked for at any phase, as another homing makes it. Coordinates of time and signals that the
    other recording lacks are not tested, and stay.
    """
    there, known = fit(current.terms, held, current.betas, 0), coordinates(held)
    basis = there.basis()
    residual = there.residual - basis @ (basis.T @ there.residual)

    def again(each: Structure) -> bool:
        if each.coordinate == "position_lines" and held.motion.position is not None:
            return _recurs(each.peak, there, held, seed)
        # A line in time is no coordinate of a curve.
        if each.coordinate.startswith("time") or each.coordinate not in known:
            return True
        knots, heights = each.curve
        curve = _hats(held, *known[each.coordinate], knots) @ heights
        curve = curve - basis @ (basis.T @ curve)
        return bool(np.sum((residual - curve) ** 2) < np.sum(residual**2))

    return [each for each in found if again(each)]


def _recurs(peak: float, there: Fit, held: Evidence, seed: int) -> bool:
    """Whether a fit leaves a line over position in another recording, 1/m, at any phase, beyond
    chance; also where that one cannot show it.
    """
    span = held.limits.high - held.limits.low
    near = np.abs(peak + np.array([-1.0, 0.0, 1.0]) / (OVERSAMPLING * span))
    scan = BlockBootstrap(there, witnesses(held), seed)(
        scaled(SpectralLines("position", False).columns(held, near))
    )
    (p_value,) = adjusted(np.array([scan.gain.max()]), scan.drawn[None])
    return bool(p_value <= LEVEL or not scan.dimension.any())


def without_line(current: Fit, evidence: Evidence, found: Structure) -> Fit:
    """A fit whose residual is without a line."""
    wave = SpectralLines(found.coordinate.removesuffix("_lines"), False)
    columns = wave.columns(evidence, np.array([found.peak]))[0]
    residual = current.residual - columns @ np.linalg.lstsq(columns, current.residual)[0]
    return current._replace(residual=residual)


def coordinates(evidence: Evidence) -> dict[str, tuple[np.ndarray, np.ndarray, str]]:
    """Value and factor at the nodes, and the kind of force, of each coordinate by name."""
    motion = evidence.motion
    v, seen = np.asarray(motion.velocity), motion.channels
    one, side = np.ones_like(v), np.sign(v)
    force = np.asarray(seen["predicted_force"])
    since, distance = since_reversal(evidence)
    found = {
        "velocity": (v, one, "plain"),
        "time_since_reversal": (since, side, "plain"),
        "distance_since_reversal": (distance, side, "plain"),
        "predicted_force": (force, one, "plain"),
        "predicted_force_by_direction": (force, side, "plain"),
        "force_rate": (force, one, "rate"),
        "acceleration": (np.asarray(seen["predicted_acceleration"]), one, "plain"),
    }
    if evidence.clock:
        t = np.asarray(motion.time)
        found["time"] = (t, one, "plain")
        found["time_by_direction"] = (t, side, "plain")
        found["time_by_velocity"] = (t, v, "plain")
    if motion.position is not None:
        x = np.asarray(motion.position)
        found["position"] = (x, one, "plain")
        found["position_by_direction"] = (x, side, "plain")
        found["position_by_acceleration"] = (x, v, "momentum")
    for name in ("load", "temperature"):
        if name in seen:
            found[name] = (np.asarray(seen[name]), side, "plain")
    if "neighbour_velocity" in seen:
        other = np.asarray(seen["neighbour_velocity"])
        found["neighbour"] = (other, one, "plain")
    return found


def since_reversal(evidence: Evidence) -> tuple[np.ndarray, np.ndarray]:
    """Time, s, and distance, m, since the velocity last changed its sign, at the nodes.

    Before the first reversal of a segment both count from the segment's start.
    """
    velocity, time = np.asarray(evidence.motion.velocity), evidence.elapsed
    segment = np.asarray(evidence.motion.segment)
    turns = (velocity[1:] * velocity[:-1] <= 0) | (segment[1:] != segment[:-1])
    last = np.maximum.accumulate(np.where(np.pad(turns, (1, 0)), np.arange(len(time)), 0))
    speed = np.abs(velocity)
    way = np.pad(np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time)), (1, 0))
    return time - time[last], way - way[last]


# Coordinates with the encoder's noise in them, differentiated twice or more, which is in the
# residual too. Where most samples share a value, knots at its quantiles would resolve that noise.
NOISY = frozenset({"acceleration", "predicted_force", "predicted_force_by_direction", "force_rate"})
# Curves that can follow that noise: an inertia along the stroke is one over the position, too.
ACCELERATED = NOISY | {"position_by_acceleration"}


def _knots(name: str, values: np.ndarray) -> np.ndarray:
    knots = np.quantile(values, _EARLY if "since" in name else _EVEN)
    if name in NOISY:
        low, high = np.quantile(values, [0.01, 0.99])
        knots = np.linspace(low, high, KNOTS)
    width = knots[-1] - knots[0]
    # Strictly increasing, by a millionth of the range, where many samples share one value.
    return knots + 1e-6 * (width if width > 0 else 1.0) * np.arange(len(knots))


def _hats(evidence, value, factor, kind, knots) -> np.ndarray:
    """The curve's hats as rows, `(J, K)`."""
    if kind == "rate":
        return evidence.project(np.zeros((1, len(value))), value[None, :]).T
    at = np.interp(value, knots, np.arange(len(knots)))
    hats = np.maximum(1 - np.abs(at[:, None] - np.arange(len(knots))[None, :]), 0.0)
    if kind == "plain":
        return evidence.project((factor[:, None] * hats).T).T
    # Lagrange: d(M₁ v)/dt − ½ M₁′ v².
    cell = np.clip(np.floor(at).astype(int), 0, len(knots) - 2)
    inside = (value > knots[0]) & (value < knots[-1])
    rate = np.where(inside, 1 / np.diff(knots)[cell], 0.0)
    slopes = np.zeros_like(hats)
    rows = np.arange(len(value))
    slopes[rows, cell], slopes[rows, cell + 1] = -rate, rate
    plain = -0.5 * (factor**2)[:, None] * slopes
    return evidence.project(plain.T, (factor[:, None] * hats).T).T
