"""The motion that tells rival effects apart, found before it is made.

A recording of N samples with white noise σ of the force speaks for one effect against another by
N log(1 + D/σ²). D is the mean square of what the one's force leaves when all other terms and the
other effect are fitted in its place, least over the other's parameters (T-optimal design; Atkinson
& Fedorov 1975). It is what [`decide`][jaxfric.identification.deciding.decide] counts.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .. import signals
from ..models import Model
from ..terms.base import AbstractTerm, Sum, bounds, summands
from ..terms.effects import effect
from ..terms.sample import Scales
from .deciding import STRONG, own, shapes
from .design import STEPS, Design, checked, columns, gains, noise_of
from .motion import Limits, Motion, from_rest, multisine, search, sine
from .reduced import orthonormal, root

# Places of nonlinear parameters: of the effect that is true, and of the one fitted in its stead.
PLACES = 24
# Samples on which motions are compared: over a hundred a cycle of the shortest harmonic.
ROUGH = 1000
# Half-width, in samples, of the weak form's shortest kernel: rows across a reversal are left out.
KERNEL = 16


class Apart(NamedTuple):
    """Two effects, one true: rms force, N, by which the best imitation by the other fails, along
    the plain sine (`before`) and along the designed motion (`after`).

    At the found parameters where the found effect is true; where a rival is, whose parameters
    nobody knows, the median over its bounds, with the found force's standard deviation.
    """

    true: str
    other: str
    before: float
    after: float


class _Pair(NamedTuple):
    """The found term's place in the model, itself, and the rival's terms."""

    own: int
    term: AbstractTerm
    rivals: tuple[AbstractTerm, ...]


class _Known(NamedTuple):
    """Of a pair: places of the found term `(G, d)`, of each rival's term, and forces' factors."""

    mine: Float[Array, "G d"]
    others: tuple[Float[Array, "G e"], ...]
    sizes: tuple[Float[Array, " G"], ...]


def separate(
    model: Model,
    rivals: Mapping[str, Sequence[str]],
    limits: Limits,
    noise: float | None = None,
    steps: int = STEPS,
) -> Design:
    """The motion along which found effects differ most from what they may be confused with.

    The recording that confuses two effects told the parameters of neither. So each is taken as the
    true one at many places of its parameters, and the mean of log(10 + evidence) is maximised: a
    ratio counts alike for each pair, and evidence below ten, which decides nothing, counts little.

    **Arguments:** `model`, the improved one; `rivals`, of each found effect its rivals' names;
    `noise`, the standard deviation of white noise on the force, N, by default 2 % of the force.

    **Raises:** `ValueError` for effects without a term of the model, or without a rival's term.
    """
    model = checked(model, limits)
    plain = sine(limits)
    noise = noise_of(model, multisine(plain, limits)) if noise is None else float(noise)
    rough = limits._replace(interval=max(limits.interval, limits.duration / ROUGH))
    named, left_out = _moved(rivals, limits)
    pairs = [_pair(model, name, other, limits) for name, other in named]
    known = [_known(model, pair, limits, multisine(plain, rough)) for pair in pairs]
    count, reach = round(limits.duration / limits.interval), KERNEL * limits.interval

    def cost(coefficients, values):
        model, known, noise = values
        motion = multisine(coefficients, rough)
        told = [
            jnp.mean(jnp.log(STRONG + count * jnp.log1p(left / noise**2)))
            for pair, each in zip(pairs, known, strict=True)
            for left in _lefts(model, motion, reach, pair, each)
        ]
        return -jnp.mean(jnp.stack(told))

    # As arguments, not as constants, so that one program serves all models of one structure.
    best = search(cost, limits, steps, (model, known, jnp.asarray(noise)))
    motion = multisine(from_rest(best), limits)
    motions = (multisine(plain, limits), motion)
    apart = [
        each
        for names, pair, values in zip(named, pairs, known, strict=True)
        for each in _apart(names, *(_lefts(model, m, reach, pair, values) for m in motions))
    ]
    enough = noise * float(np.sqrt(np.expm1(STRONG / count)))
    return Design(motion, noise, gains(model, motions, noise), tuple(apart), enough, left_out)


def _moved(rivals: Mapping[str, Sequence[str]], limits: Limits):
    """The pairs of names whose rival a motion can show, and the rivals that none shows."""
    named = [(name, other) for name, others in rivals.items() for other in others]
    shown = [pair for pair in named if shapes(pair[1], _scales(limits))]
    left_out = tuple(dict.fromkeys(other for _, other in named if (_, other) not in shown))
    if not shown:
        advice = " ".join(f"{name}: {effect(name).separate_by}" for name in left_out)
        raise ValueError(f"No motion of this axis alone shows {', '.join(left_out)}. {advice}")
    return shown, left_out


def _apart(names: tuple[str, str], before, after) -> tuple[Apart, Apart]:
    found, other = names
    first = (float(jnp.sqrt(left[0][0])) for left in (before, after))
    second = (float(jnp.sqrt(jnp.median(left[1]))) for left in (before, after))
    return Apart(found, other, *first), Apart(other, found, *second)


def _lefts(model: Model, motion: Motion, reach: float, pair: _Pair, known: _Known):
    """Mean squares, N², that remain of the found effect's force at its places, the found ones
    first, and of the rival's at its own, each `(G,)`; what is not in slip counts as nothing.
    """
    parts = list(summands(model.term))
    kept = Sum(tuple(part for i, part in enumerate(parts) if i != pair.own))
    slip = _slip(motion, reach)[:, None]
    base = orthonormal(slip * columns(kept, motion))
    mine, *others = (slip[None] * each for each in _columns(motion, pair, known))
    forces = [
        force * size[:, None]
        for force, size in zip(_forces(model, pair, mine, *others), known.sizes, strict=True)
    ]
    first = jnp.min(jnp.stack([_left(base, forces[0], other) for other in others]), axis=0)
    second = [_left(base, force, mine) for force in forces[1:]]
    return first, jnp.concatenate(second)


def _columns(motion: Motion, pair: _Pair, known: _Known):
    """Columns of the found term and of each rival's term at their places, each `(G, N, p)`."""
    return [
        jax.lax.map(
            lambda b, term=term: columns(term.with_beta(b) if term.nonlinear else term, motion),
            places,
        )
        for term, places in zip((pair.term, *pair.rivals), (known.mine, *known.others), strict=True)
    ]


def _slip(motion: Motion, reach: float) -> Float[Array, " N"]:
    """Roots of the samples' weights: little within `reach`, s, of a reversal, where v < a reach."""
    slowest = signals.SLIP_SHARE * jnp.max(jnp.abs(motion.velocity))
    square = motion.velocity**2
    return root(square / (square + (reach * motion.acceleration) ** 2 + slowest**2))


def _forces(model: Model, pair: _Pair, mine, *others) -> list[Float[Array, "G N"]]:
    """The found effect's forces at its places with the found amplitudes; the rivals' with drawn
    ones, such as the phase of a wave.
    """
    ends = np.cumsum([0, *(len(part.affine) for part in summands(model.term))])
    weights = model.alpha[ends[pair.own] : ends[pair.own + 1]]
    forces = [mine @ weights]
    for other in others:
        drawn = np.random.default_rng(1).normal(size=(other.shape[0], other.shape[2]))
        forces.append(jnp.einsum("gnq,gq->gn", other, jnp.asarray(drawn, other.dtype)))
    return forces


def _left(base, force: Float[Array, "P N"], other: Float[Array, "G N q"]) -> Float[Array, " P"]:
    """The least mean square that is left of each force over the places of the other."""
    force = force - (force @ base) @ base.T
    other = other - jnp.einsum("nb,gbq->gnq", base, jnp.einsum("nb,gnq->gbq", base, other))
    size = root(jnp.sum(other**2, axis=1))
    other = other / jnp.where(size > 0, size, 1.0)[:, None]
    square = jnp.einsum("gnq,gnr->gqr", other, other)
    square = square + 1e-9 * jnp.eye(square.shape[-1], dtype=square.dtype)[None]
    shared = jnp.einsum("gnq,pn->gqp", other, force)
    taken = jnp.sum(shared * jnp.linalg.solve(square, shared), axis=1)
    left = jnp.sum(force**2, axis=1)[None] - taken
    return jnp.maximum(jnp.min(left, axis=0), 0.0) / force.shape[1]


def _pair(model: Model, name: str, other: str, limits: Limits) -> _Pair:
    scales = _scales(limits)
    place = own(model, name, scales)
    return _Pair(place, summands(model.term)[place], tuple(shapes(other, scales)))


def _known(model: Model, pair: _Pair, limits: Limits, plain: Motion) -> _Known:
    """Places of both, and factors by which each force varies as much as the found one does along
    the plain sine.
    """
    scales = _scales(limits)
    mine = _places(pair.term, scales)
    if pair.term.nonlinear:
        mine = jnp.concatenate([pair.term.beta()[None], mine])
    known = _Known(mine, tuple(_places(term, scales) for term in pair.rivals), ())
    spreads = [
        jnp.std(force, axis=1) for force in _forces(model, pair, *_columns(plain, pair, known))
    ]
    whole = spreads[0][0]
    sizes = (jnp.where(s > 0, whole / jnp.where(s > 0, s, 1.0), 0.0) for s in spreads)
    return known._replace(sizes=tuple(sizes))


def _scales(limits: Limits) -> Scales:
    """What a motion within the limits would say about magnitudes."""
    slowest = signals.SLIP_SHARE * limits.velocity
    low, high = limits.centre - limits.position, limits.centre + limits.position
    values = (slowest, limits.velocity, low, high, 1.0, 0.0, limits.duration, limits.interval)
    return Scales(*(jnp.asarray(x, float) for x in (*values, 2.0)))


def _places(term: AbstractTerm, scales: Scales) -> Float[Array, "G d"]:
    """Nonlinear parameters at places spread over their bounds."""
    if not term.nonlinear:
        return jnp.zeros((1, 0))
    low, high = np.asarray(bounds(term, scales))
    share = np.random.default_rng(0).uniform(size=(PLACES, low.size))
    share[:, 0] = np.linspace(0, 1, PLACES)
    ratio = np.array([p.logarithmic for p in term.nonlinear])
    safe = np.where(low > 0, low, 1.0)
    even = low + share * (high - low)
    return jnp.asarray(np.where(ratio & (low > 0), safe * (high / safe) ** share, even))
