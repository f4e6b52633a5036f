"""Handing a model over to another program."""

import re

from ..models import Model
from . import c, modelica, mujoco, table, urdf
from .cost import Range
from .outcome import Exported

_EXACT = {"c": c.export, "modelica": modelica.export}
_RANGED = {"mujoco": mujoco.export, "urdf": urdf.export, "table": table.export}
TARGETS = ("c", "modelica", "mujoco", "urdf", "table")


def export(
    model: Model,
    target: str,
    name: str = "axis",
    speed: Range | None = None,
    position: Range | None = None,
) -> Exported:
    """The model as text for another program, with the force error that the form costs.

    **Arguments:** `target`, one of [`TARGETS`][]; `name`, of the functions, block or joint;
    `speed` and `position`, the ranges (lowest, highest), m/s and m, that mujoco, urdf and table
    are fitted and counted over, by default those that the model's parameters suggest
    ([`cost.speed_range`][], [`cost.natural`][]).

    **Raises:** `ValueError` for an unknown target, a term that it cannot express (mujoco and urdf
    leave such terms out instead and count them), a range that is none, or a model that is not
    fully identified. Not to be used inside jit: the result is text.
    """
    if target in _RANGED:
        if not re.fullmatch(r"\w+([.-]\w+)*", name):
            raise ValueError(
                f"{name!r} is no name for an axis: use letters, digits, _ . - (--name)."
            )
        return _RANGED[target](model, name, speed, position)
    if target not in _EXACT:
        raise ValueError(f"There is no target {target!r}; there are {', '.join(TARGETS)}.")
    if speed is not None or position is not None:
        raise ValueError(
            f"{target} is exact everywhere and takes no range: leave out --speed and --position."
        )
    return _EXACT[target](model, name)
