"""What the command prints for a person: plain aligned text."""

import math
from collections.abc import Mapping
from typing import Any

from .models import NAMED
from .uncertainty import BLOCKS, student_quantile

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
        "Fc coulomb, Fv viscous, Fb stribeck_force, vs stribeck_velocity, δ stribeck_exponent; each",
        "direction of motion has its own (names end in + and -), and M dv/dt, inertia, is added.",
        "The prefix symmetric- ties the directions and adds a constant offset.",
    ]
    return "\n".join(lines)


def identification(document: Mapping[str, Any], truth: Mapping[str, float] | None = None) -> str:
    """An identification (schema `jaxfric.identification/1`) as a table with its circumstances."""
    facts = document["recording"]
    rate = f"{facts['sample_rate']:.6g} Hz" if facts["sample_rate"] else "one sample"
    source = f"{facts['file'] or 'recording'}: {facts['samples']} samples, "
    pieces = f", {facts['segments']} segments" if facts["segments"] > 1 else ""
    lines = [source + f"{facts['duration']:.4g} s at {rate}{pieces}"]
    lines += [f"  {note}" for note in facts["notes"]]
    lines += ["", f"model {document['name']}, {_how(document)}", ""]
    lines += _rows(document["parameters"], truth)
    lines += ["", f"force error {document['force_error']:.2%}   result {document['result']}"]
    if document["result"] != "successful":
        lines.append(document["diagnosis"])
    lines += _remarks(document["parameters"])
    return "\n".join(lines)


def _how(document: Mapping[str, Any]) -> str:
    covered = f"{document['covered']:.0%} of the slip time"
    if document["projection"] == "closed_windows":
        count = document["windows"]
        return f"closed windows ({count} window{'s' * (count != 1)}, {covered}; no mass, no acceleration)"
    return f"weak form ({document['windows']} slip stretches, {covered}; inertia fitted too)"


def _rows(parameters: Mapping[str, Any], truth: Mapping[str, float] | None) -> list[str]:
    quantile = student_quantile(0.975, BLOCKS - (len(parameters) + 1) // 2)
    head = ["parameter", "value", "± 95 %", "unit"] + (["true"] if truth else [])
    table = [head]
    for name, entry in parameters.items():
        value, error = entry["value"], entry["standard_error"]
        seen = math.isfinite(error)
        row = [
            name,
            f"{value:.5g}" if seen else "-",
            f"{quantile * error:.2g}" if seen else "not visible",
            entry["unit"],
        ]
        table.append(row + ([f"{truth[name]:.5g}"] if truth else []))
    widths = [max(len(row[i]) for row in table) for i in range(len(head))]
    numeric = (1, 2, 4)
    return [
        "  ".join(
            cell.rjust(width) if i in numeric else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in table
    ]


def _remarks(parameters: Mapping[str, Any]) -> list[str]:
    """What an engineer would object to, said first."""
    remarks = []
    for name, entry in parameters.items():
        clear = abs(entry["value"]) > 2 * entry["standard_error"]
        if name.startswith("stribeck_force") and entry["value"] < 0 and clear:
            remarks.append(
                f"{name} is negative: friction falls towards zero speed instead of rising. That is "
                "no Stribeck effect; presliding, lag or a small dead-time near reversals looks so."
            )
        if name.startswith(("coulomb", "viscous", "inertia")) and entry["value"] < 0 and clear:
            remarks.append(
                f"{name} is negative, which no passive axis is: check the signs of force and motion."
            )
    return remarks
