"""Several nonlinear terms searched one after the other: never on the product of their grids.

Each law is a block with a grid of its own, scanned beside the columns of all the others and their
derivatives, so that those may follow to first order (backfitting with variable projection; Golub &
Pereyra 2003, section 6). All blocks in turn, then a joint refinement from the few best places of
each; again, until nothing improves. The places that lost are the rivals of the one that won.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from ..terms.base import AbstractTerm, Directional, summands
from . import grids, reduced, small, uncertainty
from .problem import Problem

# Places of each grid that are refined, each more than this many cells away from the better ones:
# four cells are a cycle of a wave, or an octave.
PLACES = 3
APART = 4
# A second round starts from terms that know of each other; more are needed where the first one
# was misled. What gains less than this share of the cost is rounding.
ROUNDS = 4
GAIN = 1e-9


class Block(NamedTuple):
    """One law with nonlinear parameters: its side of the motion (0: both), and its part of β."""

    law: AbstractTerm
    side: int
    start: int
    stop: int

    @property
    def at(self) -> slice:
        """Its places in β."""
        return slice(self.start, self.stop)


class Staged(NamedTuple):
    """The minimiser in the unit cube, `(d,)`, whether the refinement converged; the rival: the β
    of the lowest other minimum that noise could have made the lowest, NaN where there is none.
    """

    unit: Float[Array, " d"]
    converged: Bool[Array, ""]
    rival: Float[Array, " d"]


def blocks(term: AbstractTerm) -> tuple[Block, ...]:
    """The laws with nonlinear parameters, each direction's own apart, in the order of β."""
    found, start = [], 0
    for part in summands(term):
        sides: tuple[tuple[int, AbstractTerm], ...] = ((0, part),)
        if isinstance(part, Directional):
            sides = ((1, part.positive), (-1, part.negative))
        for side, inner in sides:
            for law in summands(inner):
                stop = start + len(law.nonlinear)
                if stop > start:
                    found.append(Block(law, side, start, stop))
                start = stop
    return tuple(found)


def search(problem: Problem, plan: grids.Plan) -> Staged:
    """β of the least cost over the grids of a plan."""
    parts = blocks(problem.term)
    coarse = problem.thinned(plan.thin)
    lines = [grids.in_unit(b.law.nonlinear, plan.axes[b.at], problem.box[:, b.at]) for b in parts]
    residuals, fixed, target = problem.residuals(), coarse.fixed(), coarse.target()
    width = max(b.stop - b.start for b in parts)

    def scan(number, unit, active):
        """The best places of one block's grid, `(PLACES, width)`, beside the active others."""
        others = active * (1 - jax.nn.one_hot(number, len(parts), dtype=unit.dtype))
        beside = _beside(coarse, parts, unit, others, fixed, target)
        basis = reduced.orthonormal(jnp.concatenate([fixed, beside], axis=1))
        left = reduced.project_out(basis, target[:, None])[:, 0]

        def branch(block, grid, cells):
            def gain(u):
                return gained(basis, left, _columns(coarse, block, u))

            gains = reduced.tiled(lambda us: jax.vmap(gain)(us)[None], grid, 4 * left.size)[0]
            found = _separate(grid, cells, gains)
            return jnp.pad(found, ((0, 0), (0, width - found.shape[1])))

        branches = [lambda b=b, g=g: branch(b, *g) for b, g in zip(parts, lines, strict=True)]
        return jax.lax.switch(number, branches)

    def cell(unit):
        return jnp.concatenate([_cell(unit[b.at], *g) for b, g in zip(parts, lines, strict=True)])

    return _rounds(scan, cell, residuals, parts, problem)


class _State(NamedTuple):
    unit: Float[Array, " d"]
    cost: Float[Array, ""]
    converged: Bool[Array, ""]
    tried: Float[Array, "S d"]
    gained: Bool[Array, ""]
    number: Float[Array, ""]


def _rounds(scan, cell, residuals, parts, problem) -> Staged:
    """Rounds over all blocks, with a joint refinement after each, until nothing improves."""
    from . import refine  # optimistix takes long to import, and a kept program does without

    count, dtype = len(problem.logarithmic), problem.box.dtype

    def refined(start):
        unit, converged = refine.refine(residuals, start, cell(start))
        return unit, jnp.sum(residuals(unit) ** 2), converged

    def around(state: _State) -> _State:
        first = state.number == 0

        def one(number, carry):
            unit, found, active = carry
            places = scan(number, unit, active)
            # In the first round each block starts where its grid is best.
            unit = jnp.where(first, _put(parts, number, unit, places[0]), unit)
            active = jnp.maximum(active, jax.nn.one_hot(number, len(parts), dtype=dtype))
            return unit, found.at[number].set(places), active

        width = max(b.stop - b.start for b in parts)
        found = jnp.zeros((len(parts), PLACES, width), dtype)
        active = jnp.where(first, jnp.zeros(len(parts), dtype), jnp.ones(len(parts), dtype))
        unit, found, _ = jax.lax.fori_loop(0, len(parts), one, (state.unit, found, active))
        starts = [unit] + [
            unit.at[b.at].set(found[i, k, : b.stop - b.start])
            for i, b in enumerate(parts)
            for k in range(PLACES)
        ]
        units, costs, converged = jax.lax.map(refined, jnp.stack(starts))
        best = jnp.argmin(costs)
        better = costs[best] < state.cost
        return _State(
            jnp.where(better, units[best], state.unit),
            jnp.minimum(costs[best], state.cost),
            jnp.where(better, converged[best], state.converged),
            units,
            # One block alone would see the same grid again.
            (first | (costs[best] < (1 - GAIN) * state.cost)) & (len(parts) > 1),
            state.number + 1,
        )

    start = _State(
        jnp.full(count, 0.5, dtype),
        jnp.asarray(jnp.inf, dtype),
        jnp.zeros((), bool),
        jnp.zeros((1 + PLACES * len(parts), count), dtype),
        jnp.ones((), bool),
        jnp.zeros((), int),
    )
    going = lambda s: s.gained & (s.number < ROUNDS)  # noqa: E731
    end = jax.lax.while_loop(going, around, start)
    rival = _rival(residuals, problem, end.unit, end.tried, cell(end.unit))
    return Staged(end.unit, end.converged, rival)


def _columns(problem: Problem, block: Block, unit) -> Float[Array, "J k"]:
    """The weighted columns of one block at a point of its unit cube."""
    beta = reduced.decode(unit, problem.box[:, block.at], problem.logarithmic[block.at])
    law, recording = block.law.with_beta(beta), problem.recording
    parts = [law.columns(recording), law.momentum(recording) if law.inertial else None]
    if block.side:
        here = (block.side * recording.velocity > 0)[:, None]
        parts = [x if x is None else jnp.where(here, x, 0.0) for x in parts]
    return problem.root[:, None] * problem.rows.project(*parts)


def _beside(problem, parts, unit, active, fixed, target):
    """Columns of the active blocks, and of their force the derivatives by β, `(J, k)`."""
    columns = [
        active[i] * _columns(problem, block, unit[block.at]) for i, block in enumerate(parts)
    ]
    whole = jnp.concatenate([fixed, *columns], axis=1)
    alpha = reduced.least_squares(whole, target)[fixed.shape[1] :]
    slopes = []
    for i, block in enumerate(parts):
        count = columns[i].shape[1]
        own, alpha = alpha[:count], alpha[count:]

        def force(u, block=block, own=own):
            return _columns(problem, block, u) @ own

        slopes.append(active[i] * jax.jacfwd(force)(unit[block.at]))
    return jnp.concatenate([*columns, *slopes], axis=1)


def gained(
    basis: Float[Array, "J q"], target: Float[Array, " J"], columns: Float[Array, "J k"]
) -> Float[Array, ""]:
    """What columns take off the square of a target that is orthogonal to a basis.

    By the Gram matrix of what the basis leaves of them: half the digits, which choose a grid point
    as well as all, in a quarter of the time.
    """
    rest = columns - basis @ (basis.T @ columns)
    squares = jnp.sum(rest**2, axis=0)
    eps = jnp.finfo(rest.dtype).eps
    seen = squares > 1e4 * eps * jnp.sum(columns**2, axis=0)
    rest = jnp.where(seen[None, :], rest, 0.0)
    gram = rest.T @ rest
    # Columns that are nearly one are made two by rounding: of those the second counts for little.
    gram = gram * (1 + 1e4 * eps * jnp.eye(gram.shape[0], dtype=gram.dtype))
    white = small.whiten(gram)
    return jnp.sum((white.T @ (rest.T @ target)) ** 2)


def _put(parts, number, unit, place):
    """β with one block's part replaced."""
    branches = [lambda b=b: unit.at[b.at].set(place[: b.stop - b.start]) for b in parts]
    return jax.lax.switch(number, branches)


def _separate(grid, cells, gains):
    """The best points of a grid, none within [`APART`][] cells of a better one, `(PLACES, d)`."""

    def pick(gains, _):
        best = jnp.argmax(gains)
        reach = 1.001 * APART * cells[best]
        near = jnp.all(jnp.abs(grid - grid[best][None]) <= reach[None], axis=1)
        return jnp.where(near, -jnp.inf, gains), grid[best]

    return jax.lax.scan(pick, jnp.where(jnp.isnan(gains), -jnp.inf, gains), length=PLACES)[1]


def _cell(unit, grid, cells):
    """The cell of the grid point nearest to a place."""
    size = jnp.where(cells > 0, cells, 1.0)
    return cells[jnp.argmin(jnp.max(jnp.abs(grid - unit[None]) / size, axis=1))]


def _rival(residuals, problem, unit, tried, cell) -> Float[Array, " d"]:
    """The lowest minimum elsewhere that the data do not tell from the best one; NaN if none.

    With e what the best fit leaves and d the difference of the two fits, the costs differ by
    L′ − L, and e·d is how much of it noise may have decided; its variance V is that of slow cosines
    of its terms, as for the parameters, or of independent rows, if that is larger. For white noise
    of variance σ² and fits that explain the truth, (L′ − L)/√V is the root of the likelihood
    ratio (L′ − L)/σ². Below Student's 95 % quantile the rival is as good.
    """
    best, rows = residuals(unit), problem.rows
    place = uncertainty.places(rows.positive + rows.negative)
    k = jnp.arange(1, uncertainty.COSINES + 1, dtype=place.dtype)
    waves = 2**0.5 * jnp.cos(jnp.pi * k[:, None] * place[None, :])
    bound = uncertainty.student_quantile(0.975, uncertainty.COSINES)
    lowest = jnp.sum(best**2)

    def compare(other):
        error = residuals(other)
        terms = best * (best - error)
        variance = jnp.maximum(jnp.mean((waves @ terms) ** 2), jnp.sum(terms**2))
        more = jnp.sum(error**2) - lowest
        away = jnp.any(jnp.abs(other - unit) > cell)
        return jnp.where(away & (more <= bound * jnp.sqrt(variance)), more, jnp.inf)

    above = jax.lax.map(compare, tried)
    lowest = jnp.argmin(above)
    beta = reduced.decode(tried[lowest], problem.box, problem.logarithmic)
    return jnp.where(jnp.isfinite(above[lowest]), beta, jnp.nan)


def staged(term: AbstractTerm) -> bool:
    """Whether a term is searched in blocks.

    Not one smooth law, nor one such law for each direction, whose small grids are as good.
    """
    if any(p.resolution is not None for p in term.nonlinear):
        return True
    shared, sided = [[b for b in blocks(term) if bool(b.side) is s] for s in (False, True)]
    return len(shared) > 1 or bool(shared and sided)


def wanted(plan: grids.Plan | int | None, term: AbstractTerm) -> grids.Plan:
    """The plan; that many points along each parameter; or the usual ones."""
    if isinstance(plan, grids.Plan):
        return plan
    if plan is not None:
        return grids.Plan(tuple(grids.Axis(max(2, plan)) for _ in term.nonlinear))
    return grids.plan(term, {}, None, None)
