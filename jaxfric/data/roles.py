"""What a column's name says: the role of its signal and the unit.

Nothing is guessed: a name is a usual synonym of one role, or is left alone.
"""

import re
from collections.abc import Callable
from functools import partial

from ..units import TORQUES, TURNS
from . import makers
from .languages import PARTICLES, english, plain
from .spellings import FITTING, apart, other_prefix, unit_of

ROLES = (
    "time", "position", "velocity", "force", "reference", "load", "temperature", "segment"
)  # fmt: skip

# `time_stamp`, `TimeStamp` and `time stamp` are all `timestamp`; symbols are taken to the letter,
# for `qd` is a velocity in most logs but `q_d` is a desired position in some.
_SYNONYMS = {
    "time": "time times t timestamp stamp tstamp elapsed elapsedtime seconds sec epoch",
    "position": "position pos q qm q_m x y z angle theta phi displacement encoder enc qpos "
    "jointangle angularposition rotorposition encoderposition linearencoder rotaryencoder azimuth "
    "elevation altitude height stroke",
    "velocity": "velocity vel velo v qd dq qdot q_dot qvel xd dx xdot x_dot speed omega "
    "angularvelocity angularspeed thetadot dtheta rpm",
    "force": "force torque tau current u vir effort moment thrust f i iq i_q qaxiscurrent "
    "controleffort loadcell fx fy fz",
    "reference": "reference ref qg qref xref qdes xdes rposition",
    "load": "load payload loadmass normalload externalload",
    "temperature": "temperature temp",
    "segment": "segment seg segmentid segmentindex run runid trial episode",
    "neighbour_velocity": "neighbourvelocity neighborvelocity",
}
MOTION = frozenset({"position", "velocity"})
_ROLE_OF = {word: role for role, words in _SYNONYMS.items() for word in words.split()}
# One direction of a force: where another force is recorded, it is beside that one.
OF_ONE_DIRECTION = frozenset({"fx", "fy", "fz"})
# Letters that stand for a signal wherever they are in one of its units: M, T, and the speed n.
_ROTATION = {f"{angle}/{per}" for angle in TURNS for per in ("s", "min")} | {"rpm", "krpm"}
_LETTERS = {"m": ("force", TORQUES), "t": ("force", TORQUES), "n": ("velocity", _ROTATION)}
MEASURED = frozenset(
    "measured meas actual act active feedback fb estimate estimated est value motor joint axis "
    "drive actuator cylinder piston".split()
)
# How a signal was treated, in words behind its unit.
_TREATED = frozenset({"filtered", "filt", "raw", "smoothed"})
# Of a signal that is measured, too, its estimate is not needed.
ESTIMATED = frozenset({"estimate", "estimated", "est"})
WANTED = frozenset(
    "desired des reference ref setpoint sp set command commanded cmd target demand goal".split()
)

_BRACKETS = re.compile(r"[\[({]([^\])}]*)[\])}]")
# What stands in a bracket beside units: which signal it is.
_REMARK = re.compile(
    r"^(?:|\d+|[a-z]|(?:axis|joint|motor|drive|link)?[ _-]?\w?\d*|(?:low)?[ _-]?(?:pass)?filtered|"
    r"raw|smoothed|est(?:imated)?|abs(?:olute)?|rel(?:ative)?)$"
)


def words_of(name: str) -> list[str]:
    """The words of a name without its brackets and its maker's code, in English."""
    return [word.lower() for word in _cased(name)]


def _cased(name: str) -> list[str]:
    """As `words_of`, in the name's own capitals: `MN` and `mN` are two units."""
    name = apart(_last(_BRACKETS.sub(" ", makers.named(plain(name)))))
    words = [word for word in re.split(r"[^\w°%]+|_+", name) if word]
    words = [word for word in words if word.lower() not in PARTICLES] or words
    return [each for word in words for each in _english(word)]


def _last(name: str) -> str:
    """The last part of a structure's name, with the one before where it is a unit: `motor.mNm`."""
    before, _, last = name.rpartition(".")
    is_name = len(last.strip()) < 2 or _plain_role([last.strip().lower()])
    if not before or is_name or not any(unit_of(last, role) for role in FITTING):
        return last
    return f"{before.rpartition('.')[2]}_{last}"


def brackets(name: str) -> list[str]:
    """What stands in the brackets of a name."""
    return [text.strip() for text in _BRACKETS.findall(makers.named(plain(name)))]


def _bracketed(name: str, role: str) -> str | None:
    return next((unit for text in brackets(name) if (unit := unit_of(text, role))), None)


def _english(word: str) -> list[str]:
    found = english(word.lower())
    return [word] if found == [word.lower()] else found


def _plain_role(words: list[str]) -> str | None:
    joined = "".join(words)
    return _ROLE_OF.get("_".join(words)) or (_ROLE_OF.get(joined) if len(joined) > 5 else None)


def role_of_words(words: list[str]) -> str | None:
    """The role of a name without unit; what is *wanted* is a reference or nothing."""
    if (role := _plain_role(words)) is not None:
        return role
    if any(word in WANTED for word in words):
        rest = [word for word in words if word not in WANTED]
        return "reference" if rest and role_of_words(rest) == "position" else None
    kept = [word for word in words if word not in MEASURED]
    return (_plain_role(kept) if len(kept) < len(words) else None) or _said_twice(kept)


def _said_twice(words: list[str]) -> str | None:
    """The role that each part of a name stands for: `loadcell_force`, `iq_torque`.

    A letter may number axes (`x_force`), and a unit is none of the words (`time_sec`).
    """
    for end in range(1, len(words)):
        role = _plain_role(words[:end])
        parts = "_".join(words[:end]), "_".join(words[end:])
        if role is None or any(len(part) < 2 or unit_of(part, role) for part in parts):
            continue
        if role in (_plain_role(words[end:]), _said_twice(words[end:])):
            return role
    return None


def describe(name: str) -> tuple[str | None, str | None]:
    """The role that a column's name stands for and the unit that it states, each or `None`."""
    cased, words = _cased(name), words_of(name)
    if found := _by_letter(words, lambda role: _bracketed(name, role)):
        return found
    if (role := role_of_words(words)) is not None:
        return role, _bracketed(name, role) or ("rpm" if words[-1:] == ["rpm"] else None)
    for tail in (1, 2, 3):
        if len(words) <= tail:
            break
        stated = "_".join(cased[-tail:])
        if found := _by_letter(words[:-tail], partial(unit_of, stated)):
            return found
        role = role_of_words(words[:-tail])
        unit = unit_of(stated, role) if role else None
        # `position_in` is rather an input than in inches.
        if unit and (tail > 1 or words[-1] != "in"):
            return role, unit
    return None, None


def _by_letter(words: list[str], unit_as: Callable[[str], str | None]) -> tuple[str, str] | None:
    """The role and the unit of a name that is one letter, where its unit is one of that signal."""
    role, units = _LETTERS.get("".join(word for word in words if word not in MEASURED), (None, ()))
    unit = unit_as(role) if role else None
    return (role, unit) if unit in units else None


def stated_unit(name: str, role: str) -> str | None:
    """The unit that the name of a role's column states, or `None`.

    A column that is given a role may be called anything: then a bracket states a unit, and a tail
    of more than one letter (`foo_rpm`; `axis_a` is hardly in ampere) or an N, also before words
    that say which signal it is (`foo_rpm_filtered`). The unit is what follows the name: `M_Nm` is
    in newton metres.
    """
    own, unit = describe(name)
    if own == role:
        return unit
    if (unit := _bracketed(name, role)) or not all(map(is_remark, brackets(name))):
        return unit
    return unit_of(tail, role) if (tail := _tail(name, role)) else None


def _tail(name: str, role: str) -> str | None:
    """The end of a name that spells a unit of the role, its words joined by `_`."""
    words = _cased(name)
    while len(words) > 1 and (words[-1].isdigit() or words[-1].lower() in MEASURED | _TREATED):
        words = words[:-1]
    for count in (3, 2, 1):
        text = "_".join(words[-count:])
        fits = len(text) > 1 or (text == "N" and re.search(r"(?<![^\W_])N(?![^\W_])", name))
        if len(words) >= count and fits and unit_of(text, role):
            return text
    return None


def other_unit(name: str, role: str) -> str | None:
    """The unit that a name may state as well as the one that is read from it, or `None`.

    A prefix may stand apart from its unit (`drive_k_Nm`, `armNm`), a letter may be the signal or
    a prefix (`MNm`, `uA`), and capitals alone do not tell mega from milli (`TORQUE_MNM`).
    """
    if role == "force" and (unit := _mega(name)):
        return unit
    if describe(name)[0] == role or any(brackets(name)):
        return None
    if not (tail := _tail(name, role)):
        return None
    bare = _BRACKETS.sub(" ", name).strip()
    if bare == tail:
        return unit_of(tail[1:], role) if tail[0] in "Mu" else None
    before = re.sub(r"[\W_]+", "_", bare).rpartition(tail)[0]
    # A letter that is the whole name is no prefix, nor is the end of a word that is parted.
    if not re.search(r"[^\W_](?:[\W_](?:da|mu|\w)[\W_]|[^\W_])$", before):
        return None
    return other_prefix(before, tail, role)


def _mega(name: str) -> str | None:
    """The other unit of a name whose letters are all capitals, also those that have no reason to
    be: those of a word, the metre of a torque.
    """
    letters = "".join(re.findall(r"[^\W\d_]", name))
    symbol = letters.endswith("MN") and len(letters) < 4  # `F_MN`
    if symbol or not name.isupper() or not letters.endswith(("MN", "MNM")):
        return None
    return {"MN": "mN", "mN·m": "MN·m"}.get(stated_unit(name, "force") or "")


def is_remark(text: str) -> bool:
    """Whether a bracket says which signal it is, not in which unit."""
    return bool(_REMARK.match(text.lower())) or set(words_of(text)) <= MEASURED | WANTED
