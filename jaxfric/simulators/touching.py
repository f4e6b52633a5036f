"""Where a model's joints are at their limits, and where its bodies touch."""

from typing import Any

import numpy as np

from .inverse import Motion

# So many moments are looked at; a touch lasts longer than what lies between.
MOMENTS = 2000


def alone(mujoco: Any, model: Any) -> None:
    """Take contacts and limits out of a model's dynamics: how far one body is in another, by which
    MuJoCo says their force, is beyond any encoder.
    """
    flags = mujoco.mjtDisableBit
    model.opt.disableflags |= int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_LIMIT)


def at_limit(model: Any, joint: int, position: np.ndarray) -> np.ndarray:
    """Where a joint is at its limit or beyond, `(N,)`."""
    if not model.jnt_limited[joint]:
        return np.zeros(len(position), bool)
    low, high = model.jnt_range[joint] + np.array([1, -1]) * model.jnt_margin[joint]
    return (position <= low) | (position >= high)


def touching(mujoco: Any, model: Any, motion: Motion) -> np.ndarray:
    """Where bodies of the model touch, `(N,)`."""
    count = len(motion.position)
    found = np.zeros(count, bool)
    if not np.any((model.geom_contype != 0) & (model.geom_conaffinity != 0)):
        return found
    kept = int(model.opt.disableflags)
    model.opt.disableflags = kept & ~int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    data, step = mujoco.MjData(model), max(1, count // MOMENTS)
    for i in range(0, count, step):
        data.qpos[:] = motion.position[i]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        found[max(0, i - step) : i + step + 1] |= bool(data.ncon)
    model.opt.disableflags = kept
    return found
