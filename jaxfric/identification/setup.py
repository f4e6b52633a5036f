"""The setup of an identification: the arguments checked, the recording prepared."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from .. import signals
from ..data.recording import Recording, described, row_of
from ..models import Model, named
from ..terms.actuator import PREDICTED, REACTION, predicted
from ..terms.base import AbstractTerm, leaves
from . import blocks, grids
from .identified import Identified
from .projections import AbstractProjection, ClosedWindows, WeakForm


class Setup(NamedTuple):
    """All that an identification depends on: the term, a prepared recording or batch, the
    projection, the half-width of the weak form's kernel (of the mass and of the force error too),
    the bounds by name and the points of the grid, or a plan of several.
    """

    term: AbstractTerm
    recording: Recording
    projection: AbstractProjection
    width: int
    bounds: tuple[tuple[str, tuple[float, float]], ...]
    grid: grids.Plan | int | None


def set_up(
    model: AbstractTerm | Model | Identified | str,
    recording: Recording,
    projection: AbstractProjection | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    grid: int | None = None,
    width: int | None = None,
    prepared: Recording | None = None,
) -> Setup:
    """What [`identify`][] solves for its arguments; `width` and the recording `prepared`, where
    they are known already.

    **Raises:** `ValueError` if the model cannot be identified from such a recording.
    """
    term = structure(model)
    _check_arguments(term, projection, bounds, grid)
    if prepared is None:
        prepared = _prepare(recording)
    _check(term, projection, prepared)
    width = _width(projection, prepared) if width is None else width
    limits = tuple(sorted((name, tuple(map(float, pair))) for name, pair in (bounds or {}).items()))
    chosen = projection or (WeakForm(width) if _beyond_velocity(term) else ClosedWindows())
    plan = _plan(term, prepared, chosen, dict(limits)) if grid is None else grid
    return Setup(term, prepared, chosen, width, limits, plan)


def _plan(term, recording, projection, given) -> grids.Plan | None:
    """The grids of a term that needs its own; the usual ones where the recording is traced."""
    if not blocks.staged(term):
        return None
    width = projection.half_width if isinstance(projection, WeakForm) else None
    if signals.is_traced(recording):
        return grids.plan(term, given, None, width)
    if recording.time.ndim == 1:
        return grids.plan(term, given, signals.host_scales(recording)[0], width)
    count = recording.time.shape[0]
    each = (row_of(recording, i) for i in range(count))
    sizes = [signals.host_scales(one)[0] for one in each]
    return grids.plan(term, given, jax.tree.map(lambda *x: np.stack(x), *sizes), width)


def _width(projection: AbstractProjection | None, recording: Recording) -> int:
    """Half-width of the weak form's kernel; rows that share one have the median of a few rows'."""
    if isinstance(projection, WeakForm):
        return projection.half_width
    if recording.time.ndim == 1 or signals.is_traced(recording):
        return signals.kernel_half_width(recording)
    count = recording.time.shape[0]
    some = [row_of(recording, i) for i in range(0, count, -(-count // 8))]
    return sorted(signals.kernel_half_width(one) for one in some)[len(some) // 2]


def structure(model: AbstractTerm | Model | Identified | str) -> AbstractTerm:
    """The sum of terms of what [`identify`][] is given.

    **Raises:** `ValueError` if that is none.
    """
    if isinstance(model, str):
        return named(model)
    if isinstance(model, Identified):
        return model.model.term
    if isinstance(model, Model):
        return model.term
    if not isinstance(model, AbstractTerm):
        raise ValueError(
            f"identify needs a model's name, a sum of terms (terms.Coulomb() + …), a Model or an "
            f"Identified, not {described(model)}."
        )
    return model


def _check_arguments(term, projection, bounds, grid) -> None:
    if projection is not None and not isinstance(projection, AbstractProjection):
        raise ValueError(
            f"projection is {described(projection)}; give jaxfric.ClosedWindows(), "
            "jaxfric.WeakForm(half_width) or None."
        )
    if not isinstance(grid, int | np.integer | None) or (grid is not None and grid < 2):
        raise ValueError(f"grid is {grid!r}; give a whole number of points a side from 2, or None.")
    if not isinstance(bounds, Mapping | None):
        raise ValueError(
            f"bounds is {described(bounds)}; give pairs by name, {{name: (low, high)}}."
        )
    searched = [p.name for p in term.nonlinear]
    for name, pair in (bounds or {}).items():
        if name not in searched and name not in {each.rstrip("+-") for each in searched}:
            raise ValueError(
                f"bounds names {name!r}, which the model does not search; it searches "
                f"{', '.join(searched) or 'nothing'}."
            )
        if np.shape(pair) != (2,) or not pair[0] < pair[1]:
            raise ValueError(f"The bounds of {name} are {pair!r}; give (low, high), low first.")


def _beyond_velocity(term: AbstractTerm) -> frozenset[str]:
    return term.coordinates - {"velocity", "acceleration"}


def _check(term, projection, recording):
    beyond = _beyond_velocity(term)
    if isinstance(projection, ClosedWindows) and beyond:
        raise ValueError(
            f"ClosedWindows leaves inertia out, which is exact only for functions of velocity; "
            f"this model depends on {', '.join(sorted(beyond))} too, and acceleration is not "
            "orthogonal to that. Use projection=jaxfric.WeakForm(...), or leave it to the default."
        )
    missing = {"position"} & beyond if recording.position is None else set()
    missing |= {c for c in beyond if c not in ("position", "time") and c not in recording.channels}
    if missing & {PREDICTED, REACTION}:
        raise ValueError(_acts_on_force(term))
    if missing:
        place = [] if recording.position is None else ["position"]
        raise ValueError(
            f"The model needs {', '.join(sorted(missing))}, which the recording lacks; "
            f"it has {', '.join(['time', *place, 'velocity', *recording.channels])}."
        )


def _acts_on_force(term: AbstractTerm) -> str:
    """Which terms of a model need the force of its other terms, and what to do."""
    names = dict.fromkeys(type(part).__name__ for part in leaves(term) if predicted(part))
    verb, them = ("acts", "it") if len(names) == 1 else ("act", "them")
    return (
        f"{' and '.join(names)} {verb} on the force that the other terms make, as an actuator's "
        "faults and friction that grows with the load do. identify cannot fit both at once. Leave "
        f"{them} out and identify the other terms, fit = jaxfric.identify(others, recording); then "
        f"jaxfric.explain(recording, fit) finds {them} beside these."
    )


def _prepare(recording: Recording) -> Recording:
    if recording.time.ndim == 1:
        return signals.prepare(recording)
    if signals.is_traced(recording):
        return jax.vmap(signals.prepare)(recording)
    return together(recording, ready_rows(recording))


def ready_rows(recording: Recording) -> list[signals.Ready]:
    """Each row of a batch, or the one recording, prepared; nothing of it is traced."""
    host = jax.tree.map(np.asarray, recording)
    if host.time.ndim == 1:
        return [signals.Ready.of(host)]
    return [signals.Ready.of(row_of(host, i)) for i in range(len(host.time))]


def together(recording: Recording, rows: Sequence[signals.Ready]) -> Recording:
    """A batch with the velocities of its prepared rows, and where these are known."""
    each = [(one.recording.velocity, one.recording.mask) for one in rows]
    velocity, mask = (np.stack(list(map(np.asarray, own))) for own in zip(*each, strict=True))
    return dataclasses.replace(recording, velocity=velocity, mask=mask)


def all_finite(recording: Recording) -> Bool[Array, ""]:
    """Whether every signal of a recording is a number at all valid samples."""
    signals_ = [recording.time, recording.force, recording.velocity, recording.position]
    good = [jnp.all(jnp.isfinite(s) | ~recording.mask) for s in signals_ if s is not None]
    return jnp.all(jnp.stack(good))


def sanitised(recording: Recording, of=jnp) -> Recording:
    """Zeros for what is not finite, so that one bad sample cannot spoil sums or gradients.

    `of`: the arrays' module, `numpy` on the host.
    """

    def clean(x):
        inexact = jnp.issubdtype(x.dtype, jnp.inexact)
        return of.where(of.isfinite(x), x, x.dtype.type(0)) if inexact else x

    usable = recording.mask
    for signal in (recording.force, recording.velocity, recording.time):
        usable = usable & of.isfinite(signal)
    return eqx.tree_at(lambda r: r.mask, jax.tree.map(clean, recording), usable)
