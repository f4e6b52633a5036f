"""CSV: friction over velocity, and every further term over its coordinate."""

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np

from ..data.recording import Recording
from ..data.writing import csv_text
from ..models import Model
from ..units import VELOCITY, spell
from . import cost
from .cost import Range
from .outcome import Exported, ForceError
from .parts import Part, left_out, levels, parts

# A Gaussian bump at a fifth of the top speed (the default range) is drawn to 1e-3 of its height.
POINTS = 201


def export(
    model: Model,
    name: str = "axis",
    speed: Range | None = None,
    position: Range | None = None,
    points: int = POINTS,
) -> Exported:
    """A table of friction over both directions of velocity, and of the other terms beside it.

    Each coordinate has a column of its own, spaced evenly over its range. A term that depends on
    place and direction is given for positive velocity: it changes its sign with the direction.
    `force_error` is that of straight lines between the points of friction. A term that is no
    function of one coordinate is left out and named.

    **Raises:** `ValueError` for a term whose range is not known.
    """
    every = [part for part in parts(model) if part.law.in_joint != "inertia"]
    beside = [part for part in every if not part.slips]
    further = [part for part in beside if part.sampled and _coordinate(part) is not None]
    taken = {part.key for part in further}
    missing = tuple(left_out(model, part) for part in beside if part.key not in taken)
    known = cost.ranges(model, speed, position)
    columns, force_error = _friction(model, known["velocity"], points)
    columns |= _stick(model, points)
    for part in further:
        columns |= _beside(model, part, known, points)
    remark = [] if len(every) == len(parts(model)) else ["Inertia is no table: see the model."]
    odd = [part.name for part in further if part.term.sided]
    if odd:
        remark.append(f"{', '.join(odd)}: for positive velocity; negative velocity turns the sign.")
    return Exported(csv_text(columns), force_error, missing, tuple(remark), known["velocity"])


def _stick(model: Model, points: int) -> dict[str, np.ndarray]:
    """The break-away level of each row's direction; the slip curve's end where it is not known."""
    if not levels(model):
        return {}
    tiny = np.sqrt(np.finfo(float).tiny)  # below any Stribeck velocity, in any unit
    ends = np.asarray(model.friction(jnp.asarray([-tiny, tiny])), float)
    pair = np.where(np.isfinite(model.breakaway), np.asarray(model.breakaway, float), ends)
    return {f"breakaway [{dict(model.units)['force']}]": np.repeat(pair, points)}


def _coordinate(part: Part) -> str | None:
    """The one coordinate of a term, or `None` where there are more."""
    if part.term.sided:
        return "position"
    names = set(part.term.coordinates)
    return names.pop() if len(names) == 1 else None


def _friction(model: Model, span: Range, points: int) -> tuple[dict[str, np.ndarray], ForceError]:
    """Velocity and friction, and the error of the straight lines between the points."""
    low, high = span
    # The curve jumps at zero: the innermost points lie on either side of it.
    inner = low if low > 0 else 1e-6 * high
    speeds = np.linspace(inner, high, points)
    velocity = np.concatenate([-speeds[::-1], speeds])
    curve = np.asarray(model.friction(jnp.asarray(velocity)), float)
    where = cost.motion({"velocity": span})
    wanted = np.asarray(model.friction(where.recording.velocity), float)
    given = _between(np.asarray(where.recording.velocity, float), velocity, curve)
    unit = dict(model.units)["force"]
    columns = {f"velocity [{spell(VELOCITY, dict(model.units))}]": velocity}
    return columns | {f"friction [{unit}]": curve}, cost.error(where, wanted, given, unit)


def _between(velocity: np.ndarray, knots: np.ndarray, curve: np.ndarray) -> np.ndarray:
    """Straight lines between the knots of each direction, `(N,)`; none leads across zero."""
    up = knots > 0
    forwards = np.interp(velocity, knots[up], curve[up])
    backwards = np.interp(velocity, knots[~up], curve[~up])
    return np.where(velocity > 0, forwards, backwards)


def _beside(
    model: Model, part: Part, known: Mapping[str, Range], points: int
) -> dict[str, np.ndarray]:
    """The columns of one further term; the coordinate's is the same for all that share it."""
    coordinate, units = _coordinate(part), dict(model.units)
    if coordinate not in known:
        raise ValueError(
            f"The model does not say over which {coordinate} {part.name} is to be tabulated: give "
            "the range, for instance --position 0:0.4."
        )
    # As many rows as the friction has.
    at = np.linspace(*known[coordinate], 2 * points)
    rest = jnp.zeros(at.size)
    signals = {"time": rest, "position": rest, coordinate: jnp.asarray(at)}
    motion = Recording(force=rest, velocity=jnp.ones_like(rest), **signals)
    force = np.asarray(part.term.columns(motion) @ cost.alpha(model, part), float)
    unit = units["position"] if coordinate == "position" else "s"
    label = (
        f"{part.name} {' '.join(part.affine[:1])}" if part.affine[0][-1].isdigit() else part.name
    )
    return {f"{coordinate} [{unit}]": at, f"{label} [{units['force']}]": force}
