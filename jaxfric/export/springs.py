"""Springs of transmissions that a written file has and the given one had not."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..simulators.elastic import springs_of, tag
from ..simulators.loading import library, read
from ..simulators.patching import folder_of

# Radians of a swing in a step: MuJoCo's integrators leave a spring to the next step, by which it
# swings 4 % too fast at one radian, and without bound at two.
FASTEST = 1.0


class NewSpring(NamedTuple):
    """A spring in words, and why the file cannot hold it: empty where it can."""

    text: str
    why: str


def new_springs(given: str | Path, text: str) -> list[NewSpring]:
    """The springs of a text that the given file has not."""
    mujoco, folder = library(), folder_of(given)
    model, before = read(mujoco, text, folder), read(mujoco, given)
    known = {before.joint(joint).name for joint in springs_of(mujoco, before)}
    return [
        _told(mujoco, model, spring, motor)
        for spring, motor in springs_of(mujoco, model).items()
        if model.joint(spring).name not in known
    ]


def _told(mujoco: Any, model: Any, spring: int, motor: int) -> NewSpring:
    own, joint = tag(mujoco, model, spring), model.joint(motor).name
    why = _unable(mujoco, model, spring, motor)
    if why:
        why = (
            f"the spring of joint {joint}: {why}. What was found beside it holds only with it. By "
            f"hand: {own} behind that joint, in its body"
        )
    return NewSpring(f"joint/{joint}: behind it, in its body, {own}", why)


def _unable(mujoco: Any, model: Any, spring: int, motor: int) -> str:
    """Why MuJoCo cannot run a motor on a spring."""
    rotor = float(model.dof_armature[motor])
    if rotor <= 0:
        return (
            "its joint has no armature, and MuJoCo cannot move a motor without inertia. Give the "
            "joint that of its rotor, times the square of the gear ratio"
        )
    data, mass = mujoco.MjData(model), np.zeros(model.nv)
    mujoco.mj_forward(model, data)
    mujoco.mj_mulM(model, data, mass, np.eye(model.nv)[spring])
    pace = np.sqrt(float(model.jnt_stiffness[spring]) * (1 / rotor + 1 / mass[spring]))
    if pace * model.opt.timestep > FASTEST:
        return f"it needs a timestep below {FASTEST / pace:.2g} s"
    return ""
