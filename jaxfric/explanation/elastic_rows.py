"""The rows of all joints of a robot, and what a spring in one transmission adds to them.

Behind a spring of stiffness k and damping c the link of a joint is turned by x more than its motor:
s ẍ + (d + c) ẋ + (g + k) x = −f, with the force f that the link needs where the motor is, and its
derivatives by the link's acceleration, speed and position. All joints feel s_i ẍ + d_i ẋ + g_i x.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .. import programs
from ..identification.refine import refine
from ..simulators.swing import swing
from ..terms import KNOWN_FORCE
from .acceptance import LINEARITY
from .joint_rows import JointRows
from .least_squares import orthonormal
from .nodes import stride

# Damping ratios: of bare steel, and of what creeps.
DAMPINGS = (0.003, 1.0)


class Kernel(NamedTuple):
    """By row: which joint's, the nodes that it is made of, their weights, 1 and 1/s, and one over
    its noise.
    """

    number: Any
    index: Any
    average: Any
    slope: Any
    weight: Any


class RobotRows(NamedTuple):
    """All joints' rows one below the other, divided by their noise.

    - `target` `(J,)`: what the simulator leaves; `table` `(J, P)`: what each number of a
      joint, of gravity and of bodies adds, and a little lateness of each force.
    - `own`: the names of the numbers of joints, the first of the P; `shared`: which are of gravity
      and of bodies, but for products of both; `block` of each row; `kernel`.
    """

    joints: tuple[JointRows, ...]
    target: np.ndarray
    table: np.ndarray
    own: tuple[tuple[str, str], ...]
    shared: slice
    block: np.ndarray
    kernel: Kernel


class Nodes(NamedTuple):
    """A spring's link at the nodes: `time` and where it `begins`, `(M,)`; the `load` f, `(M,)`; its
    derivatives s, d, g, `(3, M)`, and those of all joints' forces, `(3, n, M)`; the rate of s_i.
    """

    time: Any
    begins: Any
    load: Any
    own: Any
    every: Any
    rate: Any


class Box(NamedTuple):
    """What a spring can be: the least and the largest stiffness, and the link's inertia."""

    low: Any
    high: Any
    inertia: Any

    def spring(self, place: Float[Array, "2"]) -> tuple[Any, Any]:
        """Stiffness and damping at a place in the unit square."""
        stiffness = self.low * (self.high / self.low) ** place[0]
        ratio = DAMPINGS[0] * (DAMPINGS[1] / DAMPINGS[0]) ** place[1]
        return stiffness, 2 * ratio * jnp.sqrt(stiffness * self.inertia)


def robot_rows(joints: Sequence[JointRows]) -> RobotRows:
    """The rows of all joints side by side, through kernels of one width."""
    own = np.cumsum([0, *(len(each.own) for each in joints)])
    shared = joints[0].columns.shape[1] - len(joints[0].own)
    # Three of gravity, then ten of each body and twelve of its products with gravity.
    single = 3 + 10 * ((shared - 3) // 22)
    targets, tables, blocks, kernels, first = [], [], [], [], 0
    for k, rows in enumerate(joints):
        seen = rows.evidence
        assert seen is not None  # the rows are of a recording
        basis = orthonormal(rows.columns)
        noise = _noise(rows.target - basis @ (basis.T @ rows.target)) * rows.noise
        noise = max(noise, LINEARITY * float(np.sqrt(np.mean(seen.force**2))), 1e-300)
        table = np.zeros((len(rows.target), own[-1] + shared + len(joints)))
        table[:, own[k] : own[k + 1]] = rows.columns[:, : len(rows.own)] * rows.noise
        table[:, own[-1] : own[-1] + shared] = rows.columns[:, len(rows.own) :] * rows.noise
        known = np.asarray(seen.motion.channels[KNOWN_FORCE], float)
        table[:, own[-1] + shared + k] = seen.project(np.zeros_like(known), known)
        targets.append(rows.target * rows.noise / noise)
        tables.append(table / noise)
        blocks.append(rows.block + first)
        first += int(rows.block[-1]) + 1
        at = seen.rows[:, None] * stride(seen.half) + np.arange(2 * seen.half + 1)[None, :]
        count = np.ones(len(at))
        kernels.append((k * count.astype(int), at, seen.average[seen.rows], seen.slope[seen.rows],
                        count / noise))  # fmt: skip
    parts = (np.concatenate(part) for part in zip(*kernels, strict=True))
    return RobotRows(
        tuple(joints), np.concatenate(targets), np.concatenate(tables),
        tuple((each.name, name) for each in joints for name in each.own),
        slice(int(own[-1]), int(own[-1]) + single), np.concatenate(blocks), Kernel(*parts),
    )  # fmt: skip


def _noise(left: np.ndarray) -> float:
    """By the median difference of neighbours, which structure hardly touches."""
    return float(np.median(np.abs(np.diff(left)))) / 0.6745 / np.sqrt(2)


def spring_rows(kernel: Kernel, nodes: Nodes, stiffness, damping, load, start=(0.0, 0.0)):
    """What a spring adds to the rows of all joints, `(J,)`, in units of their noise."""
    s, d, g = nodes.own
    more = swing(nodes.time, nodes.begins, s, d + damping, g + stiffness, -load, start)
    by_acceleration, by_speed, by_place = nodes.every
    place, speed = more.place[None], more.speed[None]
    plain = (by_speed - nodes.rate) * speed + by_place * place
    momentum, at = by_acceleration * speed, (kernel.number[:, None], kernel.index)
    found = jnp.sum(plain[at] * kernel.average + momentum[at] * kernel.slope, axis=1)
    return kernel.weight * found


# What was before the recording: bent, and moving.
STARTS = ((1.0, 0.0), (0.0, 1.0))


def left_by(place, box: Box, kernel: Kernel, nodes: Nodes, target, basis):
    """What a spring leaves of the rows and of what is known beforehand, `(J + P,)`, beside all that
    is linear and what it did before the recording.
    """
    stiffness, damping = box.spring(place)
    force = spring_rows(kernel, nodes, stiffness, damping, nodes.load)
    still = jnp.zeros_like(nodes.load)
    before = jnp.stack(
        [spring_rows(kernel, nodes, stiffness, damping, still, start) for start in STARTS], axis=1
    )
    every = jnp.concatenate([-force[:, None], before], axis=1)
    every = jnp.pad(every, ((0, len(target) - len(force)), (0, 0)))
    every = every.at[:, 0].add(target)
    every = every - basis @ (basis.T @ every)
    left, before = every[:, 0], every[:, 1:]
    before = before / (jnp.sqrt(jnp.sum(before**2, axis=0, keepdims=True)) + 1e-300)
    gram = before.T @ before + 1e-9 * jnp.eye(len(STARTS))
    return left - before @ jnp.linalg.solve(gram, before.T @ left)


@programs.compiled
def energies(places, box: Box, kernel: Kernel, nodes: Nodes, target, basis):
    """What springs at many places leave, in units of the noise's energy, `(G,)`."""

    def energy(place):
        return jnp.sum(left_by(place, box, kernel, nodes, target, basis) ** 2)

    return jax.lax.map(energy, places, batch_size=8)


@programs.compiled
def refined(place, cell, box: Box, kernel: Kernel, nodes: Nodes, target, basis):
    """The best spring near a place, what it leaves, and the derivatives of that by the place."""

    def left(place):
        return left_by(place, box, kernel, nodes, target, basis)

    best, _ = refine(left, place, cell)
    return best, left(best), jax.jacfwd(left)(best)


@programs.compiled
def responses(place, box: Box, kernel: Kernel, nodes: Nodes, loads):
    """What a spring adds by further loads, `(L, M)` to `(J, L)`."""
    stiffness, damping = box.spring(place)

    def response(load):
        return spring_rows(kernel, nodes, stiffness, damping, load)

    return jax.lax.map(response, loads, batch_size=8).T
