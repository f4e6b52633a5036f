"""Forces that change with time, and terms that do."""

from abc import abstractmethod

import equinox as eqx
from jaxtyping import Array, Float

from ..data.recording import Recording
from .base import AbstractTerm
from .sample import Parameter
from .text import Syntax
from .vectors import joined, vector


class AbstractModulated(AbstractTerm):
    """A force law times a factor of time; `term` is the law.

    A concrete class names the factor's nonlinear parameters in `of_time`, with fields of the same
    names, gives the `prefix` for the affine parameters, and `factor(time)`.
    """

    term: eqx.AbstractVar[AbstractTerm]
    of_time: eqx.AbstractClassVar[tuple[Parameter, ...]]
    prefix: eqx.AbstractClassVar[str]

    def __check_init__(self):
        if self.term.inertial:
            raise ValueError(
                f"{type(self).__name__} changes a force law in time; {type(self.term).__name__} "
                "has momentum. Give friction, for instance terms.Viscous()."
            )

    @abstractmethod
    def factor(self, time: Float[Array, " N"]) -> Float[Array, " N"]:
        """The factor at each time, s, dimensionless."""

    def factor_text(self, s: Syntax, *names: str) -> str | None:
        """The factor in a language, of its parameters' names; `None` where it has no text."""
        return None

    @property
    def affine(self):
        return tuple(p._replace(name=f"{self.prefix}_{p.name}") for p in self.term.affine)

    @property
    def nonlinear(self):
        inner = (p._replace(name=f"{self.prefix}_{p.name}") for p in self.term.nonlinear)
        return (*self.of_time, *inner)

    @property
    def coordinates(self):
        return self.term.coordinates | {"time"}

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        return self.factor(recording.time)[:, None] * self.term.columns(recording)

    def beta(self) -> Float[Array, " d"]:
        own = vector([getattr(self, parameter.name) for parameter in self.of_time])
        return joined([own, self.term.beta()])

    def with_beta(self, beta: Float[Array, " d"]) -> "AbstractModulated":
        names = [parameter.name for parameter in self.of_time]
        where = lambda term: (*(getattr(term, name) for name in names), term.term)  # noqa: E731
        own, inner = beta[: len(names)], beta[len(names) :]
        return eqx.tree_at(where, self, (*own, self.term.with_beta(inner)))
