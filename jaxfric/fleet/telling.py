"""A fleet in words and tables."""

from collections import Counter
from collections.abc import Mapping, Sequence

from ..data.printable import printable
from ..identification import identified
from ..looks.text import aligned
from .comparing import (
    FEWEST_OF_AXIS,
    FORCE_ERROR,
    LARGE,
    LEVEL,
    Drift,
    Summary,
    Usual,
    sound,
)
from .files import File
from .journal import Row

# Lines of a list, and files of one; the table has the others.
MOST, FIRST = 20, 3


def summary(files: Sequence[File], rows: Mapping[str, Row], found: Summary) -> str:
    """Results, what is usual, outliers and drifts."""
    results = Counter(rows[file.path]["result"] for file in files)
    lines = [", ".join(f"{count} {result}" for result, count in results.most_common())]
    fine = [file for file in files if rows[file.path]["result"] == "successful"]
    if left := [file.path for file in fine if not sound(rows[file.path])]:
        lines.append(
            f"Not compared, for their force error is over {LARGE:.0%} or their friction negative: "
            f"{_first(left)}"
        )
    lines += _usual(found.usual) + _outliers(found) + _drifts(found)
    return "\n".join(lines)


def troubles(files: Sequence[File], rows: Mapping[str, Row]) -> str:
    """The files that gave no result and why; and the other results, once each."""
    failed = [rows[f.path]["reason"] for f in files if rows[f.path]["result"] == "failed"]
    lines = [f"failed: {printable(reason)}" for reason in failed[:MOST]] + _more(failed)
    results = dict.fromkeys(rows[file.path]["result"] for file in files)
    for result in results:
        if result not in ("successful", "failed"):
            said = str(identified.Result[getattr(identified.Result, result)])
            lines.append(f"{result}: {said}")
            lines += _named([f for f in files if rows[f.path]["result"] == result], rows, said)
    return "\n".join(lines + _warned(files, rows))


def _named(files: Sequence[File], rows: Mapping[str, Row], said: str) -> list[str]:
    """The first files of a result, each with what its reason says beyond the result's words."""
    own = [(rows[file.path].get("reason") or "").removeprefix(said).strip() for file in files]
    if not any(own):
        return [f"  {_first([file.path for file in files])}"]
    shown = list(zip(files, own, strict=True))[:FIRST]
    lines = [f"  {printable(file.path)}: {printable(text)}" for file, text in shown]
    return lines + [f"  and {len(own) - FIRST} more"] * (len(own) > FIRST)


def _first(paths: Sequence[str]) -> str:
    """The first paths, and how many more there are."""
    shown = ", ".join(map(printable, paths[:FIRST]))
    return shown + (f" and {len(paths) - FIRST} more" if len(paths) > FIRST else "")


def _warned(files: Sequence[File], rows: Mapping[str, Row]) -> list[str]:
    """How many recordings each warning is about, and the first of them; the table has all."""
    paths: dict[str, list[str]] = {}
    for file in files:
        for name in filter(None, (rows[file.path].get("warnings") or "").split(", ")):
            paths.setdefault(name, []).append(file.path)
    return [
        f"warning {name}: {len(on)} recording{'s' * (len(on) > 1)}: {_first(on)}"
        for name, on in paths.items()
    ]


def _usual(usual: Sequence[Usual]) -> list[str]:
    if not usual:
        return []
    grouped = any(one.group for one in usual)
    table = [["group"] * grouped + ["parameter", "median", "scatter", "unit", "recordings"]]
    for one in usual:
        table.append([one.group] * grouped + [one.name, *_level(one), str(one.recordings)])
    return ["", *aligned(table, {1 + grouped, 2 + grouped, 4 + grouped})]


def _level(one: Usual) -> list[str]:
    if one.name == FORCE_ERROR:
        return [f"{one.median:.2%}", _ratio(one.deviation), ""]
    scatter = _ratio(one.deviation) if one.ratio else f"± {one.deviation:.2g}"
    return [f"{one.median:.4g}", scatter, one.unit]


def _ratio(deviation: float) -> str:
    return f"× {2.718281828459045**deviation:.3g}"


def _outliers(found: Summary) -> list[str]:
    tried = found.tried[0]
    if not found.outliers:
        return ["", f"No outliers among {tried} values."] if tried else []
    table = [["outlier", "value", "unit", "usual", "deviations", "chance"]]
    for one in found.outliers[:MOST]:
        share = one.name == FORCE_ERROR
        value, usual = (f"{x:.2%}" if share else f"{x:.4g}" for x in (one.value, one.usual.median))
        cells = [f"{printable(one.path)}  {one.name}", value, "" if share else one.unit, usual]
        table.append([*cells, f"{one.deviations:+.1f}", _chance(one.chance)])
    note = f"chance: that any of the {tried} values tried is so far off by itself"
    return ["", *aligned(table, {1, 3, 4, 5}), *_more(found.outliers), note]


def _drifts(found: Summary) -> list[str]:
    tried = found.tried[1]
    shown = [drift for drift in found.drifts if drift.chance < LEVEL]
    if found.most > 1 and not tried:
        few = f"no axis has more than {found.most} sound recordings, and it takes {FEWEST_OF_AXIS}."
        return ["", f"Drift: {few}"]
    if not shown:
        return ["", f"No drift among {tried} courses of an axis's parameter."] if tried else []
    table = [["drift", "slope", "± s.e.", "unit", "from", "to", "chance"]]
    for drift in shown[:MOST]:
        table.append(
            [f"{printable(drift.axis)}  {drift.name}", *_course(drift), _chance(drift.chance)]
        )
    note = f"chance: that any of the {tried} slopes tried is so far from zero by itself"
    return ["", *aligned(table, {1, 2, 4, 5, 6}), *_more(shown), note]


def _course(drift: Drift) -> list[str]:
    level, rise = drift.line
    end = level + rise * float(drift.places[-1])
    unit = f"{drift.unit}/{drift.per}".removeprefix("1/" if drift.name == FORCE_ERROR else "\0")
    unit = f"per {unit}" if drift.name == FORCE_ERROR else unit
    return [f"{rise:+.3g}", f"{drift.slope_error:.2g}", unit, f"{level:.4g}", f"{end:.4g}"]


def _chance(chance: float) -> str:
    return f"{chance:.3f}" if chance >= 0.001 else "<0.001"


def _more(entries: Sequence) -> list[str]:
    return [f"... and {len(entries) - MOST} more"] if len(entries) > MOST else []
