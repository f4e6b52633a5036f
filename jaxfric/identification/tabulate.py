"""What the command prints for a person: plain aligned text."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..checks import NO_STRIBECK, is_bump, passive
from ..data import summary
from ..data.printable import printable
from ..looks.text import Block, Table, aligned, text, wrapped
from ..looks.unseen import slower
from ..models import NAMED
from .constant_load import NAME as LOAD

# The result whose diagnosis needs no words.
FINE = "successful"

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
    return text(identified(document, truth, automatic))


def _when(delay: float, late: bool) -> str:
    """When the force acts; `late`, whether a warning says that it is later than that."""
    if late and not delay:
        return (
            "The delay told above is more than --align (align=True) corrects, one and a half "
            "samples: the force was taken at its time stamps."
        )
    if not delay:
        return "The force acts at its time stamp, as far as the log shows."
    span, side = f"{1e3 * abs(delay):.3g} ms", "after" if delay > 0 else "before"
    return f"The force acts {span} {side} its time stamp, which is taken into account."


def identified(
    document: Mapping[str, Any],
    truth: Mapping[str, float] | None = None,
    automatic: bool = False,
) -> list[Block]:
    """The paragraphs and the table of [`identification`][]; the recording may be absent."""
    result = f"{_errors(document)}   result {document['result']}"
    told = [result, *([document["diagnosis"]] * (document["result"] != FINE)), *warnings(document)]
    if delay := document.get("model", {}).get("force_delay"):
        late = any(warning["name"] == "force_late" for warning in document.get("warnings", []))
        told.append(_when(delay["value"], late))
    for evidence in ("constant_velocity", "breakaway"):
        if said := document.get(evidence, {}).get("summary"):
            told.append(said)
    if document["result"] != "not_passive":
        told += _remarks(document["parameters"], document["warnings"])
    chosen = standings(document["selection"]) if "selection" in document else []
    return [
        _source(document),
        *chosen,
        [f"model {document['name']}; {_how(document, automatic)}"],
        _table(document["parameters"], truth),
        told + _closing(document),
    ]


def standings(document: Mapping[str, Any]) -> list[Block]:
    """The table of a selection, by rising held-out error, and why some cannot be told apart."""
    table = [["", "model", "parameters", "held-out error", "± 95 %"]]
    for entry in document["candidates"]:
        name = entry["name"]
        mark = "*" if name == document["model"] else "=" if name in document["tied"] else ""
        error, half = f"{entry['filtered_force_error']:.3%}", f"{entry['half_width']:.2%}"
        table.append([mark, name, str(entry["parameters"]), error, half])
    said = f"* chosen: {document['model']}"
    if len(document["tied"]) > 1:
        said += ", the simplest of those that the best does not beat significantly (=; 5 %)"
    if contradicted := document.get("contradicted"):
        names = ", ".join(contradicted)
        said += f" and whose curve the whole recording does not contradict, as it does {names}"
    return [Table(table, (2, 3, 4)), [said, *([document["reason"]] if document["reason"] else [])]]


def _percent(share: float | None) -> str:
    return f"{share:.2%}" if share is not None and math.isfinite(share) else "unknown"


def _errors(document: Mapping[str, Any]) -> str:
    """The force error of `predict`, where it was computed, and the one through the kernel."""
    filtered = f"filtered force error {_percent(document['filtered_force_error'])}"
    if document["force_error"] is None:
        return filtered
    span = f"{2e3 * document['filter_half_width']:.3g} ms"
    # The force error counts samples in motion alone; of these a filter leaves less, not more.
    if (document["filtered_force_error"] or 0.0) > document["force_error"]:
        span += ", which reach over reversals and rest"
    return f"force error {_percent(document['force_error'])}; {filtered} ({span})"


def many(documents: Sequence[Mapping[str, Any]]) -> str:
    """Identifications of several recordings, one row each."""
    names = list(dict.fromkeys(name for d in documents for name in d["parameters"]))
    units = {name: e["unit"] for d in documents for name, e in d["parameters"].items()}
    same_model = len({d["name"] for d in documents}) == 1
    head = ["file", "model", "force error", *names, "result"]
    rows = [head, ["", "", "", *(units[name] for name in names), ""]]
    for document in documents:
        cells = [_cell(document["parameters"].get(name)) for name in names]
        error = _percent(document["force_error"])
        file = _name(document)
        rows.append([file, document["name"], error, *cells, document["result"]])
    if same_model:
        rows = [[row[0], *row[2:]] for row in rows]
    numeric = range(1 if same_model else 2, len(rows[0]) - 1)
    lines = [f"model {documents[0]['name']}", ""] if same_model else []
    lines += aligned(rows, numeric)
    lines += ["", "~ the 95 % interval is wider than the value; - not visible; intervals: --json"]
    for result, diagnosis in dict.fromkeys((d["result"], d["diagnosis"]) for d in documents):
        if result != FINE:
            lines += wrapped(f"{result}: {diagnosis}")
    for document in documents:
        for each in warnings(document):
            lines += [f"{_name(document)}: {line}" for line in wrapped(each)]
    return "\n".join(lines)


def _name(document: Mapping[str, Any]) -> str:
    return printable(Path(document["recording"]["file"]).name)


def warnings(document: Mapping[str, Any]) -> list[str]:
    """What is wrong with the recording or the fit, a paragraph each."""
    return [f"Warning: {w['text']}" for w in document.get("warnings", [])]


def _cell(entry: Mapping[str, Any] | None) -> str:
    if entry is None or entry["interval"] is None:
        return "-"
    doubtful = _half(entry) > abs(entry["value"])
    return f"{'~' * doubtful}{entry['value']:.4g}"


def _half(entry: Mapping[str, Any]) -> float:
    """Half the 95 % interval, infinite where the recording does not show the value."""
    return math.inf if (ends := entry["interval"]) is None else (ends[1] - ends[0]) / 2


def _source(document: Mapping[str, Any]) -> list[str]:
    """The recording: how much of it, in which units, and what was put in order."""
    if not document["recording"]:
        return []
    facts, units = document["recording"], document["model"]["units"]
    named = f"force in {units['force']}, position in {units['position']}"
    return [f"{printable(summary.line(facts))}, {named}", *(f"  {note}" for note in facts["notes"])]


def _how(document: Mapping[str, Any], automatic: bool) -> str:
    covered = f"{document['covered']:.0%} of the slip"
    if document["projection"] == "closed_windows":
        count = document["windows"]
        which = f"{count} window{'s' * (count != 1)}"
        return f"closed windows ({which}, {covered}; mass and acceleration cancel)"
    why = "closed windows would use less than half of it; " * automatic
    return f"weak form ({document['windows']} slip stretches, {covered}; {why}inertia fitted too)"


def _table(parameters: Mapping[str, Any], truth: Mapping[str, float] | None) -> Table:
    table = [["parameter", "value", "± 95 %", "unit"] + (["true"] if truth else [])]
    for name, entry in parameters.items():
        seen = entry["interval"] is not None
        row = [
            name,
            f"{entry['value']:.5g}" if seen else "-",
            f"{_half(entry):.2g}" if seen else "not visible",
            entry["unit"],
        ]
        table.append(row + ([f"{truth[name]:.5g}"] if truth else []))
    return Table(table, (1, 2, 4))


def _closing(document: Mapping[str, Any]) -> list[str]:
    """What closing the windows was good for, where it was more than the uncertainty."""
    parameters = document["parameters"]
    gains = [
        f"{name} by {bias:+.2g} {parameters[name]['unit']}"
        for name, bias in document["open_ends"].items()
        if abs(bias) > (parameters[name]["standard_error"] or math.inf)
    ]
    if not gains:
        return []
    return [
        "Used whole, with its unequal end velocities, the record would be off in "
        + ", ".join(gains)
        + "."
    ]


def _remarks(parameters: Mapping[str, Any], said: Sequence[Mapping[str, Any]]) -> list[str]:
    """What an engineer would object to, said first; what the warnings say is not said again."""
    seen = {name: entry for name, entry in parameters.items() if entry["interval"]}
    sizes = {name: (entry["value"], _half(entry)) for name, entry in seen.items()}
    falling = [n for n, (value, half) in sizes.items() if is_bump(n) and value < -half]
    faint = [n for n, (value, half) in sizes.items() if is_bump(n) and abs(value) <= half]
    loaded = any(warning["name"] == LOAD for warning in said)
    counted = {"viscous", "inertia"} if loaded else {"coulomb", "viscous", "inertia"}
    wrong = [n for n, (value, half) in sizes.items() if passive(n) in counted and value < -half]
    lines = []
    if falling:
        lines.append(
            f"{' and '.join(falling)} negative: friction falls towards zero speed instead of "
            f"rising. {NO_STRIBECK}"
        )
    if faint:
        lines.append(
            f"{' and '.join(faint)} cannot be told from zero, nor then its velocity: a simpler "
            "model may do (--model best, in Python jaxfric.select, lets held-out data choose)."
        )
    if wrong:
        lines.append(
            f"{' and '.join(wrong)} negative, as in no passive axis: the sign of force or motion "
            "is wrong, a force that the model lacks (load, cogging) is taken for it, or friction "
            "still falls at the fastest speed: then go faster, or give wider bounds."
        )
    return lines


def explanation(document: Mapping[str, Any]) -> str:
    """An explanation (schema `jaxfric.explanation/1`) in words and tables."""
    return text(explained(document))


def explained(document: Mapping[str, Any]) -> list[Block]:
    """The paragraphs and tables of [`explanation`][]."""
    facts = document["recording"]
    file = printable(facts["file"])
    whose = f"{file}: " if file else ""  # made in Python, and not named
    rate, units = facts.get("sample_rate"), (document.get("model") or {}).get("units") or {}
    at = f" at {rate:.6g} Hz" if rate else ""
    named = "".join(f", {name} in {printable(unit)}" for name, unit in units.items())
    source = [f"{whose}{facts['samples']} samples, {facts['duration']:.4g} s{at}{named}"]
    source += [f"  {note}" for note in facts.get("notes", [])]
    said = [f"{document['verdict']}: {document['summary']}", *warnings(document)]
    motion = document["fit"].get("simulation_error")
    if motion and motion["before"] is not None:
        after = "not to be run" if motion["after"] is None else f"{motion['after']:.2%}"
        said += [f"Run forward: velocity error {motion['before']:.2%} before, {after} after."]
    baseline = [f"baseline {document['baseline']['name']}"]
    findings = [_finding(finding) for finding in document["findings"]]
    findings += [
        [
            f"{finding['effect']}, not {_NOT[finding['confirmed']]}",
            f"  {finding['sentence']}",
        ]
        for finding in document.get("not_confirmed", [])
    ]
    return [source, baseline, said, *_sanity(document), *findings, *_places(document)]


# Of what the held-out recording refutes, and of what it has no say in.
_NOT = {False: "confirmed", None: "in the model"}


def _sanity(document: Mapping[str, Any]) -> list[Block]:
    """What was looked at before any physics; what of it is a finding is said there."""
    rows = document.get("sanity") or []
    named = {finding["effect"] for finding in document["findings"]}
    wrong = [row["text"] for row in rows if row["wrong"] and row["check"] not in named]
    right = sorted({row["check"].replace("_", " ") for row in rows if row["wrong"] is False})
    lines = [f"looked at first: {text}" for text in wrong]
    if right:
        lines.append(f"looked at first, and right: {', '.join(right)}")
    return [lines] if lines else []


def _finding(finding: Mapping[str, Any]) -> list[str]:
    lines = [finding["effect"], f"  {finding['sentence']}"]
    if finding["confusable_with"] and finding["separate_by"]:
        lines.append(f"  To tell: {finding['separate_by']}")
    return lines


def _places(document: Mapping[str, Any]) -> list[Block]:
    """Where the baseline errs, and what would not have been seen."""
    where = [["where the baseline errs", "share", "p", "detail"]]
    for place in document["where"]:
        name = place["coordinate"].replace("_", " ")
        share, chance = f"{place['share']:.0%}", f"{place['p_value']:.3f}"
        where.append([name, share, chance, place["detail"]])
    hidden = [["not found, would have been seen from", "rms in slip", ""]]
    for entry in document["not_visible"]:
        name = entry["effect"].replace("_", " ")
        hidden.append([f"  {name}", f"{entry['smallest_detectable']:.3g}", entry["unit"]])
    tables = [Table(where, (1, 2)), Table(hidden, (1,))]
    blocks: list[Block] = [table for table in tables if len(table.rows) > 1]
    note = slower(document)
    return [*blocks, [note]] if note else blocks
