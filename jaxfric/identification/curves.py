"""What the picture of an identification is drawn from: its friction curve, and the force."""

import dataclasses
from pathlib import PurePath
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .. import signals
from ..data.recording import Recording
from ..looks.drawing import Side
from ..models import Model, weighed
from ..units import FORCE, VELOCITY
from .projections import WeakForm
from .uncertainty import student_quantile

# Bins a direction: enough to show a bump, few enough that each holds several rows.
BINS = 30
# A mean of fewer rows than this says nothing about their scatter.
FEWEST = 3
# Points of a curve.
POINTS = 400
# Speeds that one call takes: so that one program serves all.
PADDED = 512
# A Stribeck bump is gone at five of its velocities: exp(−25), and 4 % of a Lorentzian.
BUMP = 5.0
# The slowest speed drawn, as a share of the fastest, where no recording says what is resolved.
SLOWEST = 1e-3


class Force(NamedTuple):
    """Rows of the weak form, each of shape `(J,)`: what the force error is counted on.

    Acceleration is on the kernel, so that nothing here is a noisy derivative. `width`: the
    kernel's half-width in samples.
    """

    time: np.ndarray
    measured: np.ndarray
    predicted: np.ndarray
    friction: np.ndarray
    velocity: np.ndarray
    segment: np.ndarray
    slip: np.ndarray
    moving: np.ndarray
    width: int


def prepared(recording: Recording) -> Recording:
    """A recording with its velocity; see [`jaxfric.signals.prepare`][]."""
    return signals.prepare(recording)


def name(source: str) -> str:
    """What to call an axis: its file without the folder."""
    return PurePath(source).name


def rows(found: Any, recording: Recording) -> Force:
    """The rows of a prepared recording beside what an `Identified` says of them."""
    width = signals.kernel_half_width(recording)
    columns = _rows(found.model, recording, width)
    return Force(**{name: np.asarray(x) for name, x in columns.items()}, width=width)


@eqx.filter_jit
def _rows(model, recording: Recording, width: int) -> dict[str, Any]:
    rows = WeakForm(width).rows(recording, signals.scales(recording))
    predicted = weighed(rows.columns(model.term, recording), model.alpha)
    velocity = recording.velocity
    others = (model.friction(velocity), velocity, recording.segment, recording.mask)
    columns = jnp.stack([x.astype(velocity.dtype) for x in others], 1)
    friction, velocity, segment, valid = rows.project(columns).T
    slip = rows.positive + rows.negative > 0
    predicted = predicted + rows.offset(model.term, recording)
    # A kernel over two segments, or over samples left out, belongs to none.
    one = (jnp.abs(segment - jnp.round(segment)) < 1e-6) & (valid > 1 - 1e-6)
    segment = jnp.where(one, jnp.round(segment), -1.0)
    return {
        "time": rows.time,
        "measured": rows.target,
        "predicted": predicted,
        "friction": friction,
        "velocity": velocity,
        "segment": segment,
        "slip": slip,
        "moving": rows.moving > 0,
    }


def measured(found: Any, recording: Recording, rows: Force) -> list[Side]:
    """The friction curve over the speeds of a prepared recording, beside what was measured."""
    force = (rows.measured - rows.predicted + rows.friction)[rows.slip]
    speed = rows.velocity[rows.slip]
    slowest = float(signals.scales(recording).slowest)
    drawn = []
    for sign in (1, -1):
        side = sign * speed > 0
        if side.any():
            fastest = np.max(np.abs(speed[side]))
            curve = _side(found, sign, np.geomspace(slowest, fastest, POINTS))
            at, mean, spread = _bins(speed[side], force[side])
            drawn.append(curve._replace(at=at, mean=mean, spread=spread))
    return drawn


def sides(found: Any) -> list[Side]:
    """The friction curve over the speeds that the parameters themselves suggest."""
    fastest = fastest_speed(found.model)
    speed = np.geomspace(SLOWEST * fastest, fastest, POINTS)
    return [_side(found, sign, speed) for sign in (1, -1)]


def fastest_speed(model: Any) -> float:
    """Where friction that grows with speed has reached Coulomb friction, or the bump is over.

    That is, five Stribeck velocities; the higher of both, and 1 where nothing bends.
    """
    term, values = model.term, {n: abs(float(v)) for n, v in model.parameters.items()}
    values = {n: value for n, value in values.items() if np.isfinite(value)}
    speeds = [BUMP * values[p.name] for p in term.nonlinear if p.dimension == VELOCITY]
    constant = [values[p.name] for p in term.affine if p.dimension == FORCE and p.name in values]
    for p in term.affine:
        if isinstance(p.dimension, str):
            continue
        force, position, time = p.dimension
        grows = force == 1 and position == -time and time > 0
        if grows and constant and values.get(p.name, 0) > 0:
            speeds.append((max(constant) / values[p.name]) ** (1 / time))
    return max(filter(None, speeds), default=1.0)


def _side(found: Any, sign: int, speed: np.ndarray) -> Side:
    velocity = sign * speed
    return Side(sign, velocity, *band(found, velocity))


def _bins(speed, force):
    """Mean force and its standard deviation in bins of speed, finer where it is slow.

    Edges are even in the square root of speed: friction changes most beside zero.
    """
    root = np.sqrt(np.abs(speed))
    edges = np.linspace(root.min(), root.max(), BINS + 1)[1:-1]
    place = np.digitize(root, edges)
    groups = [place == k for k in range(BINS)]
    groups = [group for group in groups if np.count_nonzero(group) >= FEWEST]
    mean = np.array([force[group].mean() for group in groups])
    spread = np.array([force[group].std() for group in groups])
    return np.array([speed[group].mean() for group in groups]), mean, spread


def band(found: Any, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The friction curve and its pointwise 95 % band by the delta method, low and high, N, `(K,)`.

    Parameters that are not visible have no part in the band.
    """
    force, slopes = tangent(found.model, velocity)
    matrix = np.asarray(found.covariance)
    known = np.concatenate([np.asarray(found.model.alpha), np.asarray(found.model.term.beta())])
    seen = np.isfinite(np.diagonal(matrix)) & np.isfinite(known)
    covariance = np.where(seen[:, None] & seen[None, :], matrix, 0.0)
    freedom = next(iter(found.parameters.values())).degrees_of_freedom
    half = student_quantile(0.975, freedom) * np.sqrt(
        np.maximum(np.einsum("ij,jk,ik->i", slopes, covariance, slopes), 0.0)
    )
    return force, force - half, force + half


def tangent(model: Model, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The slip friction, N, `(K,)`, and its derivatives by all parameters, `(K, P)`."""
    model = dataclasses.replace(model, units=())  # for which nothing is to be compiled anew
    blocks = np.pad(velocity, (0, -velocity.size % PADDED), mode="edge").reshape(-1, PADDED)
    parts = zip(*(_tangent(model, block) for block in blocks), strict=True)
    force, slopes = (np.concatenate(part)[: velocity.size] for part in parts)
    return force, slopes


@eqx.filter_jit
def _tangent(model: Model, velocity: Float[np.ndarray, " K"]) -> tuple[Array, Array]:
    count = model.alpha.shape[-1]

    def friction(values):
        term = model.term.with_beta(values[count:])
        return dataclasses.replace(model, term=term, alpha=values[:count]).friction(velocity)

    values = jnp.concatenate([jnp.asarray(model.alpha), model.term.beta()])
    return friction(values), jax.jacfwd(friction)(values)
