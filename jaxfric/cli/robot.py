"""`jaxfric explain --mujoco`: a simulator's joints against a log, and its file put right."""

import dataclasses
import os
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..data.io import read_with_notes
from ..data.joints import COMMAND, references_of
from ..data.provenance import sha256
from ..data.recording import Recording
from ..data.tables import load
from ..data.targets import standard
from ..explanation import Explanation, explain
from ..explanation.sanity import Check, CheckedSimulator, Part, check_logs, rows_of
from ..export.patch import Again, Patch, patch
from ..identification import documents, tabulate
from ..report import page, robot
from ..simulators import Mujoco
from ..simulators.loading import is_hinge, joints_of, library, read as read_model
from ..simulators.patching import folder_of, patched
from ..terms.effects.parameter_mismatch import MISMATCH
from . import joint_columns
from .commands import put, read, today, working
from .joint_columns import Logged
from .messages import message, say
from .saving import saved

SCHEMA = "jaxfric.robot/1"
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


def run(arguments: Namespace) -> int:
    """Explain the joints that the log has; print them, and write what was asked for."""
    if arguments.report:
        page.library()
    mujoco = library()
    model = read_model(mujoco, arguments.mujoco)
    joints = joints_of(mujoco, model)
    if arguments.joint and arguments.joint not in joints:
        raise ValueError(
            f"{arguments.mujoco}: there is no joint {arguments.joint!r}. Its joints are "
            f"{', '.join(joints)}."
        )
    found = _explained(arguments, mujoco, model, joints)
    done = [joint for joint in found if joint.told is not None]
    if not done:
        raise ValueError(found[0].error)
    patch_ = _patched(arguments, done)
    texts = _written(arguments, found, patch_)
    for path, text in texts.items():
        put(path, text)
    if not any(standard(path) for path in texts):
        _print(arguments, found, patch_)
    return 0


def _explained(arguments: Namespace, mujoco: Any, model: Any, joints: list[str]) -> list[Joint]:
    """The joints of the log, those farther out first: what is wrong of a body is put right before
    the joints that carry it are judged.
    """
    paths = [arguments.file, *([arguments.holdout] if arguments.holdout else [])]
    logged = joint_columns.logged(arguments, joints)
    joint_columns.check_save(arguments.save, logged.chosen)
    source: str | Path = arguments.mujoco
    found: list[Joint] = []
    corrected: tuple[str, ...] = ()
    shared: dict[bytes, Any] = {}
    hinges = {name: is_hinge(mujoco, model, joints.index(name)) for name in joints}
    with working(f"explaining {arguments.file}") as doing:
        doing("signs, zeros, clocks and limits of all joints")
        opened = {
            name: _opened(name, shared, paths, logged, arguments, hinges[name])
            for name in logged.chosen
        }
        checked = _checked(opened)
        for name in reversed(logged.chosen):
            doing(f"joint {name}")
            one = _joint(opened[name], checked.get(name), source, shared, arguments)
            said = [
                f"{c.attribute} at {float(c.value.value):.5g}" for c in _of_others(name, checked)
            ]
            found.insert(0, one._replace(corrected=(*said, *corrected)))
            if bodies := _bodies(one):
                changed = patched(mujoco, source, bodies, folder_of(arguments.mujoco))
                source = changed.text
                said = [f"{key} at {bodies[key]:.5g}" for key in changed.written]
                corrected = (*corrected, *said)
    without = [Joint(name, None, why, [], None, []) for name, why in logged.without.items()]
    return [*found, *without]


def _opened(
    name: str, shared, paths: Sequence[str], logged: Logged, arguments: Namespace, hinge: bool
) -> Joint:
    """One joint's recordings and simulator, not explained yet."""
    logs, notes = list[Recording](), list[str]()
    reference: np.ndarray | None = None
    try:
        commanded = COMMAND in logged.columns[0].get(name, arguments.columns)
        simulator = Mujoco(arguments.mujoco, name, shared=shared, commanded=commanded)
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
        notes += [*simulator.standing, *map(_still, still)]
    except ValueError as error:
        return Joint(name, None, _refusal(error, paths), logs, None, notes)
    stand = tuple(map(_still, still))
    return Joint(name, None, "", logs, simulator, notes, reference, logs[0], still=stand)


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


def _checked(opened: Mapping[str, Joint]) -> dict[str, CheckedSimulator]:
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
        return _checked({k: v for k, v in opened.items() if k not in others}) if others else {}


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


def _of_others(name: str, checked: Mapping[str, CheckedSimulator]) -> list[Check]:
    """What is wrong elsewhere that this joint's simulator is judged with: zeros of other joints."""
    own = checked.get(name)
    checks = own.checks if own is not None else []
    return [
        c
        for c in checks
        if c.effect == "position_zero" and c.wrong and c.parameter != f"{name} zero"
    ]


def _joint(
    joint: Joint, checked: CheckedSimulator | None, source, shared, arguments: Namespace
) -> Joint:
    """One joint explained, its bodies as they were corrected by those farther out."""
    if joint.simulator is None:
        return joint
    logs = joint.logs
    held = logs[1] if len(logs) > 1 else None
    try:
        zeros = checked.faults.zeros if checked is not None else {}
        commanded = joint.simulator.actuator is not None
        folder = folder_of(arguments.mujoco)
        simulator = Mujoco(source, joint.name, folder, shared, zeros, commanded)
        baseline = simulator if checked is None else checked.standing_on(simulator)
        told = explain(logs[0], baseline, held, simulate=arguments.simulate)
    except ValueError as error:
        return joint._replace(error=_refusal(error, [log.source for log in logs]))
    if checked is not None and checked.changed:
        logs = [log for log in (checked.part.recording, checked.part.holdout) if log is not None]
        if checked.faults.clock:
            joint = joint._replace(commanded=logs[0])
    return joint._replace(told=told, simulator=simulator, logs=logs)


def _log(
    path: str, name: str, own: Mapping[str, Mapping[str, str]], arguments: Namespace, hinge: bool
) -> tuple[Recording, list[str]]:
    """The recording of one joint, with the positions of the others as channels."""
    units = {"force": "N·m", "position": "rad"} if hinge else {"force": "N", "position": "m"}
    units |= arguments.units
    if not own:
        columns = dict(arguments.columns)
        if COMMAND in columns:
            columns["force"] = columns.pop(COMMAND)
        given = Namespace(**vars(arguments) | {"units": units, "columns": columns})
        log, notes = read(path, given)
    else:
        others = {joint: roles["position"] for joint, roles in own.items() if joint != name}
        roles = {**own[name], **others, **dict.fromkeys(OTHERS, "")}
        if COMMAND in roles:
            roles["force"] = roles.pop(COMMAND)
        wanted = references_of(load(Path(path)).columns, list(own), arguments.columns)
        if name in wanted:
            roles["reference"] = wanted[name]
        for role in ("time", "segment"):
            if role in arguments.columns:
                roles[role] = arguments.columns[role]
        if "segment" not in arguments.columns and "segment" in load(Path(path)).columns:
            roles["segment"] = "segment"
        turned = arguments.scale.get("position")
        turns = [*others, *(["reference"] if name in wanted else [])]
        scale = arguments.scale | ({} if turned is None else dict.fromkeys(turns, turned))
        log, notes = read_with_notes(
            path, columns=roles, scale=scale, units=units, period=arguments.period,
            repair=arguments.repair, rate=arguments.rate,
            counts_per_rev=arguments.counts_per_rev,
        )  # fmt: skip
    return log, notes


def _bodies(joint: Joint) -> dict[str, float]:
    """The wrong values of bodies that nothing else could stand for."""
    found: dict[str, float] = {}
    for finding in joint.told.findings if joint.told else []:
        if finding.effect == MISMATCH and not finding.instead:
            found |= {
                key: float(m.value) for key, m in finding.parameters.items() if key[:5] == "body/"
            }
    return found


def _patched(arguments: Namespace, done: list[Joint]) -> Patch | None:
    """The simulator's file with what was found, if one was asked for."""
    if not arguments.save or not arguments.save.lower().endswith(".xml"):
        return None
    return patch(
        arguments.mujoco,
        {joint.name: joint.told for joint in done if joint.told is not None},
        {joint.name: joint.logs for joint in done},
        arguments.save,
        Again(
            {joint.name: joint.simulator for joint in done if joint.simulator is not None},
            {joint.name: joint.commanded for joint in done if joint.commanded is not None},
            {joint.name: joint.reference for joint in done if joint.reference is not None},
        ),
    )


def _document(arguments: Namespace, joint: Joint) -> dict[str, Any]:
    if joint.told is None:
        return {"verdict": "refused", "error": joint.error}
    document = joint.told.to_dict()
    document["recording"]["notes"] = joint.notes
    document["baseline"] |= {"file": arguments.mujoco, "sha256": sha256(arguments.mujoco)}
    return document


def _row(joint: Joint) -> dict[str, Any]:
    """One joint of the summary."""
    if joint.told is None:
        return {"joint": joint.name, "verdict": "refused", "error": joint.error}
    errors = joint.told.fit
    return {
        "joint": joint.name,
        "verdict": joint.told.verdict,
        "findings": [*_severe(joint.told), *map(_said, joint.told.findings)],
        "filtered_force_error": errors["filtered_force_error"],
        "filtered_holdout_force_error": errors["filtered_holdout_force_error"],
        "corrected_before": list(joint.corrected),
        "actuator": [] if joint.simulator is None else joint.simulator.standing,
        "still": list(joint.still),
    }


def _severe(told: Explanation) -> list[str]:
    """What nothing can be named beside."""
    return [each["text"] for each in told.warnings if each["severe"]]


def _said(finding) -> str:
    if finding.effect == MISMATCH:
        return finding.sentence.removeprefix("Wrong in the simulator: ").rpartition("; ")[0]
    return finding.sentence


def _written(arguments: Namespace, found: list[Joint], done: Patch | None) -> dict[str, str]:
    """What was asked for, by path."""
    texts = {}
    if arguments.json:
        texts[arguments.json] = documents.to_json(_whole(arguments, found, done))
    if arguments.report:
        texts |= _pages(arguments, found, done)
    if done is not None:
        texts[arguments.save] = done.text
        if done.forces is not None:
            texts[str(Path(arguments.save).with_name(done.module))] = done.forces
    elif arguments.save:
        told = found[0].told
        assert told is not None  # a single joint without an answer is an error
        texts[arguments.save] = documents.to_json(documents.saved(told.model, *found[0].logs))
    return texts


def _whole(arguments: Namespace, found: list[Joint], done: Patch | None) -> dict[str, Any]:
    """The document: that of the joint where one is named, else of the robot, a row each."""
    after = {} if done is None else {"patch": done.to_dict()}
    if len(found) == 1 and found[0].told is not None:
        return _document(arguments, found[0]) | after
    rows = [_row(joint) | {"explanation": _document(arguments, joint)} for joint in found]
    return {"schema": SCHEMA, "simulator": os.fspath(arguments.mujoco), "joints": rows, **after}


def _pages(arguments: Namespace, found: list[Joint], done: Patch | None) -> dict[str, str]:
    """The page of a joint; of several one of the robot, and theirs behind it."""
    documents_ = [_document(arguments, joint) for joint in found]
    if len(found) == 1:
        return {arguments.report: _page(arguments, documents_[0], found[0], done)}
    path = Path(arguments.report)
    if standard(arguments.report):
        raise ValueError("--report -: several joints have a page each; name a file.")
    texts, links = {}, {}
    for joint, document in zip(found, documents_, strict=True):
        if joint.told is not None:
            links[joint.name] = f"{path.stem}_{joint.name}.html"
            texts[str(path.with_name(links[joint.name]))] = _page(arguments, document, joint, done)
    rows = [_row(joint) for joint in found]
    lines = [] if done is None else [*done.written, *(f"not written: {x}" for x in done.left)]
    again = [] if done is None else [done.rerun.curves(name) for name in done.rerun.joints]
    whole = robot.render(arguments.mujoco, arguments.file, rows, links, lines, again)
    return {arguments.report: whole} | texts


def _page(
    arguments: Namespace, document: Mapping[str, Any], joint: Joint, done: Patch | None
) -> str:
    curves = joint.told.curves if joint.told else {}
    if done is not None and joint.name in done.rerun.joints:
        curves = curves | {"rerun": done.rerun.curves(joint.name)}
    return page.render(document, curves, arguments.typed, today())


def _print(arguments: Namespace, found: list[Joint], done: Patch | None) -> None:
    if len(found) == 1 and found[0].told is not None:
        say(tabulate.explanation(_document(arguments, found[0])))
    else:
        say(tabulate.joints(arguments.mujoco, arguments.file, [_row(joint) for joint in found]))
    if done is not None:
        say(f"\n{tabulate.patch(arguments.save, done.to_dict())}")
    elif arguments.save and found[0].told is not None:
        saved(arguments.save, found[0].told.model)
