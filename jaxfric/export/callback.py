"""Python that adds to a MuJoCo simulation what its joints have no attribute for."""

from collections.abc import Sequence
from pathlib import Path
from textwrap import indent

import jax.numpy as jnp
import numpy as np

from ..models import Model
from ..terms.base import Sum
from .parts import Line, Part, lines, parts, stated
from .syntax import PYTHON, identifier, literal

# What MuJoCo knows at the moment at which it asks for passive forces.
PRESENT = frozenset({"position", "velocity", "time"})
# Below this part of the usual speed a sign is no step: an explicit force would chatter.
SLOW = 1e-3


def able(part: Part) -> bool:
    """Whether the motion at one moment, without its acceleration, says a part's force."""
    return part.sampled and part.term.coordinates <= PRESENT and not part.term.inertial


def callback(models: dict[str, Model], speeds: dict[str, float], file: str) -> str:
    """The text of a module with `install(mujoco)` for the terms of each joint, all of them able.

    **Arguments:** `models` by the joint's name; `speeds`, the usual speed of each joint; `file`,
    the module's name.
    """
    bodies = [_joint(name, model, speeds[name]) for name, model in models.items()]
    names = ", ".join(f'"{name}": force_{identifier(name)}' for name in models)
    model_file = f"{Path(file).stem.removesuffix('_forces')}.xml"
    return f'''"""Forces for {model_file} that it has no attribute for.

Written by jaxfric. Use it beside the model:

    import mujoco, {Path(file).stem}
    model = mujoco.MjModel.from_xml_path("{model_file}")
    {Path(file).stem}.install(mujoco)
"""

import math

{"".join(bodies)}
FORCES = {{{names}}}


def passive(model, data):
    """For mjcb_passive: what each joint resists with is taken off its force."""
    for name, force in FORCES.items():
        joint = model.joint(name)
        at, place = int(joint.dofadr[0]), int(joint.qposadr[0])
        data.qfrc_passive[at] -= force(data.qpos[place], data.qvel[at], data.time)


def install(mujoco):
    """Have MuJoCo add these forces from now on; mujoco.set_mjcb_passive(None) ends it."""
    mujoco.set_mjcb_passive(passive)
'''


def _joint(name: str, model: Model, speed: float) -> str:
    every = parts(model)
    inner = "".join(_statements(part) for part in every)
    rows = "".join(
        f"    {identifier(key)} = {literal(float(value))}\n"
        for key, value in model.parameters.items()
    )
    slow = literal(SLOW * speed)
    return f'''
def force_{identifier(name)}(x, v, t):
    """N or N·m at the joint {name}: {", ".join(part.name for part in every)}."""

    def sign_of(value):  # no step, for an explicit force would chatter
        return math.tanh(value / {slow})

{rows}    u = 0.0
{inner}    return u

'''


def _statements(part: Part) -> str:
    def added(line: Line) -> str:
        return f"u += {identifier(line.parameter)} * {line.column}\n"

    return indent(stated(lines(PYTHON, part), added, "if v {} 0.0:\n", ""), "    ")


def told(model: Model) -> tuple[list[Part], list[Part]]:
    """The parts of a model that a callback takes, and the others."""
    every = [part for part in parts(model) if part.affine]
    return [p for p in every if able(p)], [p for p in every if not able(p)]


def only(model: Model, chosen: Sequence[Part]) -> Model:
    """The model with those of its parts alone."""
    values = model.parameters
    term = Sum(tuple(part.term for part in chosen))
    alpha = np.array([float(values[name]) for part in chosen for name in part.affine])
    return Model(term, jnp.asarray(alpha), model.units)
