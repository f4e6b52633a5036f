"""A sum of terms with its parameters, which identification returns."""

import dataclasses
import json
import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from ..data.printable import listed, short
from ..data.recording import Recording, described
from ..looks import html, text
from ..looks.text import Block, Table
from ..terms import bristles
from ..terms.base import AbstractTerm, Sum, summands
from ..terms.vectors import split
from ..units import SI, spell
from . import saved
from .structures import name_of

SCHEMA = "jaxfric.model/1"


class Model(eqx.Module):
    """A sum of terms with all its parameters known: u = Σ_j (f0_j + g_j(β)ᵀ α_j).

    **Arguments:** `term`, any term or sum, its leaves the nonlinear parameters β; `alpha`, the
    affine parameters in the order of `term.affine`, shape `(p,)`; `units`, names of the force
    and position unit. A parameter that is not known, of a direction that nothing moved in, is NaN;
    so is the force wherever it would count, and only there. `breakaway`: the forces F_slip(0−) and
    F_slip(0+) of Kim, Kim & Ha (2004), eq. (4), at which the axis breaks away, N, shape `(2,)`,
    where they were measured; NaN or `None` where the slip curve's ends stand for them. `bristles`:
    stiffness σ₀, N/m, and damping σ₁, N·s/m, of LuGre's bristles (`terms.bristles`), shape `(2,)`;
    `None` for friction that jumps at rest. `force_limit`: what the actuator gives at most in either
    direction, N; `None` where nothing is known of it. The force that a motion needs is not cut off
    there, but of a command no more arrives. `force_delay`: by how much later than its time stamp a
    recorded force acts, s, as one that is held from sample to sample does by half of one; `predict`
    gives the force at its stamp. `None` for a force that acts at once.
    """

    term: AbstractTerm
    alpha: Float[Array, " p"]
    units: tuple[tuple[str, str], ...] = eqx.field(
        static=True, default=(), converter=lambda units: tuple(sorted((SI | dict(units)).items()))
    )
    breakaway: Float[Array, " 2"] | None = None
    bristles: Float[Array, " 2"] | None = None
    force_limit: Float[Array, ""] | None = None
    force_delay: Float[Array, ""] | None = None

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

        **Raises:** `ValueError` for a batch of models.
        """
        require(self, "friction()")
        return _slip_friction(self, jnp.asarray(velocity))

    def without(self, prefix: str) -> "Model":
        """The model without the terms that read a signal whose name begins with `prefix`."""
        return self.only(lambda term: not any(c.startswith(prefix) for c in term.coordinates))

    def only(self, kept: Callable[[AbstractTerm], bool]) -> "Model":
        """The model of some of its terms, at least one."""
        terms, alphas = zip(*((t, a) for t, a in self.pairs() if kept(t)), strict=True)
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

    def with_force_limit(self, limit: float) -> "Model":
        """The model with an actuator that gives no more, N.

        **Raises:** `ValueError` for a limit that is not above zero.
        """
        if not 0 < limit < math.inf:
            raise ValueError(f"The force limit is {limit:g}: a force above zero belongs there.")
        return dataclasses.replace(self, force_limit=jnp.asarray(limit, self.alpha.dtype))

    def with_force_delay(self, delay: float) -> "Model":
        """The model of a log whose force acts so much later than its time stamp, s; or earlier.

        **Raises:** `ValueError` for a delay that is not finite.
        """
        if not math.isfinite(delay):
            raise ValueError(f"The force delay is {delay:g}: a finite time belongs there.")
        return dataclasses.replace(self, force_delay=jnp.asarray(delay, self.alpha.dtype))

    def arriving(self, command: Float[ArrayLike, "*shape"]) -> Float[Array, "*shape"]:
        """What the actuator gives of commanded forces, N, any shape: all, up to `force_limit`."""
        command = jnp.asarray(command)
        if self.force_limit is None:
            return command
        limit = self.force_limit.astype(command.dtype)
        return jnp.clip(command, -limit, limit)

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
        require(self, "to_dict()")
        dimensions = {p.name: p.dimension for p in (*self.term.affine, *self.term.nonlinear)}
        parameters = {
            name: {"value": saved.known(value), "unit": spell(dimensions[name], dict(self.units))}
            for name, value in self.parameters.items()
        }
        structure = {"term": saved.term_to_dict(self.term), "parameters": parameters}
        document = {"schema": SCHEMA, **structure, "units": dict(self.units)}
        if self.breakaway is not None:
            levels = zip(("backward", "forward"), self.breakaway, strict=True)
            document["breakaway"] = {way: saved.known(level) for way, level in levels}
        if self.bristles is not None:
            values = zip(saved.BRISTLES.items(), self.bristles, strict=True)
            document["bristles"] = {
                name: {"value": float(value), "unit": spell(dimension, dict(self.units))}
                for (name, dimension), value in values
            }
        if self.force_limit is not None:
            unit = dict(self.units)["force"]
            document["force_limit"] = {"value": float(self.force_limit), "unit": unit}
        if self.force_delay is not None:
            document["force_delay"] = {"value": float(self.force_delay), "unit": "s"}
        return document

    @staticmethod
    def from_dict(document: Mapping[str, Any]) -> "Model":
        """The model that [`to_dict`][] wrote; raises `ValueError` where the document is not one."""
        schema = document.get("schema") if isinstance(document, Mapping) else None
        if schema != SCHEMA:
            shown = short(repr(schema))
            raise ValueError(f"Not a model document: schema is {shown}, not {SCHEMA!r}.")
        try:
            term = saved.term_from_dict(document["term"])
            entries = document["parameters"].items()
            values = {name: saved.number(name, entry["value"]) for name, entry in entries}
        except RecursionError as error:
            raise ValueError("The model document is nested deeper than any model.") from error
        except (KeyError, TypeError, AttributeError) as error:
            shown = short(repr(error))
            raise ValueError(
                f"The model document is damaged: {shown} is missing or misplaced."
            ) from error
        model = from_parameters(term, values, saved.units_of(document.get("units", {})))
        if (levels := saved.levels(document)) is not None:
            model = model.with_breakaway(*levels)
        if (stiffness := saved.bristles(document)) is not None:
            model = model.with_bristles(*stiffness)
        if (limit := saved.quantity(document, "force_limit")) is not None:
            model = model.with_force_limit(limit)
        if (delay := saved.quantity(document, "force_delay")) is not None:
            model = model.with_force_delay(delay)
        return model

    def __repr__(self) -> str:
        return text.shown(self, _blocks)

    def _repr_html_(self) -> str:
        return html.shown(self, _blocks)

    def alphas(self) -> list[Float[Array, " q"]]:
        """The affine parameters of each summand, in order."""
        return [alpha for _, alpha in self.pairs()]

    def pairs(self) -> list[tuple[AbstractTerm, Float[Array, " q"]]]:
        """Each summand with its affine parameters, in order."""
        terms = summands(self.term)
        alphas = split(self.alpha, [len(term.affine) for term in terms])
        return list(zip(terms, alphas, strict=True))


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
    for term, alpha in model.pairs():
        if term.coordinates <= {"velocity"}:
            total = total + weighed(term.columns(motion), alpha) + term.offset(motion)
    return jnp.reshape(total, velocity.shape)


def from_parameters(
    term: AbstractTerm, values: Mapping[str, float], units: Mapping[str, str] | None = None
) -> Model:
    """A model from a sum of terms and the value of every parameter by name; a nonlinear one that
    the term has a value of may be left out.

    **Raises:** `ValueError` if a parameter is missing or unknown.
    """
    names = [p.name for p in (*term.affine, *term.nonlinear)]
    missing = [name for name in names if name not in values]
    if missing:
        own = dict(zip(names[len(term.affine) :], np.asarray(term.beta()), strict=True))
        known = {name: own[name] for name in missing if np.isfinite(own.get(name, np.nan))}
        missing, values = [name for name in missing if name not in known], known | dict(values)
    if missing:
        raise ValueError(f"Missing parameter {listed(missing)}; the model needs {listed(names)}.")
    empty = Model(term, jnp.zeros(len(term.affine)), tuple((units or {}).items()))
    return empty.with_parameters(values)


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
    if model.force_limit is not None:
        most = f"{np.median(model.force_limit):.5g}"
        table.append(["  force_limit", "=", most, units["force"]])
    if model.force_delay is not None:
        table.append(["  force_delay", "=", f"{np.median(model.force_delay):.5g}", "s"])
    yield Table(table, (2,))


def require(model: object, verb: str) -> None:
    """Raise `ValueError`, with the remedy, where an argument is not one model with its values."""
    if isinstance(model, Model):
        if jnp.ndim(model.alpha) != 1:
            raise ValueError(
                f"{verb} takes one model, not a batch: give a row, fits[i].model "
                "(jax.tree.map(lambda x: x[i], model)), or use jax.vmap."
            )
        return
    hint = "Load a saved one: jaxfric.models.load(text)."
    if isinstance(model, AbstractTerm):
        hint = "Its parameters need values: jaxfric.models.from_parameters(term, values)."
    elif isinstance(getattr(model, "model", None), Model):
        hint = "Give its .model."
    raise ValueError(f"{verb} needs a Model, not {described(model)}. {hint}")


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
