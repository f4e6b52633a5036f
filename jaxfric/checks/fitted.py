"""Faults that show in what a model leaves of a recording, on the host."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from .design import HALF, MATTERS, Design
from .kinds import places
from .lateness import Lateness, Look, lateness

# Rows for each parameter in either part of a record.
ROWS = 10
# Where a record is split.
SPLITS = tuple(i / 10 for i in range(1, 10))
# A tenth of the force, a hundredth of its power, is more than any filter or ripple of the log
# leaves; it is structure where it has twice the power of what neighbouring rows differ by.
LEFT, ROUGH = 0.1, 2.0**0.5
# Of a quarter of the force everyone wants to know, noise or not.
LARGE = 0.25


class Estimated(NamedTuple):
    """The first parameters of a design, `alpha`, their intervals' `half`, both `(p,)`, the
    `interval` between the samples, s, by how much the force is late, if that is known, and whether
    it was `aligned` already.
    """

    alpha: Float[np.ndarray, " p"]
    half: Float[np.ndarray, " p"]
    interval: float
    lateness: Lateness | None = None
    aligned: bool = False


def suspects(
    designs: Design, force_errors: np.ndarray, looks: Sequence[Look], fits: Sequence[Estimated]
) -> Bool[np.ndarray, " B"]:
    """Which fits of a batch [`fitted`][] may find a fault of, by what a few passes show.

    **Arguments:** the `looks` at the designs, and what was estimated from each.
    """
    used = np.asarray(designs.weight) > 0
    target, left = (np.where(used, np.asarray(x), 0.0) for x in (designs.target, designs.left))
    powers, energies = (np.einsum("bj,bj->b", x, x) for x in (target, left))
    few = np.count_nonzero(used, axis=1) < ROWS * max(designs.columns.shape[2], 1)
    plain = (energies <= 0.99 * MATTERS**2 * powers) & (np.asarray(force_errors) <= LEFT)
    found = few | ~plain | [look.gain for look in looks]
    for i, fit in enumerate(fits):
        late = fit.lateness
        if late is not None and not found[i]:
            columns, shift = designs.columns[i, used[i]], designs.shift[i]
            stamped = bool(_stamped(late, fit, columns, target[i], shift))
            found[i] = stamped or _beyond(late, fit, shift) or late.gain > 0.99 * HALF * energies[i]
    return found


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
    least = MATTERS**2 * power, HALF * energy
    if known is not None and fit is not None and _beyond(known, fit, np.asarray(design.shift)):
        least = 0.0, HALF * (energy - _rough(left) ** 2)
    found = _slightly_late(known, design, *least)
    found |= found or _gain(basis, target, left, design.forward, rows)
    if not found and energy > least[0]:
        found |= _late(design, rows, basis, energy, max(least))
    if not found and energy > MATTERS**2 * power:
        found |= _split(columns, target, left, np.asarray(design.time)[rows], power)
    if known is not None and fit is not None and "force_late" not in found:
        columns, shift = np.asarray(design.columns, float)[rows], np.asarray(design.shift)
        found |= _stamped(known, fit, columns, target, shift)
    if force_error > LEFT and np.sqrt(energy) > max(LEFT * np.sqrt(power), ROUGH * _rough(left)):
        found["structure_left"] = force_error
    elif force_error > LARGE:
        found["large_error"] = force_error
    return places(found)


# By so many intervals a parameter has to be off, to first order.
OFF = 2.0
# Of a parameter that makes less than a fifth of the force a twentieth is no matter.
PART = 0.2
# Of a force with less of its power in one sign, a tenth of its size, a gain of that sign would be
# read off next to nothing.
ONE_SIGN = 0.01
# What leaves less than half as much again does as well.
ALIKE = 1.5


def _gain(basis, target, left, forward, rows) -> dict[str, float]:
    """The gain of the positive force, where one of its own leaves half of the residual; or which
    share friction of each direction leaves, where that does as well: a machine has it more often.

    Of the force that the model gives: the measured one holds its own noise, which where each
    direction has parameters of its own is all that they leave of it.
    """
    positive = np.maximum(target - left, 0.0)
    powers = float(positive @ positive), float(target @ target)
    if not ONE_SIGN * powers[1] < powers[0] < (1 - ONE_SIGN) * powers[1]:
        return {}
    own = positive - basis @ (basis.T @ positive)
    size = float(own @ own)
    if size <= 1e-6 * powers[0]:
        return {}
    share = float(own @ left) / size
    energy = float(left @ left)
    rest = energy - share**2 * size
    if rest >= HALF * energy or not MATTERS < abs(share) < 1:
        return {}
    if forward is not None and forward.shape[1]:
        apart = _least(np.concatenate([basis, np.asarray(forward, float)[rows]], axis=1), left)
        if apart <= ALIKE * rest:
            return {"friction_by_direction": (apart / energy) ** 0.5}
    return {"gain_by_sign": 1 / (1 - share)}


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


def _beyond(known: Lateness, fit: Estimated, shift) -> bool:
    """Whether the force is surely later, or earlier, than a hold and a cycle of the controller make
    it, and that counts: a parameter is off by a twentieth, or by its interval where that holds
    zero; or the force was to be aligned.
    """
    if not known.told or known.sure(fit.interval):
        return False
    moved, size = np.abs(known.time * shift[: len(fit.alpha)]), np.abs(fit.alpha)
    return fit.aligned or bool(np.any(moved > np.where(size > fit.half, MATTERS * size, fit.half)))


def _slightly_late(known: Lateness | None, design: Design, changed, gain) -> dict[str, float]:
    """A delay of less than a row. Half a sample of it is damping to a light, fast axis.

    It changes the force by the energy `changed` at least, N², and takes off `gain`.
    """
    if known is None:
        return {}
    rows = np.flatnonzero(np.asarray(design.weight) > 0)
    spacing = float(np.median(np.diff(np.asarray(design.time, float)[: rows[-1] + 1])))
    counts = known.time**2 * known.shape > changed and known.gain > gain
    if counts and abs(known.time) < spacing:
        return {"force_late": known.time}
    return {}


def _stamped(known: Lateness, fit: Estimated, columns, target, shift) -> dict[str, float]:
    """By how much the force acts after its stamp, where a parameter that makes a good part of the
    force is off for it, by a twentieth and by more than its interval.
    """
    if not known.sure(fit.interval):
        return {}
    moved = np.abs(known.time * shift[: len(fit.alpha)])
    sizes = np.abs(fit.alpha) * np.linalg.norm(columns[:, : len(fit.alpha)], axis=0)
    large = sizes > PART * np.linalg.norm(target)
    off = large & (moved > OFF * fit.half) & (moved > MATTERS * np.abs(fit.alpha))
    return {"force_stamped": -known.time} if off.any() else {}


def _late(design: Design, rows, basis, energy, gain) -> dict[str, float]:
    """By how much the force is late, where taking it earlier takes off an energy `gain`, N².

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
    if not best or energy - tried[best] <= gain:
        return {}
    # Between whole rows by the parabola through three of them.
    low, high = (energy if lag == 0 else left(lag) for lag in (best - 1, best + 1))
    bend = low - 2 * tried[best] + high
    part = 0.5 * (low - high) / bend if bend > 0 else 0.0
    return {"force_late": (best + float(np.clip(part, -0.5, 0.5))) * spacing}
