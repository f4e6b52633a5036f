"""Named sums of terms, and a sum with its parameters, which identification returns."""

import dataclasses
import json
import math
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from inspect import isabstract
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from . import terms as laws
from .data.nearest import meant
from .data.printable import listed, short
from .data.recording import Recording, described
from .looks import html, text
from .looks.text import Block, Table
from .terms import bristles
from .terms.base import AbstractTerm, Directional, Sum, summands
from .terms.effects import law_named
from .units import DAMPING, SI, STIFFNESS, spell

SCHEMA = "jaxfric.model/1"
# Their names and dimensions: force, position, time.
_BRISTLES = {"stiffness": STIFFNESS, "damping": DAMPING}


class Model(eqx.Module):
    """A sum of terms with all its parameters known: u = Σ_j (f0_j + g_j(β)ᵀ α_j).

    **Arguments:** `term`, any term or sum, its leaves the nonlinear parameters β; `alpha`, the
    affine parameters in the order of `term.affine`, shape `(p,)`; `units`, names of the force
    and position unit. A parameter that is not known, of a direction that nothing moved in, is NaN;
    so is the force wherever it would count, and only there. `breakaway`: the forces F_slip(0−) and
    F_slip(0+) of Kim, Kim & Ha (2004), eq. (4), at which the axis breaks away, N, shape `(2,)`,
    where they were measured; NaN or `None` where the slip curve's ends stand for them. `bristles`:
    stiffness σ₀, N/m, and damping σ₁, N·s/m, of LuGre's bristles (`terms.bristles`), shape `(2,)`;
    `None` for friction that jumps at rest.
    """

    term: AbstractTerm
    alpha: Float[Array, " p"]
    units: tuple[tuple[str, str], ...] = eqx.field(
        static=True, default=(), converter=lambda units: tuple(sorted((SI | dict(units)).items()))
    )
    breakaway: Float[Array, " 2"] | None = None
    bristles: Float[Array, " 2"] | None = None

    @property
    def parameters(self) -> dict[str, Float[Array, ""]]:
        """Every parameter by name: the affine ones, then the nonlinear ones.

        Each a scalar; of shape `(B,)` in a batch of models.
        """
        names = [p.name for p in (*self.term.affine, *self.term.nonlinear)]
        if self.alpha.ndim > 1:
            if isinstance(self.alpha, np.ndarray):  # of what was moved to numpy nothing is compiled
                columns = [np.moveaxis(x, -1, 0) for x in (self.alpha, self.term.beta())]
                return dict(zip(names, [*columns[0], *columns[1]], strict=True))
            rows = jax.vmap(lambda row: row.parameters)(self)
            return {name: rows[name] for name in names}
        return dict(zip(names, [*self.alpha, *self.term.beta()], strict=True))

    def force(self, recording: Recording) -> Float[Array, " N"]:
        """Actuator force without the acceleration terms, N, shape `(N,)`."""
        force = weighed(self.term.columns(recording), self.alpha) + self.term.offset(recording)
        if self.bristles is None:
            return force
        stiffness, damping = self.bristles
        return force + bristles.force(self.term, self.alpha, stiffness, damping, recording)

    def momentum(self, recording: Recording) -> Float[Array, " N"]:
        """What has to be differentiated in time to give the rest of the force, N·s, `(N,)`."""
        return weighed(self.term.momentum(recording), self.alpha)

    def friction(self, velocity: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
        """The slip friction F_slip(v), N: every term that is a function of velocity alone.

        **Arguments:** `velocity`, m/s, any shape. Sticking (v = 0) is not slip; there the value
        is that of the constant terms.
        """
        return _slip_friction(self, jnp.asarray(velocity))

    def without(self, prefix: str) -> "Model":
        """The model without the terms that read a signal whose name begins with `prefix`."""
        parts = [
            (term, alpha)
            for term, alpha in zip(summands(self.term), self.alphas(), strict=True)
            if not any(name.startswith(prefix) for name in term.coordinates)
        ]
        terms, alphas = zip(*parts, strict=True)
        return dataclasses.replace(self, term=Sum(terms), alpha=jnp.concatenate(alphas))

    def with_bristles(self, stiffness: float, damping: float = 0.0) -> "Model":
        """The model with bristles in place of the jump at rest: LuGre; Dahl without `damping`.

        **Arguments:** `stiffness` σ₀, N/m; `damping` σ₁, N·s/m.

        **Raises:** `ValueError` for a stiffness that is not positive or a negative damping.
        """
        if not 0 < stiffness < math.inf or not 0 <= damping < math.inf:
            raise ValueError(
                f"Bristles of stiffness {stiffness:g} and damping {damping:g} are none: the "
                "stiffness is over zero, the damping zero or more, both finite."
            )
        pair = jnp.asarray([stiffness, damping], self.alpha.dtype)
        return dataclasses.replace(self, bristles=pair)

    def with_breakaway(self, backward: float, forward: float) -> "Model":
        """The model with break-away levels, N, with their signs: NaN for the slip curve's end.

        **Raises:** `ValueError` for a level of the wrong sign, which would drive the axis.
        """
        levels = np.array([backward, forward], float)
        if backward > 0 or forward < 0 or np.isinf(levels).any():
            raise ValueError(
                f"The break-away levels are {backward:g} and {forward:g}: backwards below zero "
                "and forwards above it, or NaN where the level is not known."
            )
        return dataclasses.replace(self, breakaway=jnp.asarray(levels, self.alpha.dtype))

    def with_parameters(self, values: Mapping[str, float]) -> "Model":
        """The model with some parameters replaced; raises `ValueError` for a name it lacks."""
        current = self.parameters
        unknown = sorted(set(values) - set(current))
        if unknown:
            raise ValueError(f"No parameter {', '.join(unknown)}; there are {', '.join(current)}.")
        wanted = [values.get(name, value) for name, value in current.items()]
        vector = jnp.stack([jnp.asarray(value, self.alpha.dtype) for value in wanted])
        count = self.alpha.shape[-1]
        term = self.term.with_beta(vector[count:])
        return dataclasses.replace(self, term=term, alpha=vector[:count])

    def to_dict(self) -> dict[str, Any]:
        """The model as plain data for JSON: structure, parameters with units."""
        dimensions = {p.name: p.dimension for p in (*self.term.affine, *self.term.nonlinear)}
        parameters = {
            name: {"value": _known(value), "unit": spell(dimensions[name], dict(self.units))}
            for name, value in self.parameters.items()
        }
        structure = {"term": _term_to_dict(self.term), "parameters": parameters}
        document = {"schema": SCHEMA, **structure, "units": dict(self.units)}
        if self.breakaway is not None:
            levels = zip(("backward", "forward"), self.breakaway, strict=True)
            document["breakaway"] = {way: _known(level) for way, level in levels}
        if self.bristles is not None:
            values = zip(_BRISTLES.items(), self.bristles, strict=True)
            document["bristles"] = {
                name: {"value": float(value), "unit": spell(dimension, dict(self.units))}
                for (name, dimension), value in values
            }
        return document

    @staticmethod
    def from_dict(document: Mapping[str, Any]) -> "Model":
        """The model that [`to_dict`][] wrote; raises `ValueError` where the document is not one."""
        schema = document.get("schema") if isinstance(document, Mapping) else None
        if schema != SCHEMA:
            shown = short(repr(schema))
            raise ValueError(f"Not a model document: schema is {shown}, not {SCHEMA!r}.")
        try:
            term = _term_from_dict(document["term"])
            entries = document["parameters"].items()
            values = {name: _number(name, entry["value"]) for name, entry in entries}
        except RecursionError as error:
            raise ValueError("The model document is nested deeper than any model.") from error
        except (KeyError, TypeError, AttributeError) as error:
            shown = short(repr(error))
            raise ValueError(
                f"The model document is damaged: {shown} is missing or misplaced."
            ) from error
        model = from_parameters(term, values, _units(document.get("units", {})))
        model = _with_levels(model, document.get("breakaway"))
        return _with_bristles(model, document.get("bristles"))

    def __repr__(self) -> str:
        return text.shown(self, _blocks)

    def _repr_html_(self) -> str:
        return html.shown(self, _blocks)

    def alphas(self) -> list[Float[Array, " q"]]:
        """The affine parameters of each summand, in order."""
        start, parts = 0, []
        for term in summands(self.term):
            parts.append(self.alpha[start : start + len(term.affine)])
            start += len(term.affine)
        return parts


def weighed(
    columns: Float[Array, "N p"], alpha: Float[Array, " p"], unknown: float | Array = float("nan")
) -> Float[Array, " N"]:
    """The sum of columns, each times its parameter; `unknown` where one that is NaN would count."""
    lacking = jnp.isnan(alpha)
    total = jnp.where(lacking[None], 0.0, columns) @ jnp.where(lacking, 0.0, alpha)
    counts = jnp.any((columns != 0) & lacking[None], axis=-1)
    return jnp.where(counts, jnp.asarray(unknown, total.dtype), total)


@eqx.filter_jit
def _slip_friction(model: Model, velocity: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    flat = jnp.ravel(velocity)
    motion = Recording(time=jnp.zeros_like(flat), force=jnp.zeros_like(flat), velocity=flat)
    total = jnp.zeros_like(flat)
    for term, alpha in zip(summands(model.term), model.alphas(), strict=True):
        if term.coordinates <= {"velocity"}:
            total = total + weighed(term.columns(motion), alpha) + term.offset(motion)
    return jnp.reshape(total, velocity.shape)


def from_parameters(
    term: AbstractTerm, values: Mapping[str, float], units: Mapping[str, str] | None = None
) -> Model:
    """A model from a sum of terms and the value of every parameter by name.

    **Raises:** `ValueError` if a parameter is missing or unknown.
    """
    names = [p.name for p in (*term.affine, *term.nonlinear)]
    missing = [name for name in names if name not in values]
    if missing:
        raise ValueError(f"Missing parameter {listed(missing)}; the model needs {listed(names)}.")
    empty = Model(term, jnp.zeros(len(term.affine)), tuple((units or {}).items()))
    return empty.with_parameters(values)


def coulomb_viscous() -> Sum:
    """Inertia, and Coulomb and viscous friction for each direction (Kim, Kim & Ha 2004, eq. 25)."""
    return laws.Inertia() + Directional(laws.Coulomb() + laws.Viscous())


def gaussian() -> Sum:
    """`coulomb_viscous` with a Gaussian Stribeck bump in each direction (eq. 20)."""
    return _with_bump(laws.Gaussian())


def lorentzian() -> Sum:
    """`coulomb_viscous` with a Lorentzian Stribeck bump in each direction (eq. 29)."""
    return _with_bump(laws.Lorentzian())


def exponential() -> Sum:
    """`coulomb_viscous` with an exponential Stribeck bump in each direction (Tustin 1947)."""
    return _with_bump(laws.Exponential())


def generalised() -> Sum:
    """`coulomb_viscous` with the bump exp(−|v/v_s|^δ) in each direction (Bo & Pavelescu 1982)."""
    return _with_bump(laws.Generalised())


def _with_bump(bump: AbstractTerm) -> Sum:
    return laws.Inertia() + Directional(laws.Coulomb() + laws.Viscous() + bump)


def symmetric(model: Sum) -> Sum:
    """A model whose two directions share their parameters, with a constant offset beside them."""
    tied = [t.positive if isinstance(t, Directional) else t for t in model.terms]
    return Sum(tuple(leaf for t in tied for leaf in summands(t))) + laws.Offset()


NAMED: dict[str, Callable[[], Sum]] = {
    "coulomb-viscous": coulomb_viscous,
    "gaussian": gaussian,
    "lorentzian": lorentzian,
    "exponential": exponential,
    "generalised": generalised,
}


def name_of(term: AbstractTerm) -> str:
    """The name of a model, or its terms where it has none."""
    structure = jax.tree.structure(term)
    known = (name for name, other in _structures().items() if other == structure)
    return next(known, None) or _spelled(term)


@cache
def _structures() -> dict[str, Any]:
    return {name: jax.tree.structure(named(name)) for name in names()}


def _spelled(term: AbstractTerm) -> str:
    if isinstance(term, Sum):
        return " + ".join(map(_spelled, term.terms))
    if isinstance(term, Directional):
        sides = dict.fromkeys(map(_spelled, (term.positive, term.negative)))
        return f"Directional({', '.join(sides)})"
    return type(term).__name__


def _blocks(model: Model) -> Iterator[Block]:
    """What to say of a model of arrays of numpy: each parameter with its unit; medians of rows."""
    units, term = dict(model.units), model.term
    several = model.alpha.ndim > 1
    count = f", medians of {model.alpha[..., 0].size} rows" * several
    yield [f"model {name_of(term)}{count}"]
    dimensions = {p.name: p.dimension for p in (*term.affine, *term.nonlinear)}
    table = [
        [f"  {name}", "=", f"{np.median(value):.5g}", spell(dimensions[name], units)]
        for name, value in model.parameters.items()
    ]
    yield Table(table, (2,))


def require(model: object, verb: str) -> None:
    """Raise `ValueError`, with the remedy, where an argument is not one model with its values."""
    if isinstance(model, Model):
        if jnp.ndim(model.alpha) != 1:
            raise ValueError(
                f"{verb} takes one model, not a batch: give a row, "
                "jax.tree.map(lambda x: x[i], model), or use jax.vmap."
            )
        return
    hint = "Load a saved one: jaxfric.models.load(text)."
    if isinstance(model, AbstractTerm):
        hint = "Its parameters need values: jaxfric.models.from_parameters(term, values)."
    elif isinstance(getattr(model, "model", None), Model):
        hint = "Give its .model."
    raise ValueError(f"{verb} needs a Model, not {described(model)}. {hint}")


def names() -> tuple[str, ...]:
    """All model names, the symmetric ones included."""
    return (*NAMED, *(f"symmetric-{name}" for name in NAMED))


def named(name: str) -> Sum:
    """The model of that name; raises `ValueError`, with the names there are, for another."""
    known = listed_as(name)
    stem = known.removeprefix("symmetric-")
    return symmetric(NAMED[stem]()) if known != stem else NAMED[stem]()


def listed_as(name: str) -> str:
    """A model's name as [`names`][] lists it: also `coulomb_viscous`, as its function is called.

    **Raises:** `ValueError`, with the names there are, for another.
    """
    known = name.replace("_", "-")
    if known not in names():
        near = meant(name, names())
        raise ValueError(f"No model is called {name!r}; there are {', '.join(names())}.{near}")
    return known


def load(text: str) -> Model:
    """The model in a JSON text: a model document, or any document with one under `model`.

    **Raises:** `ValueError` if the text is no JSON or holds no model.
    """
    try:
        document = json.loads(text)
    except (ValueError, RecursionError) as error:  # also a number of thousands of digits
        raise ValueError(f"Not a model document: this is no JSON: {error}.") from error
    if isinstance(document, dict) and document.get("schema") != SCHEMA and "model" in document:
        document = document["model"]
    return Model.from_dict(document)


def _term_to_dict(term: AbstractTerm) -> dict[str, Any]:
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
        return _term_to_dict(value)
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    return value.tolist() if isinstance(value, jax.Array | np.ndarray) else value


def _known(value: Any) -> float | None:
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


def _number(name: str, value: Any) -> float:
    """A parameter's number; NaN where it is not known."""
    if value is None:
        return float("nan")
    if _is_number(value):
        return float(value)
    shown = short(repr(value))
    raise ValueError(f"Parameter {name} of the model document must be a number, not {shown}.")


def _with_levels(model: Model, levels: Any) -> Model:
    """The model with the break-away levels of a document, where it has any."""
    if levels is None:
        return model
    if not isinstance(levels, Mapping):
        raise ValueError(f"The model document's breakaway is {short(repr(levels))}, no pair.")
    pair = [_number(f"breakaway {way}", levels.get(way)) for way in ("backward", "forward")]
    return model.with_breakaway(*pair)


def _with_bristles(model: Model, values: Any) -> Model:
    """The model with the bristles of a document, where it has any."""
    if values is None:
        return model
    try:
        pair = [_number(name, values[name]["value"]) for name in _BRISTLES]
    except (KeyError, TypeError) as error:
        raise ValueError(
            f"The model document's bristles are {short(repr(values))}: stiffness and damping, "
            "each with its value, belong there."
        ) from error
    return model.with_bristles(*pair)


def _units(units: Any) -> dict[str, str]:
    if not isinstance(units, Mapping) or not all(
        quantity in SI and isinstance(unit, str) and unit.isprintable() and short(unit) == unit
        for quantity, unit in units.items()
    ):
        raise ValueError(
            "The model document's units must be names of the force and the position unit, not "
            f"{short(repr(units))}."
        )
    return dict(units)


def _term_from_dict(document: Mapping[str, Any]) -> AbstractTerm:
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
        return _term_from_dict(value)
    return tuple(_revived(item) for item in value) if isinstance(value, list) else value
