"""Named sums of terms."""

from collections.abc import Callable
from functools import cache
from typing import Any

import jax

from .. import terms as laws
from ..data.nearest import meant
from ..terms.base import AbstractTerm, Directional, Sum, summands


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
