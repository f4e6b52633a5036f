"""One identification, compiled: the search, all parameters, their covariance, the verdict."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .. import checks, programs, signals
from ..checks import Design
from ..data.recording import Recording
from ..models import Model
from ..terms.base import AbstractTerm, Sum, bounds as term_bounds, summands
from ..terms.inertia import Inertia
from ..terms.sample import Scales
from . import assessment, moments
from .identified import LEAST_EXPLAINED, Identified
from .projections import Rows, WeakForm
from .search import Found, search
from .setup import all_finite, sanitised

# Samples at once that keep an accelerator busy: some hundred numbers for each are 3 GB.
SAMPLES = 2**22


def _solve_rows(term, recording, projection, width, given, grid) -> tuple[Identified, Design]:
    """What a [`Setup`][] of a batch describes, row by row."""

    def one(row):
        return solve_one(term, row, projection, width, given, grid)

    return jax.lax.map(one, recording, batch_size=_at_once(*recording.time.shape))


def _at_once(count: int, samples: int) -> int:
    """How many rows of so many samples go at once."""
    if jax.default_backend() != "cpu":
        return max(1, min(SAMPLES // samples, count))
    # Small batches: a refinement loop under vmap makes every row wait for the slowest.
    return min(8, count)


solve_rows = programs.compiled(_solve_rows)


class _Searched(NamedTuple):
    """What the nonlinear parameters were searched in, and what was found; the velocity's noise.

    `inertial`: what was taken off the force in closed windows.
    """

    limits: Scales
    noise: Float[Array, ""]
    rows: Rows
    found: Found
    inertial: "assessment.InertialForce | None"


@programs.compiled
def _search_rows(magnitudes, term, recording, projection, width, given, grid) -> _Searched:
    """The nonlinear parameters."""
    recording = sanitised(recording)
    limits, noise = _magnitudes(recording) if magnitudes is None else magnitudes
    rows = projection.rows(recording, limits)
    active, inertial = _active(term, projection, limits), None
    if active.nonlinear and not projection.keeps_inertia:
        inertial = assessment.inertial_force(recording, limits, rows)
        rows = eqx.tree_at(lambda r: r.target, rows, rows.target - inertial.force)
    box = term_bounds(
        active, limits._replace(fastest=_reached(rows, recording, limits)), dict(given)
    )
    # By default both directions have the bounds that the whole recording suggests.
    alike = not any(name.endswith(("+", "-")) for name, _ in given)
    found = search(active, recording, rows, box, grid, alike)
    return _Searched(limits, noise, rows, found, inertial)


@programs.compiled
def _assess(
    searched: _Searched, term, recording, projection, width, given, grid
) -> tuple[Identified, Design]:
    """All parameters and what is known about them, from the nonlinear ones."""
    finite = all_finite(recording)
    recording = sanitised(recording)
    rows = searched.rows
    weak = rows if projection.keeps_inertia else WeakForm(width).rows(recording, searched.limits)
    active = _active(term, projection, searched.limits)
    known = _known(searched, term, active, recording, weak, finite)
    best, error = searched.found, weak.relative(known.design.left)
    ambiguous = known.ambiguous
    found = Identified(
        model=known.model(term, recording),
        covariance=known.covariance,
        result=_verdict(searched, term, recording, weak, known, finite, error),
        windows=rows.windows,
        covered=rows.covered,
        filtered_force_error=error,
        cost=known.minimum,
        open_ends=known.open_ends,
        weak=jnp.asarray(projection.keeps_inertia),
        rival=jnp.where(ambiguous, known.rival, jnp.nan) if best.beta.size else None,
        warnings=jnp.full(len(checks.NAMES), jnp.nan, error.dtype),
        border=known.border if best.beta.size else None,
    )
    return found, known.design


class _Known(NamedTuple):
    """What the rows tell of all parameters.

    `alpha`, `beta` and their `covariance`; `unseen`, which of all act in no row, `(P,)`; `minimum`,
    the reduced cost, N²·s; `open_ends`, `design`: as in `assessment.Solved`; `rival`, `border`: as
    in `search.Found`; `ambiguous`: whether the rival is beyond the intervals.
    """

    alpha: Float[Array, " p"]
    beta: Float[Array, " d"]
    covariance: Float[Array, "P P"]
    unseen: Bool[Array, " P"]
    minimum: Float[Array, ""]
    open_ends: Float[Array, " p"]
    design: Design
    rival: Float[Array, " d"]
    border: Bool[Array, " d"]
    ambiguous: Bool[Array, ""]

    @property
    def hidden(self) -> Bool[Array, ""]:
        """Whether the recording does not show some parameter."""
        return jnp.any(jnp.isinf(jnp.diagonal(self.covariance)))

    def model(self, term: AbstractTerm, recording: Recording) -> Model:
        """The term with its parameters; NaN for what acts in no row."""
        values = jnp.concatenate([self.alpha, self.beta.astype(self.alpha.dtype)])
        values = jnp.where(self.unseen, jnp.nan, values)
        alpha, beta = jnp.split(values, [self.alpha.size])
        return Model(term.with_beta(beta.astype(self.beta.dtype)), alpha, recording.units)


def _known(searched: _Searched, term, active, recording, weak: Rows, finite) -> _Known:
    """The parameters of the whole `term`, of which `active` was searched, and their covariance."""
    limits, _, rows, best, inertial = searched
    weight = rows.positive + rows.negative
    fitted, jacobian, error = assessment.solve(active, best.beta, recording, rows, best.alpha)
    minimum = jnp.sum(weight * (error if inertial is None else error + inertial.force) ** 2)
    solved = assessment.solved(
        active.with_beta(best.beta), fitted, jacobian, error, term, recording, limits, rows, weak,
        inertial,
    )  # fmt: skip
    beta, matrix = moments.dated(
        active, fitted, best.beta, recording, rows, limits.interval, error,
        solved.deviations.covariance,
    )  # fmt: skip
    nothing = ~finite | (jnp.sum(weight) <= 0)
    alpha = jnp.where(nothing, jnp.nan, solved.alpha)
    matrix = jnp.where(nothing, jnp.inf, matrix)
    unseen = assessment.unseen(term, active, jacobian, weight) & jnp.isinf(jnp.diagonal(matrix))
    rival = jnp.full_like(beta, jnp.nan) if best.rival is None else best.rival
    return _Known(
        alpha,
        beta,
        matrix,
        unseen,
        minimum,
        solved.open_ends,
        solved.design,
        rival,
        best.border & ~unseen[alpha.size :],  # what acts in no row is anywhere in its bounds
        assessment.outside(rival, beta, matrix),
    )


def _verdict(searched: _Searched, term, recording, weak: Rows, known: _Known, finite, error):
    """What the result is, of an `error` of the rows of the weak form."""
    limits, noise, rows, best, _ = searched
    alpha, matrix = known.alpha, known.covariance
    return assessment.verdict(
        finite=finite,
        slipping=limits.fastest > signals.SLIP_DEVIATIONS * noise,
        closed=jnp.sum(rows.positive + rows.negative) > 0,
        hidden=known.hidden,
        border=jnp.any(known.border),
        converged=best.converged,
        ambiguous=known.ambiguous | assessment.still_falling(term, alpha, matrix),
        odd=assessment.Oddities(
            described=~(error**2 > 1 - LEAST_EXPLAINED),
            passive=assessment.passive(term, alpha, matrix, known.design, weak, recording),
        ),
    )


def solve_one(*setup) -> tuple[Identified, Design]:
    """What a [`Setup`][] of one recording describes, in two programs.

    What is found once in a recording is found on the host, where it needs no compiling.
    """
    recording = setup[1]
    magnitudes = None
    if not any(isinstance(x, jax.core.Tracer) for x in jax.tree.leaves(setup)):
        magnitudes = signals.host_scales(sanitised(jax.tree.map(np.asarray, recording), np))
    return _assess(_search_rows(magnitudes, *setup), *setup)


def _magnitudes(recording: Recording) -> tuple[Scales, Float[Array, ""]]:
    limits = signals.scales(recording)
    return limits, signals.velocity_noise(recording, limits.interval)


def _reached(rows: Rows, recording: Recording, limits: Scales) -> Float[Array, ""]:
    """The speed that both directions reach in the rows, m/s: no faster bump could be seen."""
    velocity = recording.velocity
    used = jnp.stack([rows.positive > 0, rows.negative > 0])
    if rows.target.shape != velocity.shape:
        used = jnp.stack([velocity > 0, velocity < 0])
    top = jnp.max(jnp.where(used, jnp.abs(velocity)[None, :], 0.0), axis=1)
    both = jnp.min(jnp.where(top > limits.slowest, top, jnp.inf))
    return jnp.maximum(jnp.minimum(limits.fastest, both), 4 * limits.slowest)


def _active(term: AbstractTerm, projection, limits: Scales) -> AbstractTerm:
    """The terms that are fitted, with moments that have a derivative."""
    own = term if projection.keeps_inertia else without_inertia(term)
    return own.resolved(moments.RAMP * limits.interval)


def without_inertia(term: AbstractTerm) -> AbstractTerm:
    """The terms that closed windows leave: all but inertia.

    Raises:
        ValueError: There is no other.
    """
    kept = tuple(t for t in summands(term) if not isinstance(t, Inertia))
    if not kept:
        raise ValueError("The model has no term but inertia; add friction, e.g. terms.Coulomb().")
    return Sum(kept)
