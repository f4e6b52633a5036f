"""The JSON documents that others rely on."""

import json
import math
from collections.abc import Sequence
from typing import Any

from ..data.excerpt import excerpt
from ..data.printable import json_text
from ..data.provenance import sha256, versions
from ..data.recording import Recording, uniform
from ..data.summary import facts
from ..models import name_of
from ..signals import host_interval, kernel_half_width, prepare
from . import breakaway
from .constant_velocity import ConstantVelocity, remark as contradicts, sentence

IDENTIFICATION = "jaxfric.identification/1"


def identification(
    found: Any,
    recording: Recording | None = None,
    notes: Sequence[str] = (),
    test: ConstantVelocity | None = None,
    force_error: float | None = None,
    stick: breakaway.BreakAway | None = None,
) -> dict[str, Any]:
    """An `Identified` as plain data (schema `jaxfric.identification/1`).

    **Arguments:** `recording` that it was identified from, with the `notes` of its reader, so that
    its facts are told as well; its constant-velocity `test`, which may warn; `force_error` of
    `predict` with the model and the recording, for what was identified through the kernel that is
    chosen from the recording: then `filter_half_width`, s, is that kernel's, through which the rows
    of `filtered_force_error` went. Both are null where it was not computed. `stick`: the break-away
    levels, which the model then holds.
    """
    parameters = {name: estimate.to_dict() for name, estimate in found.parameters.items()}
    remarks, units = list(found.remarks), dict(found.model.units)
    if test is not None and (contradiction := contradicts(test, units)):
        remarks.append(contradiction)
    document = {
        "schema": IDENTIFICATION,
        "name": name_of(found.model.term),
        "recording": {} if recording is None else facts(recording, notes),
        "model": (found if stick is None else stick).model.to_dict(),
        "parameters": parameters,
        "projection": found.projection,
        "windows": int(found.windows),
        "covered": float(found.covered),
        "open_ends": open_ends(found),
        "result": found.result_name,
        "diagnosis": found.diagnosis,
        "force_error": force_error,
        "filtered_force_error": float(found.filtered_force_error),
        "filter_half_width": None
        if force_error is None or recording is None
        else _half_width(recording),
        "warnings": [remark.to_dict() for remark in remarks],
        "versions": versions(),
    }
    if test is not None:
        document["constant_velocity"] = test.to_dict() | {"summary": sentence(test, units)}
    if stick is not None:
        document["breakaway"] = stick.to_dict() | {"summary": breakaway.sentence(stick, units)}
    return document


def _half_width(recording: Recording) -> float:
    """Half the width of the kernel that is chosen from a recording, s."""
    prepared = prepare(uniform(excerpt(recording)))
    return kernel_half_width(prepared) * host_interval(prepared)


def saved(model: Any, *recordings: Recording | None) -> dict[str, Any]:
    """A model as plain data, with what it was made from and by."""
    files = [
        {"file": each.source, "sha256": each.sha256 or None}
        for each in recordings
        if each is not None
    ]
    return model.to_dict() | {"made_from": files, "versions": versions()}


def made(schema: str, *paths: str | None) -> dict[str, Any]:
    """What begins a document: its schema, the files it was made from, and by which versions."""
    files = [{"file": path, "sha256": sha256(path) or None} for path in paths if path]
    return {"schema": schema, "made_from": files, "versions": versions()}


def open_ends(found: Any) -> dict[str, float]:
    """The bias that the whole record's unequal end velocities would leave, by parameter."""
    names = [parameter.name for parameter in found.model.term.affine]
    return dict(zip(names, map(float, found.open_ends), strict=True))


def to_json(document: Any) -> str:
    """JSON text; what is infinite or not a number becomes null, as JSON has neither."""
    text = json.dumps(finite(document), indent=2, ensure_ascii=False, allow_nan=False)
    return json_text(text) + "\n"


def finite(value: Any) -> Any:
    """Plain data with `None` for what is infinite or not a number."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
