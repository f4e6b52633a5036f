"""What an identification is asked: the arguments checked, the recording prepared."""

from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from . import signals
from .identified import Identified
from .models import Model, named
from .projections import AbstractProjection, ClosedWindows, WeakForm
from .recording import Recording
from .terms.base import AbstractTerm


class Question(NamedTuple):
    """All that an identification depends on: the term, a prepared recording or batch, the
    projection, the half-width of the weak form's kernel (of the mass and of the force error too),
    the bounds by name and the points of the grid.
    """

    term: AbstractTerm
    recording: Recording
    projection: AbstractProjection
    width: int
    bounds: tuple[tuple[str, tuple[float, float]], ...]
    grid: int | None


def ask(
    model: AbstractTerm | Model | Identified | str,
    recording: Recording,
    projection: AbstractProjection | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    grid: int | None = None,
    width: int | None = None,
) -> Question:
    """What [`identify`][] solves for its arguments; `width`, where it is known already.

    **Raises:** `ValueError` if the model cannot be identified from such a recording.
    """
    term = _structure(model)
    batched = recording.time.ndim == 2
    prepared = _prepare_batch(recording) if batched else signals.prepare(recording)
    _check(term, projection, prepared)
    width = _width(projection, prepared) if width is None else width
    limits = tuple(sorted((name, tuple(map(float, pair))) for name, pair in (bounds or {}).items()))
    chosen = projection or (WeakForm(width) if _beyond_velocity(term) else ClosedWindows())
    return Question(term, prepared, chosen, width, limits, grid)


def _width(projection: AbstractProjection | None, recording: Recording) -> int:
    """Half-width of the weak form's kernel; a batch shares the median of a few rows' widths."""
    if isinstance(projection, WeakForm):
        return projection.half_width
    if recording.time.ndim == 1 or signals.is_traced(recording):
        return signals.kernel_half_width(recording)
    count = recording.time.shape[0]
    some = [jax.tree.map(lambda x, i=i: x[i], recording) for i in range(0, count, -(-count // 8))]
    return sorted(signals.kernel_half_width(row) for row in some)[len(some) // 2]


def _structure(model) -> AbstractTerm:
    if isinstance(model, str):
        return named(model)
    if isinstance(model, Identified):
        return model.model.term
    return model.term if isinstance(model, Model) else model


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
    if missing:
        raise ValueError(
            f"The model needs {', '.join(sorted(missing))}, which the recording lacks; "
            f"it has {', '.join(['time', 'velocity', *recording.channels])}."
        )


def _prepare_batch(recording: Recording) -> Recording:
    if recording.velocity is not None:
        return recording
    if signals.is_traced(recording):
        return jax.vmap(signals.prepare)(recording)
    widths = _half_widths(recording)
    return _differentiated(recording, widths, int(jnp.max(widths)))


@eqx.filter_jit
def _half_widths(recording):
    return jax.lax.map(signals.choose_half_width, recording)


@eqx.filter_jit
def _differentiated(recording, widths, reach):
    def one(row):
        return signals.prepare(*row, reach)

    return jax.lax.map(one, (recording, widths))
