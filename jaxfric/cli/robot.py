"""`jaxfric explain --mujoco`: a simulator's joints against a log, and its file put right."""

import os
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..data.provenance import sha256
from ..data.targets import standard
from ..explanation import Explanation
from ..explanation.contradictions import CONTRADICTION, with_contradictions
from ..explanation.springs import DOUBTED
from ..explanation.wording import HOLDS_MORE, describes_nothing, nothing_described, unexplained
from ..export.patch import Again, Patch, patch
from ..identification import documents, tabulate
from ..report import page, robot
from ..simulators import elastic
from ..simulators.actuation import passive
from ..simulators.loading import is_hinge, joints_of, library, read as read_model
from ..terms.effects.parameter_mismatch import MISMATCH
from . import joint_columns, robot_text
from .commands import put, today, working
from .messages import say
from .robot_joints import Joint, checked_logs, explained, opened
from .saving import saved
from .together import loaded, together
from .transmissions import Answer, with_springs

SCHEMA = "jaxfric.robot/1"
# Warnings that say why values are not sure.
DOUBTS = (CONTRADICTION, DOUBTED)


def run(arguments: Namespace) -> int:
    """Explain the joints that the log has; print them, and write what was asked for."""
    if arguments.report:
        page.library()
    mujoco = library()
    model = read_model(mujoco, arguments.mujoco)
    joints = elastic.logged(mujoco, model, joints_of(mujoco, model))
    if arguments.joint and arguments.joint not in joints:
        raise ValueError(
            f"{arguments.mujoco}: there is no joint {arguments.joint!r}. Its joints are "
            f"{', '.join(joints)}."
        )
    answer = _explained(arguments, mujoco, model, joints)
    found = answer.joints
    done = [joint for joint in found if joint.told is not None]
    if not done:
        raise ValueError(found[0].error)
    patch_ = _patched(arguments, answer, done)
    texts = _written(arguments, found, patch_)
    for path, text in texts.items():
        put(path, text)
    if not any(standard(path) for path in texts):
        _print(arguments, found, patch_)
    return 0


def _explained(arguments: Namespace, mujoco: Any, model: Any, joints: list[str]) -> Answer:
    """The joints of the log, each by itself; then what all say of the bodies together, and whether
    a transmission gives.
    """
    paths = [arguments.file, *([arguments.holdout] if arguments.holdout else [])]
    names = joints_of(mujoco, model)
    logged = joint_columns.logged(arguments, joints, passive(mujoco, model, names))
    joint_columns.check_save(arguments.save, logged.chosen)
    shared: dict[bytes, Any] = {}
    numbers = {name: i for i, name in enumerate(names)}
    hinges = {name: is_hinge(mujoco, model, numbers[name]) for name in joints}
    with working(f"explaining {arguments.file}") as doing:

        def by(source: str) -> list[Joint]:
            doing("signs, zeros, clocks and limits of all joints")
            there = {
                name: opened(name, shared, paths, logged, arguments, hinges[name], source)
                for name in logged.chosen
            }
            checked = checked_logs(there)
            found = []
            for name in logged.chosen:
                doing(f"joint {name}")
                found.append(explained(there[name], checked, source, shared, arguments))
            doing("the bodies, by all joints")
            found = loaded(together(there, found, checked, shared, arguments, source))
            told = with_contradictions({j.name: j.told for j in found if j.told is not None})
            return [joint._replace(told=told.get(joint.name)) for joint in found]

        answer = with_springs(by, arguments, doing)
    without = [Joint(name, None, why, [], None, []) for name, why in logged.without.items()]
    return answer._replace(joints=[*answer.joints, *without])


def _patched(arguments: Namespace, answer: Answer, done: list[Joint]) -> Patch | None:
    """The simulator's file with what was found, if one was asked for."""
    if not arguments.save or not arguments.save.lower().endswith(".xml"):
        return None
    return patch(
        answer.source,
        {joint.name: joint.told for joint in done if joint.told is not None},
        {joint.name: joint.logs for joint in done},
        arguments.save,
        Again(
            {joint.name: joint.simulator for joint in done if joint.simulator is not None},
            {joint.name: joint.commanded for joint in done if joint.commanded is not None},
            {joint.name: joint.reference for joint in done if joint.reference is not None},
        ),
        arguments.mujoco,
    )


def _document(arguments: Namespace, joint: Joint) -> dict[str, Any]:
    if joint.told is None:
        return {"verdict": "refused", "error": joint.error}
    document = joint.told.to_dict()
    document["recording"]["notes"] = joint.notes
    document["baseline"] |= {"file": arguments.mujoco, "sha256": sha256(arguments.mujoco)}
    return document


def _row(joint: Joint, done: Patch | None) -> dict[str, Any]:
    """One joint of the summary; `file`: what the written file leaves of its force, and `callback`
    what it does with the callback too.
    """
    if joint.told is None:
        return {"joint": joint.name, "verdict": "refused", "error": joint.error}
    errors = joint.told.fit
    written = {} if done is None else {"file": done.after(joint.name)}
    if done is not None and (callback := done.with_forces(joint.name)):
        written["callback"] = callback
    return {
        "joint": joint.name,
        "verdict": joint.told.verdict,
        "findings": [*_severe(joint.told), *map(_said, joint.told.findings)],
        "filtered_force_error": errors["filtered_force_error"],
        "filtered_holdout_force_error": errors["filtered_holdout_force_error"],
        "filtered_noise_floor": errors.get("filtered_noise_floor"),
        "corrected_before": list(joint.corrected),
        "actuator": [] if joint.simulator is None else joint.simulator.standing,
        "still": list(joint.still),
        "contradicted": [w["text"] for w in joint.told.warnings if w["name"] in DOUBTS],
        **_unexplained(joint.told),
        **_describes_nothing(joint.told),
        **written,
    }


def _unexplained(told: Explanation) -> dict[str, str]:
    """What is known of a joint that nothing explains; nothing where that is said already."""
    if told.verdict != "unexplained" or _severe(told):
        return {}
    return {"unexplained": unexplained(told.where, told.not_confirmed)}


def _describes_nothing(told: Explanation) -> dict[str, str]:
    """That the simulator as it is describes nothing of a joint's force, where it does not."""
    before = told.fit["filtered_force_error"]["before"]
    if _severe(told) or not describes_nothing(before, told.fit.get("filtered_noise_floor")):
        return {}
    return {"describes_nothing": nothing_described(told.verdict)}


def _severe(told: Explanation) -> list[str]:
    """What nothing can be named beside, and that the other recording holds more."""
    return [w["text"] for w in told.warnings if w["severe"] or w["name"] == HOLDS_MORE]


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
    rows = [_row(joint, done) | {"explanation": _document(arguments, joint)} for joint in found]
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
    rows = [_row(joint, done) for joint in found]
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
        say(
            robot_text.joints(
                arguments.mujoco, arguments.file, [_row(joint, done) for joint in found]
            )
        )
    if done is not None:
        say(f"\n{robot_text.patch(arguments.save, done.to_dict())}")
    elif arguments.save and found[0].told is not None:
        saved(arguments.save, found[0].told.model)
