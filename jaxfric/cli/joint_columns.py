"""Which joints of a simulator a robot's logs hold, and what is wrong with how they are named."""

from argparse import Namespace
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from ..data.joints import COMMAND, ROLES, columns_of, mentioned, unclaimed, unknown
from ..data.tables import load

Columns = dict[str, dict[str, str]]
# What is said of a log as a whole; the velocity of an axis that is no joint of the model.
WHOLE = ("time", "segment", "neighbour_velocity")


class Logged(NamedTuple):
    """The joints of a simulator in its logs.

    - `chosen`: those to be explained; `columns`, of each log by joint and role, empty where a log
      is of one joint and its columns have no joint's name.
    - `without`: joints that cannot be explained, with why; `still`: joints that no log knows of.
    """

    chosen: list[str]
    columns: list[Columns]
    without: dict[str, str]
    still: list[str]


def logged(
    arguments: Namespace, joints: Sequence[str], passive: Collection[str] = frozenset()
) -> Logged:
    """The joints that the recording, and the held-out one, have columns of.

    **Arguments:** `passive`, the joints that no actuator of the model drives.

    **Raises:** `ValueError`, naming the file, where there is none.
    """
    paths = [arguments.file, *([arguments.holdout] if arguments.holdout else [])]
    names = [list(load(Path(path)).columns) for path in paths]
    columns = [
        columns_of(own, joints, arguments.columns, path)
        for own, path in zip(names, paths, strict=True)
    ]
    able = [[joint for joint in joints if _forced(each, joint)] for each in columns]
    if not any(able) and (len(joints) == 1 or arguments.joint):
        return Logged([arguments.joint or joints[0]], [{} for _ in columns], {}, [])
    if strange := unknown(arguments.columns, joints, (*WHOLE, *ROLES)):
        raise ValueError(
            f"--columns {strange}={arguments.columns[strange]}: there is no joint of that name. "
            f"The joints are {', '.join(joints)}: name a joint and position, force or command, "
            f"such as {joints[0]}_force=NAME."
        )
    wanted = [arguments.joint] if arguments.joint else list(joints)
    for path, own in zip(paths, able, strict=True):
        if not set(own) & set(wanted):
            some = wanted[0]
            raise ValueError(
                f"{path}: no joint of the model has a position and a force in this log. The "
                f"joints are {', '.join(joints)}. Name the columns: --columns "
                f"{some}_position=NAME,{some}_force=NAME."
            )
    chosen = [joint for joint in wanted if all(joint in own for own in able)]
    without = {
        joint: _unforced(path, joint, joint in passive)
        for joint in wanted
        for path, each in zip(paths, columns, strict=True)
        if joint in each and not _forced(each, joint)
    }
    if not chosen:
        raise ValueError(next(iter(without.values())))
    known = set().union(*(mentioned(own, joints) for own in names), *columns)
    # A position that is no joint's may be that of one which is missing.
    open_ = any(unclaimed(own, each) for own, each in zip(names, columns, strict=True))
    still = [] if open_ else [joint for joint in joints if joint not in known]
    return Logged(chosen, columns, without, still)


def _unforced(path: str, joint: str, passive: bool) -> str:
    if passive:
        return (
            f"No actuator of the model drives the joint {joint}, and {path} has no force of it: a "
            "passive joint. The other joints are judged along its motion; its own friction, "
            f"damping and stiffness are not judged. If it is driven: --columns {joint}_force=NAME."
        )
    return (
        f"{path}: there is no force of the joint {joint} in this log, so that nothing is said of "
        f"it. Name its column: --columns {joint}_force=NAME."
    )


def _forced(columns: Mapping[str, Mapping[str, str]], joint: str) -> bool:
    return bool({"force", COMMAND} & columns.get(joint, {}).keys())


def check_save(path: str | None, joints: Sequence[str]) -> None:
    """Raise `ValueError` where what is found could not be written to a file of that name."""
    if not path or path.lower().endswith(".xml"):
        return
    if path.lower().endswith((".urdf", ".mjcf")):
        raise ValueError(
            f"--save {path}: what is found is written as MuJoCo's own model, since a URDF has no "
            f"armature and no stiffness. Name it so: --save {Path(path).with_suffix('.xml')}."
        )
    if len(joints) > 1:
        raise ValueError(
            f"--save {path}: several joints are no one model. Save the simulator's file (--save "
            "robot.xml), or one joint (--joint NAME)."
        )
