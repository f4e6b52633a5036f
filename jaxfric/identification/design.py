"""The next experiment: the motion that tells most, found by gradient descent before it is made.

What a motion tells of a model's parameters is known in advance: their covariance is
σ² (Σ J Jᵀ)⁻¹, J the derivative of the force by them along it. What it tells of two rival effects is
what the one leaves when the other is fitted in its place.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .. import signals
from ..models import Model
from ..terms.base import AbstractTerm, Sum, bounds, summands
from ..terms.effects import effect
from ..terms.sample import Scales
from ..units import spell
from .motion import HARMONICS, Limits, Motion, descend, multisine, sine
from .reduced import orthonormal, project_out

STEPS, STARTS = 150, 4
# White noise of the force beside the root mean square of its own, where none is given.
NOISE = 0.02
# Places of a rival's nonlinear parameters that are fitted in its stead.
PLACES = 24


class Gain(NamedTuple):
    """A parameter's predicted standard error along the plain sine and along the design."""

    before: float
    after: float
    unit: str


class Design(NamedTuple):
    """The proposed motion; `gains` by parameter, with white noise of the force of `noise`, N; and
    for rivals the root mean square force, N, by which they differ at least, before and after.
    """

    motion: Motion
    noise: float
    gains: dict[str, Gain]
    separation: tuple[float, float] | None = None
    rivals: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The prediction as plain data."""
        gains = {name: gain._asdict() for name, gain in self.gains.items()}
        apart = None
        if self.separation:
            apart = dict(zip(("before", "after"), self.separation, strict=True))
        return {"noise": self.noise, "standard_errors": gains, "separation": apart,
                "rivals": list(self.rivals)}  # fmt: skip


def jacobian(model: Model, motion: Motion) -> Float[Array, "N P"]:
    """Derivatives of the force by all parameters along a motion, affine ones first, `(N, P)`."""
    log = motion.recording()

    def force(beta):
        return columns(model.term.with_beta(beta), motion) @ model.alpha

    affine = columns(model.term, motion)
    if not model.term.nonlinear:
        return affine
    beta = model.term.beta().astype(log.time.dtype)
    return jnp.concatenate([affine, jax.jacfwd(force)(beta)], axis=1)


def columns(term: AbstractTerm, motion: Motion) -> Float[Array, "N p"]:
    """A term's columns along a motion, what has momentum differentiated in time, `(N, p)`."""
    log = motion.recording()
    plain = term.columns(log)
    if not term.inertial:
        return plain

    def momentum(x, v):
        moved = log.__class__(log.time, log.force, x, v)
        return term.momentum(moved)

    tangents = (motion.velocity, motion.acceleration)
    return plain + jax.jvp(momentum, (motion.position, motion.velocity), tangents)[1]


def errors(model: Model, motion: Motion, noise: float | Array) -> Float[Array, " P"]:
    """Predicted standard errors of all parameters; infinite where a motion does not show them."""
    matrix = jacobian(model, motion)
    size = jnp.linalg.norm(matrix, axis=0)
    size = jnp.where(size > 0, size, 1.0)
    scaled = matrix / size[None]
    square = scaled.T @ scaled + 1e-13 * jnp.eye(size.size, dtype=size.dtype)
    return noise * jnp.sqrt(jnp.diagonal(jnp.linalg.inv(square))) / size


def design(model: Model, limits: Limits, noise: float | None = None, steps: int = STEPS) -> Design:
    """The motion that minimises the sum of the parameters' relative variances (A-optimality).

    **Arguments:** `model` with its values, as good as a first guess has to be; `limits`; `noise`,
    the standard deviation of white noise on the force, N, by default 2 % of the force.

    **Raises:** `ValueError` for limits that are none or a model without values.
    """
    model = _checked(model, limits)
    values = jnp.asarray([float(v) for v in model.parameters.values()])
    # What is zero has no relative error: its size is that of the force.
    scale = jnp.where(jnp.abs(values) > 0, jnp.abs(values), 1.0)
    first = multisine(sine(limits), limits)
    noise = _noise(model, first) if noise is None else float(noise)

    def cost(coefficients):
        found = errors(model, multisine(coefficients, limits), noise) / scale
        return jnp.log(jnp.sum(found**2))

    motion = multisine(_search(cost, limits, steps), limits)
    return Design(motion, noise, _gains(model, (first, motion), noise))


def separate(
    model: Model,
    rivals: Mapping[str, Sequence[str]],
    limits: Limits,
    noise: float | None = None,
    steps: int = STEPS,
) -> Design:
    """The motion along which found effects differ most from what they may be confused with.

    What an effect leaves when all other terms and a rival are fitted in its place is made as large
    as it can be, and what the rival leaves when the effect is. The recording that confuses them
    told the parameters of neither: both are taken at many, and the mean of the logarithms counts.

    **Arguments:** `model`, the improved one; `rivals`, of each found effect its rivals' names.

    **Raises:** `ValueError` for effects without a term of the model, or without a rival's term.
    """
    model = _checked(model, limits)
    pairs = _pairs(model, rivals, limits)
    first = multisine(sine(limits), limits)

    def least(motion):
        left = [_left(model, motion, one, terms) for one, terms in pairs]
        return jnp.min(jnp.concatenate(left))

    own = [_placed(summands(model.term)[one], _scales(limits)) for one, _ in pairs]
    # As arguments, not as constants, so that one program serves all models of one structure.
    values = (model, [mine[1] for mine in own], [[b for _, b in terms] for _, terms in pairs])
    kinds = tuple(
        (one, mine[0], tuple(t for t, _ in terms))
        for (one, terms), mine in zip(pairs, own, strict=True)
    )

    def cost(coefficients, values):
        model, own, rivals = values
        motion = multisine(coefficients, limits)
        apart = [
            _apart(model, motion, one, (term, mine), (rival, betas))
            for (one, term, others), mine, places in zip(kinds, own, rivals, strict=True)
            for rival, betas in zip(others, places, strict=True)
        ]
        return -jnp.mean(jnp.stack(apart))

    motion = multisine(_search(cost, limits, steps, values), limits)
    noise = _noise(model, first) if noise is None else float(noise)
    apart = (float(jnp.sqrt(least(first))), float(jnp.sqrt(least(motion))))
    names = tuple(f"{one} or {other}" for one, others in rivals.items() for other in others)
    return Design(motion, noise, _gains(model, (first, motion), noise), apart, names)


def _checked(model: Model, limits: Limits) -> Model:
    wrong = [n for n, v in limits._asdict().items() if not 0 < v < np.inf]
    if wrong:
        raise ValueError(f"Limits are over zero and finite; {', '.join(wrong)} is not.")
    if lacking := [n for n, v in model.parameters.items() if not np.isfinite(float(v))]:
        raise ValueError(
            f"The model has no value for {', '.join(lacking)}; give a guess "
            "(model.with_parameters) to design for."
        )
    known = {"velocity", "acceleration", "position", "time"}
    if other := sorted(model.term.coordinates - known):
        raise ValueError(
            f"The model depends on {', '.join(other)}, which a motion does not determine. Leave "
            "that term out: model.without(NAME)."
        )
    return model


def _noise(model: Model, motion: Motion) -> float:
    force = columns(model.term, motion) @ model.alpha
    return float(NOISE * jnp.sqrt(jnp.mean(force**2)))


def _search(cost, limits: Limits, steps: int, values=None) -> Float[Array, "2 H"]:
    """The best of descents from the plain sine and from drawn multisines.

    **Arguments:** `cost` of coefficients, and of `values` where there are any.
    """
    plain = sine(limits)
    drawn = jax.random.normal(jax.random.key(0), (STARTS, 2, HARMONICS))
    drawn = drawn / jnp.arange(1, HARMONICS + 1, dtype=drawn.dtype)[None, None]
    starts = jnp.concatenate([(plain + 0.02 * drawn[0])[None], drawn[1:].astype(plain.dtype)])

    @eqx.filter_jit
    def all_of(starts, values):
        def one(start):
            return descend(cost if values is None else lambda c: cost(c, values), start, steps)

        return jax.lax.map(one, starts)

    found, least = all_of(starts, values)
    return found[int(jnp.nanargmin(least))]


def _gains(model: Model, motions: Sequence[Motion], noise: float) -> dict[str, Gain]:
    before, after = (np.asarray(errors(model, motion, noise)) for motion in motions)
    units = dict(model.units)
    parameters = (*model.term.affine, *model.term.nonlinear)
    return {
        p.name: Gain(float(a), float(b), spell(p.dimension, units))
        for p, a, b in zip(parameters, before, after, strict=True)
    }


def _pairs(model: Model, rivals: Mapping[str, Sequence[str]], limits: Limits):
    """For each pair of a found effect and a rival: the places of the effect's columns, and the
    rival's terms over its parameters.
    """
    scales = _scales(limits)
    pairs = []
    for name, others in rivals.items():
        kinds = {type(term) for term in effect(name).shapes(scales)}
        own = [i for i, term in enumerate(summands(model.term)) if type(term) in kinds]
        if not own:
            raise ValueError(f"The model has no term of the effect {name!r} to tell from another.")
        for other in others:
            terms = [t for t in effect(other).shapes(scales) if not t.inertial]
            if not terms:
                raise ValueError(
                    f"{other!r} is no term of a motion; {effect(other).separate_by or ''}".strip()
                )
            pairs.append((own[0], [_placed(term, scales) for term in terms[:1]]))
    return pairs


def _scales(limits: Limits) -> Scales:
    """What a motion within the limits would say about magnitudes."""
    slowest = signals.SLIP_SHARE * limits.velocity
    values = (slowest, limits.velocity, -limits.position, limits.position, 1.0, 0.0,
              limits.duration, limits.interval)  # fmt: skip
    return Scales(*(jnp.asarray(x, float) for x in values))


def _apart(model: Model, motion: Motion, own: int, mine, rival) -> Float[Array, ""]:
    """How well an effect and a rival are told apart: the mean of two mean logarithms.

    Each of the share of its force that the other, and all other terms, do not account for, at
    places of its own parameters, the found ones among them, the least over places of the other's.
    """
    parts = list(summands(model.term))
    ends = np.cumsum([0, *(len(part.affine) for part in parts)])
    others = Sum(tuple(part for i, part in enumerate(parts) if i != own))
    base = orthonormal(columns(others, motion))
    term, betas = mine
    if term.nonlinear:
        betas = jnp.concatenate([parts[own].beta()[None], betas])
    weights = model.alpha[ends[own] : ends[own + 1]]
    first = jax.lax.map(lambda b: columns(_bent(term, b), motion), betas)
    second = jax.lax.map(lambda b: columns(_bent(rival[0], b), motion), rival[1])
    equal = jnp.ones(second.shape[-1], weights.dtype)
    both = _share(base, first, weights, second) + _share(base, second, equal, first)
    return 0.5 * both


def _bent(term: AbstractTerm, beta: Float[Array, " d"]) -> AbstractTerm:
    return term.with_beta(beta) if term.nonlinear else term


def _share(base, first: Float[Array, "P N p"], weights, second: Float[Array, "G N q"]):
    """Mean over P of the logarithm of the least share left, over G, of the first's force."""
    force = first @ weights
    power = jnp.sum(force**2, axis=1)
    force = force - (force @ base) @ base.T
    second = second - jnp.einsum("nb,gbq->gnq", base, jnp.einsum("nb,gnq->gbq", base, second))
    size = jnp.linalg.norm(second, axis=1)
    second = second / jnp.where(size > 0, size, 1.0)[:, None]
    square = jnp.einsum("gnq,gnr->gqr", second, second)
    square = square + 1e-9 * jnp.eye(square.shape[-1], dtype=square.dtype)[None]
    shared = jnp.einsum("gnq,pn->gqp", second, force)
    taken = jnp.sum(shared * jnp.linalg.solve(square, shared), axis=1)
    left = (jnp.sum(force**2, axis=1)[None] - taken) / jnp.where(power > 0, power, 1.0)[None]
    # A millionth of the power is no difference: below it, nothing is gained.
    return jnp.mean(jnp.log(jnp.maximum(jnp.min(left, axis=0), 0.0) + 1e-6))


def _placed(term: AbstractTerm, scales: Scales):
    """The rival with its nonlinear parameters at places spread over their bounds, `(G, d)`."""
    if not term.nonlinear:
        return term, jnp.zeros((1, 0))
    low, high = np.asarray(bounds(term, scales))
    share = np.random.default_rng(0).uniform(size=(PLACES, low.size))
    share[:, 0] = np.linspace(0, 1, PLACES)
    ratio = np.array([p.logarithmic for p in term.nonlinear])
    safe = np.where(low > 0, low, 1.0)
    even = low + share * (high - low)
    return term, jnp.asarray(np.where(ratio & (low > 0), safe * (high / safe) ** share, even))


def _left(model: Model, motion: Motion, own: int, terms) -> Float[Array, " G"]:
    """Mean square of what a term's force leaves when the others and a rival are fitted, N²."""
    parts = list(summands(model.term))
    ends = np.cumsum([0, *(len(part.affine) for part in parts)])
    force = columns(parts[own], motion) @ model.alpha[ends[own] : ends[own + 1]]
    others = Sum(tuple(part for i, part in enumerate(parts) if i != own))
    base = columns(others, motion)
    left = []
    for term, betas in terms:

        def one(beta, term=term):
            rival = columns(term.with_beta(beta) if term.nonlinear else term, motion)
            basis = orthonormal(jnp.concatenate([base, rival], axis=1))
            return jnp.mean(project_out(basis, force[:, None]) ** 2)

        left.append(jax.lax.map(one, betas))
    return jnp.concatenate(left)
