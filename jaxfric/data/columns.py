"""Which column of a file is which signal: names to roles, and the units that names state.

Nothing is guessed: a name either is a usual synonym of one role or is left alone, two candidates
for a role are an error, and a unit in a name is reported or refused but never converted.
"""

import re
import shlex
from collections.abc import Iterable, Mapping

from ..units import SI, TORQUES
from . import makers
from .languages import PARTICLES, english, plain
from .nearest import meant
from .printable import listed
from .spellings import FITTING, apart, spelt, unit_of

ROLES = (
    "time", "position", "velocity", "force", "reference", "load", "temperature", "segment"
)  # fmt: skip

# `time_stamp`, `TimeStamp` and `time stamp` are all `timestamp`; symbols are taken to the letter,
# for `qd` is a velocity in most logs but `q_d` is a desired position in some.
_SYNONYMS = {
    "time": "time times t timestamp stamp tstamp elapsed elapsedtime seconds sec",
    "position": "position pos q qm q_m x y z angle theta displacement encoder enc qpos jointangle "
    "angularposition rotorposition encoderposition azimuth elevation altitude height stroke",
    "velocity": "velocity vel velo v qd dq qdot q_dot qvel xd dx xdot x_dot speed omega "
    "angularvelocity angularspeed thetadot dtheta rpm",
    "force": "force torque tau current u vir effort moment thrust f i iq i_q qaxiscurrent "
    "controleffort",
    "reference": "reference ref qg qref xref qdes xdes rposition",
    "load": "load payload loadmass normalload externalload",
    "temperature": "temperature temp",
    "segment": "segment seg segmentid segmentindex run runid trial episode",
    "neighbour_velocity": "neighbourvelocity neighborvelocity",
}
MOTION = frozenset({"position", "velocity"})
_ROLE_OF = {word: role for role, words in _SYNONYMS.items() for word in words.split()}
_MEASURED = frozenset(
    "measured meas actual act active feedback fb estimate estimated est value motor joint axis "
    "drive actuator cylinder piston".split()
)
# How a signal was treated, in words behind its unit.
_TREATED = frozenset({"filtered", "filt", "raw", "smoothed"})
# Of a signal that is measured, too, its estimate is not needed.
_ESTIMATED = frozenset({"estimate", "estimated", "est"})
_WANTED = frozenset(
    "desired des reference ref setpoint sp set command commanded cmd target demand goal".split()
)

# What `jaxfric predict` writes beside the time.
PREDICTED = ("force", "measured_force", "in_motion")
# Of the columns that are not used so many are told.
TOLD = 12

_BRACKETS = re.compile(r"[\[({]([^\])}]*)[\])}]")
# What stands in a bracket beside units: which signal it is.
_REMARK = re.compile(
    r"^(?:|\d+|[a-z]|(?:axis|joint|motor|drive|link)?[ _-]?\w?\d*|(?:low)?[ _-]?(?:pass)?filtered|"
    r"raw|smoothed|est(?:imated)?|abs(?:olute)?|rel(?:ative)?)$"
)


def _words(name: str) -> list[str]:
    """The words of a name without its brackets and its maker's code, in English."""
    return [word.lower() for word in _cased(name)]


def _cased(name: str) -> list[str]:
    """As `_words`, in the name's own capitals: `MN` and `mN` are two units."""
    name = apart(_BRACKETS.sub(" ", makers.named(plain(name))).rsplit(".", 1)[-1])
    words = [word for word in re.split(r"[^\w°%]+|_+", name) if word]
    words = [word for word in words if word.lower() not in PARTICLES] or words
    return [each for word in words for each in _english(word)]


def _english(word: str) -> list[str]:
    found = english(word.lower())
    return [word] if found == [word.lower()] else found


def _plain_role(words: list[str]) -> str | None:
    joined = "".join(words)
    return _ROLE_OF.get("_".join(words)) or (_ROLE_OF.get(joined) if len(joined) > 5 else None)


def _role_of_words(words: list[str]) -> str | None:
    """The role of a name without unit; what is *wanted* is a reference or nothing."""
    if (role := _plain_role(words)) is not None:
        return role
    if any(word in _WANTED for word in words):
        rest = [word for word in words if word not in _WANTED]
        return "reference" if rest and _role_of_words(rest) == "position" else None
    kept = [word for word in words if word not in _MEASURED]
    return _plain_role(kept) if len(kept) < len(words) else None


def describe(name: str) -> tuple[str | None, str | None]:
    """The role that a column's name stands for and the unit that it states, each or `None`."""
    bracket = _BRACKETS.search(makers.named(plain(name)))
    cased, words = _cased(name), _words(name)
    if (role := _role_of_words(words)) is not None:
        stated = bracket[1] if bracket else "rpm" if words[-1:] == ["rpm"] else ""
        return role, unit_of(stated, role)
    for tail in (1, 2, 3):
        role = _role_of_words(words[:-tail]) if len(words) > tail else None
        unit = unit_of("_".join(cased[-tail:]), role) if role else None
        # `position_in` is rather an input than in inches.
        if unit and (tail > 1 or words[-1] != "in"):
            return role, unit
    return None, None


def stated_unit(name: str, role: str) -> str | None:
    """The unit that the name of a role's column states, or `None`.

    A column that is given a role may be called anything: then a bracket states a unit, and a tail
    of more than one letter (`foo_rpm`; `axis_a` is hardly in ampere), also before words that say
    which signal it is (`foo_rpm_filtered`).
    """
    own, unit = describe(name)
    if own == role:
        return unit
    if bracket := _BRACKETS.search(makers.named(name)):
        return unit_of(bracket[1], role)
    words = _cased(name)
    while len(words) > 1 and (words[-1].isdigit() or words[-1].lower() in _MEASURED | _TREATED):
        words = words[:-1]
    tails = ("_".join(words[-tail:]) for tail in (3, 2, 1) if len(words) >= tail)
    return next((u for t in tails if len(t) > 1 and (u := unit_of(t, role))), None)


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


def unknown_units(chosen: Mapping[str, str], scale: Mapping[str, float]) -> list[str]:
    """A sentence for each bracket in the name of a needed column that is no unit of it."""
    sentences = []
    for role, name in chosen.items():
        bracket = _BRACKETS.search(makers.named(name))
        if role not in FITTING or scale.get(role) is not None or not bracket:
            continue
        text = bracket[1].strip()
        if unit_of(text, role) is not None or (spelt(text, role) is None and _is_remark(text)):
            continue
        fault = f"is no unit of {role}" if spelt(text, role) else "is not known"
        sentences.append(
            f"Warning: the unit [{text}] of column {name!r} {fault}; the numbers are taken as "
            f"{_TAKEN[role]}. If they are not: --scale {role}=FACTOR."
        )
    return sentences


def _is_remark(text: str) -> bool:
    """Whether a bracket says which signal it is, not in which unit."""
    return bool(_REMARK.match(text.lower())) or set(_words(text)) <= _MEASURED | _WANTED


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
    names: Iterable[str],
    columns: Mapping[str, str | None] | None,
    source: str,
    set_point: bool = False,
    motion: bool = True,
) -> dict[str, str]:
    """Role to column name: what the user says first, then the usual synonyms.

    **Arguments:** `names`, the columns that the file has; `columns`, role to column name as
    given by the user, where an empty name leaves the role out; `source`, for messages;
    `set_point`, whether the time and a reference, a position or a force are enough; `motion`,
    whether a position or velocity is needed: one that the user names may be absent without.

    **Raises:** `ValueError` if a named column is absent, if two columns stand for one role, or
    if time, force, or both position and velocity are missing.
    """
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
        found = [name for name in several if not _ESTIMATED & set(_words(name))] or several
        if role == "force" and set(PREDICTED) <= set(names):
            raise ValueError(
                f"{source}: jaxfric predict wrote this table of forces, in which no motion is. "
                "Give the recording that it was made from."
            )
        if len(found) > 1:
            raise ValueError(
                f"{source}: {len(found)} columns could be the {role}: {listed(found)}. "
                f"Say which: --columns {_option(role, found[0])} "
                f"(columns={{{role!r}: {found[0]!r}}})."
            )
        chosen[role] = found[0]
    if set_point and "time" in chosen and {"reference", "position", "force"} & set(chosen):
        return chosen
    _check_needed(chosen, names, source, motion)
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


def _check_needed(chosen: Mapping[str, str], names: list[str], source: str, motion: bool) -> None:
    missing = [role for role in ("time", "force") if role not in chosen]
    if motion and not MOTION & set(chosen):
        missing.append("position")
    if missing:
        wanted = ["position or velocity" if role == "position" else role for role in missing]
        example = ",".join(f"{role}=NAME" for role in missing)
        clock = " Without a clock: --rate HZ (rate=)." if "time" in missing else ""
        raise ValueError(
            f"{source}: no column is recognised as {' nor as '.join(wanted)}. The columns are: "
            f"{listed(names)}. Name them: --columns {example}.{clock}"
            + ("" if "force" in chosen else _commanded(names))
        )


def _option(role: str, name: str) -> str:
    """The option's value that names a column, fit for a shell."""
    value = f'{role}="{name}"' if "," in name else f"{role}={name}"
    return value if value.replace('"', "").isidentifier() else shlex.quote(value)


def _commanded(names: Iterable[str]) -> str:
    """What to do with the one column that holds the commanded force."""
    found = []
    for name in names:
        words = _words(name)
        rest = [word for word in words if word not in _WANTED]
        if len(rest) < len(words) and _role_of_words(rest) == "force":
            found.append(name)
    if len(found) != 1:
        return ""
    return (
        f" {found[0]!r} is the commanded force; where the drive gives what it is told, that will "
        f"do: --columns {_option('force', found[0])}."
    )


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
    words = _words(chosen["force"]) if named else []
    if force is None:
        force = "N·m" if "torque" in words else "A" if "current" in words else None
    if force:
        found["force"] = force
    if position is None and (given.get("force") or force) in TORQUES:
        position = None if scale.get("position") is not None else "rad"
    if position:
        found["position"] = position
    return found | dict(given)


def _stated(role: str, chosen: Mapping[str, str], scale: Mapping[str, float]) -> str | None:
    return stated_unit(chosen[role], role) if role in chosen and scale.get(role) is None else None
