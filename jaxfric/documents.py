"""The JSON documents that others rely on."""

import json
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from .identified import Identified, result_names
from .recording import Recording

IDENTIFICATION = "jaxfric.identification/1"


def recording_facts(recording: Recording, notes: Sequence[str] = ()) -> dict[str, Any]:
    """File, samples, duration (s), mean sample rate (Hz) of a recording, and what was tidied."""
    mask = np.asarray(recording.mask)
    time, segment = np.asarray(recording.time)[mask], np.asarray(recording.segment)[mask]
    steps = np.diff(time)[np.diff(segment) == 0]
    return {
        "file": recording.source,
        "samples": int(mask.size),
        "used": int(np.count_nonzero(mask)),
        "segments": int(np.unique(segment).size),
        "duration": float(np.sum(steps)),
        "sample_rate": float(steps.size / np.sum(steps)) if steps.size else None,
        "notes": list(notes),
    }


def identification(found: Identified, recording: Recording, notes: Sequence[str] = ()) -> dict:
    """An identification as plain data (schema `jaxfric.identification/1`)."""
    parameters = {
        name: {
            "value": float(estimate.value),
            "standard_error": float(estimate.standard_error),
            "unit": estimate.unit,
        }
        for name, estimate in found.parameters.items()
    }
    result = result_names()[int(found.result._value)]
    return {
        "schema": IDENTIFICATION,
        "recording": recording_facts(recording, notes),
        "model": found.model.to_dict(),
        "parameters": parameters,
        "projection": found.projection,
        "windows": int(found.windows),
        "covered": float(found.covered),
        "open_ends": open_ends(found),
        "result": result,
        "diagnosis": found.diagnosis,
        "force_error": float(found.force_error),
    }


def open_ends(found: Identified) -> dict[str, float]:
    """The bias that the whole record's unequal end velocities would leave, by parameter."""
    names = [parameter.name for parameter in found.model.term.affine]
    return dict(zip(names, map(float, found.open_ends), strict=True))


def to_json(document: Any) -> str:
    """JSON text; what is infinite or not a number becomes null, as JSON has neither."""
    return json.dumps(_finite(document), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
