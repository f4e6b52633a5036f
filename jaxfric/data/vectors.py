"""Columns that hold a vector in each row, as LeRobot's data sets do: one column for each joint.

LeRobot's Parquet (Cadene et al. 2024) has `observation.state`, the measured positions, `action`,
the commanded ones, and `timestamp`; what a vector's parts are called stands in `meta/info.json`.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

# What a feature of such a data set is, by the last word of its name.
ROLES = {"state": "position", "action": "reference", "qpos": "position", "qvel": "velocity"}
# How a part's name says what of a joint it is: `shoulder_pan.pos`.
PARTS = {
    "pos": "position", "vel": "velocity", "effort": "effort", "torque": "torque",
    "current": "current",
}  # fmt: skip
# A log of several runs: one number for each.
EPISODE = "episode_index"
ABOVE = 4


def spread(column: Any, name: str, path: Path) -> dict[str, np.ndarray]:
    """The parts of a column of vectors of one length by name; none where they are no numbers."""
    import pyarrow as pa

    kind = column.type
    lists = (pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list)
    if not any(is_list(kind) for is_list in lists) or column.null_count:
        return {}
    inner = kind.value_type
    if not (pa.types.is_floating(inner) or pa.types.is_integer(inner)):
        return {}
    rows = [np.asarray(row, float) for row in column.to_pylist()]
    if not rows or len({len(row) for row in rows}) > 1 or not len(rows[0]):
        return {}
    values = np.stack(rows)
    return dict(zip(names(name, values.shape[1], path), values.T, strict=True))


def names(feature: str, count: int, path: Path) -> list[str]:
    """What the parts of a feature are called: joint and role, or role and number."""
    last = feature.rsplit(".", 1)[-1]
    role = ROLES.get(last, last)
    parts = _said(feature, path)
    if len(parts) != count:
        return [f"{role}:{i + 1}" for i in range(count)]
    return [_named(part, role, wanted=last == "action") for part in parts]


def _named(part: str, role: str, wanted: bool) -> str:
    joint, _, tail = part.rpartition(".")
    if not joint or tail not in PARTS:
        return f"{part}/{role}"
    return f"{joint}/{role if wanted else PARTS[tail]}"


def _said(feature: str, path: Path) -> list[str]:
    """The names that the data set's description has for a feature's parts; none without one."""
    for folder in list(path.resolve().parents)[:ABOVE]:
        described = folder / "meta" / "info.json"
        if described.is_file():
            break
    else:
        return []
    try:
        whole = json.loads(described.read_text(encoding="utf-8"))
        found = whole["features"][feature]["names"]
    except (ValueError, KeyError, TypeError, OSError):
        return []
    if isinstance(found, Mapping):  # {"motors": [...]}
        found = next(iter(found.values()), [])
    return [str(name) for name in found] if isinstance(found, list) else []
