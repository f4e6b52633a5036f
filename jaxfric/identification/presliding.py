"""Stiffness and damping of the bristles of LuGre, on the presliding part of a recording.

The static parameters begin with those of the identification, problem (L). With them the deflection
z along the recorded position is known for each stiffness σ₀, and u = M a + f + σ₀ z + σ₁ dz/dt is
linear in σ₁ (Canudas de Wit, Olsson, Åström & Lischinsky 1995; `terms.bristles`). From the best σ₀
all parameters are refined together, since presliding bends the slip curve that (L) sees. The
derivatives stand on the kernel of the weak form, over reversals too: none is taken on the data.
"""

import dataclasses
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from .. import signals
from ..data.recording import Recording, require
from ..models import Model
from ..terms import bristles
from ..units import DAMPING, STIFFNESS, spell
from .uncertainty import Estimate, deviations, places

# The kernel is as short as its second differences allow: reversals are over in a few samples.
HALF_WIDTH = 8
# Eight places a decade of stiffness, between which the cost is smooth.
PER_DECADE = 8
# Nearer to steady slip than a hundredth of the friction a row tells of the slip curve, not of z.
STEADY = 0.01
FEWEST = 96
ITERATIONS = 60
# Parts of the top speed at which a Stribeck curve may bend; the refinement reaches between them.
BUMPS = (0.01, 0.05, 0.2)
# A stiffness is seen if it is told to within a factor of three, its 95 % interval each way.
TOLD = np.log(3.0) / 2


class Presliding(NamedTuple):
    """The bristles: `stiffness` σ₀, N/m, `damping` σ₁, N·s/m, each an estimate or `None`; `why`.

    `distance`: friction at rest over σ₀, m, the scale of presliding. `seconds`: of presliding.
    `model`: with them and the static parameters refined beside them, for `predict` and `simulate`;
    `standard_errors` of the static parameters by name.
    """

    stiffness: Estimate | None
    damping: Estimate | None
    distance: float
    seconds: float
    why: str = ""
    model: Model | None = None
    standard_errors: dict[str, float] = {}

    def to_dict(self) -> dict[str, Any]:
        """The bristles as plain data, in the units of the recording."""
        values = {"stiffness": self.stiffness, "damping": self.damping}
        told = {
            name: None
            if each is None
            else {
                "value": float(each.value),
                "standard_error": float(each.standard_error),
                "unit": each.unit,
            }
            for name, each in values.items()
        }
        return told | {"distance": self.distance, "seconds": self.seconds, "why": self.why}

    def __repr__(self) -> str:
        if self.stiffness is None:
            return f"No bristles identified: {self.why}."
        known = {"stiffness": self.stiffness, "damping": self.damping}
        said = [
            f"{name} {float(e.value):.4g} {e.unit} ± {float(e.interval()[1] - e.value):.2g} (95 %)"
            for name, e in known.items()
            if e is not None
        ]
        return "\n".join(
            [f"bristles over {self.seconds:.3g} s of presliding", *said, self.why]
        ).strip()


class _Rows(NamedTuple):
    """What does not depend on the bristles: the recording, the kernel and its places."""

    recording: Recording
    kernel: Float[Array, " K"]
    centre: Float[Array, " J"]


def presliding(recording: Recording, found: Any) -> Presliding:
    """Stiffness and damping of bristles that take the place of the jump of friction at rest.

    The uncertainty of the static parameters is in the intervals.

    **Arguments:** `recording` with a position, signals of shape `(N,)`; `found`, an `Identified`
    with an inertia and a friction that does not vanish at rest.

    **Raises:** `ValueError` for a batch, inside `jax.jit`, or without a position or an inertia.
    """
    require(recording, "presliding")
    if signals.is_traced(recording):
        raise ValueError("presliding reads values: call it outside of jax.jit.")
    if recording.position is None:
        raise ValueError("presliding is micrometres of motion: it needs a recorded position.")
    lacking = [n for n, v in found.model.parameters.items() if not np.isfinite(float(v))]
    if lacking or "inertia" not in found.model.parameters:
        raise ValueError(
            f"presliding needs every static parameter; {', '.join(lacking) or 'inertia'} is not "
            "known. Move in both directions, and identify a model with Inertia()."
        )
    log = signals.prepare(recording)
    rows = _rows(log)
    ends = jnp.asarray([-1e-9, 1e-9]) * signals.scales(log).fastest
    level = float(jnp.mean(jnp.abs(bristles.dry(found.model.term, found.model.alpha, ends))))
    if not level > 0 or rows.centre.size < FEWEST:
        return Presliding(None, None, np.nan, 0.0, "the model has no friction at rest, or no row")
    return _fitted(found, rows, level)


def _rows(log: Recording) -> _Rows:
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
    return _Rows(log, jnp.asarray(kernel / kernel.sum()), jnp.asarray(centre[whole]))


def _through(rows: _Rows, signal: Float[Array, " N"], order: int = 0) -> Float[Array, " J"]:
    """A signal through the kernel, or through a difference of the kernel of that order."""
    kernel, step = rows.kernel, signals.interval(rows.recording)
    if order == 1:
        kernel = -0.5 * jnp.convolve(kernel, jnp.array([1.0, 0.0, -1.0])) / step
    if order == 2:
        kernel = jnp.convolve(kernel, jnp.array([1.0, -2.0, 1.0])) / step**2
    reach = kernel.size // 2
    index = rows.centre[:, None] + jnp.arange(-reach, reach + 1)[None]
    return signal[index] @ kernel


def _left(
    model: Model, static: Float[Array, " P"], dynamic: Float[Array, " 2"], rows: _Rows
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
    pushed = _through(rows, log.force - rest - bent)
    turning = _through(rows, z, 1)
    left = pushed - inertia * _through(rows, log.position, 2) - dynamic[1] * turning
    away = _through(rows, jnp.abs(bent) / jnp.maximum(jnp.max(jnp.abs(own)), 1e-300))
    return left, turning, away


@eqx.filter_jit
def _scan(model, static, rows, grid):
    """Cost over the grid of log σ₀, each with its best σ₁ ≥ 0, `(G,)` each."""

    def one(place):
        left, turning, _ = _left(model, static, jnp.stack([place, jnp.zeros(())]), rows)
        power = jnp.sum(turning**2)
        damping = jnp.maximum(jnp.sum(left * turning) / jnp.where(power > 0, power, 1.0), 0.0)
        return jnp.sum((left - damping * turning) ** 2), damping

    return jax.lax.map(one, grid)


def _fitted(found: Any, rows: _Rows, level: float) -> Presliding:
    model: Model = found.model
    static = jnp.concatenate([model.alpha, model.term.beta()])
    limits = signals.scales(rows.recording)
    # From the way of one sample at the slowest slip to a tenth of the stroke, as for `Dahl`.
    shortest = float(limits.slowest * limits.interval)
    longest = 0.1 * float(limits.high - limits.low)
    ends = np.log(level / np.array([longest, shortest]))
    grid = np.linspace(
        ends[0], ends[1], max(int(PER_DECADE * (ends[1] - ends[0]) / np.log(10)), 4) + 1
    )
    best = None
    for start in _starts(model, static, limits):
        costs, dampings = map(np.asarray, _scan(model, start, rows, jnp.asarray(grid)))
        place = int(np.nanargmin(costs))
        first = jnp.concatenate([jnp.asarray([grid[place], dampings[place]]), start])
        values, cost = _refined(model, first, rows)
        if best is None or float(cost) < best[1]:
            best = np.asarray(values), float(cost)
    assert best is not None
    values = best[0]
    if not ends[0] < values[0] < ends[1]:
        which = "longer than a tenth of the stroke" if values[0] < ends[0] else "over in a sample"
        return Presliding(None, None, np.nan, 0.0, f"presliding is {which}, if there is any")
    return _told(found, rows, values)


def _starts(model: Model, static: Float[Array, " P"], limits) -> list[Float[Array, " P"]]:
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
def _refined(model: Model, first: Float[Array, " Q"], rows: _Rows):
    """All parameters by Levenberg and Marquardt, and the cost; log σ₀, σ₁, then the static ones."""
    scale = _scale(model, first)

    def left(at, _):
        values = _free(model, at * scale)
        out = _left(model, values[2:], values[:2], rows)[0]
        return jnp.where(jnp.isfinite(out), out, 1e6)

    solver: Any = optx.LevenbergMarquardt(rtol=1e-6, atol=1e-6)
    sought = _bound(model, first) / scale
    found: Any = optx.least_squares(left, solver, sought, max_steps=ITERATIONS, throw=False)
    return _free(model, found.value * scale), jnp.sum(left(found.value, None) ** 2)


def _positive(model: Model) -> np.ndarray:
    """Which of all parameters are sought by their logarithm: the nonlinear ones that are ratios."""
    ratios = [p.logarithmic for p in model.term.nonlinear]
    return np.array([False, False, *[False] * model.alpha.size, *ratios])


def _bound(model: Model, values: Float[Array, " Q"]) -> Float[Array, " Q"]:
    ratio = _positive(model)
    return jnp.where(ratio, jnp.log(jnp.where(ratio, jnp.abs(values), 1.0)), values)


def _free(model: Model, sought: Float[Array, " Q"]) -> Float[Array, " Q"]:
    ratio = _positive(model)
    return jnp.where(ratio, jnp.exp(jnp.where(ratio, sought, 0.0)), sought)


def _scale(model: Model, first: Float[Array, " Q"]) -> Float[Array, " Q"]:
    """Sizes of the parameters that are sought; of the damping what half a sample of z has."""
    size = jnp.where(_positive(model), 1.0, jnp.maximum(jnp.abs(first), 1e-3 * jnp.max(first[2:])))
    return size.at[0].set(1.0).at[1].set(1e-3 * jnp.exp(first[0]))


@eqx.filter_jit
def _linear(model, values, rows):
    """What is left, its derivatives by all parameters, and the distance from steady slip."""
    left, _, away = _left(model, values[2:], values[:2], rows)
    slope = jax.jacfwd(lambda v: _left(model, v[2:], v[:2], rows)[0])(values)
    return left, slope, away


def _told(found: Any, rows: _Rows, values: np.ndarray) -> Presliding:
    """The estimates, with the refined model."""
    left, slope, away = _linear(found.model, jnp.asarray(values), rows)
    weight = jnp.ones(left.size)
    errors = np.sqrt(np.diagonal(np.asarray(
        deviations(slope, left, weight, places(weight)).covariance
    )))  # fmt: skip
    stiffness, damping = float(np.exp(values[0])), float(values[1])
    count, model = found.model.alpha.size, found.model
    term = model.term.with_beta(jnp.asarray(values[2 + count :]))
    static = dataclasses.replace(model, term=term, alpha=jnp.asarray(values[2 : 2 + count]))
    interval = float(signals.interval(rows.recording))
    seconds = float(np.sum(np.asarray(away) > STEADY)) * (HALF_WIDTH // 2) * interval
    ends = jnp.asarray([-1e-9, 1e-9]) * signals.scales(rows.recording).fastest
    level = float(jnp.mean(jnp.abs(bristles.dry(static.term, static.alpha, ends))))
    if not errors[0] < TOLD:
        why = "the stiffness is not told to within a factor of three"
        return Presliding(None, None, level / stiffness, seconds, why)
    units = dict(model.units)
    return Presliding(
        Estimate(np.float64(stiffness), np.float64(stiffness * errors[0]), spell(STIFFNESS, units)),
        Estimate(np.float64(damping), np.float64(errors[1]), spell(DAMPING, units)),
        level / stiffness,
        seconds,
        "",
        static.with_bristles(stiffness, max(damping, 0.0)),
        dict(zip(static.parameters, map(float, errors[2:]), strict=True)),
    )


def sentence(test: Presliding, units: dict[str, str]) -> str:
    """What the bristles are, in a line."""
    if test.stiffness is None or test.damping is None:
        return f"Presliding: no stiffness of bristles; {test.why}."
    low, high = test.stiffness.interval()
    half = 0.5 * float(high - low)
    low, high = test.damping.interval()
    return (
        f"Presliding: stiffness {float(test.stiffness.value):.4g} ± {half:.2g} "
        f"{test.stiffness.unit}, damping {float(test.damping.value):.3g} ± "
        f"{0.5 * float(high - low):.2g} {test.damping.unit}; over {test.distance:.2g} "
        f"{units['position']}."
    )
