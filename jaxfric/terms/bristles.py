"""LuGre friction for a whole model: bristles in place of the jump that slip friction has at rest.

Canudas de Wit, Olsson, Åström & Lischinsky (1995), eqs. 1 to 3: F = σ₀ z + σ₁ dz/dt + f(v) with
dz/dt = v − σ₀ abs(v) z / g(v). Here g is the friction of the model that does not vanish at rest
(Coulomb, Stribeck), of each direction its own, and f the rest (viscous): in steady slip the force
is the model's slip friction. With σ₁ = 0 and a constant g it is the model of Dahl (1968).
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..data.recording import Recording
from .base import AbstractTerm, summands
from .presliding import starts, travel


def dry(
    term: AbstractTerm, alpha: Float[Array, " p"], velocity: Float[Array, " N"]
) -> Float[Array, " N"]:
    """The slip friction that does not vanish at rest and turns its sign there, N, `(N,)`."""
    least = jnp.sqrt(jnp.finfo(velocity.dtype).tiny).astype(velocity.dtype)
    ends = _motion(jnp.stack([least, -least]))
    total, begin = jnp.zeros_like(velocity), 0
    for part in summands(term):
        count = len(part.affine)
        own, begin = jnp.nan_to_num(alpha[begin : begin + count]), begin + count
        if not part.coordinates or not part.coordinates <= {"velocity"}:
            continue
        forward, backward = part.columns(ends)
        # A hundredth of a column's size at rest, far more than what viscous friction has there.
        jumps = (jnp.abs(forward - backward) > 1e-2) & (forward * backward <= 0)
        total = total + part.columns(_motion(velocity)) @ jnp.where(jumps, own, 0.0)
    return total


def _motion(velocity: Float[Array, " N"]) -> Recording:
    still = jnp.zeros_like(velocity)
    return Recording(still, still, still, velocity)


def rate(
    velocity: Float[Array, " N"],
    level: Float[Array, " N"],
    deflection: Float[Array, " N"],
    stiffness: Float[Array, ""],
) -> Float[Array, " N"]:
    """dz/dt = v − σ₀ abs(v) z / g, m/s, `(N,)`; where there is no friction z stays."""
    safe = jnp.where(level > 0, level, 1.0)
    turned = velocity - stiffness * jnp.abs(velocity) * deflection / safe
    return jnp.where(level > 0, turned, 0.0)


def force(
    term: AbstractTerm,
    alpha: Float[Array, " p"],
    stiffness: Float[Array, ""],
    damping: Float[Array, ""],
    recording: Recording,
) -> Float[Array, " N"]:
    """What bristles change of the force along a recording: σ₀ z + σ₁ dz/dt − g sign(v), N, `(N,)`.

    Exact for pieces of the motion that are straight and as slow as their end. A segment starts with
    the deflection of steady slip.
    """
    moved, begins, velocity = travel(recording), starts(recording), recording.velocity
    way = jnp.where(begins, jnp.sign(velocity), jnp.sign(moved))
    least = jnp.sqrt(jnp.finfo(velocity.dtype).tiny).astype(velocity.dtype)
    # Beside a reversal the position may turn a sample before the smoothed velocity does. What does
    # not move has no direction, and keeps its deflection in either.
    side = jnp.where(way == 0, jnp.ones_like(way), way)
    level = dry(term, alpha, side * jnp.maximum(jnp.abs(velocity), least))
    size = jnp.where(level == 0, 1.0, jnp.abs(level))
    keep = jnp.where(begins, 0.0, jnp.exp(-jnp.abs(moved) * stiffness / size))

    def relax(deflection, step):
        share, goal = step
        deflection = share * deflection + (1 - share) * goal
        return deflection, deflection

    goal = jnp.where(way == 0, 0.0, level / stiffness)
    z = jax.lax.scan(relax, jnp.zeros_like(goal[0]), (keep, goal), unroll=8)[1]
    own = dry(term, alpha, velocity)
    turning = rate(velocity, jnp.abs(level), z, stiffness)
    return stiffness * z + damping * turning - own
