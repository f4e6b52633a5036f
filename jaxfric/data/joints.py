"""Which columns of a robot's log are whose: `elbow_position`, `elbow/pos`, `q1`, `tau1`.

A column's name is a joint's name and the name of a role, in either order, with words such as
`joint_states` beside them; or a role and a number, where there are as many numbers as joints.
"""

import re
from collections.abc import Iterable, Mapping, Sequence

from .printable import listed
from .roles import describe
from .spellings import apart

ROLES = ("position", "force")
# What the joint's actuator was told, in its own unit, in place of the joint's force.
COMMAND = "command"
# What stands in topics and headers beside joint and role.
_BESIDE = frozenset("joint joints state states jointstate jointstates data robot arm".split())


def _words(name: str) -> list[str]:
    return re.findall(r"\d+|[^\W\d_]+", apart(name).lower())


def columns_of(
    columns: Iterable[str], joints: Sequence[str], given: Mapping[str, str], source: str
) -> dict[str, dict[str, str]]:
    """The columns of position and force of each joint that the log has both of.

    **Arguments:** `given`, what the user says: `elbow` (its position; its force is then the column
    that differs from it in the role alone), `elbow_position`, `elbow_force`, or `elbow_command` for
    what its actuator was told, each with a column.

    **Raises:** `ValueError` if two columns stand for one role of one joint, or a column that is
    given is not there.
    """
    names, given = list(columns), _spelt(given, joints)
    found: dict[str, dict[str, list[str]]] = {joint: {} for joint in joints}
    numbered = _numbered(names)
    for name in names:
        for joint, role in _named(name, joints):
            found[joint].setdefault(role, []).append(name)
    named = any(role in ROLES for roles in found.values() for role in roles)
    if not named and (by_order := _by_order(numbered, joints)):
        found = by_order
    for joint in joints:
        for role, name in _given(joint, given, names, numbered, source).items():
            found[joint][role] = [name]
    for joint, roles in found.items():
        for role, several in roles.items():
            if role in ROLES and len(several) > 1:
                raise ValueError(
                    f"{source}: {len(several)} columns could be the {role} of the joint {joint}: "
                    f"{listed(several)}. Say which: --columns {joint}_{role}={several[0]}."
                )
    picked = {
        joint: {role: roles[role][0] for role in (*ROLES, COMMAND) if role in roles}
        for joint, roles in found.items()
    }
    return {joint: roles for joint, roles in picked.items() if "position" in roles}


def unknown(given: Mapping[str, str], joints: Sequence[str], roles: Sequence[str]) -> str | None:
    """The first name that the user gives a column to and that is no joint, nor a joint's role, nor
    one of the `roles`.
    """
    known = (*joints, *roles, *(f"{j}_{r}" for j in joints for r in (*ROLES, COMMAND, "reference")))
    spelt = zip(given, _spelt(given, joints), strict=True)
    return next((key for key, name in spelt if name not in known and key not in known), None)


def mentioned(columns: Iterable[str], joints: Sequence[str]) -> set[str]:
    """The joints that any column is of, by its name."""
    return {joint for name in columns for joint, _ in _named(name, joints)}


def unclaimed(columns: Iterable[str], found: Mapping[str, Mapping[str, str]]) -> list[str]:
    """Columns of a position that are no joint's."""
    taken = {name for roles in found.values() for name in roles.values()}
    return [name for name in columns if name not in taken and _part(name, "position")]


def _part(name: str, role: str) -> tuple[str, ...] | None:
    """What a column's name says beside a role that begins or ends it; `None` without the role."""
    words = _words(name)
    for at in range(1, len(words)):
        for own, rest in ((words[at:], words[:at]), (words[:at], words[at:])):
            if _role(own) == role:
                return tuple(rest)
    return None


def references_of(
    columns: Iterable[str], joints: Sequence[str], given: Mapping[str, str]
) -> dict[str, str]:
    """The column of each joint's reference, where there is one and no more."""
    names, found = list(columns), dict[str, list[str]]()
    given = _spelt(given, joints)
    for name in names:
        for joint, role in _named(name, joints):
            if role == "reference":
                found.setdefault(joint, []).append(name)
    if not found and (family := _numbered(names).get("reference")) and len(family) == len(joints):
        found = {joint: [family[n]] for joint, n in zip(joints, sorted(family), strict=True)}
    for joint in joints:
        if (own := given.get(f"{joint}_reference")) in names:
            found[joint] = [own]
    return {joint: some[0] for joint, some in found.items() if len(some) == 1}


def _spelt(given: Mapping[str, str], joints: Sequence[str]) -> dict[str, str]:
    """What the user says, its roles by their names: `elbow_effort` is `elbow_force`."""
    found = {}
    for key, column in given.items():
        meant = [] if key in joints else _named(key, joints)
        found["_".join(meant[0]) if len(meant) == 1 else key] = column
    return found


def _named(name: str, joints: Sequence[str]) -> list[tuple[str, str]]:
    """The joint whose name is part of a column's, and the role of the rest; the longest name."""
    words, best = _words(name), list[tuple[int, str, str]]()
    for joint in joints:
        own = _words(joint)
        for at in range(len(words) - len(own) + 1):
            if words[at : at + len(own)] != own:
                continue
            rest = words[:at] + words[at + len(own) :]
            role = _role(rest)
            if role:
                best.append((len(own), joint, role))
    longest = max((size for size, _, _ in best), default=0)
    return list(dict.fromkeys((joint, role) for size, joint, role in best if size == longest))


def _role(words: Sequence[str]) -> str | None:
    plain = "_".join(words)
    return describe(plain)[0] or describe("_".join(w for w in words if w not in _BESIDE))[0]


def _numbered(names: Sequence[str]) -> dict[str, dict[int, str]]:
    """Columns that are a role and a number, by role and number; the first family of each role."""
    found: dict[str, dict[str, dict[int, str]]] = {}
    for name in names:
        words = _words(name)
        digits = [i for i, word in enumerate(words) if word.isdigit()]
        if len(digits) != 1:
            continue
        rest = words[: digits[0]] + words[digits[0] + 1 :]
        if role := _role(rest):
            family = found.setdefault(role, {}).setdefault("_".join(rest), {})
            family[int(words[digits[0]])] = name
    return {role: next(iter(families.values())) for role, families in found.items()}


def _by_order(numbered: Mapping[str, Mapping[int, str]], joints: Sequence[str]):
    """Numbered columns in the order of the joints, where there are as many as joints."""
    found: dict[str, dict[str, list[str]]] = {joint: {} for joint in joints}
    for role, family in numbered.items():
        if len(family) == len(joints) and sorted(family)[0] in (0, 1):
            for joint, number in zip(joints, sorted(family), strict=True):
                found[joint][role] = [family[number]]
    return found if any(found.values()) else None


def _given(joint, given, names, numbered, source: str) -> dict[str, str]:
    """What the user says of a joint."""
    found = {}
    for key, role in ((joint, "position"), (f"{joint}_position", "position"),
                      (f"{joint}_force", "force"), (f"{joint}_command", COMMAND)):  # fmt: skip
        if key not in given:
            continue
        if given[key] not in names:
            raise ValueError(
                f"{source}: there is no column {given[key]!r} for {key}. The columns are: "
                f"{listed(names)}."
            )
        found[role] = given[key]
    if "position" in found and "force" not in found:
        own = _part(found["position"], "position")
        forces = [name for name in names if own and _part(name, "force") == own]
        if len(forces) == 1:
            found["force"] = forces[0]
        places = [
            n for n, name in numbered.get("position", {}).items() if name == found["position"]
        ]
        if places and places[0] in numbered.get("force", {}):
            found["force"] = numbered["force"][places[0]]
    return found
