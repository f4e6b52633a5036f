"""What `jaxfric explain --mujoco` prints of a robot: plain aligned text."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ..data.printable import printable
from ..explanation.quantities import percent
from ..looks.text import aligned, wrapped


def joints(simulator: str, log: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """What a simulator's joints and a log differ in, a row each."""
    after = ["after", *["callback"] * any("callback" in row for row in rows)]
    noise = ["noise"] * any(row.get("filtered_noise_floor") is not None for row in rows)
    table = [["joint", "verdict", "error", *after, *noise, "held out", *after, "what"]]
    for row in rows:
        cells = [""] * (2 * (1 + len(after)) + len(noise))
        if "error" not in row:
            here, held = (_with_file(row, name) for name in ("force_error", "holdout_force_error"))
            cells = [_cell(here.get(w)) for w in ("before", *after)]
            cells += [_cell(row.get("filtered_noise_floor"))] * len(noise)
            cells += [_cell(held.get(w)) for w in ("before", *after)]
        below = "see below" * any(row.get(key) for key in ("error", "findings", "unexplained"))
        table.append([row["joint"], row["verdict"], *cells, below])
    lines = [f"{printable(simulator)} against {printable(log)}", ""]
    lines += aligned(table, range(2, 4 + 2 * len(after) + len(noise)))
    every = [each for row in rows for each in row.get("findings", ())]
    shared = {each for each in every if every.count(each) > 1}  # said of several joints together
    lines += [
        line for each in dict.fromkeys(every) if each in shared for line in ["", *wrapped(each)]
    ]
    for row in rows:
        said = [row["error"]] if "error" in row else row["findings"]
        for each in said:
            lines += [] if each in shared else ["", *wrapped(f"{row['joint']}: {each}")]
        if row.get("describes_nothing"):
            lines += ["", *wrapped(f"{row['joint']}: {row['describes_nothing']}")]
        if row.get("unexplained"):
            more = f"More by --joint {row['joint']}."
            lines += ["", *wrapped(f"{row['joint']}: {row['unexplained']} {more}")]
        if row.get("corrected_before"):
            lines += ["", f"{row['joint']}: judged with {', '.join(row['corrected_before'])}"]
        for each in row.get("actuator", ()):
            lines += ["", *wrapped(f"{row['joint']}: {each}")]
    for name in ("contradicted", "still"):
        for each in dict.fromkeys(text for row in rows for text in row.get(name, ())):
            lines += ["", *wrapped(each)]
    note = "Force errors through the kernel by which effects are looked for."
    note += " Noise: what it alone makes." * bool(noise)
    note += " After: of the file as it was written." * any("file" in row for row in rows)
    note += " Callback: with it beside the file." * (len(after) > 1)
    lines += ["", *wrapped(note)]
    return "\n".join(lines)


def _cell(error: float | None) -> str:
    return "" if error is None or math.isnan(error) else percent(error)


def _with_file(row: Mapping[str, Any], name: str) -> Mapping[str, float]:
    """A joint's errors before and after; after by the written file, where there is one, and with
    the callback beside it, where one is.
    """
    error = row[f"filtered_{name}"]
    if error is None:
        return {}
    written = {"after": row.get("file", {}), "callback": row.get("callback", {})}
    return {**error, **{key: each[name] for key, each in written.items() if name in each}}


def patch(path: str, document: Mapping[str, Any]) -> str:
    """What was written into a simulator's file, and what that is worth."""
    lines = [f"{path}:"]
    lines += [f"  {line}" for line in document["written"] or ["nothing to change"]]
    for line in document["left"]:
        lines += wrapped(f"  not written: {line}")
    table = [["filtered force error", "before", "with the file", "with the callback too"]]
    for joint, errors in document["errors"].items():
        for name, error in errors.items():
            held = "held out" if name.startswith("holdout") else "recording"
            cells = [percent(error[w]) if w in error else "" for w in ("before", "file", "forces")]
            table.append([f"{joint}, {held}", *cells])
    lines += ["", *aligned(table, (1, 2, 3))]
    for line in (*document["as_read"], *document["misses"]):
        lines += ["", *wrapped(line)]
    lines += _rerun(document["rerun"])
    return "\n".join(lines)


def _rerun(document: Mapping[str, Any]) -> list[str]:
    """The closed loops that were run again."""
    if not document["joints"]:
        return ["", *wrapped(document["remark"])] if document["remark"] else []
    table = [["run again", "off the recording", "after", "tracking, recorded", "before", "after"]]
    for row in document["joints"]:
        off, track = row["deviation"], row["tracking_error"]
        cells = [off["before"], off["after"], track["recorded"], track["before"], track["after"]]
        table.append([row["joint"], *(f"{cell:.3g}" for cell in cells)])
    said = (
        "Root mean squares, rad or m, of the closed loop with the recording's reference and its "
        f"controller ({document['controller']})."
    )
    return ["", *aligned(table, (1, 2, 3, 4, 5)), "", *wrapped(said)]
