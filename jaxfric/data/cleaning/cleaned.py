"""A log put in order, or only made fit to compute with."""

from typing import NamedTuple

import numpy as np

from . import clock
from .filtered import filtered_seams
from .held import between_updates, held_for
from .lone import lone_samples
from .missing import missing_rows
from .pieces import borders, note, runs, some
from .wraps import check_period, unwrap

# Below this no fit of even the smallest model (three parameters a direction) has samples to spare.
MIN_SAMPLES = 16


class Clean(NamedTuple):
    """Signals without faults: all arrays of shape `(N,)`; `notes` says what was done.

    `position_every`: how many samples the position came apart, before it was interpolated.
    """

    signals: dict[str, np.ndarray]
    mask: np.ndarray
    segment: np.ndarray
    notes: list[str]
    position_every: int = 1


def clean(
    signals: dict[str, np.ndarray],
    segment: np.ndarray | None,
    rows: np.ndarray,
    source: str,
    period: float | None = None,
    repair: bool = True,
) -> Clean:
    """Put a log in order: clock, interruptions, invalid and lone samples, wrapped position.

    **Arguments:** `signals`, role to float64 array of shape `(N,)`, with `time` in s; `segment`,
    labels of any kind whose changes start a new segment, or `None`; `rows`, the rows of the
    samples as a person counts, for the notes; `source`, for messages; `period`, the modulus of
    the position, where stated; without `repair` only samples that cannot be computed with are
    masked, and a stated period is heeded.

    **Raises:** `ValueError` if the clock does not run or too few valid samples are left.
    """
    notes: list[str] = []
    every = 1
    segment = runs(segment) if segment is not None else np.zeros(len(rows), np.int32)
    stamped = np.isfinite(signals["time"])
    if np.count_nonzero(stamped) < MIN_SAMPLES:
        raise ValueError(
            f"{source}: {np.count_nonzero(stamped)} samples have a time stamp; at least "
            f"{MIN_SAMPLES} are needed."
        )
    if repair:
        signals, segment, rows = _in_order(signals, segment, rows, stamped, notes, source)
        mask = _mask(signals, segment, rows, notes, source)
    else:
        signals = _with_all_stamps(signals, segment, rows, stamped, notes, source)
        mask = _mask(signals, segment, rows, notes, source) & stamped
    if period is not None and "position" in signals:
        check_period(signals["position"][mask], period, source)
    if repair:
        mask = _without_lone(signals, mask, segment, rows, notes)
        told = len(notes)
        if period is None:
            segment = filtered_seams(signals, mask, segment, rows, notes)
        unwrap(signals, mask, segment, rows, notes, period, quiet=len(notes) > told)
        segment = missing_rows(signals, mask, segment, rows, notes)
        every = _fresh(signals, segment, notes)
    elif period is not None:
        unwrap(signals, mask, segment, rows, notes, period)
    return Clean(signals, mask, segment, notes, every)


def _in_order(signals, segment, rows, stamped, notes, source):
    """Signals, segments and rows of the samples whose time is known."""
    note(notes, ~stamped, rows, "without a time stamp left out")
    signals = {role: some(signal, stamped) for role, signal in signals.items()}
    segment, rows = runs(some(segment, stamped)), some(rows, stamped)
    inside, segment = clock.order(signals, segment, rows, notes, source)
    signals = {role: some(signal, inside) for role, signal in signals.items()}
    return signals, runs(some(segment, inside)), some(rows, inside)


def _with_all_stamps(signals, segment, rows, stamped, notes, source):
    """The signals as they are; a sample without a stamp is given one between its neighbours'."""
    note(notes, ~stamped, rows, "without a time stamp masked")
    clock.check_increases(signals["time"][stamped], segment[stamped], rows[stamped], source)
    return signals | {"time": _filled(signals["time"], ~stamped, segment)}


def _fresh(signals, segment, notes) -> int:
    """A position that comes at a lower rate than the rest, interpolated by cubics; that rate."""
    every = held_for(signals["position"]) if "position" in signals else 1
    if every > 1:
        fresh = between_updates(signals["time"], signals["position"], segment, every)
        signals["position"] = fresh
        notes.append(f"The position is new at every {every} samples only: interpolated by cubics.")
    return every


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
            note(notes, bad, rows, f"without a finite {role} masked")
        else:  # a slow sensor that is logged at every tenth sample says nothing about the motion
            note(notes, bad, rows, f"without a finite {role} interpolated")
    if np.count_nonzero(mask) < MIN_SAMPLES:
        raise ValueError(
            f"{source}: {np.count_nonzero(mask)} valid samples are left after the clean-up; at "
            f"least {MIN_SAMPLES} are needed. {' '.join(notes)}".rstrip()
        )
    return mask


def _without_lone(signals, mask, segment, rows, notes) -> np.ndarray:
    """The mask without samples that no motion or actuator made, which are filled."""
    for role, lone in lone_samples(signals, mask, segment).items():
        furthest = signals[role][lone][np.argmax(np.abs(signals[role][lone]))]
        signals[role] = _filled(signals[role], lone, segment)
        mask = mask & ~lone
        what = f"with a {role} far from all others, as {furthest:.4g}, masked: of the sensor or bus"
        note(notes, lone, rows, what)
    return mask


def _filled(signal: np.ndarray, bad: np.ndarray, segment: np.ndarray) -> np.ndarray:
    """Interpolated between valid neighbours of the same segment, or of any where it has none."""
    index = np.arange(len(signal))
    result = np.where(bad, np.interp(index, index[~bad], signal[~bad]), signal)
    for part in np.split(index, borders(segment)):
        good = part[~bad[part]]
        if 0 < len(good) < len(part):
            result[part] = np.interp(part, good, signal[good])
    return result
