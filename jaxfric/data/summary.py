"""A recording in numbers, text and pictures, on the host."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from ..looks import drawing
from ..looks.text import Block, Table
from ..units import POSITION, VELOCITY, spell
from .cleaning.pieces import some


def facts(recording: Any, notes: Sequence[str] = ()) -> dict[str, Any]:
    """File, samples, duration (s), mean sample rate (Hz) of a `Recording`, and what was tidied.

    A sample that is left out has its place in the clock.
    """
    mask = np.asarray(recording.mask)
    time, segment = (some(np.asarray(x), mask) for x in (recording.time, recording.segment))
    changes = np.flatnonzero(segment[1:] != segment[:-1])
    first, last = np.append(0, changes + 1), np.append(changes, time.size - 1)
    first, last = first[: time.size], last[: time.size]
    count, duration = time.size - first.size, float(np.sum(time[last] - time[first]))
    rate = count / duration if count else None
    if rate and not mask.all():
        steps, same = np.diff(recording.time), np.diff(recording.segment) == 0
        steps = np.asarray(steps, float)[same & (steps > 0)]  # none where it is padded
        rate = steps.size / float(np.sum(steps))
    return {
        "file": recording.source,
        "sha256": recording.sha256 or None,
        "samples": int(mask.size),
        "used": int(np.count_nonzero(mask)),
        "segments": int(np.unique(segment[first]).size),
        "duration": duration,
        "sample_rate": rate,
        "notes": list(notes),
    }


def line(facts: Mapping[str, Any]) -> str:
    """Source, samples, duration, rate and segments of a recording, from its [`facts`][]."""
    rate = ""
    if facts["sample_rate"]:
        rate = f", {facts['duration']:.4g} s at {facts['sample_rate']:.6g} Hz"
    pieces = f", {facts['segments']} segments" * (facts["segments"] > 1)
    left = facts["samples"] - facts["used"]
    used = f"{facts['samples']} samples" + f" ({left} left out)" * (left > 0)
    return f"{facts['file'] or 'recording'}: {used}{rate}{pieces}"


def blocks(recording: Any) -> Iterator[Block]:
    """What to say of a `Recording` or a batch of them, of arrays of numpy."""
    if recording.time.ndim == 1:
        yield [line(facts(recording))]
    else:
        yield _batch(recording)
    yield Table([["signal", "least", "greatest", "rms", "unit"], *_ranges(recording)], (1, 2, 3))
    absent = [name for name in ("position", "velocity") if getattr(recording, name) is None]
    if "velocity" in absent:
        yield ["velocity is not recorded: it is derived from the position"]
    elif absent:
        yield ["position is not recorded"]


def _batch(recording: Any) -> list[str]:
    """Rows, and what of their samples is valid."""
    length = recording.time.shape[-1]
    used = np.count_nonzero(recording.mask.reshape(-1, length), axis=1)
    of = f"{used.min()} to {used.max()}" if np.ptp(used) else f"{used.max()}"
    spread = f"{used.size} recordings of {length} samples each, {of} of them valid"
    return [f"{recording.source}: {spread}" if recording.source else spread]


def _ranges(recording: Any) -> Iterator[list[str]]:
    """Each signal's range over the valid samples."""
    yield _range("time", "s", recording.time, recording.mask)[:3] + ["", "s"]
    for name, unit, values in channels(recording):
        yield _range(name, unit, values, recording.mask)


def channels(recording: Any) -> Iterator[tuple[str, str, np.ndarray]]:
    """Name, unit and values of each signal but the time.

    Of set-points the unit is known, of other further signals none.
    """
    units = recording.unit_names
    place, speed = spell(POSITION, units), spell(VELOCITY, units)
    for name, unit in (("position", place), ("velocity", speed), ("force", units["force"])):
        if getattr(recording, name) is not None:
            yield name, unit, getattr(recording, name)
    known = {"reference": place, "reference_velocity": speed}
    for name, values in recording.channels.items():
        yield name, known.get(name, ""), values


def _range(name: str, unit: str, values: np.ndarray, mask: np.ndarray) -> list[str]:
    valid = np.asarray(values[mask], float)
    fine = valid[np.isfinite(valid)]
    bad = valid.size - fine.size
    note = f"{unit}  ({bad} not finite)" if bad else unit
    if not fine.size:
        return [name, "-", "-", "-", note]
    with np.errstate(over="ignore"):  # of the largest numbers the square is none
        rms = np.sqrt(np.mean(fine**2))
    return [name, *(f"{value:.4g}" for value in (fine.min(), fine.max(), rms)), note]


def draw(recording: Any, names: Sequence[str], panels: Sequence[Any]) -> None:
    """Signals of a `Recording` over time, each on axes of its own.

    The samples left out are gaps; segments whose clock starts again follow one another.
    """
    signals = {name: (unit, values) for name, unit, values in channels(recording)}
    unknown = [name for name in names if name not in signals]
    if unknown:
        raise ValueError(f"No signal {', '.join(unknown)}; there are {', '.join(signals)}.")
    time, clock = _clock(recording)
    shown = []
    for name in names:
        unit, values = signals[name]
        wanted = signals.get({"position": "reference", "velocity": "reference_velocity"}.get(name))
        goal = None if wanted is None else _gapped(wanted[1], recording)
        shown.append(drawing.Signal(name, unit, _gapped(values, recording), goal))
    drawing.signals(panels, time, shown, clock)
    left = int(np.count_nonzero(~np.asarray(recording.mask)))
    note = f" ({left} samples left out)" * (left > 0)
    panels[0].set_title(
        drawing.plain(f"{recording.source or 'recording'}{note}"), fontsize=10, loc="left"
    )


def _clock(recording: Any) -> tuple[np.ndarray, str]:
    """The time of the samples, rising all along, and what it is called."""
    time, segment = np.asarray(recording.time, float), np.asarray(recording.segment)
    steps, same = np.diff(time), np.diff(segment) == 0
    if np.all(steps[~same] >= 0) or not np.any(same):
        return time, "time [s]"
    steps = np.where(same, steps, np.median(steps[same]))
    return np.concatenate([[0.0], np.cumsum(steps)]), "time, one segment after the other [s]"


def _gapped(values: np.ndarray, recording: Any) -> np.ndarray:
    """Values with NaN where samples are left out and where a segment begins."""
    begins = np.diff(np.asarray(recording.segment), prepend=recording.segment[:1]) != 0
    return np.where(np.asarray(recording.mask) & ~begins, np.asarray(values, float), np.nan)


def main_signals(recording: Any) -> list[str]:
    """The names of position, velocity and force, where recorded."""
    names = ("position", "velocity", "force")
    return [name for name in names if getattr(recording, name) is not None]
