"""Named sums of terms, and a sum with its parameters, which identification returns."""

import dataclasses
import json
from collections.abc import Callable, Mapping
from inspect import isabstract
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from . import terms as laws
from .recording import Recording
from .terms.base import AbstractTerm, Directional, Sum
from .units import SI, spell

SCHEMA = "jaxfric.model/1"


class Model(eqx.Module):
    """A sum of terms with all its parameters known: u = Σ_j (f0_j + g_j(β)ᵀ α_j).

    **Arguments:** `term`, any term or sum, its leaves the nonlinear parameters β; `alpha`, the
    affine parameters in the order of `term.affine`, shape `(p,)`; `units`, names of the force
    and position unit.
    """

    term: AbstractTerm
    alpha: Float[Array, " p"]
    units: tuple[tuple[str, str], ...] = eqx.field(
        static=True, default=(), converter=lambda units: tuple(sorted((SI | dict(units)).items()))
    )

    @property
    def parameters(self) -> dict[str, Float[Array, ""]]:
        """Every parameter by name: the affine ones, then the nonlinear ones.

        Each a scalar; of shape `(B,)` in a batch of models.
        """
        names = [p.name for p in (*self.term.affine, *self.term.nonlinear)]
        if self.alpha.ndim > 1:
            rows = jax.vmap(lambda row: row.parameters)(self)
            return {name: rows[name] for name in names}
        return dict(zip(names, [*self.alpha, *self.term.beta()], strict=True))

    def force(self, recording: Recording) -> Float[Array, " N"]:
        """Actuator force without the acceleration terms, N, shape `(N,)`."""
        return self.term.columns(recording) @ self.alpha + self.term.offset(recording)

    def momentum(self, recording: Recording) -> Float[Array, " N"]:
        """What has to be differentiated in time to give the rest of the force, N·s, `(N,)`."""
        return self.term.momentum(recording) @ self.alpha

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
            for term, alpha in zip(_summands(self.term), self._alphas(), strict=True)
            if not any(name.startswith(prefix) for name in term.coordinates)
        ]
        terms, alphas = zip(*parts, strict=True)
        return Model(Sum(terms), jnp.concatenate(alphas), self.units)

    def with_parameters(self, values: Mapping[str, float]) -> "Model":
        """The model with some parameters replaced; raises `ValueError` for a name it lacks."""
        current = self.parameters
        unknown = sorted(set(values) - set(current))
        if unknown:
            raise ValueError(f"No parameter {', '.join(unknown)}; there are {', '.join(current)}.")
        wanted = [values.get(name, value) for name, value in current.items()]
        vector = jnp.stack([jnp.asarray(value, self.alpha.dtype) for value in wanted])
        count = self.alpha.shape[-1]
        return Model(self.term.with_beta(vector[count:]), vector[:count], self.units)

    def to_dict(self) -> dict[str, Any]:
        """The model as plain data for JSON: structure, parameters with units."""
        dimensions = {p.name: p.dimension for p in (*self.term.affine, *self.term.nonlinear)}
        parameters = {
            name: {"value": float(value), "unit": spell(dimensions[name], dict(self.units))}
            for name, value in self.parameters.items()
        }
        structure = {"term": _term_to_dict(self.term), "parameters": parameters}
        return {"schema": SCHEMA, **structure, "units": dict(self.units)}

    @staticmethod
    def from_dict(document: Mapping[str, Any]) -> "Model":
        """The model that [`to_dict`][] wrote; raises `ValueError` where the document is not one."""
        schema = document.get("schema") if isinstance(document, Mapping) else None
        if schema != SCHEMA:
            raise ValueError(f"Not a model document: schema is {schema!r}, not {SCHEMA!r}.")
        try:
            term = _term_from_dict(document["term"])
            entries = document["parameters"].items()
            values = {name: _number(name, entry["value"]) for name, entry in entries}
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(
                f"The model document is damaged: {error!r} is missing or misplaced."
            ) from error
        units = document.get("units", {})
        if not isinstance(units, Mapping) or not all(isinstance(u, str) for u in units.values()):
            raise ValueError(
                f"The model document's units must be names by quantity, not {units!r}."
            )
        return from_parameters(term, values, units)

    def _alphas(self):
        start, parts = 0, []
        for term in _summands(self.term):
            parts.append(self.alpha[start : start + len(term.affine)])
            start += len(term.affine)
        return parts


@eqx.filter_jit
def _slip_friction(model: Model, velocity: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    flat = jnp.ravel(velocity)
    motion = Recording(time=jnp.zeros_like(flat), force=jnp.zeros_like(flat), velocity=flat)
    total = jnp.zeros_like(flat)
    for term, alpha in zip(_summands(model.term), model._alphas(), strict=True):
        if term.coordinates <= {"velocity"}:
            total = total + term.columns(motion) @ alpha + term.offset(motion)
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
        raise ValueError(
            f"Missing parameter {', '.join(missing)}; the model needs {', '.join(names)}."
        )
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
    return Sum(tuple(leaf for t in tied for leaf in _summands(t))) + laws.Offset()


NAMED: dict[str, Callable[[], Sum]] = {
    "coulomb-viscous": coulomb_viscous,
    "gaussian": gaussian,
    "lorentzian": lorentzian,
    "exponential": exponential,
    "generalised": generalised,
}


def names() -> tuple[str, ...]:
    """All model names, the symmetric ones included."""
    return (*NAMED, *(f"symmetric-{name}" for name in NAMED))


def named(name: str) -> Sum:
    """The model of that name; raises `ValueError`, with the names there are, for another."""
    stem = name.removeprefix("symmetric-").replace("_", "-")
    if stem not in NAMED:
        raise ValueError(f"No model is called {name!r}; there are {', '.join(names())}.")
    return symmetric(NAMED[stem]()) if name.startswith("symmetric-") else NAMED[stem]()


def load(text: str) -> Model:
    """The model in a JSON text: a model document, or any document with one under `model`.

    **Raises:** `ValueError` if the text is no JSON or holds no model.
    """
    try:
        document = json.loads(text)
    except json.JSONDecodeError as error:
        raise ValueError(f"Not a model document: this is no JSON: {error}.") from error
    if isinstance(document, dict) and document.get("schema") != SCHEMA and "model" in document:
        document = document["model"]
    return Model.from_dict(document)


def _summands(term: AbstractTerm) -> tuple[AbstractTerm, ...]:
    return term.terms if isinstance(term, Sum) else (term,)


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
    return value.tolist() if isinstance(value, jax.Array) else value


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"Parameter {name} of the model document must be a number, not {value!r}.")
    return float(value)


def _term_from_dict(document: Mapping[str, Any]) -> AbstractTerm:
    kind = document["type"]
    found = getattr(laws, kind, None)
    if not (isinstance(found, type) and issubclass(found, AbstractTerm)) or isabstract(found):
        raise ValueError(
            f"The model document names a term {kind!r} that jaxfric.terms does not have."
        )
    fields = {name: _revived(value) for name, value in document.items() if name != "type"}
    if found is Directional:
        return Directional(_term(fields["positive"]), _term(fields["negative"]))
    if found is Sum:
        return Sum(tuple(_term(part) for part in fields["terms"]))
    return found(**fields)


def _term(value: Any) -> AbstractTerm:
    if not isinstance(value, AbstractTerm):
        raise TypeError(f"a term where {value!r} stands")
    return value


def _revived(value: Any) -> Any:
    if isinstance(value, Mapping):
        return _term_from_dict(value)
    return tuple(_revived(item) for item in value) if isinstance(value, list) else value
