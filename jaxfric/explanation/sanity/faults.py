"""The zero of an encoder, and two clocks: found by Gauss-Newton beside the simulator's own values.

A wrong zero z makes the simulator's force f(q − z); a force whose stamps are late by τ is u(t) =
f(t − τ), of a clock that runs at another rate τ grows with time. To first order each is a column
like a wrong value. It is believed where the fewest columns that account for the mismatch include
it, and these leave little. A zero competes with gravity of another direction, as of a tilted base,
which it looks like to one joint.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...data.recording import Recording
from ...simulators import Mujoco
from ...terms import at_other_times
from ...terms.effects.late import CLOCK
from ..acceptance import LINEARITY
from ..mismatch import MOST_WRONG, fewest
from .changes import Changes, by_gravity, by_zero, differences
from .rows import Part, Rows, Stack, energy, estimate, rows_of, stacked
from .shifts import HALVED, shift_of

ZERO, OFFSET, DRIFT = "zero/", CLOCK.name, "clock_drift"
# A quarter of the power: what leaves more is not the fault, or not alone.
LEAVES = 0.25
# Steps below this part of the standard error change nothing.
ROUNDS, CLOSE = 6, 0.1
# Further, rad, an angle's sine is no straight line: 5 %.
FAR = 0.5


class Faults(NamedTuple):
    """The zeros by joint, rad or m, and how late the force is, s, and by how much more each second.

    `errors`: of each value by name.
    """

    zeros: Mapping[str, float] = {}  # noqa: RUF012 - a NamedTuple's default, never changed
    late: float = 0.0
    drift: float = 0.0
    errors: Mapping[str, float] = {}  # noqa: RUF012

    @property
    def clock(self) -> bool:
        """Whether the force has a clock of its own."""
        return bool(self.late or self.drift)


class FaultSearch(NamedTuple):
    """Where the search ended: the faults, what can be seen of those that are none, the rows, and
    the part of the mismatch that they and the wrong values leave. `alone`: whether one joint's
    force has a clock of its own, beside others that are on time.
    """

    faults: Faults
    values: Mapping[str, tuple[float, float]]
    chosen: tuple[str, ...]
    rows: list[Rows]
    left: float = 1.0
    alone: bool = False

    @property
    def numbers(self) -> int:
        """How many numbers it takes: zeros, a clock's, and wrong values beside them."""
        clock = bool(self.faults.late) + bool(self.faults.drift)
        beside = [name for name in self.chosen if not _is_fault(name)]
        return len(beside) + len(self.faults.zeros) + clock


def find_each(parts: Sequence[Part]) -> list[FaultSearch]:
    """The search of each joint: zeros of all joints, and the clock of the log or of one force.

    Among joints that are on time one that is late is a small part of the mismatch, and other
    joints' values imitate it: each joint is asked about its clock by itself too.
    """
    if not parts:
        return []
    seen = find(parts)
    if not seen.faults.clock and len(parts) > 1:
        own = [find([part], zeros=False).faults for part in parts]
        own = [each if each.clock and not each.zeros else Faults() for each in own]
        if any(each.clock for each in own):
            on_time = [
                part._replace(recording=put_right(part.recording, each))
                for part, each in zip(parts, own, strict=True)
            ]
            seen = find(on_time)
            if not seen.faults.clock:
                return [_with_clock(seen, i, each) for i, each in enumerate(own)]
            seen = find(parts)
    return [seen._replace(rows=[rows]) for rows in seen.rows]


def _with_clock(seen: FaultSearch, number: int, own: Faults) -> FaultSearch:
    """The search of all joints as one joint's, which has a clock of its own, or has not."""
    errors = {**seen.faults.errors, **own.errors}
    faults = seen.faults._replace(late=own.late, drift=own.drift, errors=errors)
    return seen._replace(faults=faults, rows=[seen.rows[number]], alone=own.clock)


def find(parts: Sequence[Part], zeros: bool = True) -> FaultSearch:
    """The zeros and clocks of a comparison; nothing where something else accounts for as much.

    `zeros`: whether they are wanted, which takes a second search by gravity where there are some.
    """
    recorded = [_rows(part) for part in parts]
    found = _found if zeros else _searched
    seen = found(parts, recorded, Faults())
    late = shift_of(recorded)
    if not late:
        return seen
    # The shift knows of few values: of a spring, say, it makes a clock.
    shifted = found(parts, recorded, Faults(late=late))
    enough = min(HALVED * seen.left, LEAVES)
    return shifted if shifted.faults.clock and shifted.left < enough else seen


def _found(parts: Sequence[Part], recorded: list[Rows], faults: Faults) -> FaultSearch:
    """Where a search that begins with some faults ends; zeros only where gravity explains no more,
    nor a body that is another one anyway.

    A joint feels a tilt of its base as a wrong zero, and other values make up for what the others
    feel of it. A load beside the middle of a link turns that link's centre of mass, as a zero does.
    """
    seen = _searched(parts, recorded, faults)
    if not seen.faults.zeros:
        return seen
    other = _searched(parts, recorded, faults, gravity=True)
    if _explains_more(other, seen, recorded):
        return other
    plain = _searched(parts, recorded, faults, zeros=False)
    return plain if _says_as_much(plain, seen, recorded) else seen


def _says_as_much(plain: FaultSearch, seen: FaultSearch, recorded: Sequence[Rows]) -> bool:
    """Whether values alone explain as much as zeros and values, by no more numbers, and of no other
    bodies: then one thing is wrong, and not two.
    """
    bodies = {name.split("/")[1] for name in seen.chosen if name.startswith("body/")}
    more = set(plain.chosen) - set(seen.chosen)
    same = all(name.startswith("body/") and name.split("/")[1] in bodies for name in more)
    enough = _enough(recorded) / max(_energy(recorded), 1e-300)
    return same and plain.numbers <= seen.numbers and plain.left < seen.left + enough


def _explains_more(other: FaultSearch, seen: FaultSearch, recorded: Sequence[Rows]) -> bool:
    """Whether one search explains more than another: as much by fewer numbers, clearly more by as
    many, or by more numbers so much more as a clock has to.

    Where both do as well, as of a joint by which all turns, the zero stands.
    """
    if len(other.chosen) > MOST_WRONG:
        return False
    more = other.numbers - seen.numbers
    enough = _enough(recorded) / max(_energy(recorded), 1e-300)
    if more > 0:
        return other.left < HALVED * seen.left - enough
    return other.left < seen.left + (enough if more < 0 else -enough)


def _searched(
    parts: Sequence[Part], recorded: list[Rows], faults: Faults, gravity: bool = False,
    zeros: bool = True,
) -> FaultSearch:  # fmt: skip
    """Where a search that begins with some faults ends; the rows as `recorded` say what they are
    better than. `gravity`, `zeros`: whether these are among what may be wrong.
    """
    rows, before = _put_right(parts, recorded, faults), _energy(recorded)
    known = {OFFSET} if faults.late else set[str]()
    pulls = by_gravity(parts) if gravity else {}
    stack = _stack(parts, rows, faults, pulls, zeros)
    chosen = _chosen(stack, rows)
    for _ in range(ROUNDS):
        new = _new(stack, chosen)
        if not new - known and known or energy(stack, chosen) > LEAVES * before:
            break
        if not (known := known | new):
            break
        faults, rows, stack = _refined(parts, rows, faults, sorted(known), chosen, pulls, zeros)
        chosen = _chosen(stack, rows)
    if known:
        faults, rows, stack = _refined(parts, rows, faults, sorted(known), chosen, pulls, zeros)
    if _energy(rows) > before or not _matters(faults, parts):
        faults, rows = Faults(), recorded
        stack = _stack(parts, rows, faults, pulls, zeros)
    left = energy(stack, chosen) / max(before, 1e-300)
    beside = [name for name in chosen if not _is_fault(name)]
    names = [n for n in stack.names if _is_fault(n) or n.endswith(": gain")]
    beside = list(dict.fromkeys([*beside, OFFSET]))
    each = {n: estimate(stack, [*(b for b in beside if b != n), n])[n] for n in names}
    return FaultSearch(faults, each, chosen, rows, left)


def _new(stack: Stack, chosen: Sequence[str]) -> set[str]:
    """The faults among the columns that were chosen: a clock has to halve what all else leaves.

    A value that changes in the middle looks a little like a clock that drifts. Where few columns do
    not account for the mismatch, it is of another kind, and zeros would only imitate it.
    """
    if len(chosen) > MOST_WRONG:
        return set()
    new = {name for name in chosen if _is_fault(name)}
    others = [name for name in stack.names if not name.startswith(OFFSET)]
    if energy(stack, chosen) > HALVED * energy(stack, others):
        new -= {OFFSET, DRIFT}
    return new


def _refined(
    parts: Sequence[Part], rows: list[Rows], faults: Faults, names: list[str], chosen,
    pulls: Changes, zeros: bool,
) -> tuple[Faults, list[Rows], Stack]:  # fmt: skip
    """Some faults fitted beside the other wrong values, by Gauss-Newton."""
    beside = [name for name in chosen if name not in names and not _is_fault(name)]
    # A part of a sample between force and motion is no fault, and no other value's either.
    beside += [OFFSET] * (OFFSET not in names)
    stack = _stack(parts, rows, faults, pulls, zeros)
    for _ in range(ROUNDS):
        values = estimate(stack, [*beside, *names])
        steps = {name: values[name][0] for name in names}
        faults = _moved(faults, steps)
        faults = faults._replace(errors={name: values[name][1] for name in names})
        rows = _put_right(parts, rows, faults)
        stack = _stack(parts, rows, faults, pulls, zeros)
        if all(abs(step) < CLOSE * values[name][1] for name, step in steps.items()):
            break
    return faults, rows, stack


def _is_fault(name: str) -> bool:
    return name.startswith((ZERO, OFFSET))


def _energy(rows: Sequence[Rows]) -> float:
    return sum(float(np.sum((each.weight * each.target) ** 2)) for each in rows)


def _matters(faults: Faults, parts: Sequence[Part]) -> bool:
    """Within a sample force and motion are aligned anyway; a force that is early acts late, as an
    actuator's does, which is told from a lag elsewhere.
    """
    if faults.zeros or not faults.clock:
        return True
    time = np.asarray(parts[0].recording.time, float)
    sample, half = float(np.median(np.diff(time))), float(np.ptp(time)) / 2
    return faults.late > sample or abs(faults.drift) * half > sample


def _moved(faults: Faults, steps: Mapping[str, float]) -> Faults:
    zeros = dict(faults.zeros)
    for name, step in steps.items():
        if name.startswith(ZERO):
            joint = name.removeprefix(ZERO)
            zeros[joint] = zeros.get(joint, 0.0) + float(np.clip(step, -FAR, FAR))
    late = faults.late + steps.get(OFFSET, 0.0)
    return faults._replace(zeros=zeros, late=late, drift=faults.drift + steps.get(DRIFT, 0.0))


def _rows(part: Part) -> Rows:
    log, simulator = part.recording, part.simulator
    return rows_of(simulator.beside(log), simulator.baseline(log.units))


def _put_right(parts: Sequence[Part], before: Sequence[Rows], faults: Faults) -> list[Rows]:
    """The rows of all joints without the faults, as heavy as those `before`, of which some may be
    gone with the ends of the record: else a shift that spoils the rows would look like noise.
    """
    if not faults.zeros and not faults.clock:
        return list(before)
    found = []
    for part, own in zip(parts, before, strict=True):
        log = put_right(part.recording, faults)
        rows = _rows(part._replace(recording=log))
        weight = own.weight * np.sqrt(len(own.target) / len(rows.target))
        rows = rows._replace(weight=float(weight))
        if any(faults.zeros.values()) and isinstance(part.simulator, Mujoco):
            off = rows.evidence.project(differences(part.simulator, log, faults.zeros)(rows))
            rows = rows._replace(target=rows.target - off, known=rows.known + off)
        found.append(rows)
    return found


def put_right(recording: Recording, faults: Faults) -> Recording:
    """The recording with its force on the motion's clock."""
    if not faults.clock:
        return recording
    time, force = np.asarray(recording.time, float), np.asarray(recording.force, float)
    late = faults.late + faults.drift * (time - (time[0] + time[-1]) / 2)
    there = time + late
    known = np.isfinite(force)
    moved = at_other_times(
        recording, force, lambda part: np.interp(there, time[known], np.asarray(part)[known])
    )
    inside = (there >= time[0]) & (there <= time[-1])
    mask = np.asarray(recording.mask) & inside
    kind = np.asarray(recording.force).dtype
    return dataclasses.replace(recording, force=np.asarray(moved).astype(kind), mask=mask)


def _stack(
    parts: Sequence[Part], rows: Sequence[Rows], faults: Faults, pulls: Changes, zeros: bool
) -> Stack:
    """The simulator's own columns first: what they can say as well is theirs; then what `pulls`."""
    columns = []
    changes = by_zero(parts, faults.zeros) if zeros else {}
    for part, own in zip(parts, rows, strict=True):
        some = {_shared(name, part.name): own.own[:, i] for i, name in enumerate(own.names)}
        for name, change in pulls.get(part.name, {}).items():
            some[name] = own.evidence.project(change(own))
        for joint, change in changes.get(part.name, {}).items():
            some[f"{ZERO}{joint}"] = own.evidence.project(change(own))
        some[OFFSET], some[DRIFT] = -own.rate, -own.elapsed * own.rate
        columns.append(some)
    return stacked(rows, columns)


def _shared(name: str, joint: str) -> str:
    """A body's mass is one value for all joints; a gain and a constant force are each joint's."""
    return name if "/" in name else f"{joint}: {name}"


def _chosen(stack: Stack, rows: Sequence[Rows]) -> tuple[str, ...]:
    """The fewest columns that leave no more than all of them."""
    found = fewest(stack.columns, stack.target, stack.block, _enough(rows))
    return tuple(stack.names[i] for i in found)


def _enough(rows: Sequence[Rows]) -> float:
    """The energy that no sensor of force resolves."""
    force = sum(float(np.sum((r.weight * r.evidence.force) ** 2)) for r in rows)
    return LINEARITY**2 * force
