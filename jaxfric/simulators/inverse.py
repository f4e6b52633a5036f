"""MuJoCo's inverse dynamics along a motion, with the momentum apart."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from . import rigid


class Motion(NamedTuple):
    """Positions, velocities and accelerations of all joints, each `(N, dof)`."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class Along(NamedTuple):
    """What a model says along a motion, each `(N, dof)`, N or N·m.

    `force = rest + d/dt momentum`; `friction`: of `frictionloss` alone, by MuJoCo's soft
    constraint, as it resists; `frames` of the bodies, the first one's first.
    """

    force: np.ndarray
    rest: np.ndarray
    momentum: np.ndarray
    friction: np.ndarray
    motion: Motion
    frames: list[rigid.Frames]


def along(mujoco: Any, model: Any, motion: Motion) -> Along:
    """The model's inverse dynamics along a motion."""
    position, velocity, acceleration = motion
    force, inertial, bias, friction = np.empty((4, *position.shape))
    for i, data in enumerate(_moments(mujoco, model, motion)):
        force[i], bias[i], friction[i] = data.qfrc_inverse, data.qfrc_bias, -data.qfrc_constraint
        mujoco.mj_mulM(model, data, inertial[i], acceleration[i])
    frames = rigid.frames(mujoco, model, position, velocity)
    turned = sum_of_bodies(mujoco, model, frames)
    momentum = turned[1] + model.dof_armature * velocity
    # What the momentum's derivative holds beside M a is the bias less the rest: dM/dt v.
    rest = force - inertial - (bias - turned[0])
    return Along(force, rest, momentum, friction, motion, frames)


def forces(mujoco: Any, model: Any, motion: Motion) -> np.ndarray:
    """The inverse dynamics alone, `(N, dof)`."""
    found = np.empty(motion.position.shape)
    for i, data in enumerate(_moments(mujoco, model, motion)):
        found[i] = data.qfrc_inverse
    return found


def _moments(mujoco: Any, model: Any, motion: Motion) -> Iterator[Any]:
    """MuJoCo's data after its inverse dynamics, moment by moment."""
    data = mujoco.MjData(model)
    for position, velocity, acceleration in zip(*motion, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = position, velocity, acceleration
        mujoco.mj_inverse(model, data)
        yield data


def sum_of_bodies(mujoco: Any, model: Any, frames) -> tuple[np.ndarray, np.ndarray]:
    """Rest and momentum of all bodies, `(N, dof)` each."""
    found = np.zeros((2, model.nv, frames[0].velocity.shape[1]))
    for b, frame in enumerate(frames, 1):
        theta = rigid.about_origin(*weighed(mujoco, model, b))
        for joint in range(model.nv):
            found[:, joint] += theta @ np.array(rigid.regressor(frame, joint, model.opt.gravity))
    return found[0].T, found[1].T


def weighed(mujoco: Any, model: Any, body: int):
    """Mass, centre, principal inertias and their axes in the body's frame."""
    axes = np.zeros(9)
    mujoco.mju_quat2Mat(axes, model.body_iquat[body])
    return (
        float(model.body_mass[body]),
        np.array(model.body_ipos[body]),
        np.array(model.body_inertia[body]),
        axes.reshape(3, 3),
    )


def with_friction(mujoco: Any, model: Any, motion: Motion, joint: int, step: float) -> np.ndarray:
    """The friction of a joint with `frictionloss` larger by a step, `(N,)`."""
    kept = float(model.dof_frictionloss[joint])
    model.dof_frictionloss[joint] = kept + step
    found = np.array([-data.qfrc_constraint[joint] for data in _moments(mujoco, model, motion)])
    model.dof_frictionloss[joint] = kept
    return found
