"""A spring that is tried in the transmission of one joint, on the rows of all joints."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..identification.uncertainty import Estimate
from ..simulators import Mujoco, elastic
from ..simulators.inverse import Motion
from ..simulators.loading import is_hinge
from ..simulators.weights import by_gravity, linear as by_weights, weights
from ..terms import KNOWN_FORCE, KNOWN_MASKED
from .agreement import Told
from .elastic_rows import (
    Box,
    Nodes,
    RobotRows,
    energies,
    refined,
    responses,
)
from .evidence import Evidence, gather, reduced
from .figures import cast
from .intervals import spread
from .least_squares import orthonormal
from .motion import Motion as Moved, motion_of
from .regression import Fit

# Stiffnesses of the grid, a factor of two or so apart, and places of damping ratios with each; the
# longest step of the refinement.
STIFFNESSES, RATIOS, CELL = 32, (0.35, 0.6, 0.85), (1 / 32, 0.25)
# Rounds in which the spring, and what the bodies weigh that bend it, are fitted in turn.
ROUNDS = 3
# What no force tells is as drawn, by a part of a number's size: parts are made and weighed better.
TRUSTED = 0.05
# Periods of a swing in a record, and nodes in one, at least.
PERIODS, SAMPLED = 4.0, 4.0
STIFFNESS, DAMPING = "stiffness", "damping"


class Recorded(NamedTuple):
    """The robot's rows of one recording (0, or 1 for the held-out one), and what they leave of
    themselves if the simulator's values are free.
    """

    number: int
    rows: RobotRows
    width: int

    @property
    def least(self) -> np.ndarray:
        """By row."""
        basis = orthonormal(self.rows.table)
        return self.rows.target - basis @ (basis.T @ self.rows.target)


class Fitted(NamedTuple):
    """A spring on the rows of a recording: its `place` in its box, what it leaves by row, and the
    derivatives of that by the place; then the same of what is known of the values beforehand.
    """

    place: np.ndarray
    left: np.ndarray
    slopes: np.ndarray

    @property
    def energy(self) -> float:
        """In units of the noise's."""
        return float(self.left @ self.left)


class Trial:
    """A spring that is tried in the transmission of one joint."""

    def __init__(self, told: Sequence[Told], source: str, folder: Path | None, joint: str):
        self.told, self.joint = told, joint
        first = told[0].simulator
        self.number = first.joints.index(joint)
        text = elastic.with_spring(first.mujoco, source, self.number, 1.0, 0.0, folder)
        self.with_spring = Mujoco(text, joint, folder, zeros=first.zeros)
        self.with_spring.model.jnt_stiffness[self.number + 1] = 0.0
        self.known: dict[int, tuple[Nodes, Box, np.ndarray]] = {}

    def nodes(self, there: Recorded) -> tuple[Nodes, Box, np.ndarray]:
        """The link at the nodes, what the spring can be, and the loads by gravity and bodies."""
        if there.number not in self.known:
            self.known[there.number] = self._nodes(there)
        return self.known[there.number]

    def _nodes(self, there: Recorded) -> tuple[Nodes, Box, np.ndarray]:
        first, log = self.told[0].simulator, self.told[0].logs[there.number]
        seen, link = first.along(log), self.number + 1
        motion = Motion(*(np.insert(part, link, 0.0, axis=1) for part in seen.motion))
        about = elastic.linear(first.mujoco, self.with_spring.model, motion, link)
        dofs = [self.with_spring.joints.index(each.simulator.joint) for each in self.told]
        evidence, moved = self._evidence(there)
        series = [about.force[:, link], *(part[:, link] for part in about[1:])]
        series += [part[:, dof] for part in about[1:] for dof in dofs]
        of = first.mujoco, first.model, self.number, seen
        parts = [(rest, np.zeros_like(rest)) for rest in by_gravity(*of)] + by_weights(*of)
        still = np.zeros_like(series[0])
        (load, *own), every = np.split(
            reduced(moved, evidence, [(each, still) for each in series])[0], [4]
        )
        every = every.reshape(3, len(dofs), -1)
        time = _steady(np.asarray(evidence.motion.time, float), evidence.nodes)
        begins = np.diff(np.asarray(evidence.motion.segment), prepend=-1) != 0
        rate = np.gradient(every[0], time, axis=1)
        nodes = Nodes(time, begins, load, np.array(own), every, rate)
        rest, momentum = reduced(moved, evidence, parts)
        return nodes, _box(nodes, evidence), rest + np.gradient(momentum, time, axis=1)

    def _evidence(self, there: Recorded) -> tuple[Evidence, Moved]:
        """That of the rows, and the motion, without what the simulator's values add."""
        log = self.told[0].simulator.beside(self.told[0].logs[there.number])
        kept = {k: v for k, v in log.channels.items() if k in (KNOWN_FORCE, KNOWN_MASKED)}
        motion = motion_of(cast(dataclasses.replace(log, channels=kept)))
        rows = there.rows.joints[0].evidence
        assert rows is not None  # the rows are of a recording
        return gather(motion, there.width, half=rows.half), motion

    def coarse(self, here: Recorded) -> tuple[float, np.ndarray]:
        """The energy of the grid's best spring, and its place."""
        nodes, box, _ = self.nodes(here)
        steps = (np.arange(STIFFNESSES) + 0.5) / STIFFNESSES
        places = np.array([(step, ratio) for step in steps for ratio in RATIOS])
        left = np.asarray(
            energies(places, box, here.rows.kernel, nodes, *self._target(here, None, box))
        )
        left = np.where(np.isfinite(left), left, np.inf)
        return float(left.min()), places[int(np.argmin(left))]

    def fitted(self, there: Recorded, place: np.ndarray, box: Box) -> Fitted:
        """The best spring near a place, and all values of the simulator with it."""
        nodes, _, _ = self.nodes(there)
        for _ in range(ROUNDS):
            of = box, there.rows.kernel, nodes, *self._target(there, place, box)
            found = Fitted(*map(np.asarray, refined(place, np.array(CELL), *of)))
            place = found.place
        return found

    def left(self, there: Recorded, place: np.ndarray, box: Box) -> float:
        """The energy that a spring leaves, nothing of it refitted."""
        nodes, _, _ = self.nodes(there)
        of = box, there.rows.kernel, nodes, *self._target(there, place, box)
        return float(energies(place[None], *of)[0])

    def _target(self, there: Recorded, place: np.ndarray | None, box: Box):
        """The rows' target, and a basis of all that is linear, beside what is known beforehand.

        A body that weighs something else bends a spring, at a place, by as much more. What no
        force tells (the inertia of a link from that of its motor) stays by the file. The basis has
        as many columns as there are numbers, so that one program does for more recordings.
        """
        nodes, _, loads = self.nodes(there)
        table = there.rows.table.copy()
        if place is not None:
            more = responses(place, box, there.rows.kernel, nodes, loads)
            table[:, there.rows.shared] += more
        prior = np.diag(1 / (TRUSTED * self._sizes(there)))
        basis = orthonormal(np.concatenate([table, prior]))
        target = np.concatenate([there.rows.target, np.zeros(len(prior))])
        return target, np.pad(basis, ((0, 0), (0, table.shape[1] - basis.shape[1])))

    def _sizes(self, here: Recorded) -> np.ndarray:
        """The size of each number of the table; infinite of those that bend no spring."""
        sizes = np.full(here.rows.table.shape[1], np.inf)
        simulators = {each.simulator.joint: each.simulator for each in self.told}
        for i, (joint, name) in enumerate(here.rows.own):
            if name.endswith("/armature"):
                own = simulators[joint]
                sizes[i] = float(own.model.dof_armature[own.number]) or np.inf
        first = self.told[0].simulator
        parts = [np.full(3, float(np.linalg.norm(first.model.opt.gravity)) or 1.0)]
        for weight in weights(first.mujoco, first.model).values():
            way = weight.extent()
            parts.append(weight.mass * np.array([1.0, *[way] * 3, *[way**2] * 6]))
        sizes[here.rows.shared] = np.concatenate(parts)
        return sizes

    def estimates(self, found: Fitted, there: Recorded, box: Box) -> dict[str, Estimate]:
        """Stiffness and damping with their errors, from blocks of all joints' rows."""
        values = np.array(box.spring(found.place))
        turn = np.array(jax.jacfwd(lambda place: jnp.stack(box.spring(place)))(found.place))
        count = len(there.rows.target)
        columns = found.slopes[:count] @ np.linalg.inv(turn)
        empty = np.zeros((count, 0))
        fit = Fit((), (), (values,), columns, empty, found.left[:count], found.energy)
        known = spread(fit, there.rows.block)
        freedom = known.degrees_of_freedom(np.eye(2))
        simulator = self.told[0].simulator
        hinge = is_hinge(simulator.mujoco, simulator.model, self.number)
        units = ("N·m/rad", "N·m·s/rad") if hinge else ("N/m", "N·s/m")
        errors = np.sqrt(np.diag(known.covariance))
        return {
            name: Estimate(np.float64(value), np.float64(error), unit, float(df))
            for name, value, error, unit, df in zip(
                (STIFFNESS, DAMPING), values, errors, units, freedom, strict=True
            )
        }


def _steady(time: np.ndarray, count: int) -> np.ndarray:
    """Times of nodes, those without samples and those that fill the length up too."""
    known = np.flatnonzero(np.diff(np.maximum.accumulate(time[:count]), prepend=-np.inf) > 0)
    step = float(np.median(np.diff(time[known]) / np.diff(known)))
    number = np.arange(len(time))
    beyond = np.maximum(number - known[-1], 0)
    return np.interp(number, known, time[known]) + step * beyond


def _box(nodes: Nodes, evidence: Evidence) -> Box:
    """From a few swings in the record to a few nodes in a swing; gravity does not pull it over."""
    inertia = float(np.median(nodes.own[0]))
    slow = PERIODS / evidence.limits.duration
    fast = evidence.half / (SAMPLED * evidence.reach)
    least = 2 * max(0.0, -float(nodes.own[2].min()))
    low = inertia * (2 * np.pi * slow) ** 2 + least
    return Box(low, max(inertia * (2 * np.pi * fast) ** 2, 2 * low), inertia)
