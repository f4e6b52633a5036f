"""What the command prints for a person: plain aligned text."""

import math
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .identified import Result
from .models import NAMED
from .uncertainty import COSINES, student_quantile

# The diagnosis that needs no words.
FINE = str(Result[Result.successful])

EQUATIONS = {
    "coulomb-viscous": "F = Fc sign(v) + Fv v",
    "gaussian": "F = Fc sign(v) + Fv v + Fb sign(v) exp(-(v/vs)²)",
    "lorentzian": "F = Fc sign(v) + Fv v + Fb sign(v) / (1 + (v/vs)²)",
    "exponential": "F = Fc sign(v) + Fv v + Fb sign(v) exp(-|v|/vs)",
    "generalised": "F = Fc sign(v) + Fv v + Fb sign(v) exp(-|v/vs|^δ)",
}


def models() -> str:
    """The named models with their equations."""
    width = max(map(len, NAMED))
    lines = [f"{name:{width}}  {EQUATIONS[name]}" for name in NAMED]
    lines += [
        "",
        "Fc coulomb, Fv viscous, Fb stribeck_force, vs stribeck_velocity, δ stribeck_exponent;",
        "each direction of motion has its own (names end in + and -); inertia, M dv/dt, is added.",
        "The prefix symmetric- ties the directions and adds a constant offset.",
    ]
    return "\n".join(lines)


def identification(
    document: Mapping[str, Any],
    truth: Mapping[str, float] | None = None,
    automatic: bool = True,
) -> str:
    """An identification (schema `jaxfric.identification/1`) as a table with its circumstances.

    **Arguments:** `truth`, true values to stand beside; `automatic`, whether the projection was
    left to choose itself, so that the reason is told.
    """
    lines = _source(document)
    lines += ["", *_wrapped(f"model {document['name']}; {_how(document, automatic)}"), ""]
    lines += _rows(document["parameters"], truth)
    lines += ["", f"force error {document['force_error']:.2%}   result {document['result']}"]
    if document["diagnosis"] != FINE:
        lines += _wrapped(document["diagnosis"])
    lines += _remarks(document["parameters"]) + _closing(document)
    return "\n".join(lines)


def many(documents: Sequence[Mapping[str, Any]]) -> str:
    """Identifications of several recordings, one row each."""
    names = list(dict.fromkeys(name for d in documents for name in d["parameters"]))
    units = {name: e["unit"] for d in documents for name, e in d["parameters"].items()}
    same_model = len({d["name"] for d in documents}) == 1
    head = ["file", "model", "force error", *names, "result"]
    rows = [head, ["", "", "", *(units[name] for name in names), ""]]
    for document in documents:
        cells = [_cell(document["parameters"].get(name)) for name in names]
        error = f"{document['force_error']:.2%}"
        file = Path(document["recording"]["file"]).name
        rows.append([file, document["name"], error, *cells, document["result"]])
    if same_model:
        rows = [[row[0], *row[2:]] for row in rows]
    numeric = range(1 if same_model else 2, len(rows[0]) - 1)
    lines = [f"model {documents[0]['name']}", ""] if same_model else []
    lines += aligned(rows, numeric)
    lines += ["", "~ the 95 % interval is wider than the value; - not visible; intervals: --json"]
    for result, diagnosis in dict.fromkeys((d["result"], d["diagnosis"]) for d in documents):
        if diagnosis != FINE:
            lines += _wrapped(f"{result}: {diagnosis}")
    return "\n".join(lines)


def _cell(entry: Mapping[str, Any] | None) -> str:
    if entry is None or not math.isfinite(entry["standard_error"]):
        return "-"
    doubtful = _half(entry) > abs(entry["value"])
    return f"{'~' * doubtful}{entry['value']:.4g}"


def _half(entry: Mapping[str, Any]) -> float:
    """Half the 95 % interval."""
    return student_quantile(0.975, COSINES) * entry["standard_error"]


def _source(document: Mapping[str, Any]) -> list[str]:
    """The recording: how much of it, in which units, and what was put in order."""
    facts, units = document["recording"], document["model"]["units"]
    rate = f"{facts['duration']:.4g} s at {facts['sample_rate']:.6g} Hz, " * bool(
        facts["sample_rate"]
    )
    pieces = f"{facts['segments']} segments, " * (facts["segments"] > 1)
    left = facts["samples"] - facts["used"]
    used = f"{facts['samples']} samples" + f" ({left} left out)" * (left > 0)
    named = f"force in {units['force']}, position in {units['position']}"
    source = f"{facts['file'] or 'recording'}: {used}, {rate}{pieces}{named}"
    return [source, *(f"  {note}" for note in facts["notes"])]


def _how(document: Mapping[str, Any], automatic: bool) -> str:
    covered = f"{document['covered']:.0%} of the slip time"
    if document["projection"] == "closed_windows":
        count = document["windows"]
        which = f"{count} window{'s' * (count != 1)}"
        return f"closed windows ({which}, {covered}; no mass, no acceleration)"
    why = "closed windows would use less than half of it; " * automatic
    return f"weak form ({document['windows']} slip stretches, {covered}; {why}inertia fitted too)"


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(text, 98)


def _rows(parameters: Mapping[str, Any], truth: Mapping[str, float] | None) -> list[str]:
    table = [["parameter", "value", "± 95 %", "unit"] + (["true"] if truth else [])]
    for name, entry in parameters.items():
        seen = math.isfinite(entry["standard_error"])
        row = [
            name,
            f"{entry['value']:.5g}" if seen else "-",
            f"{_half(entry):.2g}" if seen else "not visible",
            entry["unit"],
        ]
        table.append(row + ([f"{truth[name]:.5g}"] if truth else []))
    return aligned(table, (1, 2, 4))


def aligned(table: Sequence[Sequence[str]], numeric: Sequence[int]) -> list[str]:
    """Columns of one width each, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if i in numeric else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in table
    ]


def _closing(document: Mapping[str, Any]) -> list[str]:
    """What closing the windows was good for, where it was more than the uncertainty."""
    parameters = document["parameters"]
    gains = [
        f"{name} by {bias:+.2g} {parameters[name]['unit']}"
        for name, bias in document["open_ends"].items()
        if abs(bias) > parameters[name]["standard_error"]
    ]
    if not gains:
        return []
    return _wrapped(
        "Used whole, with its unequal end velocities, the record would be off in "
        + ", ".join(gains)
        + "."
    )


def _remarks(parameters: Mapping[str, Any]) -> list[str]:
    """What an engineer would object to, said first."""
    sizes = {name: (e["value"], _half(e)) for name, e in parameters.items()}
    falling = [n for n, (value, half) in sizes.items() if _bump(n) and value < -half]
    # An infinite half width is "not visible", which the table and the diagnosis say already.
    faint = [n for n, (value, half) in sizes.items() if _bump(n) and abs(value) <= half < math.inf]
    passive = ("coulomb", "viscous", "inertia")
    wrong = [n for n, (value, half) in sizes.items() if n.startswith(passive) and value < -half]
    lines = []
    if falling:
        lines += _wrapped(
            f"{' and '.join(falling)} negative: friction falls towards zero speed instead of "
            "rising. That is no Stribeck effect; presliding, lag or a dead time near reversals "
            "looks so."
        )
    if faint:
        lines += _wrapped(
            f"{' and '.join(faint)} cannot be told from zero, nor then its velocity: a simpler "
            "model may do (--model best lets held-out data choose)."
        )
    if wrong:
        lines += _wrapped(
            f"{' and '.join(wrong)} negative, as in no passive axis: the sign of force or motion "
            "is wrong, or a force that the model lacks (load, cogging) is taken for it."
        )
    return lines


def _bump(name: str) -> bool:
    return name.startswith("stribeck_force")


def explanation(document: Mapping[str, Any]) -> str:
    """An explanation (schema `jaxfric.explanation/1`) in words and tables."""
    facts = document["recording"]
    lines = [f"{facts['file']}: {facts['samples']} samples, {facts['duration']:.4g} s"]
    lines += [f"  {note}" for note in facts.get("notes", [])]
    lines += ["", f"baseline {document['baseline']['name']}", ""]
    lines += _wrapped(f"{document['verdict']}: {document['summary']}")
    motion = document["fit"].get("simulation_error")
    if motion and motion["before"] is not None:
        after = "not to be run" if motion["after"] is None else f"{motion['after']:.2%}"
        lines += [f"Run forward: velocity error {motion['before']:.2%} before, {after} after."]
    for finding in document["findings"]:
        lines += ["", finding["effect"], *(f"  {line}" for line in _wrapped(finding["sentence"]))]
        if finding["confusable_with"] and finding["separate_by"]:
            lines += [f"  {line}" for line in _wrapped(f"To tell: {finding['separate_by']}")]
    if document["where"]:
        rows = [["where the baseline errs", "share", "p", "detail"]]
        for place in document["where"]:
            name = place["coordinate"].replace("_", " ")
            share, chance = f"{place['share']:.0%}", f"{place['p_value']:.3f}"
            rows.append([name, share, chance, place["detail"]])
        lines += ["", *aligned(rows, (1, 2))]
    if document["not_visible"]:
        rows = [["not found, would have been seen from", "", ""]]
        for entry in document["not_visible"]:
            name = entry["effect"].replace("_", " ")
            rows.append([f"  {name}", f"{entry['smallest_detectable']:.3g}", entry["unit"]])
        lines += ["", *aligned(rows, (1,))]
    return "\n".join(lines)
