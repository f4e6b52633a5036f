"""Which column of a file is which signal: names to roles, and the units that names state.

Nothing is guessed: a name either is a usual synonym of one role or is left alone, two candidates
for a role are an error, and a unit in a name is reported or refused but never converted.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from ..units import SI, TORQUES
from .missing import check_needed, commanded_force, option
from .nearest import meant
from .printable import listed
from .roles import (
    ESTIMATED,
    MOTION,
    OF_ONE_DIRECTION,
    WANTED,
    brackets,
    describe,
    is_remark,
    other_unit,
    stated_unit,
    words_of,
)
from .spellings import FITTING, spelt, unit_of

# What `jaxfric predict` writes beside the time.
PREDICTED = ("force", "measured_force", "in_motion")
# Of the columns that are not used so many are told.
TOLD = 12
# Where a signal has another column, one of these words is not it.
_BESIDE = ESTIMATED | OF_ONE_DIRECTION


def served(
    chosen: Mapping[str, str],
    scale: Mapping[str, float],
    named: Mapping[str, str],
    names: Iterable[str],
) -> str:
    """Which column serves as what, the factors, the units that nothing names, and what of the
    file's `names` is not used.

    `named`: the units of force and position that are [given or stated][jaxfric.data.columns.units].
    """
    pieces = []
    for role, column in chosen.items():
        factor = f" × {scale[role]:g}" if scale.get(role, 1.0) != 1.0 else ""
        name = column if column.isprintable() else repr(column)
        pieces.append(f"{role}{f' from {name}' if column != role else ''}{factor}")
    roles = {"force": {"force"}, "position": {"position", "velocity"}}
    taken = [r for r, those in roles.items() if r not in named and those & set(chosen)]
    default = " and ".join(f"{role} as {SI[role]}" for role in taken)
    option = ",".join(f"{role}=UNIT" for role in taken)
    said = f"Columns: {', '.join(pieces)}."
    said += f" No unit is named: {default} (else --units {option})." * bool(taken)
    others = [repr(n)[1:-1] for n in names if n not in chosen.values()]
    return said + f" Not used: {listed(others, TOLD)}." * bool(others)


def unknown_units(
    chosen: Mapping[str, str], scale: Mapping[str, float], given: Mapping[str, str] | None = None
) -> list[str]:
    """A sentence for each needed column with a bracket that is no unit of it, or with a name that
    may be read as two units; `given`, the units that the user names.
    """
    sentences = []
    for role, name in chosen.items():
        if role not in FITTING or scale.get(role) is not None:
            continue
        if text := _unknown(name, role):
            fault = f"is no unit of {role}" if spelt(text, role) else "is not known"
            sentences.append(
                f"Warning: the unit [{text}] of column {name!r} {fault}; the numbers are taken as "
                f"{_TAKEN[role]}. If they are not: --scale {role}=FACTOR."
            )
        elif role not in (given or {}) and (other := other_unit(name, role)):
            remedy = f"--units {role}={other}" if role in SI else f"--scale {role}=FACTOR"
            sentences.append(
                f"Warning: column {name!r} may be in {stated_unit(name, role)} or in {other}; it "
                f"is taken as {stated_unit(name, role)}. If it is not: {remedy}."
            )
    return sentences


def _unknown(name: str, role: str) -> str | None:
    """What stands in a bracket of a name that states no unit, though it should be one."""
    texts = brackets(name)
    if any(unit_of(text, role) for text in texts):
        return None
    return next((t for t in texts if spelt(t, role) is not None or not is_remark(t)), None)


# What numbers without a stated unit are.
_TAKEN = {
    "time": "s",
    "position": "they are",
    "reference": "being in the unit of the position",
    "velocity": "the unit of the position per second",
    "neighbour_velocity": "the unit of the position per second",
    "force": "they are",
}


def assign(
    names: Iterable[str] | Mapping[str, Any],
    columns: Mapping[str, str | None] | None,
    source: str,
    set_point: bool = False,
    motion: bool = True,
) -> dict[str, str]:
    """Role to column name: what the user says first, then the usual synonyms.

    **Arguments:** `names`, the columns that the file has, with their values `(N,)` where these are
    known: they serve to say what may be meant; `columns`, role to column name as
    given by the user, where an empty name leaves the role out; `source`, for messages;
    `set_point`, whether the time and a reference, a position or a force are enough; `motion`,
    whether a position or velocity is needed: one that the user names may be absent without.

    **Raises:** `ValueError` if a named column is absent, if two columns stand for one role, or
    if time, force, or both position and velocity are missing.
    """
    values = names if isinstance(names, Mapping) else {}
    names, columns = list(names), dict(columns or {})
    if not motion:
        columns = {r: n for r, n in columns.items() if r not in MOTION or n in names}
    chosen = {role: _find(names, name, role, source) for role, name in columns.items() if name}
    candidates: dict[str, list[str]] = {}
    for name in names:
        role = describe(name)[0]
        if role and role not in columns and name not in chosen.values():
            candidates.setdefault(role, []).append(name)
    for role, several in candidates.items():
        found = [name for name in several if not _BESIDE & set(words_of(name))] or several
        if role == "force" and set(PREDICTED) <= set(names):
            raise ValueError(
                f"{source}: jaxfric predict wrote this table of forces, in which no motion is. "
                "Give the recording that it was made from."
            )
        if len(found) > 1:
            raise ValueError(
                f"{source}: {len(found)} columns could be the {role}: {listed(found)}. "
                f"Say which: --columns {option({role: found[0]})} "
                f"(columns={{{role!r}: {found[0]!r}}})."
            )
        chosen[role] = found[0]
    if set_point and "time" in chosen and {"reference", "position", "force"} & set(chosen):
        return chosen
    if "force" not in {*chosen, *columns} and (told := commanded_force(chosen, names)):
        chosen["force"] = told
    check_needed(chosen, names, columns, source, motion, values)
    return chosen


def _find(names: list[str], name: str, role: str, source: str) -> str:
    if name in names:
        return name
    alike = [other for other in names if other.strip().lower() == name.strip().lower()]
    if len(alike) == 1:
        return alike[0]
    raise ValueError(
        f"{source}: there is no column {name!r} for the {role}.{meant(name, names)} The columns "
        f"are: {listed(names)}."
    )


def commanded(chosen: Mapping[str, str], given: Mapping[str, str | None] | None) -> list[str]:
    """A sentence where the force that is read is the commanded one, which the user has not
    `given`.
    """
    name = chosen.get("force", "")
    if "force" in (given or {}) or not WANTED & set(words_of(name)):
        return []
    return [
        f"No force is measured: {name!r}, the commanded one, is taken for it, which will do where "
        "the drive gives what it is told."
    ]


# What a force of that name is in unless a unit is stated.
_OF_WORD = {"torque": "N·m", "current": "A"}


def units(
    chosen: Mapping[str, str], scale: Mapping[str, float], given: Mapping[str, str]
) -> dict[str, str]:
    """Names of the force and position unit: given, else stated by the columns' names, else none.

    A scaled column no longer has the unit in its name. A column called torque is in N·m and one
    called current in A unless said otherwise, and the motion that goes with a torque is an
    angle: torque times rad/s is power.
    """
    found = {}
    force, position = _stated("force", chosen, scale), _stated("position", chosen, scale)
    if position is None and (velocity := _stated("velocity", chosen, scale)):
        position = velocity.removesuffix("/s") if velocity.endswith("/s") else None
    named = "force" in chosen and scale.get("force") is None  # a set-point may come without
    words = words_of(chosen["force"]) if named else []
    if force is None:  # a torque current is a current
        said = [_OF_WORD[word] for word in words if word in _OF_WORD]
        force = said[-1] if said else None
    if force:
        found["force"] = force
    if position is None and (given.get("force") or force) in TORQUES:
        position = None if scale.get("position") is not None else "rad"
    if position:
        found["position"] = position
    return found | dict(given)


def _stated(role: str, chosen: Mapping[str, str], scale: Mapping[str, float]) -> str | None:
    return stated_unit(chosen[role], role) if role in chosen and scale.get(role) is None else None
