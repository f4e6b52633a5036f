"""The parameters from what a stream has accumulated: problem (L), eq. (17), on its nodes."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..data.recording import Recording
from ..identification import reduced
from ..identification.projections import Rows
from ..identification.search import search
from ..models import Model, named
from ..terms.base import AbstractTerm, Sum, bounds, summands
from ..terms.inertia import Inertia
from ..terms.sample import Scales
from .moments import State


class Solution(NamedTuple):
    """The model without inertia, which the method does not need; and what there was to solve.

    `strokes` in each direction, `(2,)`; `seconds` of slip that count, `(2,)`; `cost`, the root mean
    square of what the model leaves of the force, acceleration included, N; `settled`, whether
    β was found inside its bounds.
    """

    model: Model
    strokes: Float[Array, " 2"]
    seconds: Float[Array, " 2"]
    cost: Float[Array, ""]
    settled: Bool[Array, ""]


def friction_only(model: AbstractTerm | Model | str) -> AbstractTerm:
    """The terms of a model but its inertia; raises `ValueError` for one beyond velocity."""
    term = named(model) if isinstance(model, str) else model
    term = term.term if isinstance(term, Model) else term
    kept = tuple(t for t in summands(term) if not isinstance(t, Inertia))
    beyond = sorted(Sum(kept).coordinates - {"velocity"})
    if beyond:
        raise ValueError(
            f"Online identification takes functions of velocity, and this model depends on "
            f"{', '.join(beyond)} too. Record, and use jaxfric identify."
        )
    return Sum(kept)


@eqx.filter_jit
def solve(term: AbstractTerm, state: State) -> Solution:
    """The parameters of a sum of functions of velocity from a state: grid, refinement, α (17).

    **Arguments:** `term` from `friction_only`. Pure; parameters of a direction without a closed
    stroke are zero.
    """
    weight, load = state.total.weight, state.total.load
    force = load / jnp.where(weight > 0, weight, 1.0)
    speeds = jnp.concatenate([state.nodes, -state.nodes])
    target, empty = force.reshape(-1), jnp.zeros_like(state.nodes)
    clock = jnp.arange(speeds.size, dtype=speeds.dtype)
    log = Recording(clock, target, velocity=speeds)
    positive = jnp.concatenate([weight[0], empty])
    negative = jnp.concatenate([empty, weight[1]])
    one = jnp.ones((), speeds.dtype)
    rows = Rows(target, positive, negative, positive + negative, clock, one, one)
    box = bounds(term, _scales(state))
    found = search(term, log, rows, box, None)
    known = term.with_beta(found.beta)
    columns = rows.columns(known, log)
    root = reduced.root(positive + negative)
    offset = rows.offset(known, log)
    alpha = reduced.least_squares(root[:, None] * columns, root * (target - offset))
    predicted = (columns @ alpha + offset).reshape(2, -1)
    square = state.total.square - 2 * jnp.sum(load * predicted, 1) + jnp.sum(
        weight * predicted**2, 1
    )  # fmt: skip
    seconds = jnp.sum(weight, axis=1)
    whole = jnp.sum(seconds)
    cost = jnp.sqrt(jnp.maximum(jnp.sum(square), 0.0) / jnp.where(whole > 0, whole, 1.0))
    settled = found.converged & ~found.on_border
    return Solution(Model(known, alpha), state.strokes, seconds, cost, settled)


def _scales(state: State) -> Scales:
    """Magnitudes of the strokes: the fastest speed that both directions have reached."""
    reached = jnp.where(state.total.weight > 0, state.nodes[None, :], 0.0)
    top = jnp.max(reached, axis=1)
    least = jnp.min(jnp.where(top > 0, top, jnp.inf))
    slowest = state.nodes[0]
    fastest = jnp.where(jnp.isfinite(least), jnp.maximum(least, 4 * slowest), state.nodes[-1])
    zero = jnp.zeros_like(slowest)
    one, interval = jnp.ones_like(slowest), state.interval
    return Scales(slowest, fastest, zero, zero, zero, zero, one, interval, peak=zero)
