"""A position that is counted modulo a turn, made continuous where that is certain."""

from typing import NamedTuple

import numpy as np

from .pieces import adjacent, plural, some

# A turn counted in fewer quanta than this is a switch, not an encoder: its jumps are no seam.
COARSEST_ENCODER = 16
# Turns that encoders and controllers count modulo: rad, deg and the binary resolutions.
_TURNS = (2 * np.pi, 360.0, *(2.0**k for k in range(8, 33)))
# The speed beside a seam is taken over as many samples as move it by four times what one sample
# is uncertain by: known to a quarter, the speeds of one motion before and after agree within 3/5.
GRAINS = 4
WIDEST = 64
# A stamp of the note that a jump could not be explained, for those who look for it.
UNEXPLAINED_JUMP = "the position jumps by more than half its range"


class _Steps(NamedTuple):
    """Valid positions `(M,)`, their steps `(M - 1,)`, which follow each other, which are seams."""

    valid: np.ndarray
    step: np.ndarray
    linked: np.ndarray
    seam: np.ndarray


def unwrap(signals, mask, segment, rows, notes, period=None, quiet=False) -> None:
    """Make a position that is counted modulo a turn continuous, and the reference with it.

    **Arguments:** `period`, the modulus if the user has stated it; `quiet`, where the jumps have
    been told of. Without a period the position is changed only where the motion goes through the
    seams, before and after, and the modulus is a usual one, or the same at several of them.
    """
    position = signals.get("position")
    if position is None or (period is None and quiet):
        return
    steps = _steps(signals["time"], position, mask, segment)
    turn = period or _turn(steps)
    if turn is None:
        _tell(steps, some(rows, mask)[1:], notes)
        return
    index = np.flatnonzero(mask)
    signals["position"] = _continuous(position, index, turn)
    changed = np.abs(signals["position"] - position)
    wraps = np.abs(np.diff(np.rint((signals["position"] - position)[index] / turn))) > 0
    if not wraps.any():
        return
    notes.append(
        f"The position wraps modulo {turn:.10g} at {plural(int(wraps.sum()), 'step')} (first at "
        f"row {rows[index[1:]][np.argmax(wraps)]}) and is made continuous, which changes it by up "
        f"to {np.max(changed[index]):.6g}."
    )
    reference = signals.get("reference")
    if reference is not None and np.ptp(reference) <= turn:
        reference = np.unwrap(reference, period=turn)
        offset = np.median(signals["position"] - reference)
        signals["reference"] = reference + turn * np.round(offset / turn)


def check_period(position: np.ndarray, period: float, source: str) -> None:
    """Raises `ValueError` if a position cannot be counted modulo a period, being wider."""
    position = position[np.isfinite(position)]
    steps = np.abs(np.diff(position))
    quantum = np.min(steps[steps > 0], initial=np.inf)
    if (span := np.ptp(position)) > period + (quantum if np.isfinite(quantum) else 0.0):
        raise ValueError(
            f"{source}: the position goes over {span:.6g}, more than the stated period of "
            f"{period:.6g}, so it is not counted modulo that. Give the period as the column "
            "counts it, before any scale: --period position=NUMBER."
        )


def _steps(time, position, mask, segment) -> _Steps:
    valid = some(position, mask)
    step = np.diff(valid)
    # The axis may have been moved while nothing was recorded, or nothing valid.
    linked = adjacent(time, mask, segment)
    if not mask.all():
        index = np.flatnonzero(mask)
        linked = (np.diff(index) == 1) & linked[index[:-1]]
    step[~linked] = 0.0
    return _Steps(valid, step, linked, np.abs(step) > 0.5 * np.ptp(valid))


def _tell(steps: _Steps, rows: np.ndarray, notes: list[str]) -> None:
    """A warning of jumps, unless the motion is coarsely sampled: then many steps are long."""
    span = np.ptp(steps.valid)
    if steps.seam.any() and np.quantile(np.abs(steps.step), 0.9) < 0.25 * span:
        notes.append(
            f"Warning: {UNEXPLAINED_JUMP} at {plural(int(steps.seam.sum()), 'step')} (first at "
            f"row {rows[np.argmax(steps.seam)]}); kept as it is. If it is counted modulo a turn, "
            "say so: --period position=360, for instance."
        )


def _turn(steps: _Steps) -> float | None:
    """The modulus at which a position wraps, or `None`.

    A wrap is told from a glitch by five properties, all free of units: jumps stand out from
    ordinary steps; jump less motion is the same modulus every time; that modulus equals the
    range of the position within the motion of one step, since the position is seen on both
    sides of the seam; the motion goes through the seam; and the modulus repeats, or it is one
    of the usual turns.
    """
    valid, step, jump = steps.valid, steps.step, steps.seam
    if not jump.any() or _coarse(step, jump):
        return None
    ordinary = np.max(np.abs(step[~jump]), initial=0.0)
    quantum, span = np.min(np.abs(step[step != 0.0])), np.ptp(valid)
    turns = _seams(step, jump)
    turn, slack = float(np.median(turns)), 2.0 * ordinary
    if ordinary == 0.0 or turn < COARSEST_ENCODER * quantum:
        return None
    if np.ptp(turns) > slack or abs(turn - span) > slack:
        return None
    passed, judged = _passed(steps, quantum)
    if passed == 0 or passed < 0.5 * judged:
        return None
    # Three standard errors: the scatter seen at the seams, or, where these are few, the scatter
    # of the motion between two steps (1.5 times the median deviation of a normal variable).
    scatter = np.median(np.abs(np.diff(step)[~(jump[1:] | jump[:-1])])) * 1.5
    error = quantum + 3.0 * max(float(np.std(turns)), scatter) / np.sqrt(len(turns))
    return _usual_turn(turn, error, span, passed)


def _coarse(step: np.ndarray, jump: np.ndarray) -> bool:
    """Whether ordinary steps come close to the jumps: then these are motion, coarsely sampled."""
    return np.max(np.abs(step[~jump]), initial=0.0) > 0.5 * np.min(np.abs(step[jump]))


def _seams(step: np.ndarray, jump: np.ndarray) -> np.ndarray:
    """The modulus seen at each jump: the jump less the mean of the steps before and after."""
    ordinary = np.where(jump, 0.0, step)
    padded, count = np.pad(ordinary, 1), np.pad((~jump).astype(float), 1)
    motion = (padded[:-2] + padded[2:]) / np.maximum(count[:-2] + count[2:], 1.0)
    return np.abs(step - motion)[jump]


def _passed(steps: _Steps, quantum: float) -> tuple[int, int]:
    """Through how many seams the motion goes, and at how many that can be said.

    A motion goes through a seam if its speed before and after is the same, towards the seam and
    away from it, and does not sink there: an axis that stops at one end of its stroke and is seen
    next at the other end has not passed anything.
    """
    at = np.flatnonzero(steps.seam)
    grain = GRAINS * max(quantum, _noise(steps))
    typical = np.sqrt(np.mean(steps.step[~steps.seam] ** 2))
    chosen = np.full((4, len(at)), np.nan)  # speeds before and after, near and twice as far
    for width in _widths():
        before, after = _speeds(steps, at, width)
        far = _speeds(steps, at, 2 * width)
        enough = np.minimum(np.abs(before), np.abs(after)) * width >= grain
        new = enough & np.isnan(chosen[0])
        chosen[:, new] = np.stack([before, after, far[0], far[1]])[:, new]
    onward = -np.sign(steps.step[at])
    near_before, near_after, far_before, far_after = chosen * onward
    slower, faster = np.minimum(near_before, near_after), np.maximum(near_before, near_after)
    # From rest the mean speed over twice the time is double; in passing it is the same.
    sinks = slower + faster < 0.7 * (far_before + far_after)
    # Slower than a quarter of the usual speed it may as well be standing there.
    passed = (slower > 0.5 * faster) & (slower > 0.25 * typical) & ~sinks
    room = ~np.isnan(_speeds(steps, at, 1)).any(axis=0)
    return int(passed.sum()), int(room.sum())


def _widths() -> list[int]:
    return [1 << k for k in range(WIDEST.bit_length())]


def _noise(steps: _Steps) -> float:
    """Standard deviation of the position's noise: third differences leave nothing of a motion."""
    whole = (steps.linked & ~steps.seam)[2:]
    third = np.abs(np.diff(steps.step, 2))[whole]
    return 1.4826 * float(np.median(third)) / np.sqrt(20) if len(third) else 0.0


def _speeds(steps: _Steps, at: np.ndarray, width: int) -> np.ndarray:
    """Mean steps over `width` samples before and after each seam; NaN where these are not whole."""
    bad = np.concatenate([[0], np.cumsum(~steps.linked | steps.seam)])
    result = np.full((2, len(at)), np.nan)
    for side, (start, stop) in enumerate(((at - width, at), (at + 1, at + 1 + width))):
        inside = (start >= 0) & (stop < len(bad))
        a, b = start[inside], stop[inside]
        moved = (steps.valid[b] - steps.valid[a]) / width
        result[side, inside] = np.where(bad[a] == bad[b], moved, np.nan)
    return result


def _usual_turn(turn: float, error: float, span: float, seams: int) -> float | None:
    """The usual turn, else the round number, within the error; one seam proves only the former.

    A modulus is at least the range, and an error in it would grow with every turn.
    """
    usual = [known for known in _TURNS if abs(known - turn) <= error and known >= span]
    rounded = _round(turn, error)
    if usual:  # 2000 or 2048 counts? A guess would err by more with every turn.
        rival = rounded >= span and rounded == float(f"{rounded:.0e}") != usual[0]
        return None if rival else usual[0]
    if seams < 2:
        return None
    return rounded if rounded >= span else max(turn, span)


def _round(value: float, tolerance: float) -> float:
    """The number with the fewest digits within the tolerance: resolutions are round numbers."""
    for digits in range(1, 16):
        rounded = float(f"{value:.{digits - 1}e}")
        if abs(rounded - value) <= tolerance:
            return rounded
    return value


def _continuous(position: np.ndarray, index: np.ndarray, turn: float) -> np.ndarray:
    """Unwrapped over the valid samples; a masked sample follows its valid neighbours."""
    valid = np.unwrap(position[index], period=turn)
    result = np.interp(np.arange(len(position)), index, valid)
    result[index] = valid
    return result
