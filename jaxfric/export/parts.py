"""A model taken apart: its summands with their parameters, and their force as text."""

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .. import terms as laws
from ..models import Model
from ..terms.base import AbstractTerm, summands
from ..terms.effects import effect_of
from ..terms.presliding import AbstractBristle, AbstractMemory
from ..terms.time import AbstractModulated
from ..units import spell
from .syntax import C, Syntax, identifier

SAMPLED = {"position", "velocity", "time", "acceleration"}


class Part(NamedTuple):
    """One summand of a model, with the names of its parameters there, affine and nonlinear."""

    term: AbstractTerm
    affine: tuple[str, ...]
    nonlinear: tuple[str, ...]

    @property
    def key(self) -> tuple[str, ...]:
        """What tells it from the other parts: the names of its parameters."""
        return self.affine

    @property
    def law(self) -> AbstractTerm:
        """The law itself, its positive side where the directions differ."""
        return self.term.positive if isinstance(self.term, laws.Directional) else self.term

    @property
    def name(self) -> str:
        """What it is called to the reader."""
        inner = summands(self.law)
        named = [effect_of(term) or type(term).__name__.lower() for term in inner]
        return " + ".join(dict.fromkeys(named))

    @property
    def slips(self) -> bool:
        """Whether it is slip friction: a function of velocity alone."""
        return self.term.coordinates <= {"velocity"}

    @property
    def sampled(self) -> bool:
        """Whether the motion at one moment says its force."""
        return self.term.coordinates <= SAMPLED and not isinstance(self.law, AbstractMemory)

    @property
    def remembered(self) -> bool:
        """Whether it is a bristle, whose state follows one differential equation."""
        return isinstance(self.term, AbstractBristle)


class Line(NamedTuple):
    """One product of the sum: an affine parameter times its column, on one side or both.

    `side` is `+` or `-` for a column that acts in one direction only, else empty.
    """

    parameter: str
    column: str
    side: str = ""


def parts(model: Model) -> tuple[Part, ...]:
    """The summands in order, each with its parameters' names in the model.

    **Raises:** `ValueError` where a parameter is not a finite number, or there is a batch.
    """
    if model.alpha.ndim != 1:
        raise ValueError("A batch of models cannot be exported: hand over one of its rows.")
    bad = [name for name, value in model.parameters.items() if not np.isfinite(float(value))]
    if bad:
        raise ValueError(
            f"There is no value for {', '.join(bad)}: the recording that the model was identified "
            "from does not show it. Record motion in both directions, and identify anew."
        )
    affine = [p.name for p in model.term.affine]
    nonlinear = [p.name for p in model.term.nonlinear]
    return tuple(
        part
        for term, names, searched in _shared(summands(model.term), affine, nonlinear)
        for part in _by_law(Part(term, names, searched))
    )


def _shared(terms: Sequence[AbstractTerm], affine, nonlinear):
    """Each term with the parameters that are its own."""
    for term in terms:
        count, searched = len(term.affine), len(term.nonlinear)
        yield term, tuple(affine[:count]), tuple(nonlinear[:searched])
        affine, nonlinear = affine[count:], nonlinear[searched:]


def _by_law(part: Part) -> tuple[Part, ...]:
    """A sum with directions as directional laws, one part each; another part as it is."""
    if not isinstance(part.term, laws.Directional):
        return (part,)
    sides = [summands(part.term.positive), summands(part.term.negative)]
    if [type(term) for term in sides[0]] != [type(term) for term in sides[1]]:
        return (part,)
    each = list(_shared([*sides[0], *sides[1]], part.affine, part.nonlinear))
    pairs = zip(each[: len(sides[0])], each[len(sides[0]) :], strict=True)
    return tuple(
        Part(laws.Directional(up[0], down[0]), up[1] + down[1], up[2] + down[2])
        for up, down in pairs
    )


def lines(syntax: Syntax, part: Part) -> tuple[Line, ...]:
    """The force of a part in the words of a language; raises `ValueError` for a foreign law."""
    return _lines(syntax, part.term, part.affine, part.nonlinear)


def _lines(syntax: Syntax, term: AbstractTerm, affine, nonlinear) -> tuple[Line, ...]:
    if isinstance(term, laws.Sum):
        return _sides(syntax, [(inner, "") for inner in term.terms], affine, nonlinear)
    if isinstance(term, laws.Directional):
        pair = [(term.positive, "+"), (term.negative, "-")]
        return _sides(syntax, pair, affine, nonlinear)
    if isinstance(term, AbstractModulated):
        factor = term.factor_text(syntax, identifier(nonlinear[0]))
        if factor is not None:
            inner = _lines(syntax, term.term, affine, nonlinear[1:])
            return tuple(line._replace(column=f"{factor} * ({line.column})") for line in inner)
    columns = term.text(syntax, *map(identifier, nonlinear))
    if columns is None:
        raise ValueError(f"{type(term).__name__} has no form in text.")
    return tuple(Line(name, column) for name, column in zip(affine, columns, strict=True))


def _sides(syntax, sided: Sequence[tuple[AbstractTerm, str]], affine, nonlinear):
    """The lines of several terms that share out the parameters, each on its side."""
    found: list[Line] = []
    sides = [side for _, side in sided]
    shared = _shared([term for term, _ in sided], affine, nonlinear)
    for side, (term, own, searched) in zip(sides, shared, strict=True):
        inner = _lines(syntax, term, own, searched)
        found += [line._replace(side=side or line.side) for line in inner]
    return tuple(found)


def divisors(model: Model) -> list[str]:
    """The parameters by which the force divides and that are zero."""
    found = []
    for part in parts(model):
        try:
            text = " ".join(line.column for line in lines(C, part))
        except ValueError:  # it has no text that could divide
            continue
        below = set(re.findall(r"/ (\w+)", text))
        found += [
            name
            for name in part.nonlinear
            if identifier(name) in below and float(model.parameters[name]) == 0
        ]
    return found


def constants(model: Model) -> list[tuple[str, float, str]]:
    """Name, value and unit of every parameter, in order."""
    dimensions = {p.name: p.dimension for p in (*model.term.affine, *model.term.nonlinear)}
    units = dict(model.units)
    return [
        (name, float(value), spell(dimensions[name], units))
        for name, value in model.parameters.items()
    ]


def levels(model: Model) -> list[tuple[str, float, str]]:
    """Name, value and unit of the model's break-away levels; none where it has none."""
    if model.breakaway is None:
        return []
    unit, pair = dict(model.units)["force"], np.asarray(model.breakaway, float)
    return [
        (f"breakaway{sign}", float(value), unit)
        for sign, value in zip("-+", pair, strict=True)
        if np.isfinite(value)
    ]


def refuse(wrong: Sequence[Part], target: str, able: Sequence[str], simpler: str = "") -> None:
    """Raise `ValueError` that names the parts and who can take them; nothing for no part."""
    if not wrong:
        return
    names = ", ".join(dict.fromkeys(part.name for part in wrong))
    others = f"{' and '.join(able)} can" if able else "no target can"
    raise ValueError(
        f"{target} cannot express {names}: {_reason(wrong)}. {others}; mujoco and urdf leave it "
        f"out and say what that costs.{simpler}"
    )


def _reason(wrong: Sequence[Part]) -> str:
    """What the first kind of obstacle is."""
    if any(isinstance(part.law, AbstractMemory) for part in wrong):
        return "it has a memory, and a function of the present motion has none"
    channels = sorted(set().union(*(part.term.coordinates for part in wrong)) - SAMPLED)
    if channels:
        return f"it needs {', '.join(channels)}, which the motion does not say"
    return "it has no form there"
