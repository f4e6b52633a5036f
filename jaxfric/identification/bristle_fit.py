"""The fit of bristles: what they leave of the force, scanned over stiffness, then refined.

The derivatives stand on the kernel of the weak form, over reversals too: none is taken on the data.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Bool, Float

from .. import signals
from ..data.recording import Recording
from ..models import Model
from ..terms import bristles

# The kernel is as short as its second differences allow: reversals are over in a few samples.
HALF_WIDTH = 8
ITERATIONS = 60
# Parts of the top speed at which a Stribeck curve may bend; the refinement reaches between them.
BUMPS = (0.01, 0.05, 0.2)


class Rows(NamedTuple):
    """What does not depend on the bristles: the recording, the kernel and its places."""

    recording: Recording
    kernel: Float[Array, " K"]
    centre: Float[Array, " J"]


def rows_of(log: Recording) -> Rows:
    """The kernel (1 − τ²)⁴ with both derivatives by differences, and where it is whole."""
    place = np.arange(-HALF_WIDTH, HALF_WIDTH + 1) / (HALF_WIDTH + 1)
    kernel = (1 - place**2) ** 4
    linked = signals.host_continuous(log, signals.host_interval(log))
    sound = np.asarray(log.mask) & np.isfinite(np.asarray(log.position) + np.asarray(log.force))
    broken = np.concatenate([[0], np.cumsum(~(linked & sound[1:] & sound[:-1]))])
    reach = HALF_WIDTH + 1
    count = broken.size
    centre = np.arange(reach, count - reach, HALF_WIDTH // 2)
    whole = broken[centre + reach] == broken[centre - reach]
    return Rows(log, jnp.asarray(kernel / kernel.sum()), jnp.asarray(centre[whole]))


def through(rows: Rows, signal: Float[Array, " N"], order: int = 0) -> Float[Array, " J"]:
    """A signal through the kernel, or through a difference of the kernel of that order."""
    kernel, step = rows.kernel, signals.interval(rows.recording)
    if order == 1:
        kernel = -0.5 * jnp.convolve(kernel, jnp.array([1.0, 0.0, -1.0])) / step
    if order == 2:
        kernel = jnp.convolve(kernel, jnp.array([1.0, -2.0, 1.0])) / step**2
    reach = kernel.size // 2
    index = rows.centre[:, None] + jnp.arange(-reach, reach + 1)[None]
    return signal[index] @ kernel


def left_by(
    model: Model, static: Float[Array, " P"], dynamic: Float[Array, " 2"], rows: Rows
) -> tuple[Float[Array, " J"], Float[Array, " J"], Float[Array, " J"]]:
    """Force left by the bristles with σ₀ = exp(dynamic₀), σ₁; the column of σ₁; distance from slip.

    `static`: the affine and the nonlinear parameters of the model.
    """
    count, log = model.alpha.size, rows.recording
    alpha, term = static[:count], model.term.with_beta(static[count:])
    stiffness = jnp.exp(dynamic[0])
    own = bristles.dry(term, alpha, log.velocity)
    # F = σ₀ z − dry is what `force` gives without damping, from which z is read off again.
    bent = bristles.force(term, alpha, stiffness, jnp.zeros(()), log)
    z = (bent + own) / stiffness
    inertia = dict(zip([p.name for p in term.affine], alpha, strict=True))["inertia"]
    rest = term.columns(log) @ alpha + term.offset(log)
    pushed = through(rows, log.force - rest - bent)
    turning = through(rows, z, 1)
    left = pushed - inertia * through(rows, log.position, 2) - dynamic[1] * turning
    away = through(rows, jnp.abs(bent) / jnp.maximum(jnp.max(jnp.abs(own)), 1e-300))
    return left, turning, away


@eqx.filter_jit
def scan(model, static, rows, grid):
    """Over a grid of log σ₀ the cost with the best σ₁ ≥ 0, that σ₁, the cost without, `(G,)`."""

    def one(place):
        left, turning, _ = left_by(model, static, jnp.stack([place, jnp.zeros(())]), rows)
        power = jnp.sum(turning**2)
        damping = jnp.maximum(jnp.sum(left * turning) / jnp.where(power > 0, power, 1.0), 0.0)
        return jnp.sum((left - damping * turning) ** 2), damping, jnp.sum(left**2)

    return jax.lax.map(one, grid)


def starts(model: Model, static: Float[Array, " P"], limits) -> list[Float[Array, " P"]]:
    """The static parameters, and others with a bump of friction at several speeds.

    Presliding takes from slow slip what the bump adds, so that the identification of slip alone
    may find one of the wrong sign or width.
    """
    names = [p.name for p in (*model.term.affine, *model.term.nonlinear)]
    bumps = [i for i, n in enumerate(names) if n.startswith("stribeck_force")]
    widths = [i for i, n in enumerate(names) if n.startswith("stribeck_velocity")]
    if not bumps or not widths:
        return [static]
    levels = [abs(float(v)) for n, v in zip(names, static, strict=True) if n.startswith("coulomb")]
    others = []
    for share in BUMPS:
        speed = float(limits.fastest) * share
        bumped = static.at[np.array(bumps)].set(0.3 * max(levels, default=1.0))
        others.append(bumped.at[np.array(widths)].set(speed))
    return [static, *others]


@eqx.filter_jit
def refined(model: Model, first: Float[Array, " Q"], rows: Rows, free: Bool[Array, " 2"]):
    """All parameters by Levenberg and Marquardt, and the cost; log σ₀, σ₁, then the static ones.

    `free`: whether stiffness and damping are searched too, or stay.
    """
    scale = _scale(model, first)
    held = jnp.concatenate([~free, jnp.zeros(first.size - 2, bool)])
    begin = _bound(model, first) / scale

    def values(at):
        return _free(model, jnp.where(held, begin, at) * scale)

    def left(at, _):
        there = values(at)
        out = left_by(model, there[2:], there[:2], rows)[0]
        return jnp.where(jnp.isfinite(out), out, 1e6)

    solver: Any = optx.LevenbergMarquardt(rtol=1e-6, atol=1e-6)
    found: Any = optx.least_squares(left, solver, begin, max_steps=ITERATIONS, throw=False)
    return values(found.value), jnp.sum(left(found.value, None) ** 2)


def _positive(model: Model) -> np.ndarray:
    """Which parameters are searched by their logarithm: the nonlinear ones that are ratios."""
    ratios = [p.logarithmic for p in model.term.nonlinear]
    return np.array([False, False, *[False] * model.alpha.size, *ratios])


def _bound(model: Model, values: Float[Array, " Q"]) -> Float[Array, " Q"]:
    ratio = _positive(model)
    return jnp.where(ratio, jnp.log(jnp.where(ratio, jnp.abs(values), 1.0)), values)


def _free(model: Model, searched: Float[Array, " Q"]) -> Float[Array, " Q"]:
    ratio = _positive(model)
    return jnp.where(ratio, jnp.exp(jnp.where(ratio, searched, 0.0)), searched)


def _scale(model: Model, first: Float[Array, " Q"]) -> Float[Array, " Q"]:
    """Sizes of the parameters that are searched; of the damping what half a sample of z has."""
    size = jnp.where(_positive(model), 1.0, jnp.maximum(jnp.abs(first), 1e-3 * jnp.max(first[2:])))
    return size.at[0].set(1.0).at[1].set(1e-3 * jnp.exp(first[0]))


@eqx.filter_jit
def linear(model, values, rows):
    """What is left, its derivatives by all parameters, and the distance from steady slip."""
    left, _, away = left_by(model, values[2:], values[:2], rows)
    slope = jax.jacfwd(lambda v: left_by(model, v[2:], v[:2], rows)[0])(values)
    return left, slope, away
