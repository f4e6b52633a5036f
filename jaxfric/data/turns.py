"""Encoder counts to angles, where the counts of a revolution are stated."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..units import TURNS
from .roles import MEASURED, describe, stated_unit, words_of
from .spellings import unit_of


def counted(
    table: Mapping[str, Any], columns: Mapping[str, str | None] | None
) -> dict[str, str | None]:
    """The `columns` that the user names and, where none is a position, the one of `table` that is
    called by its unit alone, `counts` or `motor_ticks`, and does not merely number the rows.
    """
    given = dict(columns or {})
    if "position" in given or any(describe(name)[0] == "position" for name in table):
        return given
    found = [name for name in table if name not in given.values() and _is_counts(name)]
    found = [name for name in found if not _numbers_rows(table[name])]
    return given | {"position": found[0]} if len(found) == 1 else given


def _is_counts(name: str) -> bool:
    words = [word for word in words_of(name) if word not in MEASURED]
    return unit_of("_".join(words), "position") == "counts"


def _numbers_rows(column: Any) -> bool:
    column = np.asarray(column)
    return column.dtype.kind in "iuf" and bool(np.all(np.diff(column.astype(np.float64)) == 1))


def angles(
    chosen: Mapping[str, str],
    scale: Mapping[str, float],
    units: Mapping[str, str],
    counts: float,
    source: str,
) -> tuple[dict[str, float], dict[str, str]]:
    """The scales and the units under which a position in counts is an angle.

    **Arguments:** `chosen`, role to column name; `scale` and `units`, as the user gives them:
    `position=rev` or `deg` there asks for that unit instead of radians; `counts`, those of one
    revolution of what the position is of; `source`, for messages.

    A velocity without a stated unit is in counts/s, as the position is in counts.

    **Raises:** `ValueError` for a number that is none of counts, a unit that is no angle, a scale
    beside the counts, and a column that states another unit than counts.
    """
    if not (math.isfinite(counts) and counts > 0):
        raise ValueError(f"{source}: {counts} counts per revolution; give a number over zero.")
    unit = units.get("position", "rad")
    if unit not in TURNS:
        raise ValueError(
            f"{source}: counts per revolution make an angle, which {unit} is not. Name "
            f"{', '.join(TURNS)} (--units position=rev), or use --scale."
        )
    found = dict(scale)
    turning = [role for role in ("position", "reference", "velocity") if role in chosen]
    for role in turning:
        stated = stated_unit(chosen[role], role)
        if role == "velocity" and (role in scale or stated == f"{unit}/s"):
            continue  # as the user says, or in the right unit as it is
        if role in scale:
            raise ValueError(
                f"{source}: the {role} has a scale and counts per revolution; give one of them."
            )
        if stated not in (None, "counts", "counts/s"):
            raise ValueError(
                f"{source}: the column {chosen[role]!r} is in {stated}, not in counts. Leave "
                f"--counts-per-rev away, or name another column: --columns {role}=NAME."
            )
        found[role] = TURNS[unit] / counts
    if not turning:
        raise ValueError(f"{source}: no position is read that could be in counts.")
    return found, dict(units) | {"position": unit}
