"""What to say where a role has no column: which one may be meant, to name it."""

import shlex
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from .printable import listed
from .roles import MOTION, WANTED, describe, stated_unit, words_of

# Words of what is in a signal's unit and not the signal.
_BESIDE = WANTED | frozenset(
    "error err deviation difference limit max min offset tolerance acceleration".split()
)


def check_needed(
    chosen: Mapping[str, str],
    names: list[str],
    given: Mapping[str, str | None],
    source: str,
    motion: bool,
    values: Mapping[str, Any],
) -> None:
    """Refuse a table without time, force or, with `motion`, position and velocity.

    **Raises:** `ValueError` with the whole option that names the columns; where one alone can be
    meant, by its unit or as the only one that rises all along, the option has it and says why.
    """
    missing = [role for role in ("time", "force") if role not in chosen]
    if motion and not MOTION & set(chosen):
        missing.append("position")
    if not missing:
        return
    wanted = ["position or velocity" if role == "position" else role for role in missing]
    likely, reasons = _likely(missing, chosen, names, values)
    roles = ["velocity" if r == "position" and "velocity" in likely else r for r in missing]
    whole = option(dict(given) | dict.fromkeys(roles, "NAME") | likely)
    clock = " Without a clock: --rate HZ (rate=)." if "time" in missing else ""
    raise ValueError(
        f"{source}: no column is recognised as {' nor as '.join(wanted)}. The columns are: "
        f"{listed(names)}. Name them: --columns {whole}.{reasons}{clock}"
    )


def _likely(
    missing: list[str], chosen: Mapping[str, str], names: list[str], values: Mapping[str, Any]
) -> tuple[dict[str, str], str]:
    """The one column of each missing role that can be meant, and why."""
    free = _free(chosen, names)
    found, reasons = {}, ""
    for role in missing:
        fitting = [name for name in free if _states(name, role)]
        if role == "position" and not fitting:
            role, fitting = "velocity", [name for name in free if _states(name, "velocity")]
        if len(fitting) == 1:
            found[role] = fitting[0]
            reasons += f" {fitting[0]!r} is the only one in a unit of {role}."
    if "time" in missing and "time" not in found:
        others = [name for name in free if name in values and name not in found.values()]
        rising = {n: step for n in others if (step := _rise(values[n])) is not None}
        if len(rising) == 1:
            ((found["time"], step),) = rising.items()
            reasons += (
                f" {found['time']!r} is the only one that rises all along, by {step:.4g} a row: "
                "the time, if that is in s; if in ms, add --scale time=0.001."
            )
    return found, reasons


def _free(chosen: Mapping[str, str], names: Iterable[str]) -> list[str]:
    """The columns that may be a signal without a column."""
    taken = {name for role, name in chosen.items() if role != "load"}  # a load may be the force
    return [name for name in names if name not in taken and not _BESIDE & set(words_of(name))]


def _states(name: str, role: str) -> bool:
    """Whether a name states a unit of the role; `in` is rather an input than inches."""
    return stated_unit(name, role) is not None and words_of(name)[-1:] != ["in"]


def _rise(column: Any) -> float | None:
    """The usual step of numbers that rise from each row to the next, or `None`."""
    column = np.asarray(column)
    if column.dtype.kind not in "iuf" or column.ndim != 1 or column.size < 3:
        return None
    steps = np.diff(column.astype(np.float64))
    return float(np.median(steps)) if np.all(steps > 0) else None


def option(columns: Mapping[str, str | None]) -> str:
    """The option's value that names columns, fit for a shell."""
    pairs = ((role, name or "") for role, name in columns.items())
    value = ",".join(f'{r}="{n}"' if "," in n else f"{r}={n}" for r, n in pairs)
    bare = value.replace('"', "").replace("=", "").replace(",", "")
    return value if '"' not in value and bare.isidentifier() else shlex.quote(value)


def commanded_force(chosen: Mapping[str, str], names: Iterable[str]) -> str | None:
    """The one column of a commanded force, where no other can be the force by its unit."""
    names, found = list(names), []
    for name in names:
        words = words_of(name)
        rest = [word for word in words if word not in WANTED]
        if len(rest) < len(words) and describe("_".join(rest))[0] == "force":
            found.append(name)
    measured = any(_states(name, "force") for name in _free(chosen, names))
    return found[0] if len(found) == 1 and not measured else None
