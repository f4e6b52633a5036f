"""Handing a model over to another program."""

import re

import numpy as np

from ..models import Model, require
from . import c, cost, fmu, modelica, mujoco, st, table, urdf
from .cost import Range
from .outcome import Exported
from .parts import divisors

_EXACT = {"c": c.export, "modelica": modelica.export, "st": st.export, "fmu": fmu.export}
_RANGED = {"mujoco": mujoco.export, "urdf": urdf.export, "table": table.export}
TARGETS = ("c", "st", "modelica", "fmu", "mujoco", "urdf", "table")


def export(
    model: Model,
    target: str,
    name: str = "axis",
    speed: Range | None = None,
    position: Range | None = None,
) -> Exported:
    """The model as text for another program, with the force error that the form costs.

    **Arguments:** `target`, one of `jaxfric.export.TARGETS`; `name`, of the functions, block or
    joint; `speed` and `position`, the ranges (lowest, highest), m/s and m, that mujoco, urdf and
    table are fitted and counted over, by default those that the model's parameters suggest
    (`export/cost.py`).

    **Raises:** `ValueError` for an unknown target, a term that it cannot express (mujoco and urdf
    leave such terms out instead and count them), a range that is none, or a model that is not
    fully identified. Not to be used inside jit: the result is text.
    """
    require(model, "export")
    found = _written(model, target, name, speed, position)
    return found._replace(remarks=(*driven(model), *_bristled(model), *found.remarks))


def _bristled(model: Model) -> tuple[str, ...]:
    """That the bristles of a model stay behind: a target has the slip friction that they end in."""
    if model.bristles is None:
        return ()
    stiffness, damping = map(float, model.bristles)
    return (
        f"Not written: the bristles of presliding, stiffness {stiffness:.4g} and damping "
        f"{damping:.3g}. The friction here jumps at rest instead.",
    )


def driven(model: Model) -> tuple[str, ...]:
    """What no passive axis does: an inertia below zero, friction that drives instead of braking.

    Half the difference of the friction forward and backward counts: a constant load cancels.
    """
    remarks = []
    inertia = model.parameters.get("inertia")
    if inertia is not None and float(inertia) < 0:
        remarks.append(f"Warning: the inertia is negative, {float(inertia):.4g}.")
    speeds = np.linspace(0, 1, 129)[1:] * cost.speed_range(model)[1]
    both = np.asarray(model.friction(np.concatenate([speeds, -speeds])))
    if np.min(0.5 * (both[:128] - both[128:])) < 0:
        remarks.append(
            "Warning: at some speeds the friction is negative and drives the axis: feed-forward "
            "with it is unsafe. Was the force's sign right, and the identification successful?"
        )
    return tuple(remarks)


def _written(model: Model, target: str, name: str, speed, position) -> Exported:
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
    if zero := divisors(model):
        raise ValueError(
            f"{', '.join(zero)} is 0, and the force divides by it: identify anew, or leave out "
            "the term."
        )
    return _EXACT[target](model, name)
