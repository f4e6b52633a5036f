"""Faults that show in what a model leaves of a recording, on the host."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Array, Bool, Float

from .kinds import places

# What a remark is about changes the force by a twentieth of its size, or it is no matter.
MATTERS = 0.05
# It takes half of the power that the model leaves: two parts of a record with parameters of their
# own take p of J rows' power from noise, which is far less (see ROWS).
HALF = 0.5
# Rows for each parameter in either part of a record.
ROWS = 10
# Parts of a record that its errors are summed over.
PARTS = 16
# Where a record is split.
SPLITS = tuple(i / 10 for i in range(1, 10))
# A tenth of the force, a hundredth of its power, is more than any filter or ripple of the log
# leaves; it is structure where it has twice the power of what neighbouring rows differ by.
LEFT, ROUGH = 0.1, 2.0**0.5
# Of a quarter of the force everyone wants to know, noise or not.
LARGE = 0.25


class Design(NamedTuple):
    """The rows of the weak form that a fit is judged by.

    - `columns`: derivatives of the rows by all parameters, affine ones first, `(J, P)`.
    - `target`: the force, N, and `left`, what the model leaves of it, `(J,)`.
    - `weight`: s, `(J,)`, zero where the axis does not slip one way; `time`: s, `(J,)`.
    """

    columns: Float[Array, "J P"]
    target: Float[Array, " J"]
    left: Float[Array, " J"]
    weight: Float[Array, " J"]
    time: Float[Array, " J"]


class Estimated(NamedTuple):
    """The first parameters of a design, `alpha`, their intervals' `half`, both `(p,)`, the
    `interval` between the samples, s, and by how much the force is late, if that is known.
    """

    alpha: Float[np.ndarray, " p"]
    half: Float[np.ndarray, " p"]
    interval: float
    lateness: "Lateness | None" = None


def fitted(design: Design, force_error: float, fit: Estimated | None = None) -> np.ndarray:
    """The numbers of the faults that a fit shows, `(W,)`, as [`kinds`][] orders them.

    **Arguments:** `fit`: what was estimated from the design, where that is to be judged too.
    """
    rows = np.flatnonzero(np.asarray(design.weight) > 0)
    columns = np.asarray(design.columns, float)[rows]
    size = np.max(np.abs(columns), axis=0, initial=0.0)
    columns = columns[:, size > 0] / size[size > 0]
    if not np.isfinite(columns).all():
        return places({})
    if len(rows) < ROWS * max(columns.shape[1], 1):
        return places({"few_rows": len(rows)})
    target, left = (np.asarray(x, float)[rows] for x in (design.target, design.left))
    power, energy = float(target @ target), float(left @ left)
    if not (np.isfinite(power) and np.isfinite(energy)) or power == 0:
        return places({})
    # What turns the columns into each other takes little off the residual and much from the truth.
    basis = np.linalg.qr(columns)[0]
    known = lateness(design) if fit is None else fit.lateness
    found = _slightly_late(known, design, energy, power)
    found |= found or _gain(basis, target, left)
    if not found and energy > MATTERS**2 * power:
        found |= _late(design, rows, basis, energy, power)
        found |= found or _split(columns, target, left, np.asarray(design.time)[rows], power)
    if known is not None and fit is not None and "force_late" not in found:
        found |= _stamped(known, fit, np.asarray(design.columns, float)[rows], target)
    if force_error > LEFT and np.sqrt(energy) > max(LEFT * np.sqrt(power), ROUGH * _rough(left)):
        found["structure_left"] = force_error
    elif force_error > LARGE:
        found["large_error"] = force_error
    return places(found)


# A force that is held acts half a sample after its stamp, and a cycle of the controller later it
# acts one and a half; what is beyond is another matter. Student's t of 15 degrees of freedom is
# below 4 in 99.9 % of the cases.
STAMPED, SURE = 1.5, 4.0
# By so many intervals a parameter has to be off: to first order, and of the weak form, since closed
# windows may feel half of it.
OFF = 2.0
# Of a parameter that makes less than a fifth of the force a twentieth is no matter.
PART = 0.2
# Of a force with less of its power in one sign, a tenth of its size, a gain of that sign would be
# read off next to nothing.
ONE_SIGN = 0.01


def _gain(basis, target, left) -> dict[str, float]:
    """The gain of the positive force, where one of its own leaves half of the residual.

    Noise alone never gives half: what of it is in the positive force is half of it at most.
    """
    positive = np.maximum(target, 0.0)
    powers = float(positive @ positive), float(target @ target)
    if not ONE_SIGN * powers[1] < powers[0] < (1 - ONE_SIGN) * powers[1]:
        return {}
    own = positive - basis @ (basis.T @ positive)
    size = float(own @ own)
    if size <= 1e-6 * powers[0]:
        return {}
    share = float(own @ left) / size
    if share**2 * size > HALF * float(left @ left) and MATTERS < abs(share) < 1:
        return {"gain_by_sign": 1 / (1 - share)}
    return {}


def _rough(left: np.ndarray) -> float:
    """The size of what rows differ by that share no samples: of noise, as large as all of it."""
    apart = left[2:] - left[:-2]
    return float(np.sqrt(0.5 * len(left) * np.mean(apart**2))) if len(apart) else 0.0


def _split(columns, target, left, time, power) -> dict[str, float]:
    """When the parameters change, where two parts of the record obey parameters of their own."""
    energy, best = float(left @ left), (np.inf, 0.0)
    for share in SPLITS:
        at = round(share * len(target))
        if min(at, len(target) - at) < ROWS * columns.shape[1]:
            continue
        parts = sum(_least(columns[part], left[part]) for part in (slice(at), slice(at, None)))
        best = min(best, (parts, float(time[at])))
    if best[0] < HALF * energy and energy - best[0] > MATTERS**2 * power:
        return {"change_in_the_middle": best[1]}
    return {}


def _least(columns: np.ndarray, target: np.ndarray) -> float:
    solved = np.linalg.lstsq(columns, target, rcond=1e-10)[0]
    rest = target - columns @ solved
    return float(rest @ rest)


class Lateness(NamedTuple):
    """By how much a recorded force is late, s (early below zero): u(t + τ) = u + τ du/dt.

    `error`, s, of the time, by parts of the record; `shift`, by how much each second of it shifts
    the parameters, `(P,)`; `gain`, the energy, N², that it would remove; `shape`, that of the
    slope, N²/s².
    """

    time: float
    error: float
    shift: Float[np.ndarray, " P"]
    gain: float
    shape: float

    def sure(self, interval: float) -> bool:
        """Whether it is told from none, and what a hold or a cycle of a controller makes.

        `interval` between the samples, s.
        """
        return SURE * self.error < abs(self.time) <= STAMPED * interval


def lateness(design: Design, moving: Bool[np.ndarray, " P"] | None = None) -> Lateness | None:
    """The [`Lateness`][] that the rows of a fit show; `None` where they cannot.

    Of less than a row. What the parameters imitate of it is no part of the estimate.

    **Arguments:** `moving`: the parameters that shift with it, where others are known from what
    these rows do not hold.
    """
    rows = np.flatnonzero(np.asarray(design.weight) > 0)
    if len(rows) < PARTS:
        return None
    end = rows[-1] + 1  # beyond is padding
    time, whole = (np.asarray(x, float)[:end] for x in (design.time, design.target))
    columns, left = (np.asarray(x, float)[rows] for x in (design.columns, design.left))
    if not np.all(np.diff(time) > 0) or not np.isfinite(columns).all():
        return None
    slope = np.gradient(whole, time)[rows]
    size = np.max(np.abs(columns), axis=0)
    size[size == 0] = 1.0
    taken = np.linalg.lstsq(columns / size, slope, rcond=1e-10)[0] / size
    own = slope - columns @ taken
    power, shape = float(own @ own), float(slope @ slope)
    if not power > 1e-6 * shape:
        return None
    part = float(own @ left)
    late = -part / power
    if moving is not None:
        solved = np.linalg.lstsq((columns / size)[:, moving], slope, rcond=1e-10)[0]
        taken = np.zeros(len(size))
        taken[moving] = solved / size[moving]
    rest = own * (left + late * own)
    sums = np.add.reduceat(rest, np.arange(PARTS) * len(rows) // PARTS)
    return Lateness(late, float(np.sqrt(sums @ sums)) / power, -taken, part**2 / power, shape)


def _slightly_late(known: Lateness | None, design: Design, energy, power) -> dict[str, float]:
    """A delay of less than a row. Half a sample of it is damping to a light, fast axis."""
    if known is None:
        return {}
    counts = known.time**2 * known.shape > MATTERS**2 * power
    rows = np.flatnonzero(np.asarray(design.weight) > 0)
    spacing = float(np.median(np.diff(np.asarray(design.time, float)[: rows[-1] + 1])))
    if known.gain > HALF * energy and counts and abs(known.time) < spacing:
        return {"force_late": known.time}
    return {}


def _stamped(known: Lateness, fit: Estimated, columns, target) -> dict[str, float]:
    """By how much the force acts after its stamp, where a parameter that makes a good part of the
    force is off for it, by a twentieth and by more than its interval.
    """
    moved = np.abs(known.time * known.shift[: len(fit.alpha)])
    forces = np.linalg.norm(columns, axis=0)
    sizes = np.abs(fit.alpha) * forces[: len(fit.alpha)]
    large = sizes > PART * np.linalg.norm(target)
    off = large & (moved > OFF * fit.half) & (moved > MATTERS * np.abs(fit.alpha))
    return {"force_stamped": -known.time} if known.sure(fit.interval) and off.any() else {}


def _late(design: Design, rows, basis, energy, power) -> dict[str, float]:
    """By how much the force is late, where taking it earlier leaves half of the residual.

    To first order in the nonlinear parameters, whose columns are among the others.
    """
    time = np.asarray(design.time, float)[: rows[-1] + 1]  # beyond is padding
    whole = np.asarray(design.target, float)[: rows[-1] + 1]
    if not np.all(np.diff(time) > 0):
        return {}
    known = whole[rows] - np.asarray(design.left, float)[rows]
    # Whole rows: halfway between two of them their noise would be less.
    spacing = float(np.median(np.diff(time)))
    ladder = np.array([1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384, 512])
    ladder = ladder[ladder < len(time) // 10]

    def left(lag: int) -> float:
        shifted = np.interp(time[rows] + lag * spacing, time, whole) - known
        rest = shifted - basis @ (basis.T @ shifted)
        return float(rest @ rest)

    tried = {lag: left(lag) for lag in map(int, np.concatenate([ladder, -ladder]))}
    best = min(tried, key=tried.__getitem__, default=0)
    for lag in range(best - abs(best) // 3, best + abs(best) // 3 + 1):
        tried[lag] = left(lag)
    best = min(tried, key=tried.__getitem__, default=0)
    if best and tried[best] < HALF * energy and energy - tried[best] > MATTERS**2 * power:
        return {"force_late": best * spacing}
    return {}
