"""MuJoCo's inverse dynamics along a recorded motion (MuJoCo reads MJCF and URDF)."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from .. import signals
from ..data.recording import Recording


class Mujoco:
    """The force that a MuJoCo model needs at one joint for a recorded motion.

    A function from a recording to that force, `(N,)`, for `explain` as a baseline. Velocity and
    acceleration are smoothing derivatives of the recorded positions, of the width that is best for
    the second one: what is faster than that, the simulator's force does not show.

    **Arguments:** `model`: a file (MJCF or URDF) or its text; `joint`: name of the joint that the
    recording is of, where there are several. The positions of the others are channels of the
    recording by their joints' names, in the model's own units, rad or m.

    **Raises:** `ValueError` for a model that MuJoCo cannot read, for free and ball joints, closed
    loops, and a joint or channel that is not there.
    """

    def __init__(self, model: str | Path, joint: str | None = None):
        self.mujoco = _library()
        self.model = _read(self.mujoco, model)
        self.joints = _joints(self.mujoco, self.model)
        if joint is None and len(self.joints) > 1:
            raise ValueError(
                f"The model has {len(self.joints)} joints: {', '.join(self.joints)}. Say which one "
                f"the recording is of: joint={self.joints[0]!r} (--joint {self.joints[0]})."
            )
        joint = self.joints[0] if joint is None else joint
        if joint not in self.joints:
            raise ValueError(
                f"The model has no joint {joint!r}. Its joints are {', '.join(self.joints)}."
            )
        self.joint = joint

    def __call__(self, recording: Recording) -> Float[np.ndarray, " N"]:
        """The generalised force at the joint, N or N·m, `(N,)`."""
        motion = np.array([self._along(recording, name) for name in self.joints])
        position, velocity, acceleration = np.moveaxis(motion, 0, -1)
        at, data = self.joints.index(self.joint), self.mujoco.MjData(self.model)
        force = np.empty(len(position))
        for i in range(len(position)):
            data.qpos[:], data.qvel[:], data.qacc[:] = position[i], velocity[i], acceleration[i]
            self.mujoco.mj_inverse(self.model, data)
            force[i] = data.qfrc_inverse[at]
        return force

    def _along(self, recording: Recording, joint: str):
        """Position, velocity and acceleration of a joint, each `(N,)`."""
        if joint != self.joint:
            if joint not in recording.channels:
                raise ValueError(
                    f"{recording.source or 'The recording'} lacks the position of the joint "
                    f"{joint!r}, which moves {self.joint!r} too. Name its column: --columns "
                    f"{joint}=NAME (channels={{{joint!r}: ...}})."
                )
            recording = dataclasses.replace(
                recording, position=recording.channels[joint], velocity=None
            )
        if recording.position is None:
            raise ValueError(
                f"{recording.source or 'The recording'} has no position, which a simulator needs. "
                "Name its column: --columns position=NAME."
            )
        choice = signals.choose(recording, order=2)
        position = np.asarray(recording.position, float)
        velocity = signals.derivative(recording, position, choice.half_width, choice.degree)
        acceleration = signals.derivative(recording, velocity, choice.half_width, choice.degree)
        return position, velocity, acceleration


def mujoco(model: str | Path, joint: str | None = None) -> Mujoco:
    """A MuJoCo model (MJCF or URDF) as a baseline of `explain`; see [`Mujoco`][]."""
    return Mujoco(model, joint)


def _library() -> Any:
    try:
        import mujoco
    except ImportError as error:
        raise ValueError(
            "MuJoCo is not installed, which a MuJoCo or URDF model needs. Install it: "
            'pip install "jaxfric[mujoco]".'
        ) from error
    return mujoco


def _read(mujoco: Any, model: str | Path) -> Any:
    text = str(model)
    try:
        if text.lstrip().startswith("<"):
            return mujoco.MjModel.from_xml_string(text)
        if not Path(text).is_file():
            raise ValueError(f"{text}: there is no such file.")
        return mujoco.MjModel.from_xml_path(text)
    except ValueError as error:
        name = "The model" if text.lstrip().startswith("<") else text
        message = str(error)
        raise ValueError(
            message if "no such file" in message else f"{name}: MuJoCo cannot read it: {message}"
        ) from error


def _joints(mujoco: Any, model: Any) -> list[str]:
    """The joints' names in the order of the generalised coordinates."""
    names = [model.joint(i).name or f"joint{i + 1}" for i in range(model.njnt)]
    single = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
    if wrong := [n for n, k in zip(names, model.jnt_type, strict=True) if int(k) not in single]:
        raise ValueError(
            f"The model's joint {wrong[0]} is free or a ball, whose position a log of an axis does "
            "not hold. Fix it in the model."
        )
    if model.neq:
        raise ValueError(
            "The model closes loops by equality constraints, whose forces no log tells. Open them."
        )
    if not names:
        raise ValueError("The model has no joint.")
    return names
