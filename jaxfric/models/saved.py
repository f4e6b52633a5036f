"""The structure of a term as plain data for JSON, and back."""

import dataclasses
import math
from collections.abc import Mapping
from inspect import isabstract
from typing import Any

import jax
import numpy as np

from .. import terms as laws
from ..data.printable import short
from ..terms.base import AbstractTerm, Directional, Sum
from ..terms.effects import law_named
from ..units import DAMPING, SI, STIFFNESS

# What is saved of bristles, and its dimension.
BRISTLES = {"stiffness": STIFFNESS, "damping": DAMPING}


def term_to_dict(term: AbstractTerm) -> dict[str, Any]:
    """The structure of a term: its class, and every field that is not a nonlinear parameter."""
    searched = (
        {p.name for p in term.nonlinear} if not isinstance(term, Sum | Directional) else set()
    )
    fields = {
        f.name: getattr(term, f.name) for f in dataclasses.fields(term) if f.name not in searched
    }
    return {"type": type(term).__name__, **{name: _plain(value) for name, value in fields.items()}}


def _plain(value: Any) -> Any:
    if isinstance(value, AbstractTerm):
        return term_to_dict(value)
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value.tolist() if isinstance(value, jax.Array | np.ndarray) else value


def known(value: Any) -> float | None:
    """A number for JSON; `None` for one that is not known."""
    return None if np.isnan(value) else float(value)


def _is_number(value: Any) -> bool:
    """Whether a value of a JSON document is a number that a float holds; NaN is one not known."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    try:
        return not math.isinf(float(value))
    except OverflowError:
        return False


def number(name: str, value: Any) -> float:
    """A parameter's number; NaN where it is not known."""
    if value is None:
        return float("nan")
    if _is_number(value):
        return float(value)
    shown = short(repr(value))
    raise ValueError(f"Parameter {name} of the model document must be a number, not {shown}.")


def quantity(document: Mapping[str, Any], name: str) -> float | None:
    """A number of a document with its unit, where it has one of that name."""
    value = document.get(name)
    if value is None:
        return None
    if not isinstance(value, Mapping) or "value" not in value:
        raise ValueError(
            f"The model document's {name} is {short(repr(value))}: a number with its value belongs "
            "there."
        )
    return number(name, value["value"])


def levels(document: Mapping[str, Any]) -> list[float] | None:
    """The break-away levels of a document, backward and forward, where it has any."""
    found = document.get("breakaway")
    if found is None:
        return None
    if not isinstance(found, Mapping):
        raise ValueError(f"The model document's breakaway is {short(repr(found))}, no pair.")
    return [number(f"breakaway {way}", found.get(way)) for way in ("backward", "forward")]


def bristles(document: Mapping[str, Any]) -> list[float] | None:
    """Stiffness and damping of the bristles of a document, where it has any."""
    found = document.get("bristles")
    if found is None:
        return None
    try:
        return [number(name, found[name]["value"]) for name in BRISTLES]
    except (KeyError, TypeError) as error:
        raise ValueError(
            f"The model document's bristles are {short(repr(found))}: stiffness and damping, "
            "each with its value, belong there."
        ) from error


def units_of(units: Any) -> dict[str, str]:
    """The names of units in a document."""
    if not isinstance(units, Mapping) or not all(
        quantity in SI and isinstance(unit, str) and unit.isprintable() and short(unit) == unit
        for quantity, unit in units.items()
    ):
        raise ValueError(
            "The model document's units must be names of the force and the position unit, not "
            f"{short(repr(units))}."
        )
    return dict(units)


def term_from_dict(document: Mapping[str, Any]) -> AbstractTerm:
    """The term that [`term_to_dict`][] wrote; its nonlinear parameters are not known."""
    kind = document["type"]
    found = getattr(laws, kind, law_named(kind)) if isinstance(kind, str) else None
    if not (isinstance(found, type) and issubclass(found, AbstractTerm)) or isabstract(found):
        raise ValueError(
            f"The model document names a term {short(repr(kind))} that jaxfric.terms does not have."
        )
    fields = {name: _revived(value) for name, value in document.items() if name != "type"}
    if found is Directional:
        return Directional(_term(fields["positive"]), _term(fields["negative"]))
    if found is Sum:
        return Sum(tuple(_term(part) for part in fields["terms"]))
    for field in dataclasses.fields(found):
        if field.name in fields:
            _check_field(f"{kind}.{field.name}", fields[field.name], field.type)
    return found(**fields)


# Nobody identifies so many waves or poles: a larger number is no number of them.
MOST_COUNTED = 100


def _check_field(name: str, value: Any, kind: Any) -> None:
    """Raise `ValueError` where the field of a term is of another kind than its class says."""
    if kind is int:
        right = isinstance(value, int) and _is_number(value) and 0 <= value <= MOST_COUNTED
    elif kind is float:
        right = _is_number(value) and not math.isnan(value)
    elif kind is str:
        right = isinstance(value, str) and value.isidentifier()
    elif kind == tuple[float, ...]:
        for part in value if isinstance(value, tuple) else [None]:
            _check_field(name, part, float)
        return
    elif isinstance(kind, type) and issubclass(kind, AbstractTerm):
        right = isinstance(value, kind)
    else:
        right = not isinstance(value, AbstractTerm)
    if not right:
        raise ValueError(
            f"{name} of the model document is {short(repr(value))}: {_wanted(kind)} belongs there."
        )


def _wanted(kind: Any) -> str:
    if kind is int:
        return f"a whole number up to {MOST_COUNTED}"
    term = isinstance(kind, type) and issubclass(kind, AbstractTerm)
    return {float: "a finite number", str: "a name"}.get(kind, "a term" if term else "no term")


def _term(value: Any) -> AbstractTerm:
    if not isinstance(value, AbstractTerm):
        shown = short(repr(value))
        raise ValueError(f"The model document is damaged: {shown} stands where a term belongs.")
    return value


def _revived(value: Any) -> Any:
    if isinstance(value, Mapping):
        return term_from_dict(value)
    return tuple(_revived(item) for item in value) if isinstance(value, list) else value
