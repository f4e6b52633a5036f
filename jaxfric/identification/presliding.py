"""Stiffness and damping of the bristles of LuGre, on the presliding part of a recording.

The static parameters begin with those of the identification, problem (L). With them the deflection
z along the recorded position is known for each stiffness σ₀, and u = M a + f + σ₀ z + σ₁ dz/dt is
linear in σ₁ (Canudas de Wit, Olsson, Åström & Lischinsky 1995; `terms.bristles`). From the best σ₀
all parameters are refined together, since presliding bends the slip curve that (L) sees. The
derivatives stand on the kernel of the weak form, over reversals too: none is taken on the data.
"""

import dataclasses
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .. import signals
from ..checks import passive
from ..data.recording import Recording, require
from ..looks.text import Block, Table
from ..models import Model
from ..terms import bristles
from ..units import DAMPING, STIFFNESS, spell
from .bristle_fit import HALF_WIDTH, Rows, linear, refined, rows_of, scan, starts, through
from .deciding import STRONG, independent
from .identified import LEAST_EXPLAINED, Result
from .tabulate import FINE
from .uncertainty import COSINES, Estimate, deviations, places, student_quantile

# Eight places a decade of stiffness, between which the cost is smooth.
PER_DECADE = 8
# Nearer to steady slip than a hundredth of the friction a row tells of the slip curve, not of z.
STEADY = 0.01
FEWEST = 96
# A stiffness is seen if it is told to within a factor of three, its 95 % interval each way.
TOLD = np.log(3.0) / 2
# The kinds of friction at rest, by rising number of parameters.
KINDS = {"jump": 0, "dahl": 1, "lugre": 2}
NAMES = {"jump": "jumps", "dahl": "Dahl", "lugre": "LuGre"}
SAID = {
    "jump": "friction that jumps at rest describes the recording as well: no presliding shows",
    "dahl": "Dahl: friction that bends at rest describes the recording better, without a damping",
    "lugre": "LuGre: friction that bends at rest, with a damping, describes the recording better",
}


class Kind(NamedTuple):
    """A kind of friction at rest: what it leaves of the rows, norm(u − û)/norm(u), and by how much
    its information criterion is `above` the least.
    """

    name: str
    filtered_force_error: float
    above: float


class Presliding(NamedTuple):
    """The bristles: `stiffness` σ₀, N/m, `damping` σ₁, N·s/m, each an estimate or `None`; `why`.

    `distance`: friction at rest over σ₀, m, the scale of presliding. `seconds`: of presliding.
    `model`: with them and the static parameters refined beside them, for `predict` and `simulate`;
    `standard_errors` of the static parameters by name. `kinds`: friction that jumps at rest, Dahl's
    (σ₁ = 0) and LuGre's, each with its static parameters refined on the same rows.
    """

    stiffness: Estimate | None
    damping: Estimate | None
    distance: float
    seconds: float
    why: str = ""
    model: Model | None = None
    standard_errors: dict[str, float] = {}
    kinds: tuple[Kind, ...] = ()

    @property
    def kind(self) -> str:
        """The simplest kind that is not told from the best; `jump` where nothing was compared."""
        return _simplest(self.kinds)

    def to_dict(self) -> dict[str, Any]:
        """The bristles as plain data, in the units of the recording."""
        values = {"stiffness": self.stiffness, "damping": self.damping}
        told: dict[str, Any] = {
            name: None if each is None else each.to_dict() for name, each in values.items()
        }
        kinds = [each._asdict() for each in self.kinds]
        told |= {"distance": self.distance, "seconds": self.seconds, "why": self.why}
        return told | {"kinds": kinds, "kind": self.kind}

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
    rows = rows_of(log)
    ends = jnp.asarray([-1e-9, 1e-9]) * signals.scales(log).fastest
    level = float(jnp.mean(jnp.abs(bristles.dry(found.model.term, found.model.alpha, ends))))
    if not level > 0 or rows.centre.size < FEWEST:
        return Presliding(None, None, np.nan, 0.0, "the model has no friction at rest, or no row")
    return _fitted(found, rows, level)


def _fitted(found: Any, rows: Rows, level: float) -> Presliding:
    model: Model = found.model
    static = jnp.concatenate([model.alpha, model.term.beta()])
    limits = signals.scales(rows.recording)
    # From the way of one sample at the slowest slip to a tenth of the stroke, as for `Dahl`.
    shortest = float(limits.slowest * limits.interval)
    longest = 0.1 * float(limits.high - limits.low)
    ends = np.log(level / np.array([longest, shortest]))
    count = max(int(PER_DECADE * (ends[1] - ends[0]) / np.log(10)), 4) + 1
    grid = jnp.asarray(np.linspace(ends[0], ends[1], count))
    best: dict[str, tuple[np.ndarray, float]] = {}
    for start in starts(model, static, limits):
        for name, first, free in _firsts(model, start, rows, grid):
            values, cost = refined(model, jnp.concatenate([first, start]), rows, free)
            if name not in best or float(cost) < best[name][1]:
                best[name] = np.asarray(values), float(cost)
    kinds = _compared(model, rows, {name: values for name, (values, _) in best.items()})
    values = best["dahl" if _simplest(kinds) == "dahl" else "lugre"][0]
    if not ends[0] < values[0] < ends[1]:
        which = "longer than a tenth of the stroke" if values[0] < ends[0] else "over in a sample"
        why = f"presliding is {which}, if there is any"
        return Presliding(None, None, np.nan, 0.0, why, kinds=kinds)
    return _told(found, rows, values)._replace(kinds=kinds)


def _firsts(model: Model, start: Float[Array, " P"], rows: Rows, grid: Float[Array, " G"]):
    """For each kind its name, log σ₀ and σ₁ to begin with, and which of the two are searched."""
    costs, dampings, dahl = map(np.asarray, scan(model, start, rows, grid))
    place, other = int(np.nanargmin(costs)), int(np.nanargmin(dahl))
    yield "lugre", jnp.asarray([grid[place], dampings[place]]), jnp.asarray([True, True])
    yield "dahl", jnp.asarray([grid[other], 0.0]), jnp.asarray([True, False])
    # The stiffest that is over within a sample: friction jumps.
    yield "jump", jnp.asarray([grid[-1], 0.0]), jnp.asarray([False, False])


def _compared(model: Model, rows: Rows, values: dict[str, np.ndarray]) -> tuple[Kind, ...]:
    """The kinds, by rising number of parameters, as `deciding` compares effects."""
    left = {name: np.asarray(linear(model, jnp.asarray(values[name]), rows)[0]) for name in KINDS}
    power = {name: max(float(np.mean(each**2)), 1e-300) for name, each in left.items()}
    count = independent(left[min(power, key=lambda name: power[name])])
    force = max(float(np.mean(np.asarray(through(rows, rows.recording.force)) ** 2)), 1e-300)
    score = {
        name: count * np.log(power[name]) + more * np.log(count) for name, more in KINDS.items()
    }
    least = min(score.values())
    return tuple(
        Kind(name, float(np.sqrt(power[name] / force)), float(score[name] - least))
        for name in KINDS
    )


def _simplest(kinds: tuple[Kind, ...]) -> str:
    return next((each.name for each in kinds if each.above <= STRONG), "jump")


def _told(found: Any, rows: Rows, values: np.ndarray) -> Presliding:
    """The estimates, with the refined model."""
    left, slope, away = linear(found.model, jnp.asarray(values), rows)
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
        reach = float(np.exp(Estimate(values[0], errors[0], "").half_width()))
        why = "the stiffness is not told to within a factor of three"
        if reach < 100:
            why += f" (its 95 % interval reaches over a factor of {reach:.2g} each way)"
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
    """What the bristles are, in a line, and what of Dahl's and LuGre's the recording asks for."""
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


def doubt(test: Presliding, found: Any) -> str:
    """What speaks against the friction beside the bristles; empty where nothing does.

    Where friction bends in truth, friction that jumps describes the recording badly, and may seem
    to drive the axis. Then the parameters refined beside the bristles count instead.
    """
    if found.result_name not in ("not_described", "not_passive"):
        return "" if found.result_name == FINE else f"{found.result_name}: {found.diagnosis}"
    if test.model is None or test.kind == "jump":
        return f"{found.result_name}: {found.diagnosis}"
    left = next(each.filtered_force_error for each in test.kinds if each.name == test.kind)
    if left**2 > 1 - LEAST_EXPLAINED:
        return f"not_described: {Result[Result.not_described]}"
    bound, values = student_quantile(0.975, COSINES), test.model.parameters
    highest = {name: float(values[name]) + bound * e for name, e in test.standard_errors.items()}
    if any(passive(name) and most < 0 for name, most in highest.items()):
        return f"not_passive: {Result[Result.not_passive]}"
    return ""


def comparison(test: Presliding) -> list[Block]:
    """The kinds of friction at rest as a table, and what follows."""
    if not test.kinds:
        return []
    table = [["", "friction at rest", "force left", "criterion above the least"]]
    for each in test.kinds:
        mark = "*" if each.name == test.kind else "=" if each.above <= STRONG else ""
        error, above = f"{each.filtered_force_error:.3%}", f"{each.above:.1f}"
        table.append([mark, NAMES[each.name], error, above])
    said = f"* {SAID[test.kind]}"
    if test.kind != "jump":
        said += ". Cogging, backlash or a lag may look so: jaxfric explain compares them."
    return [Table(table, (2, 3)), [said]]
