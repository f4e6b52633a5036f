"""A robot's bodies, and gravity, by all of its joints: one value of each, and the joints again."""

from argparse import Namespace
from collections import Counter
from collections.abc import Mapping, Sequence

from ..explanation.acceptance import LINEARITY
from ..explanation.agreement import Agreement, Told, agreed, with_bodies
from ..explanation.attributes import CONSTANT
from ..explanation.loads import with_load
from ..explanation.sanity import CheckedSimulator
from ..export.patch import SHARED
from ..simulators.loading import library
from ..simulators.patching import folder_of, patched, with_inertial
from ..terms.effects import EFFECTS
from ..terms.effects.parameter_mismatch import MISMATCH
from .robot_joints import Joint, explained


def together(
    opened: Mapping[str, Joint], found: Sequence[Joint],
    checked: Mapping[str, CheckedSimulator], shared, arguments: Namespace, source: str,
) -> list[Joint]:  # fmt: skip
    """The joints with one answer for the bodies that they move, and for gravity.

    Where a joint by itself finds what a weight can do, all joints are asked for the fewest values
    of bodies and of gravity that explain them all; with these the joints are explained again, each
    by what is its own. They are asked as well where a value of one body may stand for values of two
    joints, and believed then if they need fewer. Where the file does not take the values, or a
    joint is left with clearly more than by its own answer, the joints' own answers stand: what they
    contradict each other in is not written. `source`: the model's file, or its text.
    """
    able = [joint for joint in found if joint.told is not None and joint.simulator is not None]
    needed = any(_of_bodies(joint) or _as_a_weight(joint) for joint in able)
    if not needed and not _by_one_body(able):
        return list(found)
    mujoco, folder = library(), folder_of(arguments.mujoco)
    told = [Told(j.simulator, j.logs, j.told) for j in able if j.simulator and j.told]
    agreement = agreed(told, with_inertial(mujoco, source, folder))
    done = patched(mujoco, source, agreement.values(), folder)
    if done.left:
        return list(found)
    source = done.text if agreement.parameters else source
    names = [joint.name for joint in able]
    again = []
    for joint in found:
        if joint in able and (_of_bodies(joint) or _moves(joint, agreement)):
            new = explained(opened[joint.name], checked, source, shared, arguments, settled=True)
            if clearly_more(new, joint):
                return list(found)
            joint = _joined(joint, new, agreement, names)
        again.append(joint)
    return again if needed or _count(again) < _count(found) else list(found)


def loaded(found: Sequence[Joint]) -> list[Joint]:
    """The joints with one answer for what a body has picked up or put down, if there is one."""
    able = [j for j in found if j.told is not None and j.simulator is not None]
    told = [Told(j.simulator, j.logs, j.told) for j in able if j.simulator and j.told]
    new = dict(zip([joint.name for joint in able], with_load(told), strict=True))
    return [joint._replace(told=new.get(joint.name, joint.told)) for joint in found]


def clearly_more(new: Joint, own: Joint) -> bool:
    """Whether an answer leaves more of a joint's force than its own does, on every recording, by
    more than a sensor of force resolves.
    """
    if new.told is None or own.told is None:
        return True
    names = ("filtered_force_error", "filtered_holdout_force_error")
    pairs = [(new.told.fit[n], own.told.fit[n]) for n in names if own.told.fit[n]]
    return all(a["after"] ** 2 > b["after"] ** 2 + LINEARITY**2 for a, b in pairs)


def _of_bodies(joint: Joint) -> list[str]:
    """The values of bodies that a joint by itself finds wrong."""
    return [key for key in wrong(joint) if key.startswith("body/")]


def shared(joint: Joint) -> set[str]:
    """The values of bodies and of gravity that a joint's answer has wrong."""
    return {key for key in wrong(joint) if key.startswith(SHARED)}


def wrong(joint: Joint) -> set[str]:
    """The values that a joint by itself finds wrong, those that it cannot tell too."""
    findings = joint.told.findings if joint.told else []
    return {key for f in findings if f.effect == MISMATCH for key in (*f.parameters, *f.untold)}


def _as_a_weight(joint: Joint) -> bool:
    """Whether a joint by itself finds what gravity of another direction does to it: a constant
    force, a spring, a force that follows the position.
    """
    findings = joint.told.findings if joint.told else []
    names = {key.split("/")[-1] for key in wrong(joint)}
    places = {EFFECTS[f.effect].family for f in findings if f.effect in EFFECTS}
    return bool(names & {CONSTANT, "stiffness", "springref"}) or "position" in places


def _by_one_body(joints: Sequence[Joint]) -> set[str]:
    """The bodies of which a value would do as well as wrong values of two joints or more."""
    each = Counter(body for joint in joints for body in _could_be_of(joint))
    return {body for body, count in each.items() if count > 1}


def _could_be_of(joint: Joint) -> set[str]:
    """The bodies of which a value would do as well as one that a joint by itself finds wrong: in
    this motion, or in any.
    """
    findings = [f for f in joint.told.findings if f.effect == MISMATCH] if joint.told else []
    own = joint.simulator.attributes() if joint.simulator else {}
    keys = [key for f in findings for others in f.instead.values() for key in others]
    others = [own[key] for key in keys if key in own]
    others += [
        each for f in findings for key in f.parameters if key in own for each in own[key].alike
    ]
    return {each.owner for each in others if each.owner.startswith("body ")}


def _count(joints: Sequence[Joint]) -> int:
    """How many values are wrong by all joints; those of bodies and of gravity are one each."""
    of_all = set[str]().union(*map(shared, joints))
    return len(of_all) + sum(len(wrong(joint) - of_all) for joint in joints)


def _moves(joint: Joint, agreement: Agreement) -> bool:
    """Whether a joint feels one of the values that are wrong."""
    if joint.simulator is None:
        return False
    return agreement.everywhere or bool(agreement.bodies & joint.simulator.bodies())


def _joined(first: Joint, new: Joint, agreement: Agreement, names: Sequence[str]) -> Joint:
    """A joint explained again, with what all say of its bodies before it."""
    if new.told is None or first.told is None:
        return first
    unmoved = first.told.verdict == new.told.verdict == "consistent"
    if unmoved or not _moves(first, agreement):
        return new
    return new._replace(told=with_bodies(new.told, first.told, agreement, names))
