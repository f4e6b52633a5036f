"""The picture of an identification: the friction curve over the data, and force against time."""

from io import BytesIO
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from .. import signals
from ..identified import Identified
from ..projections import WeakForm
from ..recording import Recording
from ..uncertainty import student_quantile
from ..units import VELOCITY, spell

# Bins a direction: enough to show a bump, few enough that each holds several rows.
BINS = 30
# A mean of fewer rows than this says nothing about their scatter.
FEWEST = 3
_COLOURS = {1: "#0b5fa5", -1: "#c4570a"}


class _Rows(NamedTuple):
    """Rows of the weak form, each of shape `(J,)`: what the force error is counted on.

    Acceleration is on the kernel, so that nothing here is a noisy derivative.
    """

    time: np.ndarray
    measured: np.ndarray
    predicted: np.ndarray
    friction: np.ndarray
    velocity: np.ndarray
    segment: np.ndarray
    slip: np.ndarray
    moving: np.ndarray


def library():
    """The class `Figure` of matplotlib; raises `ValueError` if it is not installed."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ValueError('Pictures need matplotlib: pip install "jaxfric[report]".') from error
    return Figure


def render(found: Identified, recording: Recording, format: str = "png") -> bytes:
    """The picture as the content of a file, `png`, `pdf` or `svg`; raises as [`figure`][]."""
    buffer = BytesIO()
    figure(found, recording).savefig(buffer, format=format, dpi=130)
    return buffer.getvalue()


def figure(found: Identified, recording: Recording):
    """A matplotlib figure: identified friction over binned measured force, and force in time.

    **Arguments:** `found`, what was identified from `recording`, signals of shape `(N,)`.

    **Raises:** `ValueError` if matplotlib is not installed.
    """
    picture = library()(figsize=(9, 9.5), layout="constrained")
    prepared = signals.prepare(recording)
    width = signals.kernel_half_width(prepared)
    rows = _Rows(*map(np.asarray, _rows(found.model, prepared, width)))
    kernel = 2 * width * float(signals.interval(prepared))
    curve, time, rest = picture.subplots(3, 1, height_ratios=(6, 3, 2))
    rest.sharex(time)
    _curve(curve, found, prepared, rows)
    unit = prepared.unit_names["force"]
    _time(time, rest, rows, unit)
    time.set_title(
        f"Force, averaged over {1e3 * kernel:.3g} ms; force error {float(found.force_error):.2%}"
    )
    return picture


@eqx.filter_jit
def _rows(model, recording: Recording, width: int) -> _Rows:
    rows = WeakForm(width).rows(recording, signals.scales(recording))
    predicted = rows.columns(model.term, recording) @ model.alpha
    velocity = recording.velocity
    others = (model.friction(velocity), velocity, recording.segment, recording.mask)
    columns = jnp.stack([x.astype(velocity.dtype) for x in others], 1)
    friction, velocity, segment, valid = rows.project(columns).T
    slip = rows.positive + rows.negative > 0
    predicted = predicted + rows.offset(model.term, recording)
    # A kernel over two segments, or over samples left out, belongs to none.
    one = (jnp.abs(segment - jnp.round(segment)) < 1e-6) & (valid > 1 - 1e-6)
    segment = jnp.where(one, jnp.round(segment), -1.0)
    moving = rows.moving > 0
    return _Rows(rows.time, rows.target, predicted, friction, velocity, segment, slip, moving)


def _curve(axes, found: Identified, recording: Recording, rows: _Rows) -> None:
    units = recording.unit_names
    measured = (rows.measured - rows.predicted + rows.friction)[rows.slip]
    speed = rows.velocity[rows.slip]
    slowest = float(signals.scales(recording).slowest)
    for sign, colour in _COLOURS.items():
        side = sign * speed > 0
        if not side.any():
            continue
        v, mean, spread = _bins(speed[side], measured[side])
        label = "measured force less inertia: mean and standard deviation"
        style = {"fmt": "o", "color": "0.35", "ms": 3, "lw": 0.8, "capsize": 1.5, "zorder": 2}
        axes.errorbar(v, mean, spread, label=label if sign > 0 else None, **style)
        line = sign * np.geomspace(slowest, np.max(np.abs(speed[side])), 400)
        force = np.asarray(found.model.friction(jnp.asarray(line)))
        low, high = _band(found, line, force)
        axes.fill_between(line, low, high, color=colour, alpha=0.3, lw=0, zorder=1)
        name = "forwards" if sign > 0 else "backwards"
        axes.plot(line, force, color=colour, lw=1.8, label=f"identified, {name}, 95 % band")
    axes.axhline(0, color="0.8", lw=0.8, zorder=0)
    axes.axvline(0, color="0.8", lw=0.8, zorder=0)
    axes.set_xlabel(f"velocity [{spell(VELOCITY, units)}]")
    axes.set_ylabel(f"friction force [{units['force']}]")
    axes.set_title(f"Friction of {Path(recording.source).name or 'the axis'}")
    axes.legend(fontsize=8, loc="upper left")
    axes.grid(color="0.93")


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


def _band(found: Identified, velocity, force):
    """Pointwise 95 % band of the friction curve by the delta method.

    Parameters that are not visible have no part in it.
    """
    values = np.array([float(v) for v in found.model.parameters.values()])
    names = list(found.model.parameters)
    matrix = np.asarray(found.covariance)
    seen = np.isfinite(np.diagonal(matrix)) & np.isfinite(values)
    slopes = np.zeros((velocity.size, values.size))
    for i in np.flatnonzero(seen):
        step = 1e-6 * max(abs(values[i]), 1e-12)
        moved = found.model.with_parameters({names[i]: values[i] + step})
        slopes[:, i] = (np.asarray(moved.friction(jnp.asarray(velocity))) - force) / step
    covariance = np.where(seen[:, None] & seen[None, :], matrix, 0.0)
    freedom = next(iter(found.parameters.values())).degrees_of_freedom
    half = student_quantile(0.975, freedom) * np.sqrt(
        np.maximum(np.einsum("ij,jk,ik->i", slopes, covariance, slopes), 0.0)
    )
    return force - half, force + half


def _time(axes, rest, rows: _Rows, unit: str) -> None:
    # The longest segment only: the clocks of the others may start again. At rest friction is
    # whatever holds the axis, which no model of slip says: there the lines have gaps.
    used = rows.segment[rows.moving & (rows.segment >= 0)].astype(int)
    here = rows.segment == (np.argmax(np.bincount(used)) if used.size else 0)
    time, measured = rows.time[here], rows.measured[here]
    model = np.where(rows.moving, rows.predicted, np.nan)[here]
    axes.plot(time, measured, color="0.55", lw=1.8, label="measured")
    axes.plot(time, model, color=_COLOURS[1], lw=0.8, label="model in motion, inertia included")
    axes.set_ylabel(f"force [{unit}]")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.2 * (high - low))  # room for the legend
    axes.legend(fontsize=8, ncols=2, loc="upper center")
    axes.tick_params(labelbottom=False)
    rest.plot(time, measured - model, color="0.35", lw=0.7)
    rest.axhline(0, color="0.8", lw=0.8, zorder=0)
    several = " of the longest segment" if np.unique(used).size > 1 else ""
    rest.set_xlabel(f"time{several} [s]")
    rest.set_ylabel(f"difference [{unit}]")
