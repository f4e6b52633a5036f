"""What other zeros of the encoders, and another gravity, add to the forces of a robot's joints."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...data.recording import Recording
from ...simulators import Mujoco
from ...simulators.weights import GRAVITY, by_gravity as pulls
from .rows import Part, Rows, nodes

# A step of an angle, rad or m in parts of the motion, for the derivative by the zero.
STEP = 1e-3
# Forces are asked of the simulator at so many moments; between them the difference is smooth.
MOMENTS = 2000

Change = Callable[[Rows], np.ndarray]
# By joint whose force it is, and by name of what differs.
Changes = Mapping[str, Mapping[str, Change]]


def by_gravity(parts: Sequence[Part]) -> Changes:
    """By joint whose force it is, and by axis: the force at the nodes by a unit of gravity."""
    found: dict[str, dict[str, Change]] = {}
    for part in parts:
        simulator = part.simulator
        if not isinstance(simulator, Mujoco):
            continue
        seen, time = simulator.along(part.recording), np.asarray(part.recording.time, float)
        forces = pulls(simulator.mujoco, simulator.model, simulator.number, seen)
        found[part.name] = {
            name: lambda rows, time=time, force=force: np.interp(nodes(rows), time, force)
            for name, force in zip(GRAVITY, forces, strict=True)
        }
    return found


def by_zero(parts: Sequence[Part], zeros: Mapping[str, float]) -> Changes:
    """By joint whose force it is, and by joint whose zero: the force's derivative at the nodes."""
    found: dict[str, dict[str, Change]] = {}
    for part in parts:
        simulator = part.simulator
        if not isinstance(simulator, Mujoco):
            continue
        found[part.name] = {
            joint: differences(simulator, part.recording, zeros, joint)
            for joint in simulator.recorded
        }
    return found


def differences(
    simulator: Mujoco, recording: Recording, zeros: Mapping[str, float], joint: str | None = None
) -> Change:
    """The change of the force by all zeros; its derivative by that of one joint."""
    time = np.asarray(recording.time, float)
    index = np.arange(0, len(time), max(1, len(time) // MOMENTS))
    before = dict(zeros) if joint else {}
    step = STEP if joint else 1.0
    after = before | {joint: before.get(joint, 0.0) + step} if joint else dict(zeros)
    first, second = (simulator.moved(recording, each, index) for each in (before, after))
    change = (second - first) / step

    def at(rows: Rows) -> np.ndarray:
        return np.interp(nodes(rows), time[index], change)

    return at
