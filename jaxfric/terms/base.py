"""What a term is: columns of a regression, written once, for one sample.

An axis obeys u = Σ_j (f0_j + g_jᵀ α_j): the actuator force is a sum of terms. A term's nonlinear
parameters β are its pytree leaves; its affine parameters α belong to nobody until they are solved
for (`jaxfric.identification`), and then live beside the terms in a [`Model`][jaxfric.models.Model].
"""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..units import POSITION
from .sample import Burden, Parameter, Sample, Scales, samples
from .text import Syntax
from .vectors import joined, split, vector


class AbstractTerm(eqx.Module):
    """A summand of the axis equation u = Σ_j (f0_j + g_jᵀ α_j).

    Terms add (`+`), and [`Directional`][] gives each direction of motion its own parameters.
    To write a term of your own, derive from [`AbstractLaw`][].
    """

    stepped: ClassVar[bool] = False
    """Whether its columns are stepped along the motion several times a sample."""
    in_joint: ClassVar[str] = ""
    """What a simulator's joint has for it: friction, damping, inertia, spring or constant."""
    sided: ClassVar[bool] = False
    """Whether it is a function of the position times the direction."""
    swings: ClassVar[bool] = False
    """Whether it holds a load that swings, or strikes, faster than a wide kernel resolves."""

    @property
    def chosen(self) -> int:
        """How many given numbers of it the residual itself has suggested."""
        return 0

    @property
    def switched(self) -> "AbstractTerm | None":
        """The term of which it is `course` times the force; `None` where it is no such term."""
        return None

    def course(
        self, betas: Float[np.ndarray, "G d"], time: Float[np.ndarray, " N"]
    ) -> tuple[Float[np.ndarray, "G N"], Float[np.ndarray, "G N"]]:
        """The factor of `switched` at each time, s, for many β, on the host, and its rate, 1/s."""
        raise NotImplementedError

    def burden(self, beta: np.ndarray, alpha: np.ndarray) -> Burden | None:
        """What it takes of the machine's inertia and friction; `None` where it is no part of it."""
        return None

    @property
    @abstractmethod
    def affine(self) -> tuple[Parameter, ...]:
        """Names and dimensions of the affine parameters α, one for each column."""

    @property
    @abstractmethod
    def nonlinear(self) -> tuple[Parameter, ...]:
        """Names, dimensions and bounds of the nonlinear parameters β."""

    @property
    @abstractmethod
    def coordinates(self) -> frozenset[str]:
        """The signals that the columns are functions of.

        `{"velocity"}` alone means that acceleration is orthogonal to the columns (Lemma 1 of
        Kim, Kim & Ha 2004), so that neither mass nor acceleration is needed to identify them.
        """

    @property
    def inertial(self) -> bool:
        """Whether the term has momentum, so that its force contains an acceleration."""
        return False

    @property
    def frictional(self) -> tuple[bool, ...]:
        """Which affine parameters are of friction, a function of the velocity, one for each; what
        guide or screw carry is the others: inertia, weight, springs.
        """
        slips = "velocity" in self.coordinates and "acceleration" not in self.coordinates
        return (slips,) * len(self.affine)

    def text(self, s: Syntax, *names: str) -> Sequence[str] | None:
        """Its columns at one sample in a language, `names` being those of β; `None` for no text.

        The signals are `x`, `v`, `a`, `t`, and where it reads `predicted_force` or
        `predicted_reaction` `f` or `r`.
        """
        return None

    def extent(self, values: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        """The ranges of position and time in which it shows all that it does, where it says."""
        waves = [p for p in self.nonlinear if p.repeats]
        return {
            "position" if p.dimension == POSITION else "time": (0.0, p.period(values[p.name]))
            for p in waves
        }

    @abstractmethod
    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        """The regressors g, one column for each affine parameter, shape `(N, p)`."""

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        """Quantities whose time derivative adds to the columns, shape `(N, p)`.

        The derivative is never taken on the data: the projection puts it on its kernel.
        """
        return jnp.zeros((recording.num_samples, len(self.affine)), recording.time.dtype)

    def columns_and_momentum(
        self, recording: Recording
    ) -> tuple[Float[Array, "N p"], Float[Array, "N p"] | None]:
        """Both, which some laws find in one go; `None` for no momentum."""
        return self.columns(recording), self.momentum(recording) if self.inertial else None

    def offset(self, recording: Recording) -> Float[Array, " N"]:
        """The known part f0 of the term, N, shape `(N,)`."""
        return jnp.zeros_like(recording.time)

    def beta(self) -> Float[Array, " d"]:
        """The nonlinear parameters as one vector, shape `(d,)`; NaN where not yet known."""
        return vector([getattr(self, parameter.name) for parameter in self.nonlinear])

    def with_beta(self, beta: Float[Array, " d"]) -> "AbstractTerm":
        """The same term with other nonlinear parameters, `beta` of shape `(d,)`."""
        if not self.nonlinear:
            return self
        names = [parameter.name for parameter in self.nonlinear]
        return eqx.tree_at(lambda term: [getattr(term, name) for name in names], self, list(beta))

    def resolved(self, length: Float[Array, ""]) -> "AbstractTerm":
        """The same term with a jump in time drawn out over `length`, s.

        A jump between two samples has no derivative by its moment; a short ramp has.
        """
        return self

    def __add__(self, other: "AbstractTerm") -> "Sum":
        return Sum(summands(self) + summands(other))


class AbstractLaw(AbstractTerm):
    """A law of physics written for one sample; this class batches it over the recording.

    A concrete law names its affine parameters in `affine`, gives `law(sample)`, a tuple with one
    number for each of them, and lists in `nonlinear` the fields that are nonlinear parameters.
    """

    coordinates: ClassVar[frozenset[str]] = frozenset({"velocity"})  # type: ignore[misc]
    nonlinear: ClassVar[tuple[Parameter, ...]] = ()  # type: ignore[misc]

    @property
    def inertial(self) -> bool:
        return type(self).impulse is not AbstractLaw.impulse

    @abstractmethod
    def law(self, sample: Sample) -> tuple[Float[Array, ""], ...]:
        """The columns at one sample."""

    def impulse(self, sample: Sample) -> tuple[Float[Array, ""], ...]:
        """The momentum at one sample; zero but for terms with acceleration in them."""
        return tuple(jnp.zeros_like(sample.velocity) for _ in self.affine)

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        return _batched(self.law, recording)

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        return _batched(self.impulse, recording)


class Sum(AbstractTerm):
    """A sum of terms; its parameters are those of the summands, in their order.

    A sum inside of it gives its own summands.
    """

    terms: tuple[AbstractTerm, ...] = eqx.field(
        converter=lambda terms: tuple(leaf for term in terms for leaf in summands(term))
    )

    @property
    def affine(self) -> tuple[Parameter, ...]:
        return _unique([p for term in self.terms for p in term.affine])

    @property
    def nonlinear(self) -> tuple[Parameter, ...]:
        return _unique([p for term in self.terms for p in term.nonlinear])

    @property
    def coordinates(self) -> frozenset[str]:
        return frozenset().union(*(term.coordinates for term in self.terms))

    @property
    def inertial(self) -> bool:
        return any(term.inertial for term in self.terms)

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        return _beside([term.columns(recording) for term in self.terms], recording)

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        return _beside([term.momentum(recording) for term in self.terms], recording)

    def offset(self, recording: Recording) -> Float[Array, " N"]:
        return sum((term.offset(recording) for term in self.terms), jnp.zeros_like(recording.time))

    def beta(self) -> Float[Array, " d"]:
        return joined([term.beta() for term in self.terms])

    def with_beta(self, beta: Float[Array, " d"]) -> "Sum":
        counts = [len(term.nonlinear) for term in self.terms]
        return Sum(
            tuple(t.with_beta(b) for t, b in zip(self.terms, split(beta, counts), strict=True))
        )

    def resolved(self, length: Float[Array, ""]) -> "Sum":
        return Sum(tuple(term.resolved(length) for term in self.terms))


class Directional(AbstractTerm):
    """A term with parameters of its own for each direction of motion.

    g = [1(v > 0) g(v; β⁺), 1(v < 0) g(v; β⁻)], names with `+` and `-` appended. No sample lies on
    both sides, so that problem (L) separates (Kim, Kim & Ha 2004, eqs. 24 and 30).
    """

    positive: AbstractTerm
    negative: AbstractTerm

    def __init__(self, term: AbstractTerm, negative: AbstractTerm | None = None):
        self.positive = term
        self.negative = term if negative is None else negative

    @property
    def affine(self) -> tuple[Parameter, ...]:
        return _signed(self.positive.affine, "+") + _signed(self.negative.affine, "-")

    @property
    def nonlinear(self) -> tuple[Parameter, ...]:
        return _signed(self.positive.nonlinear, "+") + _signed(self.negative.nonlinear, "-")

    @property
    def coordinates(self) -> frozenset[str]:
        return self.positive.coordinates | {"velocity"}

    @property
    def inertial(self) -> bool:
        return self.positive.inertial or self.negative.inertial

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        return self._sides(
            recording, self.positive.columns(recording), self.negative.columns(recording)
        )

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        return self._sides(
            recording, self.positive.momentum(recording), self.negative.momentum(recording)
        )

    def offset(self, recording: Recording) -> Float[Array, " N"]:
        v = recording.velocity
        positive, negative = self.positive.offset(recording), self.negative.offset(recording)
        return jnp.where(v > 0, positive, jnp.where(v < 0, negative, jnp.zeros_like(v)))

    def beta(self) -> Float[Array, " d"]:
        return joined([self.positive.beta(), self.negative.beta()])

    def with_beta(self, beta: Float[Array, " d"]) -> "Directional":
        positive, negative = split(
            beta, [len(self.positive.nonlinear), len(self.negative.nonlinear)]
        )
        return Directional(self.positive.with_beta(positive), self.negative.with_beta(negative))

    def resolved(self, length: Float[Array, ""]) -> "Directional":
        return Directional(self.positive.resolved(length), self.negative.resolved(length))

    def _sides(self, recording, positive, negative):
        v = recording.velocity[:, None]
        return jnp.concatenate(
            [
                jnp.where(v > 0, positive, jnp.zeros_like(positive)),
                jnp.where(v < 0, negative, jnp.zeros_like(negative)),
            ],
            axis=-1,
        )


def summands(term: AbstractTerm) -> tuple[AbstractTerm, ...]:
    """The leaves of a sum, in order; a term that is no sum is its own only summand."""
    if not isinstance(term, Sum):
        return (term,)
    return tuple(leaf for part in term.terms for leaf in summands(part))


def leaves(term: AbstractTerm) -> Iterator[AbstractTerm]:
    """The single terms of a sum, of those with a direction the positive one."""
    for part in summands(term):
        if isinstance(part, Directional):
            yield from leaves(part.positive)
        else:
            yield part


def changed_columns(term: AbstractTerm) -> list[range]:
    """For each nonlinear parameter the columns that it changes, as their numbers."""
    if isinstance(term, Sum):
        parts: tuple[AbstractTerm, ...] = term.terms
    elif isinstance(term, Directional):
        parts = (term.positive, term.negative)
    else:
        return [range(len(term.affine))] * len(term.nonlinear)
    found, first = [], 0
    for part in parts:
        inside = changed_columns(part)
        found += [range(first + own.start, first + own.stop) for own in inside]
        first += len(part.affine)
    return found


def bounds(
    term: AbstractTerm, scales: Scales, given: Mapping[str, tuple[float, float]] | None = None
) -> Float[Array, "2 d"]:
    """The compact set B: lower and upper bounds of the nonlinear parameters, shape `(2, d)`.

    A bound `given` under a parameter's name (with or without its direction sign) wins over the
    one that the recording suggests.
    """
    given = given or {}
    pairs = []
    for parameter in term.nonlinear:
        own = given.get(parameter.name, given.get(parameter.name.rstrip("+-")))
        pair = own if own is not None else parameter.bounds(scales)
        pairs.append(jnp.stack([jnp.asarray(limit, scales.fastest.dtype) for limit in pair]))
    return jnp.stack(pairs, axis=1) if pairs else jnp.zeros((2, 0), scales.fastest.dtype)


def _beside(parts: Sequence[Float[Array, "N k"]], recording: Recording) -> Float[Array, "N p"]:
    """Columns beside each other, of however many terms."""
    none = jnp.zeros((recording.num_samples, 0), recording.time.dtype)
    return jnp.concatenate(parts, axis=-1) if parts else none


def _batched(body, recording: Recording) -> Float[Array, "N p"]:
    return jax.vmap(lambda sample: vector(body(sample)))(samples(recording))


def _signed(parameters, sign):
    return tuple(parameter._replace(name=parameter.name + sign) for parameter in parameters)


def _unique(parameters):
    """Parameters with the second and later bearers of a name numbered from 2."""
    seen: dict[str, int] = {}
    unique = []
    for parameter in parameters:
        count = seen[parameter.name] = seen.get(parameter.name, 0) + 1
        unique.append(
            parameter if count == 1 else parameter._replace(name=_numbered(parameter.name, count))
        )
    return tuple(unique)


def _numbered(name: str, count: int) -> str:
    stem = name.rstrip("+-")
    return f"{stem}_{count}{name[len(stem) :]}"
