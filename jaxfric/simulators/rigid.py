"""A multibody model's rigid-body force along a motion, linear in what each body weighs and where.

For body b with mass m, first moment m c and inertia I about its frame's origin (body frame), with
the frame's Jacobians J_v, J_w and their rates, the generalised force is

    u_b = d/dt(J_vᵀ P + J_wᵀ H) − J̇_vᵀ P − J̇_wᵀ H + J_wᵀ (v × P) − J_vᵀ m g − J_wᵀ (r × g),

with r = R m c, P = m v + ω × r and H = R I Rᵀ ω + r × v (Lagrange; Khalil & Dombre 2002, ch. 9). No
acceleration enters: the time derivative is left to the kernel that the recorded force goes through.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

# Mass, first moment (x, y, z), inertia about the body's origin (xx, yy, zz, xy, xz, yz).
PARAMETERS = 10
_PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


class Frames(NamedTuple):
    """A body's frame along a motion: rotation `(3, 3, N)`, velocities `(3, N)`, Jacobians of the
    origin and of the rotation and their rates, each `(dof, 3, N)`.
    """

    rotation: np.ndarray
    velocity: np.ndarray
    spin: np.ndarray
    jacobians: tuple[np.ndarray, np.ndarray]
    rates: tuple[np.ndarray, np.ndarray]


def frames(mujoco: Any, model: Any, position: np.ndarray, velocity: np.ndarray) -> list[Frames]:
    """The frames of all bodies but the world along a motion, positions and velocities `(N, dof)`.

    By MuJoCo's kinematics; the rates of its Jacobians are exact.
    """
    data, count, dof = mujoco.MjData(model), len(position), model.nv
    bodies = range(1, model.nbody)
    rotation = np.empty((model.nbody, count, 3, 3))
    parts = np.zeros((model.nbody, count, 4, 3, dof))
    buffers = [np.zeros((3, dof)) for _ in range(4)]
    for i in range(count):
        data.qpos[:], data.qvel[:] = position[i], velocity[i]
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        for b in bodies:
            mujoco.mj_jac(model, data, buffers[0], buffers[1], data.xpos[b], b)
            mujoco.mj_jacDot(model, data, buffers[2], buffers[3], data.xpos[b], b)
            rotation[b, i] = data.xmat[b].reshape(3, 3)
            parts[b, i] = buffers
    found = []
    for b in bodies:
        turned = np.ascontiguousarray(np.moveaxis(rotation[b], 0, -1))
        linear, turning, *rates = np.ascontiguousarray(parts[b].transpose(1, 3, 2, 0))
        moving, spin = (np.einsum("jin,nj->in", each, velocity) for each in (linear, turning))
        found.append(Frames(turned, moving, spin, (linear, turning), (rates[0], rates[1])))
    return found


def regressor(
    frame: Frames, joint: int, gravity: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, "10 N"], Float[np.ndarray, "10 N"]]:
    """Rest and momentum of a joint's force by each of the ten inertial parameters of a body.

    The force above for one parameter at a time. What r is multiplied by is one vector for its three
    components: momentum r · (J_v × ω + v × J_w), and so on.
    """
    moving, spin = frame.velocity, frame.spin
    (by_move, by_turn), (move_rate, turn_rate) = (
        [each[joint] for each in pair] for pair in (frame.jacobians, frame.rates)
    )
    down = np.broadcast_to(gravity[:, None], moving.shape)

    def inside(vector: np.ndarray) -> np.ndarray:
        return np.einsum("ijn,in->jn", frame.rotation, vector)

    # About an origin that moves itself the angular momentum changes by v × P, too.
    across = _cross(by_turn, moving)
    rest = _cross(across, spin) - _cross(move_rate, spin) + _cross(turn_rate, moving)
    rest = [-_dot(move_rate, moving) - _dot(by_move, down), *inside(rest + _cross(by_turn, down))]
    momentum = [_dot(by_move, moving), *inside(_cross(by_move, spin) - across)]
    turn, turned, rate = inside(by_turn), inside(spin), inside(turn_rate)
    for i, j in _PAIRS:
        rest.append(-rate[i] * turned[j] - (rate[j] * turned[i] if i != j else 0.0))
        momentum.append(turn[i] * turned[j] + (turn[j] * turned[i] if i != j else 0.0))
    return np.array(rest), np.array(momentum)


def _dot(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    return np.einsum("in,in->n", one, other)


def _cross(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Of vectors `(3, N)`; numpy's own is slow on the first axis."""
    (a, b, c), (x, y, z) = one, other
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])


def about_origin(
    mass: float, centre: np.ndarray, principal: np.ndarray, axes: np.ndarray
) -> Float[np.ndarray, "10"]:
    """The ten parameters of a body from its mass, centre, and principal inertias about it."""
    inertia = axes @ np.diag(principal) @ axes.T
    inertia = inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    return np.array([mass, *(mass * centre), *(inertia[i, j] for i, j in _PAIRS)])


def slopes(
    mass: float, centre: np.ndarray, principal: np.ndarray, axes: np.ndarray
) -> dict[str, Float[np.ndarray, "10"]]:
    """The derivatives of the ten parameters by mass (its shape kept), centre and inertias."""
    whole = about_origin(mass, centre, principal, axes)
    found = {"mass": whole / mass}
    for k, name in enumerate("xyz"):
        step = np.eye(3)[k]
        shift = 2 * centre[k] * np.eye(3) - np.outer(step, centre) - np.outer(centre, step)
        found[f"centre_{name}"] = np.array(
            [0.0, *(mass * step), *(mass * shift[i, j] for i, j in _PAIRS)]
        )
    for k, name in enumerate("xyz"):
        alone = np.outer(axes[:, k], axes[:, k])
        found[f"inertia_{name}"] = np.array([0.0, 0, 0, 0, *(alone[i, j] for i, j in _PAIRS)])
    return found
