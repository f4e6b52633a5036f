"""Joints whose transmission gives: the robot explained again with a spring in its model."""

from argparse import Namespace
from collections.abc import Callable, Sequence
from typing import NamedTuple

from ..explanation import springs
from ..explanation.acceptance import HALF
from ..explanation.agreement import Told
from ..explanation.elasticity import DAMPING, STIFFNESS, ElasticJoint, Suspicion, elastic_joint
from ..export.patch import SHARED
from ..simulators import Mujoco, elastic
from ..simulators.loading import library
from ..simulators.patching import folder_of, patched
from ..terms.effects.parameter_mismatch import MISMATCH
from .robot_joints import Joint
from .together import clearly_more, shared, wrong


class Answer(NamedTuple):
    """A robot's joints by a model's file or text; `open`: whether that leaves anything to find."""

    source: str
    joints: list[Joint]
    open: bool = False


def with_springs(
    explained: Callable[[str], list[Joint]], arguments: Namespace, doing: Callable[[str], None]
) -> Answer:
    """The joints by the model, with a spring in the transmission that gives.

    A spring competes with the whole answer without it: it is believed where it leaves no joint
    clearly more, and one of them clearly less, or takes fewer numbers. Where an answer stands that
    leaves no less than one with a spring, what it says of the simulator's values is not sure. Nor
    is it where a spring in a second transmission would leave clearly less: one stands for both
    then.

    **Arguments:** `explained`: the joints by a file or a text.
    """
    answer = _answer(arguments.mujoco, explained(arguments.mujoco))
    if not answer.open:
        return answer
    doing("transmissions that give")
    text, why = elastic.taking(library(), answer.source, folder_of(arguments.mujoco))
    found = elastic_joint(_told(answer), text, folder_of(arguments.mujoco))
    if isinstance(found, ElasticJoint) and why:
        found = found.unwritable(why)
    if found is None or isinstance(found, Suspicion):
        return answer if found is None else _doubted(answer, found)
    again = _with_spring(answer, found, text, explained, arguments)
    if _worse(again.joints, answer.joints):
        return answer
    if not _better(again.joints, answer.joints):
        # Beside a spring that does next to nothing the same values are wrong.
        doubtful = found.share >= HALF and not _values(answer) <= _values(again)
        return _doubted(answer, found.rivalled()) if doubtful else answer
    if (other := _once_more(again, found, text, arguments)) is not None:
        found = other
        again = _with_spring(answer, found, text, explained, arguments)
    if again.open and not found.alone:
        doing("other transmissions")
        more = elastic_joint(_told(again), again.source, folder_of(arguments.mujoco))
        if more is not None and not found.stands_beside(more):
            return _doubted(answer, found.among(more))
    return again


def _told(answer: Answer) -> list[Told]:
    return [Told(j.simulator, j.logs, j.told) for j in answer.joints if j.simulator and j.told]


def _answer(source: str, joints: list[Joint]) -> Answer:
    """An answer, which is open unless all joints are as the model, or a log is certain to be wrong:
    nothing can be named beside that.
    """
    told = [joint.told for joint in joints if joint.told is not None]
    severe = any(each["severe"] for one in told for each in one.warnings)
    return Answer(source, joints, not severe and any(t.verdict != "consistent" for t in told))


def _doubted(answer: Answer, doubt: Suspicion) -> Answer:
    """An answer without sure values of the joints that would feel a spring, nor of those that say
    the same values with them.
    """
    said = {key for j in answer.joints if j.name in doubt.felt for key in shared(j)}
    joints = [
        j._replace(told=springs.unsure(j.told, doubt))
        if j.told and (j.name in doubt.felt or said & shared(j))
        else j
        for j in answer.joints
    ]
    return answer._replace(joints=joints)


def _values(answer: Answer) -> set[tuple[str, str]]:
    """The simulator's values that are wrong, by the joints that say so."""
    return {(joint.name, key) for joint in answer.joints for key in wrong(joint)}


def _with_spring(
    answer: Answer, found: ElasticJoint, text: str, explained: Callable[[str], list[Joint]],
    arguments: Namespace,
) -> Answer:  # fmt: skip
    """The answer by the model, a text, with a spring."""
    simulator = next(j.simulator for j in answer.joints if j.simulator is not None)
    stiffness, damping = (float(found.estimates[name].value) for name in (STIFFNESS, DAMPING))
    number, folder = simulator.joints.index(found.joint), folder_of(arguments.mujoco)
    text = elastic.with_spring(library(), text, number, stiffness, damping, folder)
    again, joints = _answer(text, explained(text)), []
    for new, old in zip(again.joints, answer.joints, strict=True):
        if new.told is not None and old.told is not None:
            new = new._replace(told=springs.with_spring(new.told, old.told, found, new.name))
        joints.append(new)
    return again._replace(joints=joints)


def _once_more(
    answer: Answer, known: ElasticJoint, text: str, arguments: Namespace
) -> ElasticJoint | None:
    """The spring by what the answer with it says of the bodies that bend it and of how late the
    forces are, where that is beyond its interval; `text`: the model without it.
    """
    mujoco, folder = library(), folder_of(arguments.mujoco)
    moved = {
        key: float(value.value)
        for joint in answer.joints
        for finding in (joint.told.findings if joint.told else ())
        for key, value in finding.parameters.items()
        if finding.effect == MISMATCH and key.startswith(SHARED)
    }
    done = patched(mujoco, text, moved, folder)
    if done.left:
        return None
    told = []
    for joint in answer.joints:
        if joint.simulator is not None and joint.told is not None:
            zeros, commanded = joint.simulator.zeros, joint.simulator.actuator is not None
            own = Mujoco(done.text, joint.name, folder, {}, zeros, commanded)
            told.append(Told(own, joint.logs, joint.told))
    found = elastic_joint(told, done.text, folder, known.joint)
    if not isinstance(found, ElasticJoint):
        return None
    old, new = (each.estimates[STIFFNESS] for each in (known, found))
    same = abs(float(new.value) - float(old.value)) <= float(old.half_width())
    return None if same else found


def _worse(new: Sequence[Joint], old: Sequence[Joint]) -> bool:
    """Whether an answer leaves a joint clearly more."""
    return any(clearly_more(n, o) for n, o in zip(new, old, strict=True) if o.told is not None)


def _better(new: Sequence[Joint], old: Sequence[Joint]) -> bool:
    """Whether an answer leaves a joint clearly less, or has fewer numbers."""
    return _worse(old, new) or _numbers(new) < _numbers(old)


def _numbers(joints: Sequence[Joint]) -> int:
    """How many numbers an answer takes, those that several joints say once."""
    found = {
        (finding.sentence, name)
        for joint in joints
        for finding in (joint.told.findings if joint.told else ())
        for name in (*finding.parameters, *finding.untold)
    }
    return len(found)
