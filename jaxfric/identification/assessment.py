"""What is known about parameters that were found: affine ones, deviations, mass, and the result."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .. import checks, signals
from ..checks import Design
from ..terms.base import AbstractTerm, summands
from ..terms.friction import STRIBECK_VELOCITY
from ..terms.sample import Scales
from . import reduced, uncertainty, weighing
from .identified import Result
from .projections import Rows

# Samples each way for the mean acceleration: over more of them it lacks some of its peaks, over
# fewer it is noisier.
NEAR = 4


def solve(term, beta, recording, rows: Rows, alpha=None):
    """Affine parameters at β, the Jacobian by all parameters, and the residual, unweighted.

    `alpha`: their values, if known.
    """
    known = term.with_beta(beta)
    columns = rows.columns(known, recording)
    target = rows.target - rows.offset(known, recording)
    root = reduced.root(rows.positive + rows.negative)
    alpha = reduced.least_squares(root[:, None] * columns, root * target, alpha)
    if not term.nonlinear:
        return alpha, columns, target - columns @ alpha

    def by_beta(beta):
        return rows.force(term.with_beta(beta), jax.lax.stop_gradient(alpha), recording)

    jacobian = jnp.concatenate([columns, jax.jacfwd(by_beta)(beta)], axis=1)
    return alpha, jacobian, target - jacobian[:, : alpha.size] @ alpha


class InertialForce(NamedTuple):
    """Mass times acceleration at the samples, `force`, N; the `acceleration`, and by how much that
    is `unsure`, m/s²; all `(N,)`.

    By Lemma 1 its integral over a closed window with any function of velocity is zero. The sum over
    samples is not, where few of them lie in a bump: a mass that is taken for friction. So beside a
    bump it is taken off, by a mass that need not be exact (Kim, Kim & Ha 2004, for the integral).
    """

    force: Float[Array, " N"]
    acceleration: Float[Array, " N"]
    unsure: Float[Array, " N"]


def inertial_force(recording, limits: Scales, rows: Rows) -> InertialForce:
    """What is taken off the force of a prepared recording in the `rows` of closed windows."""
    force, velocity = recording.force, recording.velocity
    slope, rough = _slope_in_slip(recording, limits)
    wide = signals.mean_slope(recording, velocity, NEAR, limits.interval)
    mass = weighing.first_mass(force, velocity, slope, wide, rows)
    return InertialForce(mass * slope, slope, rough)


def _slope_in_slip(recording, limits: Scales) -> tuple[Float[Array, " N"], Float[Array, " N"]]:
    """The acceleration at the samples, m/s², by parabolas through three of one direction each, and
    what is unsure of it: what the last order changes.

    Where the direction changes friction jumps, and with it the acceleration. A controller may
    answer within few samples: beside the ends of the stretches it is by cubics where these differ.
    """
    velocity = recording.velocity
    way = jnp.sign(velocity)
    alike = (way[1:] * way[:-1] > 0) & signals.continuous(recording, limits.interval)
    slope = signals.mean_slope(recording, velocity, 1, limits.interval, alike)
    before, after = jnp.pad(alike, (1, 0)), jnp.pad(alike, (0, 1))
    # At the ends of a stretch the mean slope is that half a sample further inside.
    first = ~before & after & jnp.roll(after, -1)
    last = before & ~after & jnp.roll(before, 1)
    inside = jnp.where(first, jnp.roll(slope, -1), jnp.roll(slope, 1))
    rough = jnp.where(first | last, slope - inside, 0.0)
    more, known = _by_cubics(velocity, alike, first, last)
    more, bends = more / limits.interval, _surely(more * way, known, ~before, ~after)
    return slope + rough + jnp.where(bends, more, 0.0), jnp.where(bends, more, rough)


def _by_cubics(velocity, alike, first, last):
    """What cubics through four samples of one direction change of the parabolas' differences from
    sample to sample, m/s, `(N,)`; and where there are four.
    """
    known = alike[2:] & alike[1:-1] & alike[:-2]
    third = jnp.where(known, jnp.diff(velocity, n=3), 0.0)

    def from_(before: int):
        """Those that begin so many samples before each sample, and whether there are any."""
        sides = (before, 3 - before)
        return jnp.pad(third, sides), jnp.pad(known, sides)

    (earlier, one), (later, other) = from_(2), from_(1)
    both = jnp.maximum(one.astype(third.dtype) + other.astype(third.dtype), 1)
    (begun, starts), (ended, ends) = from_(0), from_(3)
    inner = -(earlier + later) / (6 * both)
    more = jnp.where(first, begun / 3, jnp.where(last, ended / 3, inner))
    return more, jnp.where(first, starts, jnp.where(last, ends, one | other))


# Samples from either end of a stretch that may be by cubics: of an answer that takes longer
# parabolas lose (1/8)²/6, a third of a per cent. Three standard errors of a mean over the
# stretches; of eight values the error is known to a quarter.
BESIDE, SURE, FEWEST = 8, 3.0, 8


def _surely(more, known, begins, ends):
    """Where `more` is no noise: samples so far from the ends of the stretches at which its mean
    over all stretches is surely not zero, `(N,)`. Chosen sample by sample it would be noise.
    """

    def beside(edge, inwards: int):
        def further(state, _):
            place, chosen = state
            here = place & known
            count = jnp.maximum(jnp.sum(here), 1).astype(more.dtype)
            mean = jnp.sum(jnp.where(here, more, 0.0)) / count
            error = jnp.sqrt(jnp.sum(jnp.where(here, more - mean, 0.0) ** 2)) / count
            sure = (jnp.abs(mean) > SURE * error) & (count >= FEWEST)
            return (jnp.roll(place, inwards) & ~edge, chosen | (here & sure)), None

        return jax.lax.scan(further, (edge, jnp.zeros_like(edge)), None, length=BESIDE)[0][1]

    return beside(begins, 1) | beside(ends, -1)


class Solved(NamedTuple):
    """Affine parameters of the whole term, deviations of all parameters, the rows of the weak form
    that they are compared on, and the bias that open ends would leave.
    """

    alpha: Float[Array, " q"]
    deviations: uncertainty.Deviations
    design: Design
    open_ends: Float[Array, " q"]


def solved(
    known,
    alpha,
    jacobian,
    error,
    term,
    recording,
    limits: Scales,
    rows: Rows,
    weak: Rows,
    inertial: InertialForce | None = None,
) -> Solved:
    """A fit of the term `known` with its uncertainty, and the mass where `term` has one beyond."""
    weight = rows.positive + rows.negative
    place = uncertainty.places(weight)
    rise = signals.mean_slope(recording, recording.force, 1, limits.interval)
    shift = _moved(jacobian, rise if rows.sampled else rows.rate(recording.force), weight)
    index = [i for i, p in enumerate(term.affine) if p.name == "inertia"]
    if not index or alpha.size == len(term.affine):
        left, columns = error, jacobian
        if weak is not rows:
            columns = weak.columns(known, recording)
            left = weak.target - weak.offset(known, recording) - columns @ alpha
        spread = uncertainty.deviations(jacobian, error, weight, place)
        design = _design(known, columns, left, weak, shift, recording)
        return Solved(alpha, spread, design, jnp.zeros_like(alpha))
    offset = known.offset(recording)
    weighed = weighing.weigh(alpha, jacobian, offset, place, recording, weak)
    # The mass times acceleration is no noise of the friction: Lemma 1 has removed its effect.
    if inertial is None:
        slope = signals.mean_slope(recording, recording.velocity, NEAR, limits.interval)
        noise = error - weighed.mass * slope
    else:
        slope = inertial.acceleration
        noise = error + inertial.force - weighed.mass * slope
    spread = uncertainty.deviations(jacobian, noise, weight, place)
    pull = weighing.open_ends(jacobian[:, : alpha.size], slope, rows.moving) * weighed.mass
    push, friction = weighed.columns[:, :1], weighed.columns[:, 1:]
    rise = weak.rate(recording.force) - friction @ shift
    heavier = _moved(push, rise, weak.positive + weak.negative)
    shift = jnp.insert(shift, index[0], heavier[0])
    spread = weighed.beside(spread, index[0])
    if inertial is not None:
        off = _moved(jacobian, weighed.mass * inertial.unsure, weight)
        spread = spread.beyond(jnp.insert(off, index[0], off @ weighed.through))
    return Solved(
        jnp.insert(alpha, index[0], weighed.mass),
        spread,
        _design(term, _inserted(weighed.columns, index[0]), weighed.left, weak, shift, recording),
        jnp.insert(pull, index[0], 0.0),
    )


def _moved(columns, rise, weight):
    """By how much parameters move for a second by which the force is late: u(t − τ) ≈ u − τ u̇."""
    root = reduced.root(weight)
    return reduced.least_squares(root[:, None] * columns, -root * rise)


def _inserted(columns: Float[Array, "J p"], index: int) -> Float[Array, "J p"]:
    """Columns of which the first belongs at that index."""
    others = columns[:, 1:]
    return jnp.concatenate([others[:, :index], columns[:, :1], others[:, index:]], axis=1)


def _design(term, columns, left, weak: Rows, shift, recording) -> Design:
    weight = weak.positive + weak.negative
    friction = columns[:, np.flatnonzero(_by_velocity(term))]
    forward = jnp.where((weak.positive > 0)[:, None], friction, 0.0)
    velocity = weak.project(recording.velocity[:, None])[:, 0]
    return Design(columns, weak.target, left, weight, weak.time, shift, forward, velocity)


def unseen(term, active, jacobian, weight) -> Bool[Array, " P"]:
    """Which parameters, affine ones first, act in no row: zero would be a friction, not a lack.

    A nonlinear one of a direction does not if no affine one of that direction does.
    """
    acts = jnp.any((weight > 0)[:, None] & (jacobian != 0), axis=0)
    own = {p.name: acts[i] for i, p in enumerate(active.affine)}
    idle = [~own[p.name] if p.name in own else jnp.zeros((), bool) for p in term.affine]
    for parameter in term.nonlinear:
        sign = parameter.name[-1]
        beside = [act for name, act in own.items() if name.endswith(sign)] if sign in "+-" else []
        idle.append(~jnp.any(jnp.stack(beside)) if beside else jnp.zeros((), bool))
    return jnp.stack(idle)


class Oddities(NamedTuple):
    """Whether the model explains the force, and whether its inertia and friction are positive."""

    described: Bool[Array, ""]
    passive: Bool[Array, ""]


def passive(term, alpha, matrix, design: Design, weak: Rows, recording) -> Bool[Array, ""]:
    """Whether neither the inertia nor the friction drives the axis, beyond their intervals.

    Of the friction half the difference of its means forward and backward counts: a constant load,
    which terms that know the direction take up, cancels. The slower and the faster half of the rows
    count each, since a line through both may be negative where nothing moved.
    """
    bound = uncertainty.student_quantile(0.975, uncertainty.COSINES)
    variance = jnp.diagonal(matrix)
    inertia = np.array([p.name == "inertia" for p in term.affine], bool)
    inertial = alpha + bound * jnp.sqrt(variance[: alpha.size]) >= 0
    passive = jnp.all(inertial | ~inertia)
    friction = _by_velocity(term)
    if not friction.any():
        return passive
    speed = jnp.abs(design.velocity)
    forward, backward = weak.positive > 0, weak.negative > 0
    middle = jnp.nanmedian(jnp.where(forward | backward, speed, jnp.nan))
    for half in (speed <= middle, speed > middle):
        ways = [side & half for side in (forward, backward)]
        both = jnp.stack(ways).astype(alpha.dtype)
        count = jnp.sum(both, axis=1)
        means = both @ design.columns[:, : alpha.size] / jnp.maximum(count, 1)[:, None]
        share = jnp.where(friction, 0.5 * (means[0] - means[1]), 0.0)
        own = jnp.where(jnp.isfinite(matrix), matrix, 0.0)[: alpha.size, : alpha.size]
        error = jnp.sqrt(jnp.maximum(share @ own @ share, 0.0))
        seen = jnp.all(jnp.isfinite(variance[: alpha.size]) | (share == 0)) & jnp.all(count > 0)
        passive = passive & (~seen | (share @ alpha + bound * error >= 0))
    return passive


def _by_velocity(term: AbstractTerm) -> np.ndarray:
    """Which affine parameters are those of functions of the velocity alone, `(p,)`."""
    leaves = summands(term)
    own = [leaf.coordinates == {"velocity"} and not leaf.inertial for leaf in leaves]
    return np.repeat(own, [len(leaf.affine) for leaf in leaves])


def outside(rival, beta, matrix) -> Bool[Array, ""]:
    """Whether a rival minimum lies beyond the 95 % interval of some parameter; not where NaN."""
    errors = jnp.sqrt(jnp.diagonal(matrix)[matrix.shape[0] - beta.size :])
    bound = uncertainty.student_quantile(0.975, uncertainty.COSINES)
    return jnp.any(jnp.abs(rival - beta) > bound * errors)


def still_falling(term, alpha, matrix) -> Bool[Array, ""]:
    """Whether friction falls up to the fastest speed, so that no bump was seen to its end.

    Viscous friction rises with speed; below zero beyond its interval, beside a Stribeck velocity of
    the same direction, it is a flank of a bump wider than the bounds. Inside them another shape
    then takes the place of that bump, and every parameter is of it.
    """
    bumps = {_sides(p.name) for p in term.nonlinear if p.name.startswith(STRIBECK_VELOCITY.name)}
    slopes = [
        checks.passive(p.name) == "viscous" and any(set(_sides(p.name)) & set(b) for b in bumps)
        for p in term.affine
    ]
    if not any(slopes):
        return jnp.zeros((), bool)
    bound = uncertainty.student_quantile(0.975, uncertainty.COSINES)
    most = alpha + bound * jnp.sqrt(jnp.diagonal(matrix)[: alpha.size])
    return jnp.any((most < 0) & np.array(slopes))


def _sides(name: str) -> str:
    """The directions of motion that a parameter is of, "+", "-" or both."""
    return name[-1] if name.endswith(("+", "-")) else "+-"


def verdict(finite, slipping, closed, hidden, border, converged, ambiguous, odd: Oddities):
    """The result of an identification: the gravest of what speaks against `successful`."""
    result = Result.where(converged, Result.successful, Result.not_converged)
    result = Result.where(ambiguous, Result.ambiguous, result)
    result = Result.where(border, Result.on_border, result)
    result = Result.where(odd.passive, result, Result.not_passive)
    result = Result.where(odd.described, result, Result.not_described)
    unseen = hidden & (~border | ~odd.described)
    result = Result.where(unseen, Result.not_excited, result)
    result = Result.where(closed, result, Result.open_windows)
    result = Result.where(slipping, result, Result.no_slip)
    return Result.where(finite, result, Result.not_finite)
