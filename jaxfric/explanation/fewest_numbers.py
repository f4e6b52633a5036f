"""The fewest numbers of a robot's file that explain the forces of all its joints."""

import itertools
import sys
from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from ..identification.uncertainty import Estimate
from ..simulators.weights import GRAVITY, MASS, MASS_ALONE
from .bodies import Bodies, State
from .joint_rows import by_chance
from .least_squares import orthonormal
from .mismatch import SURE

# Sets of one number fewer to which each other number is added, and numbers that are tried with
# each: those that would take most if all were linear. They bound the time: of one number all are
# the best of 16, of more there are 128 fits for each number more.
BEAM, TRIED = 8, 16
# A number that adds less than this to the energy of the force, by a change of its own size, is not
# seen but for rounding.
UNSEEN = 1e-12


class Answer(NamedTuple):
    """What all joints say together: the values that differ by name, with `estimates`, and what else
    would do as well in place of each, `instead`; `short`: joints of whose force they leave more
    than others would, beyond noise.
    """

    values: State
    estimates: dict[str, Estimate]
    instead: dict[str, tuple[str, ...]]
    short: tuple[str, ...] = ()


def answer(robot: Bodies, apart: Collection[str] = ()) -> Answer:
    """The fewest numbers, how well they are known, and what else would do as well.

    **Arguments:** `apart`: bodies whose mass and inertia are numbers apart from each other in the
    file.
    """
    state = fewest(robot, apart)
    known = robot.estimates(state) if state else {}
    return Answer(state, known, _instead(robot, state), _short(robot, state))


def _short(robot: Bodies, state: State) -> tuple[str, ...]:
    """Joints of which a state leaves more than all linear parameters do, by more than noise like
    that puts into what these can do.
    """
    if not state:
        return ()
    more, shift, found = robot.energies(state) - robot.least, robot.shift(state), []
    for k, joint in enumerate(robot.joints):
        linear = len(joint.own) + robot.products - robot.shared
        basis = orthonormal(joint.columns[:, :linear])
        residual = joint.target - joint.columns @ shift[robot.at(k)]
        if more[k] > max(robot.enough[k], by_chance(basis, residual, joint.block)):
            found.append(joint.name)
    return tuple(found)


def fewest(robot: Bodies, apart: Collection[str] = ()) -> State:
    """The fewest numbers that leave no joint more than all linear parameters do; of fewer bodies,
    where one number more does for each body fewer: one part of a machine is wrong sooner than two.

    The search over all bodies keeps a few sets of each size, and the right one may not be among
    them. So where several bodies are not enough, any one body may be the answer, named or not.
    """
    found = _fewest(robot, frozenset(robot.weights), apart)
    bodies = sorted({robot.owner[n][0] for n in found if n in robot.owner})
    single = bodies if sufficient(robot, found) else sorted(robot.weights)
    alike = robot.energies(found) + robot.enough
    for count in range(1, len(bodies)):
        most = len(found) + len(bodies) - count
        sets = itertools.combinations(bodies if count > 1 else single, count)
        tried = [_fewest(robot, frozenset(some), apart, most) for some in sets]
        if fewer := [state for state in tried if np.all(robot.energies(state) <= alike)]:
            return min(fewer, key=lambda state: (len(state), _changed(robot, state, apart)))
    return found


def sufficient(robot: Bodies, state: State) -> bool:
    """Whether a state leaves no joint more than all linear parameters do, but for what no sensor of
    force resolves.
    """
    return bool(np.all(robot.energies(state) - robot.least <= robot.enough))


def _fewest(
    robot: Bodies, bodies: frozenset[str], apart: Collection[str], most: int = sys.maxsize
) -> State:
    """The fewest numbers of joints and those bodies that leave no more than all do, `most` at most.

    Each of them beyond its noise, and more of them only where they leave less; among sets that do
    as well, the one that changes least.
    """
    found, beam = State(), [State()]
    while len(beam[0]) < most and not sufficient(robot, found):
        tried: dict[frozenset[str], tuple[float, State]] = {}
        for state in beam:
            for name in _promising(robot, state, bodies):
                names = frozenset({*state, name})
                if names not in tried:
                    tried[names] = robot.fitted([*state, name], state)
        kept = sorted(tried.values(), key=lambda each: each[0])[:BEAM]
        beam = [state for energy, state in kept if np.isfinite(energy)]
        sure = [state for state in beam if _sure(robot, state)]
        if not sure:
            break
        alike = robot.energies(sure[0]) + robot.enough
        good = [state for state in sure if np.all(robot.energies(state) <= alike)]
        best = [state for state in good if _less(robot, state, found)]
        if best:
            found = min(best, key=lambda state: _changed(robot, state, apart))
        elif any(sufficient(robot, state) for state in sure):
            break
    return found


def _less(robot: Bodies, state: State, fewer: State) -> bool:
    """Whether a state leaves less than one of fewer numbers: for each number more, more than noise
    takes, and of one joint at least more than a sensor of force resolves.

    Where a force has more noise than its sensor has errors, all numbers together always leave less.
    """
    gains = robot.energies(fewer) - robot.energies(state)
    noise = max(
        _noise(robot, name, {n: v for n, v in state.items() if n != name}, state) for name in state
    )
    enough = SURE**2 * (len(state) - len(fewer)) * noise
    return bool(np.any(gains > robot.enough) and gains.sum() > enough)


def _promising(robot: Bodies, state: State, bodies: frozenset[str]) -> list[str]:
    """The numbers of joints and those bodies that would take most, were they linear."""
    names = [n for n in _others(robot, state) if n in robot.place or robot.owner[n][0] in bodies]
    slopes = robot.slopes(names, state)
    rest = robot.pull - robot.gram @ robot.shift(state)
    if state:
        mine = robot.slopes(state, state)
        inner = np.linalg.pinv(mine.T @ robot.gram @ mine, rcond=1e-12)
        slopes = slopes - mine @ (inner @ (mine.T @ robot.gram @ slopes))
    sizes = np.sum(slopes * (robot.gram @ slopes), axis=0)
    own = np.array([robot.size(name) ** 2 for name in names])
    seen = sizes * own > UNSEEN * robot.powers.sum()
    gains = np.where(seen, (rest @ slopes) ** 2 / np.maximum(sizes, 1e-300), 0.0)
    return [names[i] for i in np.argsort(-gains, kind="stable")[:TRIED] if gains[i] > 0]


def _others(robot: Bodies, state: State) -> list[str]:
    """The numbers beside a state's; of a body's mass no second one."""
    owned = [robot.owner[name] for name in state if name in robot.owner]
    weighed = [body for body, what in owned if what in (MASS, MASS_ALONE)]
    twins = {f"body/{body}/{what}" for body in weighed for what in (MASS, MASS_ALONE)}
    return [name for name in robot.before if name not in state and name not in twins]


def _sure(robot: Bodies, state: State) -> bool:
    """Whether each number of a state differs beyond noise from what it would be without it."""
    return all(
        abs(float(e.value) - robot.unchanged(name, state)) > SURE * float(e.standard_error)
        for name, e in robot.estimates(state).items()
    )


def _changed(robot: Bodies, state: State, apart: Collection[str]) -> float:
    """By how much a state's numbers differ from the simulator's, a part of each, summed; where a
    mass takes more than one number of the file, that counts as another one, and so does an inertia
    that has to go along. What a joint's own number or a body's does as well is not gravity.
    """
    found = float(len(robot.raised(state)))
    for name, value in state.items():
        if name in robot.place:
            found += 2.0 if name in GRAVITY else 1.0
            continue
        body, what = robot.owner[name]
        before, size = robot.before[name], abs(value - robot.before[name])
        whole = size + robot.size(name) if what.startswith("centre") else abs(value) + abs(before)
        found += size / whole
        found += {MASS: body in apart, MASS_ALONE: body not in apart}.get(what, 0)
    return found


def _instead(robot: Bodies, state: State) -> dict[str, tuple[str, ...]]:
    """To each number of a state, others that would do as well in its place.

    With these all joints together leave no more than noise like theirs takes for the number that is
    replaced, or each of them no more than a sensor of force resolves.
    """
    found = {}
    for name in state:
        rest = {n: v for n, v in state.items() if n != name}
        names = [n for n in _others(robot, rest) if n != name]
        energy, noise = robot.energies(state), _noise(robot, name, rest, state)
        more = {n: _left(robot, [*rest, n], rest) - energy for n in names}
        alike = (
            n for n, each in more.items()
            if each.sum() <= SURE**2 * noise or np.all(each <= robot.enough)
        )  # fmt: skip
        if others := tuple(alike):
            found[name] = others
    return found


def _left(robot: Bodies, names: Sequence[str], start: State) -> np.ndarray:
    """What the best values of some numbers leave of each joint, infinite for none that can be,
    `(joints,)`.
    """
    energy, state = robot.fitted(names, start)
    return robot.energies(state) if np.isfinite(energy) else np.full(len(robot.joints), np.inf)


def _noise(robot: Bodies, name: str, rest: State, state: State) -> float:
    """The energy that a number beside others takes of noise like what a state leaves."""
    rows = robot.rows([*rest, name], state)
    beside = orthonormal(rows.columns[:, :-1])
    lone = rows.columns[:, -1] - beside @ (beside.T @ rows.columns[:, -1])
    size = max(float(np.linalg.norm(lone)), 1e-300)
    return float(np.sum(np.bincount(robot.block, lone / size * rows.residual) ** 2))
