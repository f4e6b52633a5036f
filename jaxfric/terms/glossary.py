"""The effects told to a reader: their equations, parameters, traces, and what tells them apart."""

import inspect
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from ..data.provenance import versions
from ..looks.text import WIDTH
from ..units import spell
from .base import AbstractTerm
from .effect import ANY
from .effects import EFFECTS, Effect, effect
from .sample import Parameter

SCHEMA = "jaxfric.effects/1"


def document(names: Sequence[str] = ()) -> dict[str, Any]:
    """The effects of those names (default: all) as plain data (schema `jaxfric.effects/1`).

    Units are N, m, s. **Raises:** `ValueError` for a name that there is not.
    """
    chosen = [effect(name) for name in names] or list(EFFECTS.values())
    return {
        "schema": SCHEMA,
        "effects": [_entry(each) for each in chosen],
        "versions": versions(),
    }


def _entry(each: Effect) -> dict[str, Any]:
    return {
        "name": each.name,
        "equation": each.equation,
        "where": list(each.coordinates),
        "needs": sorted(each.needs),
        "confusable_with": list(each.confusable_with),
        "separate_by": each.separate_by,
        "first_order": each.first_order,
        "terms": [_shape(term) for term in each.shapes(ANY)],
    }


def _shape(term: AbstractTerm) -> dict[str, Any]:
    """A term that models an effect, one side of it where the directions differ."""
    inner = getattr(term, "positive", term)
    solved = [_parameter(p, "solved for") for p in inner.affine]
    searched = [_parameter(p, _bounds(p)) for p in inner.nonlinear]
    return {
        "term": type(inner).__name__,
        "law": _summary(inner),
        "by_direction": inner is not term,
        "parameters": solved + searched,
    }


def _parameter(parameter: Parameter, found: str) -> dict[str, Any]:
    return {"name": parameter.name, "unit": spell(parameter.dimension), "range": found}


def _bounds(parameter: Parameter) -> str:
    """Where a nonlinear parameter is searched for, in words, or in numbers where these are fixed.

    The words are the first line of what is said about the function that draws the bounds.
    """
    said = inspect.getdoc(parameter.bounds)
    if said:
        return _lowered(said.splitlines()[0].rstrip("."))
    low, high = parameter.bounds(ANY)
    return f"from {float(low):g} to {float(high):g}"


def _lowered(text: str) -> str:
    return text[:1].lower() + text[1:]


def _summary(term: AbstractTerm) -> str:
    """The first paragraph of a law's docstring, on one line."""
    paragraph = (inspect.getdoc(type(term)) or "").split("\n\n")[0]
    return " ".join(paragraph.split())


def overview() -> str:
    """All effects, some lines each."""
    told = document()["effects"]
    blocks = ["\n".join(_brief(entry)) for entry in told]
    return "\n\n".join([*blocks, "jaxfric effects NAME: parameters, units and bounds of one."])


def _brief(entry: Mapping[str, Any]) -> list[str]:
    rows = [("shows over", _words(entry["where"]) or "the columns of the parameter that is wrong")]
    if entry["needs"]:
        rows.append(("needs", _words(entry["needs"])))
    if entry["confusable_with"]:
        rows.append(("confusable", ", ".join(entry["confusable_with"])))
    if entry["separate_by"]:
        rows.append(("to tell", entry["separate_by"]))
    head = f"{entry['name']}: {entry['equation']}"
    return [*_wrapped(head, "", "  "), *(line for row in rows for line in _labelled(*row))]


def _words(names: Sequence[str]) -> str:
    return ", ".join(name.replace("_", " ") for name in names)


def _labelled(label: str, text: str) -> list[str]:
    return _wrapped(text, f"  {label:<11} ", " " * 14)


def _wrapped(text: str, first: str, later: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=first, subsequent_indent=later)


def detail(name: str) -> str:
    """One effect in full; raises `ValueError`, with the names there are, for another."""
    entry = document([name])["effects"][0]
    lines = _brief(entry)
    if entry["first_order"]:
        lines += _labelled("valid", "to first order: while the effect is small")
    if not entry["terms"]:
        text = "without a search for a term: where the residual shows it, or in the model already"
        return "\n".join([*lines, *_labelled("found", text)])
    for shape in _richest(entry["terms"]):
        lines += ["", *_wrapped(f"{shape['term']}: {shape['law']}", "", "  ")]
        if shape["by_direction"]:
            lines.append("  each direction has its own: names end in + and -")
        lines += _rows(shape["parameters"])
    lines += ["", "Units of a linear axis; for a rotary one read N·m for N and rad for m."]
    return "\n".join(lines)


def _richest(shapes: Sequence[Mapping[str, Any]]) -> list[Mapping[str, Any]]:
    """Shapes without those that another one of the same law contains, or that are told already."""
    names = [(shape["term"], {p["name"] for p in shape["parameters"]}) for shape in shapes]
    return [
        shape
        for i, (shape, (term, own)) in enumerate(zip(shapes, names, strict=True))
        if not any(term == other and own < more for other, more in names)
        and (term, own) not in names[:i]
    ]


def _rows(parameters: Sequence[Mapping[str, str]]) -> list[str]:
    names = max(len(p["name"]) for p in parameters)
    units = max(len(p["unit"]) for p in parameters)
    lines = []
    for p in parameters:
        head = f"  {p['name']:<{names}}  {p['unit']:<{units}}  "
        lines += _wrapped(p["range"], head, " " * len(head))
    return lines
