"""What loggers do to a record, undone or masked on the host, each with a sentence that says so."""

from typing import NamedTuple

import numpy as np

# A step of the clock this many times the usual one, either way, is an interruption: jitter and a
# lost sample or two stay below it, and across it no derivative of the position means anything.
GAP = 5.0
# Below this no fit of even the smallest model (three parameters a direction) has samples to spare.
MIN_SAMPLES = 16
# Three samples are the fewest that have a central difference, that is, a velocity.
MIN_SEGMENT = 3
# Stamps are averaged over so many samples each way for the clock that they scatter about: it
# follows any drift, and what is left of the scatter is an eighth.
NEAR_STAMPS = 32
# A turn counted in fewer quanta than this is a switch, not an encoder: its jumps are no seam.
COARSEST_ENCODER = 16
# Turns that encoders and controllers count modulo: rad, deg and the binary resolutions.
_TURNS = (2 * np.pi, 360.0, *(2.0**k for k in range(8, 33)))


class Clean(NamedTuple):
    """Signals without faults: all arrays of shape `(N,)`; `notes` says what was done."""

    signals: dict[str, np.ndarray]
    mask: np.ndarray
    segment: np.ndarray
    notes: list[str]


def clean(
    signals: dict[str, np.ndarray], segment: np.ndarray | None, rows: np.ndarray, source: str
) -> Clean:
    """Put a log in order: clock, interruptions, invalid samples, wrapped position.

    **Arguments:** `signals`, role to float64 array of shape `(N,)`, with `time` in s; `segment`,
    labels of any kind whose changes start a new segment, or `None`; `rows`, the rows of the
    samples as a person counts, for the notes; `source`, for messages.

    **Raises:** `ValueError` if the clock does not run or too few valid samples are left.
    """
    notes: list[str] = []
    segment = _runs(segment) if segment is not None else np.zeros(len(rows), np.int64)
    keep = np.isfinite(signals["time"])
    _note(notes, ~keep, rows, "without a time stamp left out")
    time, segment, rows = signals["time"][keep], segment[keep], rows[keep]
    if len(time) < MIN_SAMPLES:
        raise ValueError(
            f"{source}: {len(time)} samples have a time stamp; at least {MIN_SAMPLES} are needed."
        )
    inside, segment = _clock(time, segment, rows, notes, source)
    keep[keep] = inside
    signals = {role: signal[keep] for role, signal in signals.items()}
    segment, rows = _runs(segment[inside]), rows[inside]
    mask = _mask(signals, segment, rows, notes, source)
    _unwrap(signals, mask, segment, rows, notes)
    _steady(signals, mask, segment, notes)
    return Clean(signals, mask, segment, notes)


def _runs(labels: np.ndarray) -> np.ndarray:
    """0, 1, … for each run of equal labels, in the order of the record."""
    # An empty cell next to an empty cell is no change: NaN differs from itself.
    same = labels[1:] == labels[:-1]
    if labels.dtype.kind == "f":
        same |= np.isnan(labels[1:]) & np.isnan(labels[:-1])
    return np.concatenate([[0], np.cumsum(~same.astype(bool))]) if len(labels) else labels


def _plural(count: int, noun: str = "sample") -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _note(notes: list[str], chosen: np.ndarray, rows: np.ndarray, what: str) -> None:
    count = int(np.count_nonzero(chosen))
    if count:
        notes.append(f"{_plural(count)} {what} (first at row {rows[np.argmax(chosen)]}).")


def _usual_step(time: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Median forward step of each sample's segment: segments may have rates of their own."""
    step = np.diff(time)
    forward = (np.diff(segment) == 0) & (step > 0)
    overall = np.median(step[forward]) if forward.any() else np.nan
    usual = np.full(int(segment[-1]) + 1, overall)
    label, step = segment[1:][forward], step[forward]
    borders = np.flatnonzero(np.diff(label)) + 1
    for part, name in zip(np.split(step, borders), label[np.r_[0, borders]], strict=True):
        usual[name] = np.median(part)
    return usual[segment]


def _clock(time, segment, rows, notes, source):
    """Which samples to keep, and the segments after interruptions: `(keep, segment)`."""
    step = np.diff(time)[np.diff(segment) == 0]
    if not np.count_nonzero(step > 0) > 0.5 * len(step):
        fault = "does not change" if not step.any() else "does not increase"
        raise ValueError(
            f"{source}: time {fault} at {np.count_nonzero(step <= 0)} of {len(step)} steps, so "
            "most samples have no time of their own. Give another column: --columns time=NAME, "
            "or log the time with more digits."
        )
    usual = _usual_step(time, segment)
    keep = ~_stray(time, segment, usual)
    _note(notes, ~keep, rows, "with a stray time stamp left out")
    index = np.flatnonzero(keep)
    back = np.diff(time[index]) < -GAP * usual[index][1:]
    restart = np.zeros(len(time), bool)
    restart[index[1:]] = back & (np.diff(segment[index]) == 0)
    _note(notes, restart, rows, "where the clock restarts begin a new segment")
    segment = _runs(segment + np.cumsum(restart))
    late = _not_late(time, segment, keep)
    _note(notes, keep & ~late, rows, "with a repeated or backward time stamp left out")
    keep &= late
    index = np.flatnonzero(keep)
    usual = _usual_step(time[index], _runs(segment[index]))
    gap = np.zeros(len(time), bool)
    gap[index[1:]] = (np.diff(time[index]) > GAP * usual[1:]) & (np.diff(segment[index]) == 0)
    _note(notes, gap, rows, f"after a gap of over {GAP:g} usual steps begin a new segment")
    segment = _runs(segment + np.cumsum(gap))
    short = np.bincount(segment[keep], minlength=segment[-1] + 1)[segment] < MIN_SEGMENT
    _note(notes, keep & short, rows, f"in segments of under {MIN_SEGMENT} samples left out")
    return keep & ~short, segment


def _stray(time: np.ndarray, segment: np.ndarray, usual: np.ndarray) -> np.ndarray:
    """Lone stamps far outside their neighbours, which themselves follow each other."""
    before, here, after = time[:-2], time[1:-1], time[2:]
    limit = GAP * usual[1:-1]
    outside = np.maximum(before - here, here - after) > limit
    follow = (after > before) & (after - before <= limit) & (segment[2:] == segment[:-2])
    return np.concatenate([[False], outside & follow, [False]])


def _not_late(time: np.ndarray, segment: np.ndarray, keep: np.ndarray) -> np.ndarray:
    """Samples later than all before them in their segment."""
    result = np.ones(len(time), bool)
    for part in np.split(np.flatnonzero(keep), _borders(segment[keep])):
        latest = np.maximum.accumulate(time[part])
        result[part[1:]] = time[part[1:]] > latest[:-1]
    return result


def _borders(segment: np.ndarray) -> np.ndarray:
    return np.flatnonzero(np.diff(segment)) + 1


def _mask(signals, segment, rows, notes, source) -> np.ndarray:
    """Mask samples without a number and fill them, so that arithmetic on them stays finite."""
    mask = np.ones(len(rows), bool)
    for role, signal in signals.items():
        bad = ~np.isfinite(signal)
        if not bad.any():
            continue
        if bad.all():
            raise ValueError(
                f"{source}: the {role} column holds no number at all. Name another column, or "
                f"leave it out: --columns {role}=NAME or {role}= (nothing)."
            )
        signals[role] = _filled(signal, bad, segment)
        if role in ("force", "position", "velocity"):
            mask &= ~bad
            _note(notes, bad, rows, f"without a finite {role} masked")
        else:  # a slow sensor that is logged at every tenth sample says nothing about the motion
            _note(notes, bad, rows, f"without a finite {role} interpolated")
    if np.count_nonzero(mask) < MIN_SAMPLES:
        raise ValueError(
            f"{source}: {np.count_nonzero(mask)} valid samples are left after the clean-up; at "
            f"least {MIN_SAMPLES} are needed. {' '.join(notes)}".rstrip()
        )
    return mask


def _filled(signal: np.ndarray, bad: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Interpolated between valid neighbours of the same segment, or of any where it has none."""
    index = np.arange(len(signal))
    result = np.where(bad, np.interp(index, index[~bad], signal[~bad]), signal)
    for part in np.split(index, _borders(segment)):
        good = part[~bad[part]]
        if 0 < len(good) < len(part):
            result[part] = np.interp(part, good, signal[good])
    return result


def _unwrap(signals, mask, segment, rows, notes) -> None:
    """Make a position that is counted modulo a turn continuous, and the reference with it."""
    position = signals.get("position")
    if position is None:
        return
    index = np.flatnonzero(mask)
    valid = position[index]
    step = np.diff(valid)
    step[np.diff(segment[index]) != 0] = 0.0  # the axis may have been moved in the meantime
    jump = np.abs(step) > 0.5 * np.ptp(valid)
    turn = _turn(valid, step, jump)
    if turn is None:
        # Where many steps are a good part of the range, the motion is coarsely sampled, not faulty.
        if jump.any() and np.quantile(np.abs(step), 0.9) < 0.25 * np.ptp(valid):
            row = rows[index[1:]][np.argmax(jump)]
            notes.append(
                f"Warning: the position jumps by more than half its range at "
                f"{_plural(int(jump.sum()), 'step')} (first at row {row}); kept as it is."
            )
        return
    signals["position"] = _continuous(position, index, turn)
    notes.append(
        f"The position wraps modulo {turn:.10g} at {_plural(int(jump.sum()), 'step')} (first at "
        f"row {rows[index[1:]][np.argmax(jump)]}) and is made continuous."
    )
    reference = signals.get("reference")
    if reference is not None and np.ptp(reference) <= turn:
        reference = np.unwrap(reference, period=turn)
        offset = np.median(signals["position"] - reference)
        signals["reference"] = reference + turn * np.round(offset / turn)


def _steady(signals, mask, segment, notes) -> None:
    """Put samples on the clock that their stamps scatter about, if the motion is smoother on it.

    A sample that was taken late is at v·δ beyond where it would have been, one that was only
    stamped late is not: the share of v·δ that the position holds is one or zero.
    """
    name = next((role for role in ("position", "velocity") if role in signals), None)
    if name is None:  # a reference or a force to simulate by
        return
    time = signals["time"]
    late = np.zeros(len(time))
    for part in np.split(np.arange(len(time)), _borders(segment)):
        late[part] = _scatter(time[part])
    signal, usual = signals[name], _usual_step(time, segment)
    linked = np.abs(np.diff(time) / usual[1:] - 1) < 0.5
    linked &= mask[1:] & mask[:-1] & (np.diff(segment) == 0)
    # Third differences leave nothing of the motion itself.
    whole = linked[:-2] & linked[1:-1] & linked[2:]
    beyond = np.gradient(signal) * late / usual
    ours, theirs = (np.diff(x, 3)[whole] for x in (signal, beyond))
    power = theirs @ theirs
    if not power > 0 or np.count_nonzero(whole) < 2 * NEAR_STAMPS:
        return
    share = float(theirs @ ours / power)
    # Neighbouring differences share samples: twice the error of independent ones.
    error = 2 * float(np.sqrt(np.mean((ours - share * theirs) ** 2) / power))
    if abs(share) + 3 * error < 0.5:
        signals["time"] = time - late
        notes.append(
            f"The time stamps scatter by {np.std(late / usual):.1%} of a step about a steady "
            f"clock, on which the {name} is smoother; that clock is used."
        )


def _scatter(time: np.ndarray) -> np.ndarray:
    """By how much each stamp of one segment is late, s, beside a clock that only drifts."""
    ticks = np.concatenate([[0], np.cumsum(np.rint(np.diff(time) / np.median(np.diff(time))))])
    if ticks[-1] < len(time) - 1:  # no clock: several stamps within a step
        return np.zeros(len(time))
    slope, start = np.polyfit(ticks, time, 1)
    late = time - (start + slope * ticks)
    window = np.ones(min(2 * NEAR_STAMPS + 1, len(time)))
    mean = np.convolve(late, window, "same") / np.convolve(np.ones(len(late)), window, "same")
    late = late - mean
    return late if np.max(np.abs(late)) < 0.5 * slope else np.zeros(len(time))


def _coarse(step: np.ndarray, jump: np.ndarray) -> bool:
    """Whether ordinary steps come close to the jumps: then these are motion, coarsely sampled."""
    return np.max(np.abs(step[~jump]), initial=0.0) > 0.5 * np.min(np.abs(step[jump]))


def _turn(valid: np.ndarray, step: np.ndarray, jump: np.ndarray) -> float | None:
    """The modulus at which a position wraps, or `None`.

    A wrap is told from a glitch by four properties, all free of units: jumps stand out from
    ordinary steps; jump less motion is the same modulus every time; that modulus equals the
    range of the position within the motion of one step, since the position is seen on both
    sides of the seam; and it repeats, or it is one of the usual turns.
    """
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
    # Three standard errors: the scatter seen at the seams, or, where these are few, the scatter
    # of the motion between two steps (1.5 times the median deviation of a normal variable).
    scatter = np.median(np.abs(np.diff(step)[~(jump[1:] | jump[:-1])])) * 1.5
    error = quantum + 3.0 * max(float(np.std(turns)), scatter) / np.sqrt(len(turns))
    return _usual_turn(turn, error, span, len(turns))


def _seams(step: np.ndarray, jump: np.ndarray) -> np.ndarray:
    """The modulus seen at each jump: the jump less the mean of the steps before and after."""
    ordinary = np.where(jump, 0.0, step)
    padded, count = np.pad(ordinary, 1), np.pad((~jump).astype(float), 1)
    motion = (padded[:-2] + padded[2:]) / np.maximum(count[:-2] + count[2:], 1.0)
    return np.abs(step - motion)[jump]


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
