"""`jaxfric design`: the motion to record next."""

import json
from argparse import Namespace
from pathlib import Path
from typing import Any

from ..data.io import write_table
from ..data.targets import standard
from ..identification import documents
from ..identification.design import Design, design
from ..identification.motion import Limits, led
from ..identification.separation import separate
from ..looks.text import Table, text
from ..models import Model
from ..terms.effects import effect
from .commands import load_model, put, put_table
from .messages import say


def run(arguments: Namespace) -> int:
    """Propose a reference for a model, or for the confusable findings of an explanation."""
    model = load_model(arguments.model)
    if arguments.interval >= 0.01 * arguments.duration:
        raise ValueError("--interval is longer than a hundredth of --duration: sample faster.")
    limits = Limits(
        arguments.position, arguments.velocity, arguments.acceleration, arguments.jerk,
        arguments.duration, arguments.interval, arguments.centre,
    )  # fmt: skip
    rivals = _rivals(arguments.model)
    try:
        if rivals:
            found = separate(model, rivals, limits, arguments.noise)
        else:
            found = design(model, limits, arguments.noise)
    except ValueError as error:
        raise ValueError(f"{arguments.model}: {error}") from error
    motion = led(found.motion, limits)
    columns = {
        "time": motion.time,
        "reference": motion.position,
        "reference_velocity": motion.velocity,
        "reference_acceleration": motion.acceleration,
    }
    quiet = bool(arguments.json) and standard(arguments.json)
    if quiet:
        write_table(arguments.out, columns)
    else:
        low, high = float(motion.position.min()), float(motion.position.max())
        unit = dict(model.units)["position"]
        put_table(
            arguments.out, columns, [],
            f"{motion.time.size} samples, {float(motion.time[-1]):.4g} s from rest to rest, "
            f"positions {low:.4g} to {high:.4g} {unit}",
        )  # fmt: skip
    if arguments.json:
        made = documents.made("jaxfric.design/1", arguments.model)
        put(arguments.json, documents.to_json(made | found.to_dict()))
    if not quiet and not standard(arguments.out):
        say(text(_told(found, model)))
    return 0


def _rivals(path: str) -> dict[str, list[str]]:
    """Of an explanation the confusable findings with their rivals; nothing of a model."""
    document: Any = json.loads(Path(path).read_text(encoding="utf-8"))
    findings = document.get("findings", []) if isinstance(document, dict) else []
    return {f["effect"]: f["confusable_with"] for f in findings if f.get("confusable_with")}


def _told(found: Design, model: Model):
    force = dict(model.units)["force"]
    table = [["parameter", "standard error: sine", "designed", "unit", "gain"]]
    for name, gain in found.gains.items():
        # An error beyond the value itself leaves even its sign unknown.
        size = abs(float(model.parameters[name])) or float("inf")
        seen = [each if each <= size else None for each in (gain.before, gain.after)]
        both = None not in seen and gain.after > 0
        ratio = f"{gain.before / gain.after:.3g}×" if both else ""
        shown = ["unknown" if each is None else f"{each:.3g}" for each in seen]
        table.append([name, *shown, gain.unit, ratio])
    said = [
        f"Predicted with white noise of {found.noise:.3g} {force} on the force of each sample, for "
        "the plain sine and for the designed motion within the same limits."
    ]
    parts = [Table(table, (1, 2, 4)), said]
    return parts + _apart(found, force) if found.apart else parts


def _apart(found: Design, force: str):
    """How far the rivals are apart, and whether that will be enough."""
    table = [["if it is", "and not", f"apart, {force}: sine", "designed", "ratio", "told"]]
    for each in found.apart:
        # A hundredth of what decides, and less, is nothing.
        seen = each.before > 0.01 * found.enough
        ratio = f"{each.after / each.before:.3g}×" if seen else ""
        told = "yes" if each.after > found.enough else "no"
        table.append(
            [each.true, each.other, f"{each.before:.2g}" if seen else "0", f"{each.after:.2g}",
             ratio, told]
        )  # fmt: skip
    said = [
        "Apart: the rms force by which the best imitation fails, all other terms fitted too; of a "
        f"rival the median over its parameters. {found.enough:.2g} {force} decides."
    ]
    if any(each.after <= found.enough for each in found.apart):
        said.append(
            "Where it says no, the other comes so close that no motion found within these limits "
            "tells them: widen the stroke, or record longer."
        )
    if found.left_out:
        names = ", ".join(found.left_out)
        advice = dict.fromkeys(effect(name).separate_by or "" for name in found.left_out)
        said.append(f"Not designed for, as more than the motion makes them: {names}.")
        said += [each for each in advice if each]
    return [Table(table, (2, 3, 4)), said]
