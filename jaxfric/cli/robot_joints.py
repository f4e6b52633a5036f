"""The joints of a robot's log: their recordings and simulators, and what each by itself tells."""

import dataclasses
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..data.joints import COMMAND, ROLES, references_of
from ..data.recording import Recording
from ..data.tables import load
from ..explanation import Explanation, explain
from ..explanation.sanity import Check, CheckedSimulator, Part, check_logs, rows_of
from ..simulators import Mujoco
from ..simulators.multibody import Standing
from ..simulators.patching import folder_of
from ..terms.effects.position_zero import POSITION_ZERO
from .commands import read
from .joint_columns import WHOLE, Logged
from .messages import message

# What the log of one joint gives no role to.
OTHERS = ("velocity", "reference", "load", "temperature", "segment")


class Joint(NamedTuple):
    """One joint's answer: the explanation, or why there is none; its recordings and simulator."""

    name: str
    told: Explanation | None
    error: str
    logs: list[Recording]
    simulator: Mujoco | None
    notes: list[str]
    reference: np.ndarray | None = None
    commanded: Recording | None = None
    corrected: tuple[str, ...] = ()
    still: tuple[str, ...] = ()


def opened(
    name: str, shared, paths: Sequence[str], logged: Logged, arguments: Namespace, hinge: bool,
    source: str | Path,
) -> Joint:  # fmt: skip
    """One joint's recordings and simulator by a model's file or text, not explained yet."""
    logs, notes = list[Recording](), list[str]()
    reference: np.ndarray | None = None
    try:
        commanded = COMMAND in logged.columns[0].get(name, arguments.columns)
        folder = folder_of(arguments.mujoco)
        simulator = Mujoco(source, name, folder, shared, commanded=commanded)
        still = simulator.references(logged.still)
        for path, own in zip(paths, logged.columns, strict=True):
            log, more = _log(path, name, own, arguments, hinge)
            log = dataclasses.replace(log, channels=log.channels | _held(still, log))
            log = simulator.driven(log) if commanded else log
            channels = dict(log.channels)
            wanted = channels.pop("reference", None)
            if wanted is not None and not logs:
                reference = np.asarray(wanted, float)
            logs.append(dataclasses.replace(log, channels=channels))
            notes += more
        logs, unheard = _compared(simulator, logs)
        stand = (*map(_still, still), *unheard)
        notes += [*simulator.standing, *stand]
    except ValueError as error:
        return Joint(name, None, _refusal(error, paths), logs, None, notes)
    return Joint(name, None, "", logs, simulator, notes, reference, logs[0], still=stand)


def _compared(simulator: Mujoco, logs: list[Recording]) -> tuple[list[Recording], list[str]]:
    """The logs without a held-out one in which the joint stands, and that it does."""
    try:
        for held in logs[1:]:
            simulator.beside(held)
    except Standing:
        text = (
            f"{logs[1].source}: the joint {simulator.joint} stands there, or is at a limit of the "
            "model, so that its answer is not tested on held-out motion."
        )
        return logs[:1], [text]
    return logs, []


def _held(places: Mapping[str, float], log: Recording) -> dict[str, np.ndarray]:
    """Positions of joints that stand."""
    return {name: np.full(log.num_samples, place) for name, place in places.items()}


def _still(name: str) -> str:
    return (
        f"The joint {name} is not in the log: it is taken to stand at its reference. If it moved, "
        f"name its column: --columns {name}_position=NAME."
    )


def _refusal(error: ValueError, paths: Sequence[str]) -> str:
    text = message(error)
    return text if text.startswith(tuple(paths)) else f"{paths[0]}: {text}"


def checked_logs(opened: Mapping[str, Joint]) -> dict[str, CheckedSimulator]:
    """What all joints' logs differ in from the simulator that no physics is."""
    able = [joint for joint in opened.values() if joint.simulator is not None]
    parts = [
        Part(
            joint.logs[0],
            joint.logs[1] if len(joint.logs) > 1 else None,
            joint.simulator,
            joint.name,
        )
        for joint in able
    ]
    try:
        return {part.name: own for part, own in zip(parts, check_logs(parts), strict=True)}
    except ValueError:  # a joint that does not move is told of by itself
        others = {name: joint for name, joint in opened.items() if not _moves(joint)}
        return checked_logs({k: v for k, v in opened.items() if k not in others}) if others else {}


def _moves(joint: Joint) -> bool:
    """Whether a joint slips long enough to be compared."""
    if joint.simulator is None:
        return False
    log = joint.logs[0]
    try:
        rows_of(joint.simulator.beside(log), joint.simulator.baseline(log.units))
    except ValueError:
        return False
    return True


def of_others(name: str, checked: Mapping[str, CheckedSimulator]) -> list[Check]:
    """What is wrong elsewhere that this joint's simulator is judged with: zeros of other joints."""
    own = checked.get(name)
    checks = own.checks if own is not None else []
    return [
        c
        for c in checks
        if c.effect == POSITION_ZERO.name and c.wrong and c.parameter != f"{name} zero"
    ]


def explained(
    joint: Joint, checked: Mapping[str, CheckedSimulator], source: str | Path, shared,
    arguments: Namespace, settled: bool = False,
) -> Joint:  # fmt: skip
    """One joint explained by itself against a model's file or text; `settled`: its bodies are
    right.
    """
    if joint.simulator is None:
        return joint
    logs, own = joint.logs, checked.get(joint.name)
    held = logs[1] if len(logs) > 1 else None
    try:
        zeros = own.faults.zeros if own is not None else {}
        commanded = joint.simulator.actuator is not None
        folder = folder_of(arguments.mujoco)
        simulator = Mujoco(source, joint.name, folder, shared, zeros, commanded, settled)
        baseline = simulator if own is None else own.standing_on(simulator)
        told = explain(logs[0], baseline, held, simulate=arguments.simulate)
    except ValueError as error:
        return joint._replace(error=_refusal(error, [log.source for log in logs]))
    if own is not None and own.changed:
        logs = [log for log in (own.part.recording, own.part.holdout) if log is not None]
        if own.faults.clock:
            joint = joint._replace(commanded=logs[0])
    said = [f"{c.attribute} at {float(c.value.value):.5g}" for c in of_others(joint.name, checked)]
    return joint._replace(told=told, simulator=simulator, logs=logs, corrected=tuple(said))


def _log(
    path: str, name: str, own: Mapping[str, Mapping[str, str]], arguments: Namespace, hinge: bool
) -> tuple[Recording, list[str]]:
    """The recording of one joint, with the positions of the others as channels."""
    units = {"force": "N·m", "position": "rad"} if hinge else {"force": "N", "position": "m"}
    units |= arguments.units
    given = arguments.scale
    if not own:
        columns, scale = dict(arguments.columns), _scales(given, [name], name)
        if COMMAND in columns:
            columns["force"] = columns.pop(COMMAND)
        return read(path, arguments, units=units, columns=columns, scale=scale)
    others = {joint: roles["position"] for joint, roles in own.items() if joint != name}
    roles = {**own[name], **others, **dict.fromkeys(OTHERS, "")}
    if COMMAND in roles:
        roles["force"] = roles.pop(COMMAND)
    wanted = references_of(load(Path(path)).columns, list(own), arguments.columns)
    if name in wanted:
        roles["reference"] = wanted[name]
    for role in WHOLE:
        if role in arguments.columns:
            roles[role] = arguments.columns[role]
    if "segment" not in arguments.columns and "segment" in load(Path(path)).columns:
        roles["segment"] = "segment"
    scale = _scales(given, list(own), name, name in wanted)
    return read(path, arguments, columns=roles, scale=scale, units=units, served=False)


def _scales(
    given: Mapping[str, float], joints: Sequence[str], name: str, referred: bool = False
) -> dict[str, float]:
    """The factors of the columns of one joint's recording: `elbow_position` before `position`.

    Another joint's position is a channel of its name; a reference is in the unit of its position.
    """
    named = {f"{joint}_{role}" for joint in joints for role in (*ROLES, COMMAND)}
    found = {role: factor for role, factor in given.items() if role not in named}
    for joint in joints:
        factor = given.get(f"{joint}_position", given.get("position"))
        if factor is not None:
            found["position" if joint == name else joint] = factor
    if referred and "position" in found:
        found["reference"] = found["position"]
    for role in (COMMAND, "force"):
        if f"{name}_{role}" in given:
            found["force"] = given[f"{name}_{role}"]
    return found
