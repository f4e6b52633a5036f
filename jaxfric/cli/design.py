"""`jaxfric design`: the motion to record next."""

import json
from argparse import Namespace
from pathlib import Path
from typing import Any

from ..data.io import write_table
from ..data.targets import standard
from ..identification import documents
from ..identification.design import Design, design, separate
from ..identification.motion import Limits
from ..looks.text import Table, text
from .commands import _load, put, put_table
from .options import say


def run(arguments: Namespace) -> int:
    """Propose a reference for a model, or for the confusable findings of an explanation."""
    model = _load(arguments.model)
    if arguments.interval >= 0.01 * arguments.duration:
        raise ValueError("--interval is longer than a hundredth of --duration: sample faster.")
    limits = Limits(
        arguments.position, arguments.velocity, arguments.acceleration, arguments.jerk,
        arguments.duration, arguments.interval,
    )  # fmt: skip
    rivals = _rivals(arguments.model)
    try:
        if rivals:
            found = separate(model, rivals, limits, arguments.noise)
        else:
            found = design(model, limits, arguments.noise)
    except ValueError as error:
        raise ValueError(f"{arguments.model}: {error}") from error
    motion = found.motion
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
        put_table(arguments.out, columns, [], f"{motion.time.size} samples")
    if arguments.json:
        made = documents.made("jaxfric.design/1", arguments.model)
        put(arguments.json, documents.to_json(made | found.to_dict()))
    if not quiet and not standard(arguments.out):
        say(text(_told(found, dict(model.units)["force"])))
    return 0


def _rivals(path: str) -> dict[str, list[str]]:
    """Of an explanation the confusable findings with their rivals; nothing of a model."""
    document: Any = json.loads(Path(path).read_text(encoding="utf-8"))
    findings = document.get("findings", []) if isinstance(document, dict) else []
    return {f["effect"]: f["confusable_with"] for f in findings if f.get("confusable_with")}


def _told(found: Design, force: str):
    table = [["parameter", "standard error: sine", "designed", "unit", "gain"]]
    for name, gain in found.gains.items():
        ratio = f"{gain.before / gain.after:.3g}×" if gain.after > 0 else ""
        table.append([name, f"{gain.before:.3g}", f"{gain.after:.3g}", gain.unit, ratio])
    said = [
        f"Predicted with white noise of {found.noise:.3g} {force} on the force of each sample, for "
        "the plain sine and for the designed motion within the same limits."
    ]
    if found.separation:
        before, after = found.separation
        said.append(
            f"To tell {'; '.join(found.rivals)}: they differ by at least {before:.3g} {force} "
            f"(rms) along the sine, by {after:.3g} {force} along the designed motion."
        )
    return [Table(table, (1, 2, 4)), said]
