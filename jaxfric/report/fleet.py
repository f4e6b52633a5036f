"""The picture of a fleet: every recording's parameters with what is usual, outliers and drifts."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..fleet.comparing import FORCE_ERROR, LEVEL, Drift, Summary, sound
from ..fleet.files import File
from ..fleet.journal import Row
from ..identification.uncertainty import COSINES, student_quantile
from ..looks.drawing import library, saved

ACROSS = 3
# Drifts drawn, the least likely ones.
DRIFTS = 6
# Error bars of more recordings than this would be one grey area.
BARS = 300
# Names in one panel.
LABELS = 8
_USUAL, _OUT, _LINE = "#5b7083", "#c4570a", "#0b5fa5"


def render(
    files: Sequence[File], rows: Mapping[str, Row], found: Summary, format: str = "png"
) -> bytes:
    """The picture as the content of a file, `png`, `pdf` or `svg`.

    **Raises:** `ValueError` if matplotlib is not installed.
    """
    fine = [file for file in files if sound(rows[file.path])]
    names = list(dict.fromkeys(one.name for one in found.usual if one.name != FORCE_ERROR))
    names += [FORCE_ERROR] * bool(found.usual)
    drifts = [drift for drift in found.drifts if drift.chance < LEVEL]
    told = f"outliers: {len(found.outliers)}, drifts: {len(drifts)}"
    drifts = drifts[:DRIFTS]
    count = len(names) + len(drifts)
    height = -(-count // ACROSS)
    picture = library()(figsize=(4.2 * ACROSS, 0.8 + 2.7 * max(1, height)), layout="constrained")
    whole = f"{len(files)} recordings, {len(fine)} of them compared"
    picture.suptitle(f"{whole}; {told}")
    if count:
        panels = picture.subplots(max(1, height), ACROSS, squeeze=False)
        for axes in panels.flat:
            axes.set_visible(False)
        for axes, name in zip(panels.flat, names, strict=False):
            _parameter(axes, name, fine, rows, found)
        for axes, drift in zip(panels.flat[len(names) :], drifts, strict=False):
            _drift(axes, drift)
    return saved(picture, format, 110)


def _parameter(axes, name: str, files: Sequence[File], rows: Mapping[str, Row], found: Summary):
    """One parameter of all recordings in their order, over the band of what is usual."""
    axes.set_visible(True)
    values, errors = np.array([_entry(rows[file.path], name) for file in files], float).T
    place = np.arange(1, len(files) + 1)
    usual = [one for one in found.usual if one.name == name]
    out = {one.path for one in found.outliers if one.name == name}
    outside = np.array([file.path in out for file in files])
    bars = student_quantile(0.975, COSINES) * errors if len(files) <= BARS else None
    _band(axes, usual, files, place)
    for chosen, colour, size in ((~outside, _USUAL, 3), (outside, _OUT, 5)):
        if chosen.any():
            half = None if bars is None else bars[chosen]
            style = {"fmt": "o", "ms": size, "lw": 0.8, "color": colour, "zorder": 3}
            axes.errorbar(place[chosen], values[chosen], half, **style)
    _label(axes, [file for file in files if file.path in out], place[outside], values[outside])
    if usual and usual[0].ratio and np.all(values > 0):
        axes.set_yscale("log")
    else:
        edges = [one.median + side * one.deviation for one in usual for side in (-4, 4)]
        _limit(axes, values, edges)
    unit = usual[0].unit if usual else ""
    axes.set_title(name.replace("_", " "), fontsize=10)
    axes.set_ylabel("share of the force" if name == FORCE_ERROR else unit)
    axes.set_xlabel("recording", fontsize=8)
    axes.grid(color="0.93")


def _label(axes, files: Sequence[File], places, values) -> None:
    """Names beside outliers, the first of each axis; so few that they can be read."""
    named: dict[str, None] = {}
    for file, place, value in zip(files, places, values, strict=True):
        name = file.axis or Path(file.path).stem
        if name not in named and len(named) < LABELS:
            style = {"xytext": (4, 3), "textcoords": "offset points", "fontsize": 7, "color": _OUT}
            axes.annotate(name, (place, value), **style)
        named[name] = None


def _entry(row: Row, name: str) -> tuple[float, float]:
    """Value and standard error, not a number where there is none."""
    if name == FORCE_ERROR:
        return row[FORCE_ERROR] or np.nan, 0.0
    entry = row["parameters"].get(name, {})
    pair = entry.get("value"), entry.get("standard_error")
    return (np.nan, np.nan) if None in pair else pair


def _band(axes, usual, files, place) -> None:
    """Median and three robust deviations of each group, over its recordings."""
    for one in usual:
        own = [p for p, file in zip(place, files, strict=True) if file.group == one.group]
        if one.ratio:
            low, high = one.median * np.exp([-3 * one.deviation, 3 * one.deviation])
        else:
            low, high = one.median - 3 * one.deviation, one.median + 3 * one.deviation
        span = [min(own) - 0.5, max(own) + 0.5]
        label = "median, 3 robust deviations"
        axes.fill_between(span, low, high, color=_LINE, alpha=0.12, lw=0, zorder=1, label=label)
        axes.plot(span, [one.median] * 2, color=_LINE, lw=1.2, zorder=2)


def _limit(axes, values, others) -> None:
    """Room for the values and others; a single far bar must not press all of them flat."""
    ends = [v for v in (*values, *others) if np.isfinite(v)]
    if ends and max(ends) > min(ends):
        margin = 0.08 * (max(ends) - min(ends))
        axes.set_ylim(min(ends) - margin, max(ends) + margin)


def _drift(axes, drift: Drift) -> None:
    axes.set_visible(True)
    half = student_quantile(0.975, COSINES) * drift.errors
    style = {"fmt": "o", "ms": 4, "lw": 0.8, "color": _USUAL}
    axes.errorbar(drift.places, drift.values, half, **style)
    ends = np.array([drift.places[0], drift.places[-1]])
    level, rise = drift.line
    axes.plot(ends, level + rise * ends, color=_OUT, lw=1.5)
    # Errors larger than the scatter are common to the recordings: the course shows all the same.
    _limit(axes, drift.values, level + rise * ends)
    axes.set_title(f"{drift.axis}: {drift.name.replace('_', ' ')}", fontsize=10)
    axes.set_xlabel("days" if drift.per == "day" else "recording of the axis", fontsize=8)
    axes.set_ylabel("share of the force" if drift.name == FORCE_ERROR else drift.unit)
    axes.grid(color="0.93")
