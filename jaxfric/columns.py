"""Which column of a file is which signal: names to roles, and the units that names state.

Nothing is guessed: a name either is a usual synonym of one role or is left alone, two candidates
for a role are an error, and a unit in a name is reported or refused but never converted.
"""

import re
from collections.abc import Iterable, Mapping

ROLES = (
    "time", "position", "velocity", "force", "reference", "load", "temperature", "segment"
)  # fmt: skip

# `time_stamp`, `TimeStamp` and `time stamp` are all `timestamp`; symbols are taken to the letter,
# for `qd` is a velocity in most logs but `q_d` is a desired position in some.
_SYNONYMS = {
    "time": "time times t timestamp tstamp elapsed elapsedtime seconds sec",
    "position": "position pos q qm q_m x angle theta displacement encoder enc qpos jointangle "
    "angularposition rotorposition",
    "velocity": "velocity vel v qd dq qdot q_dot qvel xd dx xdot x_dot speed omega "
    "angularvelocity angularspeed thetadot dtheta rpm",
    "force": "force torque tau current u vir effort moment thrust f i iq i_q qaxiscurrent "
    "controleffort",
    "reference": "reference ref qg qref xref qdes xdes rposition",
    "load": "load payload loadmass normalload externalload",
    "temperature": "temperature temp",
    "segment": "segment seg segmentid segmentindex run runid trial episode",
}
_ROLE_OF = {word: role for role, words in _SYNONYMS.items() for word in words.split()}
_MEASURED = frozenset("measured meas actual act feedback fb motor joint axis drive".split())
_WANTED = frozenset(
    "desired des reference ref setpoint sp set command commanded cmd target demand goal".split()
)

# Spelling in a name -> the name of the unit. Letters that are synonyms (`s` alone) still match
# as words, because a unit is only taken off where something is left in front of it.
_UNITS = {
    "s": "s", "sec": "s", "seconds": "s", "ms": "ms", "msec": "ms", "us": "µs", "usec": "µs",
    "µs": "µs", "μs": "µs", "ns": "ns", "min": "min",
    "m": "m", "mm": "mm", "um": "µm", "µm": "µm", "μm": "µm", "nm": "nm", "cm": "cm",
    "rad": "rad", "mrad": "mrad", "deg": "deg", "°": "deg", "degrees": "deg", "rev": "rev",
    "counts": "counts", "count": "counts", "cts": "counts", "inc": "counts", "ticks": "counts",
    "n": "N", "kn": "kN", "mn": "mN", "a": "A", "ma": "mA", "v": "V", "mv": "mV",
    "n·m": "N·m", "n*m": "N·m", "n.m": "N·m", "n m": "N·m", "n_m": "N·m",
    "mnm": "mN·m", "unm": "µN·m", "knm": "kN·m", "µnm": "µN·m", "%": "%",
    "rpm": "rpm", "1/min": "rpm", "mps": "m/s", "hz": "rev/s",
}  # fmt: skip
_PER_SECOND = re.compile(r"^(.+?)(?:/s(?:ec)?|[_ ]?s(?:\^?-1|⁻¹)|_per_s|_s|ps)$")
_BRACKETS = re.compile(r"[\[({]([^\])}]*)[\])}]")
_LENGTHS = {"m", "mm", "µm", "nm", "cm", "rad", "mrad", "deg", "rev", "counts"}
_FITTING = {
    "time": {"s", "ms", "µs", "ns", "min"},
    "position": _LENGTHS,
    "reference": _LENGTHS,
    "velocity": {f"{length}/s" for length in _LENGTHS} | {"rpm"},
    "force": {"N", "kN", "mN", "MN", "A", "mA", "V", "mV", "%"}
    | {f"{prefix}N·m" for prefix in ("", "m", "µ", "k", "M")},
}
_SECONDS = {"ms": "0.001", "µs": "1e-06", "ns": "1e-09", "min": "60"}


def unit_of(text: str, role: str) -> str | None:
    """The unit that a suffix or a bracket spells, or `None` where it is none that fits the role."""
    unit = _spelt(text, role)
    return unit if unit in _FITTING.get(role, (unit,)) else None


def _spelt(text: str, role: str) -> str | None:
    """As [`unit_of`][]; `nm` is newton metre on a force and nanometre on a position."""
    raw, text = text.strip(), text.strip().lower()
    if text == "nm" and role == "force":
        return "N·m"
    if role == "force" and raw in ("MN", "MNm"):
        return {"MN": "MN", "MNm": "MN·m"}[raw]
    if text in _UNITS:
        return _UNITS[text]
    per_second = _PER_SECOND.match(text)
    inner = _UNITS.get(per_second[1]) if per_second else None
    return f"{inner}/s" if inner else None


def _words(name: str) -> list[str]:
    name = re.sub(r"([a-z])([A-Z])", r"\1_\2", name.rsplit(".", 1)[-1])
    return [word for word in re.split(r"[^0-9a-zµμ°%]+", name.lower()) if word]


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
    bracket = _BRACKETS.search(name)
    words = _words(_BRACKETS.sub(" ", name))
    if (role := _role_of_words(words)) is not None:
        stated = bracket[1] if bracket else "rpm" if words[-1:] == ["rpm"] else ""
        return role, unit_of(stated, role)
    for tail in (1, 2, 3):
        role = _role_of_words(words[:-tail]) if len(words) > tail else None
        unit = unit_of("_".join(words[-tail:]), role) if role else None
        if unit:
            return role, unit
    return None, None


def assign(
    names: Iterable[str],
    columns: Mapping[str, str | None] | None,
    source: str,
    set_point: bool = False,
) -> dict[str, str]:
    """Role to column name: what the user says first, then the usual synonyms.

    **Arguments:** `names`, the columns that the file has; `columns`, role to column name as
    given by the user, where an empty name leaves the role out; `source`, for messages;
    `set_point`, whether the time and a reference, a position or a force are enough.

    **Raises:** `ValueError` if a named column is absent, if two columns stand for one role, or
    if time, force, or both position and velocity are missing.
    """
    names, columns = list(names), dict(columns or {})
    chosen = {role: _find(names, name, role, source) for role, name in columns.items() if name}
    candidates: dict[str, list[str]] = {}
    for name in names:
        role = describe(name)[0]
        if role and role not in columns and name not in chosen.values():
            candidates.setdefault(role, []).append(name)
    for role, found in candidates.items():
        if len(found) > 1:
            raise ValueError(
                f"{source}: {len(found)} columns could be the {role}: {', '.join(found)}. "
                f"Say which: --columns {role}={found[0]} (columns={{{role!r}: {found[0]!r}}})."
            )
        chosen[role] = found[0]
    if set_point and "time" in chosen and {"reference", "position", "force"} & set(chosen):
        return chosen
    _check_needed(chosen, names, source)
    return chosen


def _find(names: list[str], name: str, role: str, source: str) -> str:
    if name in names:
        return name
    alike = [other for other in names if other.strip().lower() == name.strip().lower()]
    if len(alike) == 1:
        return alike[0]
    raise ValueError(
        f"{source}: there is no column {name!r} for the {role}. The columns are: "
        f"{', '.join(names) or 'none'}."
    )


def _check_needed(chosen: Mapping[str, str], names: list[str], source: str) -> None:
    missing = [role for role in ("time", "force") if role not in chosen]
    if "position" not in chosen and "velocity" not in chosen:
        missing.append("position")
    if missing:
        wanted = ["position or velocity" if role == "position" else role for role in missing]
        example = ",".join(f"{role}=NAME" for role in missing)
        raise ValueError(
            f"{source}: no column is recognised as {' nor as '.join(wanted)}. The columns are: "
            f"{', '.join(names) or 'none'}. Name them: --columns {example}."
        )


def check_per_second(chosen: Mapping[str, str], scale: Mapping[str, float], source: str) -> None:
    """Refuse a clock that is not in seconds, and a velocity that is not position per second.

    Only names that state a unit are judged, and a role with a `scale` is the user's own word.

    **Raises:** `ValueError` with the factor to give.
    """
    stated = {role: describe(name)[1] for role, name in chosen.items() if scale.get(role) is None}
    time = stated.get("time")
    if time in _SECONDS:
        raise ValueError(
            f"{source}: the column {chosen['time']!r} says that time is in {time}, but time must "
            f"be in s. Give the factor: --scale time={_SECONDS[time]} (or time=1 if it is in s)."
        )
    velocity, position = stated.get("velocity"), stated.get("position")
    if velocity == "rpm":
        raise ValueError(
            f"{source}: the column {chosen['velocity']!r} is in rpm, but velocity must be per "
            "second. Give the factor: --scale velocity=0.10471975512 for rad/s."
        )
    if velocity and position and velocity != f"{position}/s":
        raise ValueError(
            f"{source}: {chosen['velocity']!r} is in {velocity}, but {chosen['position']!r} is in "
            f"{position}: one of them needs a factor, --scale velocity=FACTOR (or position=)."
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
    if position is None and (given.get("force") or force or "").endswith("N·m"):
        position = None if scale.get("position") is not None else "rad"
    if position:
        found["position"] = position
    return found | dict(given)


def _stated(role: str, chosen: Mapping[str, str], scale: Mapping[str, float]) -> str | None:
    return describe(chosen[role])[1] if role in chosen and scale.get(role) is None else None
