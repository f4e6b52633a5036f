"""Modelica: a block from motion to force, the parameters with their units."""

import re
from collections.abc import Sequence
from typing import Any

from ..models import Model
from .outcome import Exported, exact
from .parts import Line, Part, constants, divided, levels, lines, unwritten
from .syntax import MODELICA, identifier, literal

_KEYWORDS = set(
    "algorithm and annotation assert block break class connect connector constant constrainedby "
    "der discrete each else elseif elsewhen encapsulated end enumeration equation expandable "
    "extends external false final flow for function if import impure in initial inner input loop "
    "model not operator or outer output package parameter partial protected public pure record "
    "redeclare replaceable return stream then time true type when while within Real".split()
)
_OWN = {"position", "velocity", "acceleration", "friction", "force", *"xvatfr"}


def export(model: Model, name: str = "axis") -> Exported:
    """A Modelica block: inputs position, velocity, acceleration; outputs friction, force; exact in
    what it holds.

    Bristles (Dahl, LuGre) have a state; terms with another memory or channels, and a delay, are
    left out and named. Expressions stand in `noEvent`, so that a given motion is followed without
    an event at every reversal.

    **Raises:** `ValueError` for a name that is none in Modelica.
    """
    if not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII) or name in _KEYWORDS | _OWN:
        raise ValueError(f"{name!r} cannot name a block in Modelica: choose another (--name).")
    taken, missing = divided(model, states=True), unwritten(model, "modelica")
    states = taken.states
    needed = f"friction + {_sum(_products(taken.rest) + _bristles(states))}"
    actual = f"f + {_sum(_products(taken.faulty))}" if taken.faulty else needed
    text = (
        f'block {name} "Force of an axis, identified by jaxfric"\n'
        + "".join(f"  // Left out: {' '.join(text.split())}.\n" for text in missing)
        + "".join(_parameter(*row) for row in constants(model, taken))
        + "".join(_parameter(*row) for row in levels(model))
        + _signals(model, ", f" * bool(taken.faulty) + ", r" * (taken.borne is not None))
        + "".join(f'  Real {_state(part)} "deflection of the bristle";\n' for part in states)
        + "".join(["initial equation\n"] * bool(states))
        + "".join(f"  {_state(part)} = sign(v);\n" for part in states)
        + "equation\n  x = position;\n  v = velocity;\n  a = acceleration;\n  t = time;\n"
        + "".join(map(_evolution, states))
        + f"  friction = noEvent({_sum(_products(taken.slip))});\n"
        + f"  f = noEvent({needed});\n" * bool(taken.faulty)
        + f"  r = noEvent({_sum(_products(taken.borne or ()))});\n" * (taken.borne is not None)
        + f"  force = noEvent({actual});\n"
        + f"end {name};\n"
    )
    remarks = (
        "The break-away levels are parameters for a model of sticking: the force that a motion "
        "needs does not depend on them.",
    ) * bool(levels(model))
    return Exported(text, exact(model), missing, remarks)


def _unit(unit: str) -> str:
    """A unit as Modelica spells it (`N.s/m`); nothing where it has no name for it."""
    plain = unit.replace("·", ".").replace("*", ".").replace("Nm", "N.m")
    plain = plain.translate(str.maketrans("²³⁴", "234"))
    return f'(unit="{plain}")' if re.fullmatch(r"[A-Za-z0-9./()]+", plain, re.ASCII) else ""


def _parameter(name: str, value: float, unit: str) -> str:
    return f'  parameter Real {identifier(name)}{_unit(unit)} = {literal(value)} "{name}";\n'


def _signals(model: Model, more: str) -> str:
    force, position = dict(model.units)["force"], dict(model.units)["position"]
    moving = [("position", ""), ("velocity", "/s"), ("acceleration", "/s2")]
    inputs = [f"  input Real {name}{_unit(position + per)};\n" for name, per in moving]
    outputs = [
        f'  output Real friction{_unit(force)} "in slip";\n',
        f'  output Real force{_unit(force)} "that the motion needs";\n',
    ]
    return "".join([*inputs, *outputs]) + f"protected\n  Real x, v, a, t{more};\n"


def _products(some: Sequence[Part]) -> list[str]:
    return [_product(line) for part in some for line in lines(MODELICA, part)]


def _product(line: Line) -> str:
    text = f"{identifier(line.parameter)} * {line.column}"
    if not line.side:
        return text
    return MODELICA.choose(f"v {'>' if line.side == '+' else '<'} 0.0", text, "0.0")


def _sum(products: list[str]) -> str:
    return "\n    + ".join(products) or "0.0"


def _state(part: Part) -> str:
    return f"deflection_{identifier(part.affine[0])}"


def _evolution(part: Part) -> str:
    """dz/dt = (v/x_d)(1 − z sign v)."""
    distance, z = identifier(part.nonlinear[0]), _state(part)
    return f"  der({z}) = noEvent(v / {distance} * (1.0 - {z} * sign(v)));\n"


def _bristles(states: Sequence[Part]) -> list[str]:
    """Each column's weight times z − sign v."""
    products = []
    for part in states:
        lag = f"({_state(part)} - sign(v))"
        bristle: Any = part.term
        weights = bristle.weights(MODELICA, *map(identifier, part.nonlinear))
        for parameter, weight in zip(part.affine, weights, strict=True):
            products.append(" * ".join(filter(None, (identifier(parameter), weight, lag))))
    return products
