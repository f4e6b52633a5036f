"""The next experiment: the motion that tells most, found by gradient descent before it is made.

What a motion tells of a model's parameters is known in advance: their covariance is
σ² (Σ J Jᵀ)⁻¹, J the derivative of the force by them along it. What it tells of rival effects:
[`separate`][jaxfric.identification.separation.separate].
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..models import Model
from ..terms.base import AbstractTerm
from ..units import spell
from .motion import Limits, Motion, from_rest, multisine, search, sine

STEPS = 150
# White noise of the force beside the root mean square of its own, where none is given.
NOISE = 0.02


class Gain(NamedTuple):
    """A parameter's predicted standard error along the plain sine and along the design."""

    before: float
    after: float
    unit: str


class Design(NamedTuple):
    """The proposed motion; `gains` by parameter, with white noise of the force of `noise`, N; and
    of rivals how far it takes them `apart` ([`Apart`][jaxfric.identification.separation.Apart]):
    with this noise `enough`, N, decides. `left_out`: rivals that no motion of the axis shows.
    """

    motion: Motion
    noise: float
    gains: dict[str, Gain]
    apart: tuple[Any, ...] = ()
    enough: float = 0.0
    left_out: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The prediction as plain data."""
        apart = [each._asdict() | {"told": each.after > self.enough} for each in self.apart]
        return {
            "noise": self.noise,
            "standard_errors": {name: gain._asdict() for name, gain in self.gains.items()},
            "apart": apart,
            "enough": self.enough if apart else None,
            "left_out": list(self.left_out),
        }


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
    model = checked(model, limits)
    values = jnp.asarray([float(v) for v in model.parameters.values()])
    # What is zero has no relative error: its size is that of the force.
    scale = jnp.where(jnp.abs(values) > 0, jnp.abs(values), 1.0)
    first = multisine(sine(limits), limits)
    noise = noise_of(model, first) if noise is None else float(noise)

    def cost(coefficients):
        found = errors(model, multisine(coefficients, limits), noise) / scale
        return jnp.log(jnp.sum(found**2))

    motion = multisine(from_rest(search(cost, limits, steps)), limits)
    return Design(motion, noise, gains(model, (first, motion), noise))


def checked(model: Model, limits: Limits) -> Model:
    """The model, where it and the limits have values that a motion can be designed for."""
    sizes = limits._asdict()
    centre = sizes.pop("centre")
    wrong = [n for n, v in sizes.items() if not 0 < v < np.inf]
    wrong += ["centre"] * (not np.isfinite(centre))
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


def noise_of(model: Model, motion: Motion) -> float:
    """White noise of the force that is assumed along a motion, N."""
    force = columns(model.term, motion) @ model.alpha
    return float(NOISE * jnp.sqrt(jnp.mean(force**2)))


def gains(model: Model, motions: Sequence[Motion], noise: float) -> dict[str, Gain]:
    """Predicted standard errors of a model's parameters along two motions."""
    before, after = (np.asarray(errors(model, motion, noise)) for motion in motions)
    units = dict(model.units)
    parameters = (*model.term.affine, *model.term.nonlinear)
    return {
        p.name: Gain(float(a), float(b), spell(p.dimension, units))
        for p, a, b in zip(parameters, before, after, strict=True)
    }
