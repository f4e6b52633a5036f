"""A model's force as a formula with its numbers in place, for people to read."""

import math
import re
from typing import NamedTuple

from ..export.parts import Line, Part, lines, parts
from ..export.syntax import Syntax, identifier
from ..models import Model
from ..terms.effects import EFFECTS

READABLE = Syntax(functions={}, power="({0})^({1})", choice="({1} where {0}, else {2})", helpers={})
# Digits of a number in a formula.
DIGITS = 4
_NUMBER = re.compile(r"(?<![\w.])\d+\.?\d*(?:e[+-]?\d+)?")


class Row(NamedTuple):
    """One term of a model: its name, and its force in numbers, the products of a sum.

    Where text holds no such force, `law` with the `values` of its parameters.
    """

    name: str
    products: tuple[str, ...] = ()
    law: str = ""
    values: tuple[str, ...] = ()


def rows(model: Model) -> list[Row]:
    """The terms of a model, unseen parameters as `?`."""
    known = {name: float(value) for name, value in model.parameters.items()}
    # What was not seen is no number, which no export takes: any number, and a mark instead of it.
    lacking = [name for name, value in known.items() if not math.isfinite(value)]
    whole = model.with_parameters(dict.fromkeys(lacking, 1.0)) if lacking else model
    values = {identifier(n): "?" if n in lacking else _short(v) for n, v in known.items()}
    return [_row(part, values) for part in parts(whole)]


def _row(part: Part, values: dict[str, str]) -> Row:
    name = part.name.replace("_", " ")
    try:
        products = [_product(line, values) for line in lines(READABLE, part)]
    except ValueError:
        effect = EFFECTS.get(part.name)
        law = effect.equation if effect else type(part.law).__name__
        own = (*part.affine, *part.nonlinear)
        return Row(name, (), law, tuple(f"{n} = {values[identifier(n)]}" for n in own))
    first, *others = products
    later = [f"− {text[1:]}" if text.startswith("-") else f"+ {text}" for text in others]
    return Row(name, (first, *later))


def _product(line: Line, values: dict[str, str]) -> str:
    words = re.sub(
        r"[A-Za-z_]\w*", lambda found: values.get(found[0], found[0]), f" {line.column} "
    )
    text = _NUMBER.sub(lambda found: _short(float(found[0])), words).strip()
    level = values[identifier(line.parameter)]
    whole = level if text == "1" else f"{level} · {text}"
    where = {"+": ", v > 0", "-": ", v < 0"}.get(line.side, "")
    return _tidy(whole) + where


def _short(value: float) -> str:
    return f"{value:.{DIGITS}g}"


def _tidy(text: str) -> str:
    for turns in range(1, 9):
        text = re.sub(
            rf"(?<![\w.]){re.escape(_short(turns * 6.283185307179586))} \*", f"{2 * turns}π", text
        )
    return text.replace(" * ", " · ").replace("- -", "+ ").replace("sign(v)", "sign v")
