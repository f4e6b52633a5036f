"""Pictures of an explanation by matplotlib, from its curves; the page has others that move."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..looks import drawing

# Coordinates drawn; those after them have less structure.
MAPS = 2


def there(curves: Mapping[str, Any]) -> list[str]:
    """The names of the pictures that there are curves for."""
    count = len(curves.get("map") or ())
    maps = ["where", *(f"where {i}" for i in range(2, count + 1))][:count]
    over_time = ["force", "residual"] * bool(curves.get("time"))
    rest = ["friction"] * bool(curves.get("friction")) + ["holdout"] * bool(curves.get("holdout"))
    return [*maps[:MAPS], *over_time, *rest, *maps[MAPS:]]


def grid(figure, count: int) -> np.ndarray:
    """So many axes on a figure, two beside each other."""
    if not count:
        return np.empty(0, object)
    panels = figure.subplots(-(-count // 2), min(2, count), squeeze=False).ravel()
    for axes in panels[count:]:
        axes.remove()
    return panels[:count]


def draw(curves: Mapping[str, Any], names: Sequence[str], panels: Sequence[Any]) -> None:
    """The pictures of these names, each on axes of its own.

    **Raises:** `ValueError` for a name that there are no curves for.
    """
    known = there(curves)
    for name, axes in zip(names, panels, strict=True):
        if name not in known:
            raise ValueError(f"No picture {name!r}; there are {', '.join(known) or 'none'}.")
        _draw(curves, name, axes)


def _draw(curves: Mapping[str, Any], name: str, axes: Any) -> None:
    units = {"force": "N", "position": "m"} | dict(curves.get("units") or {})
    force = units["force"]
    if name == "friction":
        drawing.curves(axes, curves["friction"], force, f"{units['position']}/s")
    elif name == "force":
        drawing.compared(axes, curves["time"], force)
    elif name == "residual":
        drawing.compared(axes, curves["time"], force, left=True)
    elif name == "holdout":
        drawing.compared(axes, curves["holdout"], force, left=True)
        axes.set_title("held-out recording", fontsize=10)
    else:
        number = int(name.partition(" ")[2] or 1)
        drawing.residual(axes, curves["map"][number - 1], force)
