"""The mass, weighed after a fit that left it out: what the friction leaves of the weak form."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..data.recording import Recording
from . import reduced, small, uncertainty
from .projections import Rows
from .uncertainty import Deviations


class Weighed(NamedTuple):
    """The mass and what its uncertainty consists of.

    - `mass`: kg.
    - `own`: its deviations for friction parameters that are exactly known, `(K, 1)`.
    - `through`: its derivative by the friction parameters, `(p,)`.
    - `left`: what mass and friction leave of the weak form's rows, N, `(J,)`.
    - `columns`: derivatives of these rows by the mass and by the friction's parameters, `(J, 1+p)`.
    """

    mass: Float[Array, ""]
    own: Deviations
    through: Float[Array, " p"]
    left: Float[Array, " J"]
    columns: Float[Array, "J q"]

    def beside(self, friction: Deviations, index: int) -> Deviations:
        """The deviations of friction parameters and mass together, the mass at that index.

        Both follow the same cosines of slip time, so that what the friction's error does to the
        mass adds to the mass's own error with its sign.
        """
        votes = self.own.votes[:, 0] + friction.votes @ self.through
        together = jnp.insert(friction.votes, index, votes, axis=1)
        return Deviations(together, jnp.insert(friction.hidden, index, self.own.hidden[0]))


def weigh(
    alpha: Float[Array, " q"],
    jacobian: Float[Array, "N p"],
    offset: Float[Array, " N"],
    place: Float[Array, " N"],
    recording: Recording,
    weak: Rows,
) -> Weighed:
    """The mass that best explains what the friction leaves of the weak form's force.

    **Arguments:** `alpha`, the friction's affine parameters; `jacobian`, derivative of the friction
    at the samples by all its parameters, affine ones first; `offset`, its known part, N; `place`,
    where each sample stands in the slip time; `weak`, rows of the weak form.
    """
    rows, known = weak.project(jacobian), weak.project(jnp.stack([offset, place], axis=1))
    push = weak.rate(recording.velocity)[:, None]
    left = weak.target - known[:, 0] - rows[:, : alpha.size] @ alpha
    weight = weak.positive + weak.negative
    root = reduced.root(weight)
    mass = reduced.least_squares(root[:, None] * push, root * left)
    left = left - push @ mass
    # What the friction's error leaves is no noise of the rows: it comes in through the friction.
    columns = jnp.concatenate([push, rows], axis=1)
    basis = reduced.orthonormal(root[:, None] * columns)
    noise = reduced.project_out(basis, (root * left)[:, None])[:, 0]
    noise = jnp.where(root > 0, noise / jnp.where(root > 0, root, 1.0), 0.0)
    own = uncertainty.deviations(push, noise, weight, known[:, 1])
    weighted = weight * push[:, 0]
    size = jnp.vdot(weighted, push[:, 0])
    through = -(weighted @ rows) / jnp.where(size > 0, size, 1.0)
    return Weighed(mass[0], own, through, left, columns)


def first_mass(
    force: Float[Array, " N"],
    velocity: Float[Array, " N"],
    slope: Float[Array, " N"],
    wide: Float[Array, " N"],
    rows: Rows,
) -> Float[Array, ""]:
    """The mass beside dry and viscous friction of each direction, before any fit, kg.

    `slope`, the acceleration, m/s²; `wide`, its mean over other samples, which share no white noise
    of the velocity with it, as its instrument: noise would make the mass of least squares small.
    """
    roots = [reduced.root(weight) for weight in (rows.positive, rows.negative)]
    friction = jnp.stack([x for root in roots for x in (root, root * velocity)], axis=1)
    root = jnp.stack(roots).sum(axis=0)
    others = root[:, None] * jnp.stack([force, slope], axis=1)
    left = reduced.project_out(reduced.orthonormal(friction), others)
    gained, size = (root * wide) @ left
    return gained / jnp.where(size > 0, size, jnp.inf)


def open_ends(
    columns: Float[Array, "N q"], slope: Float[Array, " N"], weight: Float[Array, " N"]
) -> Float[Array, " q"]:
    """D⁻¹ ∫ v̇ g dt over all slip: what Lemma 1 makes zero where the end velocities are equal.

    Zero for a parameter whose column the ones before it span.
    """

    def products(columns, slope, weight):
        table = jnp.concatenate([columns, slope[:, None]], axis=1)
        return columns.T @ (weight[:, None] * table)

    values, piece = (columns, slope, weight), min(reduced.PIECE, len(slope))
    table = jnp.sum(reduced.by_pieces(products, values, piece), axis=0)
    white = small.whiten(table[:, :-1], float(jnp.finfo(columns.dtype).eps) ** 0.5)
    return white @ (white.T @ table[:, -1])
