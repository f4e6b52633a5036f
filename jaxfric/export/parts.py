"""A model taken apart: its summands with their parameters, and their force as text."""

import re
from collections.abc import Callable, Sequence
from itertools import groupby
from textwrap import indent
from typing import NamedTuple

import numpy as np

from .. import terms as laws
from ..models import Model
from ..terms.actuator import PREDICTED, REACTION, carried, predicted
from ..terms.base import AbstractTerm, summands
from ..terms.effects import effect_of, traits
from ..terms.known import KNOWN
from ..terms.presliding import AbstractBristle, AbstractMemory
from ..terms.time import AbstractModulated
from ..units import FORCE, spell
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
    def faulty(self) -> bool:
        """Whether it is a function of the force that the others need, as a fault of an actuator."""
        return predicted(self.term)

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


class Divided(NamedTuple):
    """The parts of a model by their place in a text.

    `slip` friction; the `rest`; what is `faulty`, a function of the sum of these; and what the text
    leaves out, `left`. `states`: bristles, where the language has differential equations.
    """

    slip: tuple[Part, ...]
    rest: tuple[Part, ...]
    states: tuple[Part, ...]
    faulty: tuple[Part, ...]
    left: tuple[Part, ...]

    @property
    def parameters(self) -> frozenset[str]:
        """The names of the parameters that the text holds."""
        held = (*self.slip, *self.rest, *self.states, *self.faulty)
        return frozenset(name for part in held for name in (*part.affine, *part.nonlinear))

    @property
    def borne(self) -> tuple[Part, ...] | None:
        """The parts whose force friction carries; `None` where no friction is a share of it."""
        if not any(REACTION in part.term.coordinates for part in self.faulty):
            return None
        return tuple(part for part in (*self.slip, *self.rest) if carried(part.term))


def divided(model: Model, states: bool = False) -> Divided:
    """The parts of a model as a language takes them; `states`, whether it knows bristles.

    Beside a force that is not written, of another simulator, what depends on the whole is not.
    """
    every = parts(model)
    channels = frozenset().union(*(part.term.coordinates for part in every))
    whole = not any(name.startswith(KNOWN) for name in channels)
    held = [part for part in every if states and part.remembered]
    spelled = [p for p in every if (p.sampled or p.faulty and whole) and _spelled(p)]
    taken = {part.key for part in (*held, *spelled)}
    return Divided(
        tuple(part for part in spelled if part.slips),
        tuple(part for part in spelled if not part.slips and not part.faulty),
        tuple(held),
        tuple(part for part in spelled if part.faulty),
        tuple(part for part in every if part.key not in taken),
    )


def _spelled(part: Part) -> bool:
    """Whether a part has a text, of signals that a function is called with."""
    try:
        lines(C, part)
    except ValueError:
        return False
    return part.term.coordinates <= SAMPLED | {PREDICTED, REACTION}


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
    if not isinstance(part.term, laws.Directional) or part.faulty:
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
        own, inner = nonlinear[: len(term.of_time)], nonlinear[len(term.of_time) :]
        factor = term.factor_text(syntax, *map(identifier, own))
        if factor is not None:
            inner = _lines(syntax, term.term, affine, inner)
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


def stated(products: Sequence[Line], add: Callable[[Line], str], opening: str, closing: str) -> str:
    """The statements of products, those of one side inside a condition, by what a language has.

    `add` writes the statement of one, `opening` has a place for the sign of comparison.
    """
    text = ""
    for side, group in groupby(products, lambda line: line.side):
        rows = "".join(map(add, group))
        if side:
            rows = indent(rows, "    ")
            rows = opening.format(">" if side == "+" else "<") + rows + closing
        text += rows
    return text


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


def constants(model: Model, taken: Divided) -> list[tuple[str, float, str]]:
    """Name, value and unit of every parameter that a text holds, in order."""
    dimensions = {p.name: p.dimension for p in (*model.term.affine, *model.term.nonlinear)}
    units = dict(model.units)
    return [
        (name, float(value), spell(dimensions[name], units))
        for name, value in model.parameters.items()
        if name in taken.parameters
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


def without_levels(model: Model) -> list[str]:
    """That a text has no break-away levels, where the model has."""
    held = [f"{name} {value:.4g} {unit}" for name, value, unit in levels(model)]
    return [f"Not written: the break-away levels, {', '.join(held)}."] * bool(held)


def left_out(model: Model, part: Part) -> str:
    """Why a text holds a part not, and what to do instead."""
    units, values, effect = dict(model.units), model.parameters, traits(part.term)
    if not effect.needs and any(name.startswith(KNOWN) for name in part.term.coordinates):
        if not part.affine:
            return "the other simulator's force: add to it what this text computes"
        return f"the other simulator's {', '.join(part.affine)}: put right there what was found"
    if effect.logged:
        return f"{part.name}: the log's alone, and the machine has none of it"
    if effect.late:
        exact = "" if effect.shift else ", to first order"
        time = float(values[part.affine[0]])
        return f"{part.name}: hand over the motion commanded {time:.4g} s later instead{exact}"
    if isinstance(part.law, AbstractMemory):
        most = burst(model, part)
        size = f"; up to {most:.3g} {units['force']} around a reversal" if most else ""
        return f"{part.name}: it has a memory, and a function of the present motion has none{size}"
    channels = sorted(part.term.coordinates - SAMPLED - {PREDICTED, REACTION})
    if channels:
        return f"{part.name}: it needs {', '.join(channels)}, which the motion does not say"
    if part.faulty:
        return f"{part.name}: it depends on the whole force, which is not all here"
    return f"{part.name}: it has no form there"


def burst(model: Model, part: Part) -> float:
    """The most that a bristle or a gap gives, N: its column, z − sign v or a gap's, is below 2.

    Zero for another part: what a load on a spring gives is the motion's, not the parameters'.
    """
    forces = all(p.dimension == FORCE for p in part.term.affine)
    if not isinstance(part.law, AbstractMemory) or part.term.swings or not forces:
        return 0.0
    return 2 * sum(abs(float(model.parameters[name])) for name in part.affine)


def unwritten(model: Model, target: str = "c") -> tuple[str, ...]:
    """What C, Structured Text and an FMU leave out of a model, or Modelica, a line each."""
    lines = [left_out(model, part) for part in divided(model, target == "modelica").left]
    if model.force_limit is not None:
        most = f"{float(model.force_limit):.5g} {dict(model.units)['force']}"
        lines.append(f"force limit: no more than {most} arrives; hold commands within it")
    return tuple(lines)
