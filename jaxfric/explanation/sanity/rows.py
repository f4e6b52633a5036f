"""The rows of several joints of one log, side by side: forces, columns, weights."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...data.recording import Recording
from ...models import Model
from ...simulators import AbstractSimulator
from ...terms import KNOWN_FEEDBACK, KNOWN_FORCE
from ..acceptance import LINEARITY
from ..evidence import Evidence, gather
from ..least_squares import RANK, orthonormal
from ..motion import motion_of
from ..significance import blocks


class Part(NamedTuple):
    """A joint of a comparison: its recording, the held-out one, its simulator, and its name."""

    recording: Recording
    holdout: Recording | None
    simulator: AbstractSimulator
    name: str = ""


class Rows(NamedTuple):
    """One joint's rows of the weak form.

    - `target`: recorded less known force, N, `(J,)`; `known`; `rate`, N/s, of what may be late.
    - `elapsed`: of each row's middle, s, from the middle of the record.
    - `own`: what the simulator's parameters add, `(J, K)`, with their `names`.
    - `weight`: one over the noise of a row, 1/N; `block`, of each row.
    """

    evidence: Evidence
    target: np.ndarray
    known: np.ndarray
    rate: np.ndarray
    elapsed: np.ndarray
    own: np.ndarray
    names: tuple[str, ...]
    weight: float
    block: np.ndarray

    @property
    def power(self) -> float:
        """What is left of the force's power."""
        force = self.evidence.force
        return float(self.target @ self.target) / max(float(force @ force), 1e-300)


def rows_of(recording: Recording, model: Model) -> Rows:
    """The rows of a recording that has its simulator's force beside it.

    **Raises:** `ValueError` if the axis hardly slips.
    """
    evidence = gather(motion_of(recording))
    term = model.term
    own = evidence.columns(term, np.zeros((1, 0)))[0]
    force = np.asarray(evidence.motion.channels[KNOWN_FORCE], float)
    # What a servo makes of the motion itself is never late.
    late = force - np.asarray(evidence.motion.channels.get(KNOWN_FEEDBACK, 0.0), float)
    rate = evidence.project(np.zeros_like(force), late)
    time = np.asarray(evidence.motion.time, float)[evidence.centre]
    elapsed = time - (time[0] + time[-1]) / 2
    known = evidence.force - evidence.target
    names = tuple(p.name for p in term.affine)
    basis = orthonormal(own)
    left = evidence.target - basis @ (basis.T @ evidence.target)
    noise = float(np.median(np.abs(np.diff(left)))) / 0.6745 / np.sqrt(2)
    # Below what no sensor of force resolves nothing counts.
    noise = max(noise, LINEARITY * float(np.sqrt(np.mean(evidence.force**2))), 1e-300)
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    return Rows(
        evidence, evidence.target, known, rate, elapsed, own, names, 1 / noise, np.asarray(block)
    )


def nodes(rows: Rows) -> np.ndarray:
    """The times of the nodes that the rows are made of, s, `(M,)`."""
    return np.asarray(rows.evidence.motion.time, float)


class Stack(NamedTuple):
    """The rows of all joints, weighted: target, columns by name, `(J, K)`, and blocks."""

    target: np.ndarray
    columns: np.ndarray
    names: list[str]
    block: np.ndarray


def stacked(parts: Sequence[Rows], columns: Sequence[Mapping[str, np.ndarray]]) -> Stack:
    """All joints' rows one below the other; a column that a joint does not have is zero there."""
    names = list(dict.fromkeys(name for some in columns for name in some))
    tables, start, block = [], 0, []
    for rows, some in zip(parts, columns, strict=True):
        none = np.zeros(len(rows.target))
        tables.append(rows.weight * np.stack([some.get(name, none) for name in names], axis=1))
        block.append(rows.block + start)
        start += int(rows.block[-1]) + 1
    target = np.concatenate([rows.weight * rows.target for rows in parts])
    return Stack(target, np.concatenate(tables), names, np.concatenate(block))


def estimate(stack: Stack, chosen: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Least squares of some columns: each value with its standard error, by blocks."""
    at = [stack.names.index(name) for name in chosen]
    columns = stack.columns[:, at]
    size = np.linalg.norm(columns, axis=0)
    columns = columns / np.where(size > 0, size, 1.0)
    inverse = np.linalg.pinv(columns, rcond=RANK)
    value = inverse @ stack.target
    left = stack.target - columns @ value
    count = int(stack.block[-1]) + 1
    sums = np.stack([np.bincount(stack.block, row * left, count) for row in inverse])
    error = np.sqrt(np.sum(sums**2, axis=1))
    return {
        name: (float(v / s), float(e / s)) if s > 0 else (0.0, float("inf"))
        for name, v, e, s in zip(chosen, value, error, size, strict=True)
    }


def energy(stack: Stack, chosen: Sequence[str] = ()) -> float:
    """What some columns leave of the target's energy."""
    at = [stack.names.index(name) for name in chosen]
    basis = orthonormal(stack.columns[:, at]) if at else np.zeros((len(stack.target), 0))
    left = stack.target - basis @ (basis.T @ stack.target)
    return float(left @ left)
