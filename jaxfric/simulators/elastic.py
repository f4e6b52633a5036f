"""Joints whose transmission gives: a spring between motor and link, which no encoder sees.

In a model it is a second joint of the same body, on the same axis and behind the motor's, with a
stiffness and no actuator. The encoder and all that the motor's joint has of its own (armature,
damping, friction) are on the motor; the link is where both joints together turn it. How far the
spring is bent follows from its own equation along the motion of all motors.
"""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from .. import signals
from ..checks import LINEARITY
from ..data.recording import Recording
from . import inverse
from .inverse import Motion
from .loading import read
from .patching import text_of
from .swing import Swing, swing
from .tags import bodies, edited, number, tags

# What the name of a spring's joint ends in.
ENDING = "_elastic"
# Of a link's inertia, what is none.
TINY = 1e-6
# Steps of Newton's method for the spring's equation, which is all but linear.
STEPS = 4
# Of the load, what the equation is off where the steps end; beyond all that a sensor tells.
CONVERGED = 1e-6
# What a spring did before the recording is gone after so many of its time constants, but for what
# no sensor of force resolves; of a recording at most so much is given up for it.
FORGOTTEN, MOST = float(np.log(1 / LINEARITY)), 0.25
# Of a position, m or rad, and of a speed: steps of numerical derivatives.
STEP = 1e-4


def springs_of(mujoco: Any, model: Any) -> dict[int, int]:
    """The numbers of the joints that are springs of a transmission, each with its motor's."""
    kind = int(mujoco.mjtTrn.mjTRN_JOINT)
    driven = {
        int(model.actuator_trnid[i, 0])
        for i in range(model.nu)
        if int(model.actuator_trntype[i]) == kind
    }
    found = {}
    for joint in range(1, model.njnt):
        motor = joint - 1
        same = (
            model.jnt_bodyid[joint] == model.jnt_bodyid[motor]
            and model.jnt_type[joint] == model.jnt_type[motor]
            and np.allclose(model.jnt_axis[joint], model.jnt_axis[motor])
            and np.allclose(model.jnt_pos[joint], model.jnt_pos[motor])
        )
        if same and joint not in driven and model.jnt_stiffness[joint] > 0:
            found[joint] = motor
    return found


def logged(mujoco: Any, model: Any, names: Sequence[str]) -> list[str]:
    """The joints that have an encoder: all but springs."""
    springs = springs_of(mujoco, model)
    return [name for i, name in enumerate(names) if i not in springs]


def with_spring(
    mujoco: Any, text: str, joint: int, stiffness: float, damping: float, folder: Path | None
) -> str:
    """The text of a model with a spring in the transmission of a joint, N·m/rad and N·m·s/rad.

    **Raises:** `ValueError` where the file does not write the joint out in a tag of its own, or
    MuJoCo reads another spring than was meant.
    """
    model = read(mujoco, text, folder)
    found = tags(text)
    tree = bodies(found)
    if len(tree.bodies) != model.nbody - 1 or len(tree.joints) != model.njnt:
        raise ValueError(
            "its bodies are not all written out in this file (include, replicate, attach)"
        )
    own = found[tree.joints[joint]]
    name = f"{model.joint(joint).name or f'joint{joint + 1}'}{ENDING}"
    kept = {k: own.attributes[k] for k in ("class", "type", "axis", "pos") if k in own.attributes}
    # A motor without inertia on a spring would leave MuJoCo a singular mass matrix.
    inertia = 0.0 if model.dof_armature[joint] > 0 else TINY * float(model.dof_M0[joint])
    values = kept | {
        "name": name, "stiffness": number(stiffness), "damping": number(damping),
        "springref": "0", "ref": "0", "armature": number(inertia), "frictionloss": "0",
        "limited": "false",
    }  # fmt: skip
    inner = " ".join(f'{key}="{value}"' for key, value in values.items())
    new = edited(text, {}, {}, after={tree.joints[joint]: f"<joint {inner}/>"})
    there = read(mujoco, new, folder)
    same = springs_of(mujoco, there).get(joint + 1) == joint
    read_back = there.jnt_stiffness[joint + 1], there.dof_damping[joint + 1]
    if not (same and np.allclose(read_back, (stiffness, damping), rtol=1e-5)):
        raise ValueError("MuJoCo reads another spring than was meant")
    return new


def taking(mujoco: Any, source: str | Path, folder: Path | None) -> tuple[str, str]:
    """The text of a model that a spring can be put into, and why that is not its own, or nothing.

    Where the file does not write its joints out it is MuJoCo's own translation.
    """
    text = text_of(mujoco, source)
    model = read(mujoco, text, folder)
    try:
        springs = springs_of(mujoco, model)
        for joint in {*range(model.njnt)} - {*springs, *springs.values()}:
            with_spring(mujoco, text, joint, 1.0, 0.0, folder)
    except ValueError as error:
        spec = mujoco.MjSpec.from_string(text)
        if folder is not None:
            spec.modelfiledir = str(folder)
        spec.compile()
        return spec.to_xml(), str(error)
    return text, ""


def tag(mujoco: Any, model: Any, joint: int) -> str:
    """A spring as the file has it, but for its axis, which is that of its motor's joint."""
    stiffness, damping = float(model.jnt_stiffness[joint]), float(model.dof_damping[joint])
    return (
        f'<joint name="{model.joint(joint).name}" stiffness="{number(stiffness)}" '
        f'damping="{number(damping)}"/>'
    )


class Linear(NamedTuple):
    """A model about a motion of all joints: its forces `(N, dof)`, and their derivatives by the
    acceleration, speed and position of one of them, `(N, dof)` each.
    """

    force: np.ndarray
    by_acceleration: np.ndarray
    by_speed: np.ndarray
    by_place: np.ndarray


def linear(mujoco: Any, model: Any, motion: Motion, joint: int) -> Linear:
    """A model's forces about a motion, to first order in the motion of one joint."""
    force = inverse.forces(mujoco, model, motion)
    shift = np.zeros(motion.position.shape[1])
    shift[joint] = 1.0
    steps = (
        motion._replace(acceleration=motion.acceleration + shift),
        motion._replace(velocity=motion.velocity + STEP * shift),
        motion._replace(position=motion.position + STEP * shift),
    )
    moved = [inverse.forces(mujoco, model, each) - force for each in steps]
    return Linear(force, moved[0], moved[1] / STEP, moved[2] / STEP)


def begins(recording: Recording) -> np.ndarray:
    """Samples before which nothing is known of the motion, `(N,)`."""
    interval = float(np.median(np.diff(np.asarray(recording.time, float))))
    return np.pad(~signals.host_continuous(recording, interval), (1, 0), constant_values=True)


def deflected(mujoco: Any, model: Any, motion: Motion, recording: Recording) -> Motion:
    """The motion of all joints with that of the springs, whose columns are zero yet.

    **Arguments:** `recording`, whose time and segments the motion is of.
    """
    time, first = np.asarray(recording.time, float), begins(recording)
    springs, about = springs_of(mujoco, model), dict[int, Linear]()
    for _ in range(STEPS):
        off = 0.0
        for joint in springs:
            if joint not in about:
                about[joint] = linear(mujoco, model, motion, joint)
                size = np.sqrt(np.mean(about[joint].force[:, joint] ** 2))
            load = inverse.forces(mujoco, model, motion)[:, joint]
            off = max(off, float(np.sqrt(np.mean(load**2)) / max(size, 1e-300)))
            own = about[joint]
            parts = (own.by_acceleration, own.by_speed, own.by_place)
            more = _swing()(time, first, *(part[:, joint] for part in parts), -load)
            motion = _moved(motion, joint, more)
        if off < CONVERGED:
            break
    return motion


def ringing(mujoco: Any, model: Any, recording: Recording) -> np.ndarray:
    """Where a spring may still swing by what was before the recording, or a piece of it, `(N,)`."""
    time, first = np.asarray(recording.time, float), begins(recording)
    found, data = np.zeros(len(time), bool), mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    mass, one = np.zeros(model.nv), np.zeros(model.nv)
    since = time - time[np.maximum.accumulate(np.where(first, np.arange(len(time)), 0))]
    for joint in springs_of(mujoco, model):
        one[:] = 0.0
        one[joint] = 1.0
        mujoco.mj_mulM(model, data, mass, one)
        rate = 0.5 * model.dof_damping[joint] / mass[joint]
        long = FORGOTTEN / rate if rate > 0 else np.inf
        found |= since < min(long, MOST * (time[-1] - time[0]) / np.count_nonzero(first))
    return found


def _moved(motion: Motion, joint: int, more: Swing) -> Motion:
    """A motion with more of one joint."""
    parts = []
    for part, each in zip(motion, more, strict=True):
        whole = part.copy()
        whole[:, joint] += np.asarray(each)
        parts.append(whole)
    return Motion(*parts)


@cache
def _swing():
    """The law of motion, compiled, in double precision."""
    compiled = jax.jit(swing)

    def run(*arguments):
        with jax.enable_x64(True):
            return compiled(*arguments)

    return run
