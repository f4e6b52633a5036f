"""Columns that belong to another joint, or count the other way: known by the force they leave."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...simulators import Mujoco
from ...simulators.loading import is_hinge
from ...terms import KNOWN_FORCE
from .changes import MOMENTS
from .rows import Part, Rows, nodes

# What leaves most of a force's power does not describe it; half of that is a description.
WRONG, RIGHT = 0.5, 0.25


class Wiring(NamedTuple):
    """What is wrong with the columns, in words, by joint; empty where nothing is.

    `everywhere`: whether no joint can be compared then.
    """

    said: dict[str, str]
    everywhere: bool = True

    def sound(self, joint: str) -> bool:
        """Whether a joint can be compared."""
        return not self.said or (not self.everywhere and joint not in self.said)


def wiring_of(parts: Sequence[Part], rows: Sequence[Rows]) -> Wiring:
    """Whether forces are repeated or swapped, positions swapped or counted the other way."""
    said = _repeated(parts)
    bad = [i for i, own in enumerate(rows) if _left(own, own.known) > WRONG]
    if said:
        # The one that it belongs to is as good as it was.
        others = {part.name for i, part in enumerate(parts) if i in bad}
        return Wiring({n: text for n, text in said.items() if n in others} or said, False)
    # Where joints are alike, another's force describes this one's, but for its size.
    off = bad or any(own.power > WRONG for own in rows)
    if not off or not all(isinstance(part.simulator, Mujoco) for part in parts):
        return Wiring({})
    said = _swapped(parts, rows) if bad else {}
    # Forces are each joint's own; a position is in the forces of all.
    return Wiring(said, False) if said else Wiring(_positions(parts, rows))


def _repeated(parts: Sequence[Part]) -> dict[str, str]:
    said: dict[str, str] = {}
    for what in ("force", "position"):
        seen: dict[bytes, str] = {}
        for part in parts:
            values = np.asarray(getattr(part.recording, what) if what == "force" else
                                part.recording.position)  # fmt: skip
            key = values.tobytes()
            if key in seen and np.ptp(values) > 0:
                said[part.name] = (
                    f"The {what} of joint {part.name} is that of joint {seen[key]}, sample by "
                    f"sample: one column for two joints. Name its own: --columns "
                    f"{part.name}_{what}=NAME."
                )
            seen.setdefault(key, part.name)
    return said


def _left(rows: Rows, known: np.ndarray) -> float:
    """The part of a force's power that a known force leaves, whatever its sign and size."""
    force = rows.evidence.force - rows.evidence.force.mean()
    known = known - known.mean()
    whole = float(force @ force) * float(known @ known)
    return 1 - float(force @ known) ** 2 / whole if whole > 0 else 1.0


def _swapped(parts: Sequence[Part], rows: Sequence[Rows]) -> dict[str, str]:
    """Joints whose recorded force is that of another joint of the simulator."""
    names = [part.name for part in parts]
    table = np.array([[_left(own, _other(own, rows[j])) for j in range(len(rows))] for own in rows])
    best = table.argmin(axis=1)
    off = [i for i in range(len(rows)) if best[i] != i]
    sure = all(table[i, best[i]] < RIGHT and table[i, i] > WRONG for i in off)
    if not off or not sure or len(set(best)) < len(best):
        return {}
    named = ",".join(f"{names[i]}_force=NAME" for i in off)
    return {
        names[i]: f"The force of joint {names[i]} is that of joint {names[best[i]]} in the "
        f"simulator (its own leaves {np.sqrt(table[i, i]):.0%}, that one "
        f"{np.sqrt(table[i, best[i]]):.0%}): the columns are permuted. Name them: --columns "
        f"{named}."
        for i in off
    }


def _other(own: Rows, other: Rows) -> np.ndarray:
    """The simulator's force of another joint at the rows of this one.

    By the number of the sample, which increases where a clock does not. Nodes without samples say
    nothing: their time and their force are zero.
    """
    said = other.evidence.elapsed > 0
    values = np.asarray(other.evidence.motion.channels[KNOWN_FORCE], float)
    at = np.interp(_samples(own), _samples(other)[said], values[said])
    return own.evidence.project(at)


def _samples(rows: Rows) -> np.ndarray:
    """The samples in the middle of the nodes, `(M,)`."""
    step = rows.evidence.width // rows.evidence.half
    return step * np.arange(len(rows.evidence.elapsed))


class Change(NamedTuple):
    """One thing that may be wrong with the columns of some joints.

    Their order the other way round, of the positions or of the `forces` too; or positions that are
    to be taken times a `factor`, of a `unit`.
    """

    names: tuple[str, ...]
    factor: float = 1.0
    unit: str = ""
    forces: bool = False

    def order(self, number: Mapping[str, int]) -> list[int]:
        """Whose column each joint's is, by number."""
        order = list(range(len(number)))
        if self.factor == 1.0:
            for one, two in zip(self.names, reversed(self.names), strict=True):
                order[number[one]] = number[two]
        return order


def _positions(parts: Sequence[Part], rows: Sequence[Rows]) -> dict[str, str]:
    """Positions that count the other way or in another unit, or columns that stand for each
    other's: one change that puts all joints right.
    """
    simulator = parts[0].simulator
    assert isinstance(simulator, Mujoco)
    time = np.asarray(parts[0].recording.time, float)
    index = np.arange(0, len(time), max(1, len(time) // MOMENTS))
    number = {name: i for i, name in enumerate(simulator.joints)}
    before = float(np.mean([_left(own, own.known) for own in rows]))
    tried = {}
    for change in _changes(simulator):
        order, signs = change.order(number), np.ones(len(number))
        signs[[number[name] for name in change.names]] = change.factor
        force = simulator.turned(parts[0].recording, order, signs, index)
        if change.forces:
            force = force[:, order]
        left = [
            _left(own, own.evidence.project(np.interp(nodes(own), time[index], values)))
            for part, own in zip(parts, rows, strict=True)
            for values in (force[:, number[part.name]],)
        ]
        if max(left) < RIGHT:
            tried[change] = float(np.mean(left))
    best = min(tried, key=lambda change: tried[change], default=None)
    return (
        _told(best, simulator.recorded) if best is not None and tried[best] < 0.5 * before else {}
    )


# What logs count positions in, in the model's unit.
ANGLES = {"degrees": np.pi / 180, "revolutions": 2 * np.pi, "mrad": 1e-3}
LENGTHS = {"mm": 1e-3}


def _changes(simulator: Mujoco) -> Iterator[Change]:
    joints = simulator.recorded
    swaps: list[tuple[str, ...]] = [
        (one, two) for i, one in enumerate(joints) for two in joints[i + 1 :]
    ]
    # Joints that are counted from the other end.
    swaps += [tuple(joints)] if len(joints) > 2 else []
    yield from (Change((name,), -1.0) for name in joints)
    yield from (Change(names, forces=forces) for names in swaps for forces in (False, True))
    numbers = [simulator.joints.index(name) for name in joints]
    hinges = [is_hinge(simulator.mujoco, simulator.model, i) for i in numbers]
    for units, turns in ((ANGLES, True), (LENGTHS, False)):
        names = tuple(name for name, hinge in zip(joints, hinges, strict=True) if hinge == turns)
        # One of them alone, as the only one with another encoder; or the whole log.
        groups = dict.fromkeys([*((name,) for name in names), names] if names else [])
        yield from (Change(some, f, unit) for some in groups for unit, f in units.items())


def _told(change: Change, joints: Sequence[str]) -> dict[str, str]:
    names = change.names
    every = ", ".join(names[:-1]) + " and " * (len(names) > 1) + names[-1]
    if change.unit:
        whole = len(names) == len(joints)
        scaled = ["position"] if whole else [f"{name}_position" for name in names]
        given = ",".join(f"{role}={change.factor:.6g}" for role in scaled)
        what = "positions ({}) are" if len(names) > 1 else "position of joint {} is"
        text = (
            f"The {what.format(every)} in {change.unit}: with {change.factor:.6g} times that the "
            f"simulator describes the force. Give --scale {given}."
        )
    elif change.factor < 0:
        text = (
            f"The position of joint {every} counts the other way than the simulator's. Turn it "
            "round in the log, or the joint's axis in the model."
        )
    else:
        what = "columns" if change.forces else "positions"
        roles = ("position", "force") if change.forces else ("position",)
        named = ",".join(f"{name}_{role}=NAME" for name in names for role in roles)
        how = "swapped" if len(names) == 2 else "in the reverse order"
        text = f"The {what} of the joints {every} are {how}. Name them: --columns {named}."
    return dict.fromkeys(names, text)
