"""Files to recordings: `read`; and what writes results to files."""

import math
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

from . import columns as names, stamps
from .along import motion_of
from .cleaning import Clean, clean
from .clocked import CLOCK, clocked
from .delimited import Table, numbers
from .per_second import per_second
from .printable import encodable
from .provenance import sha256
from .recording import Recording
from .roles import stated_unit
from .spellings import unit_of
from .tables import IN_MEMORY, in_memory, load
from .turns import angles, counted
from .writing import (
    write_bytes as write_bytes,
    write_table as write_table,
    write_text as write_text,
)

# What says how a file is read, as a command and a fleet hand it on.
READING = ("columns", "scale", "units", "period", "repair", "rate", "counts_per_rev")
_SIGNALS = ("time", "force", "position", "velocity")


def read(
    path: str | os.PathLike | Mapping[str, Any],
    *,
    columns: Mapping[str, str | None] | None = None,
    scale: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
    format: str | None = None,
    period: Mapping[str, float] | None = None,
    repair: bool = True,
    rate: float | None = None,
    counts_per_rev: float | None = None,
) -> Recording:
    """Read one log: CSV, Parquet, MATLAB `.mat`, NumPy `.npz`, a robot's bag (rosbag2, MCAP), or
    columns in memory: a mapping from names to arrays, or a frame of pandas or polars.

    What was put in order on the way (interruptions, invalid samples, a wrapped position) is told
    by `jaxfric.data.io.read_with_notes`, with what each repair changed and by how much.

    **Arguments:**

    - `path` of the file or folder, or the columns themselves, each `(N,)`, in the units that their
      names state.
    - `columns`: role to column name, where names do not speak for themselves; roles beyond the
      usual ones (`time`, `position`, `velocity`, `force`, `reference`, `load`, `temperature`,
      `segment`) become channels; an empty name leaves a role out.
    - `scale`: role to factor, for instance `{"position": 0.001}` for millimetres to metres.
    - `units`: names of the force and the position unit after scaling, `{"force": "N·m"}`.
    - `format`: `csv`, `parquet`, `mat` or `npz`, where the suffix does not say.
    - `period`: what the position is counted modulo, as the column counts it, before any scale:
      `{"position": 360}`. It is then made continuous. Without it that is done only where it is
      certain.
    - `repair`: with `False` all samples stay as they are, but for those that cannot be computed
      with: what is not finite is masked, and stamps that do not increase are an error.
    - `rate`: samples per second of a file that has no time column, 1/s.
    - `counts_per_rev`: encoder counts of a revolution; a position in counts becomes radians, or
      the `deg` or `rev` that `units` names, and a velocity in counts/s likewise.

    A [`Recording`][] of your own arrays is taken as it is; a mapping of them is put in order here.

    **Returns:** a `Recording` with signals of shape `(N,)`, in jax's default float type.

    **Raises:** `ValueError` naming file, place, fault and remedy, or for what is no table.
    """
    return read_with_notes(
        path,
        columns=columns,
        scale=scale,
        units=units,
        format=format,
        period=period,
        repair=repair,
        rate=rate,
        counts_per_rev=counts_per_rev,
    )[0]


def read_with_notes(
    path: str | os.PathLike | Mapping[str, Any],
    *,
    columns: Mapping[str, str | None] | None = None,
    scale: Mapping[str, float] | None = None,
    units: Mapping[str, str] | None = None,
    format: str | None = None,
    period: Mapping[str, float] | None = None,
    repair: bool = True,
    rate: float | None = None,
    counts_per_rev: float | None = None,
    set_point: bool = False,
    served: bool = False,
    along: Recording | None = None,
) -> tuple[Recording, list[str]]:
    """[`read`][] together with one plain sentence for each thing that was put in order.

    With `served` the first sentence says which column serves as what, and which are not used.

    With `set_point` the file may hold what an axis should do instead of what it did: time and a
    reference, a position or a force are enough, and a force that is absent is zero.

    With `along` time and force are enough where they are of the samples of that recording: the
    motion is its own then.

    Row numbers in the notes count lines in a CSV file and samples, from 1, in the other formats.
    """
    if isinstance(path, str | os.PathLike):
        path, source = Path(path), encodable(os.fspath(path))
        table = load(path, format)
    else:
        table, path, source = in_memory(path), Path(IN_MEMORY), IN_MEMORY
    scale, units, period = dict(scale or {}), dict(units or {}), dict(period or {})
    own, given = list(table.columns), dict(units)
    if rate is not None:
        table = clocked(table, rate, columns, source)
        columns = dict(columns or {}) | {"time": CLOCK}
    if counts_per_rev is not None:
        columns = counted(table.columns, columns)
    chosen = names.assign(table.columns, columns, source, set_point, along is None)
    if still := along is not None and not names.MOTION & set(chosen):
        scale = {role: factor for role, factor in scale.items() if role not in names.MOTION}
        units, period, counts_per_rev = along.unit_names | units, {}, None
    _check_arguments(chosen, scale, units, period, source)
    units = {role: unit_of(unit, role) or unit for role, unit in units.items()}  # `uNm` is µN·m
    if counts_per_rev is not None:
        scale, units = angles(chosen, scale, units, counts_per_rev, source)
    implied, units = per_second(chosen, scale, units, source)
    named = names.units(chosen, scale, units)
    time, told, in_seconds = _time(table, chosen, scale, path)
    scale = {r: f for r, f in implied.items() if r != "time" or not in_seconds} | scale
    notes = [names.served(chosen, scale, named, own)] if served else []
    notes += table.notes + names.unknown_units(chosen, scale, given) + told
    notes += names.commanded(chosen, columns)
    signals = {
        role: numbers(table.columns[name], name, path, table.first_row)
        for role, name in chosen.items()
        if role not in ("segment", "time")
    }
    signals = {"time": time} | signals
    segment = table.columns[chosen["segment"]] if "segment" in chosen else None
    _check_lengths(signals, segment, chosen, source)
    rows = np.arange(table.first_row, len(signals["time"]) + table.first_row, dtype=np.int32)
    del table  # of a long log each column counts
    tidy = clean(signals, segment, rows, source, period.get("position"), repair)
    scaled = {r: s * scale[r] if r in scale else s for r, s in tidy.signals.items()}
    if set_point:
        scaled.setdefault("force", np.zeros_like(scaled["time"]))
        if not {"position", "velocity"} & set(scaled):
            scaled["position"] = scaled.get("reference", np.zeros_like(scaled["time"]))
    notes += tidy.notes
    scaled["time"] = _exact_time(scaled["time"], tidy.segment, notes, source)
    if still:
        scaled |= motion_of(along, scaled["time"], source)
    return _recording(tidy, scaled, named, path, source), notes


def _recording(tidy: Clean, scaled, named, path: Path, source: str) -> Recording:
    return Recording(
        **{role: scaled[role] for role in _SIGNALS if role in scaled},
        mask=tidy.mask,
        segment=tidy.segment,
        channels={role: scaled[role] for role in scaled if role not in _SIGNALS},
        units=tuple(named.items()),
        source=source,
        sha256=sha256(path),
        position_every=tidy.position_every,
    )


def _check_arguments(chosen, scale, units, period, source) -> None:
    for role, factor in scale.items():
        if role not in chosen or role == "segment":
            raise ValueError(
                f"{source}: scale names {role!r}, which is not read. Read are {', '.join(chosen)}."
            )
        if not math.isfinite(factor) or factor == 0 or (role == "time" and factor < 0):
            raise ValueError(f"{source}: the scale of {role} is {factor}; give a usual number.")
    for role, turn in period.items():
        if role != "position" or "position" not in chosen:
            there = "position" if "position" in chosen else "none, for no position is read"
            raise ValueError(f"{source}: period names {role!r}; what can have one: {there}.")
        if not (math.isfinite(turn) and turn > 0):
            raise ValueError(f"{source}: the period of {role} is {turn}; give a number over zero.")
    if unknown := set(units) - {"force", "position"}:
        raise ValueError(
            f"{source}: units names {', '.join(sorted(unknown))}; only the force and the position "
            "have a unit to name, the others follow from them and the second."
        )
    for role, unit in units.items():
        if number := re.match(r"(\d*\.?\d+(?:[eE][+-]?\d+)?)[*·× ]?(?=[^\s/.])", unit):
            raise ValueError(
                f"{source}: the unit of {role} is {unit!r}. A unit is a name and converts nothing; "
                f"a factor is a scale: --scale {role}={number[1]} "
                f"--units {role}={unit[number.end() :]} (scale=, units= in Python)."
            )


def _time(table: Table, chosen, scale, path: Path) -> tuple[np.ndarray, list[str], bool]:
    """The time column, what is said of it, and whether it is in s whatever its name says."""
    column, notes = table.columns[chosen["time"]], list[str]()
    dated = stamps.moments(column, chosen["time"], path, table.first_row)
    if dated is not None:
        return dated, notes, True
    known = False
    if "time" not in scale:  # a factor is the user's own word
        if column.dtype.kind == "O":
            column = numbers(column, chosen["time"], path, table.first_row)
        column = stamps.since_1970(column, notes)
        known = bool(notes)
        if not known and stated_unit(chosen["time"], "time") is None:
            stamps.check_slow(column, notes)
    return numbers(column, chosen["time"], path, table.first_row), notes, known


def _check_lengths(signals, segment, chosen, source) -> None:
    lengths = {role: len(signal) for role, signal in signals.items()}
    if segment is not None:
        lengths["segment"] = len(segment)
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{chosen[role]} ({role}) {n}" for role, n in lengths.items())
        raise ValueError(
            f"{source}: the columns differ in length: {listed}. Name columns of one log with "
            "--columns."
        )


def _exact_time(time, segment, notes, source) -> np.ndarray:
    """Time that jax's default float type can hold, from zero where the origin costs digits."""
    kind = np.dtype(jax.dtypes.canonicalize_dtype(np.float64))
    inside = np.diff(segment) == 0
    usual = np.median(np.diff(time)[inside])
    # A stamp that is rounded by 1 % of a step puts as much error on a derived velocity.
    largest = max(abs(time.min()), abs(time.max()))
    if np.spacing(largest.astype(kind)) > 0.01 * usual and time.min() != 0:
        notes.append(f"Time is counted from its first value, {time.min():.10g} s.")
        time = time - time.min()
    if not np.all(np.diff(time.astype(kind, copy=False))[inside] > 0):
        raise ValueError(
            f"{source}: {kind.name} is too coarse for this clock. Switch on 64 bits before "
            'reading: jax.config.update("jax_enable_x64", True).'
        )
    return time
