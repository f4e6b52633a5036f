"""The picture of an identification: the friction curve over the data, and force against time."""

from io import BytesIO
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from .. import signals
from ..identified import Identified
from ..prediction import predict
from ..recording import Recording
from ..uncertainty import student_quantile
from ..units import VELOCITY, spell

# Bins a direction: enough to show a bump, few enough that each holds many samples.
BINS = 30
# A mean of fewer samples than this says nothing about their scatter.
FEWEST = 8
_COLOURS = {1: "#0b5fa5", -1: "#c4570a"}


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
    force = np.asarray(predict(found.model, prepared))
    curve, time, rest = picture.subplots(3, 1, height_ratios=(6, 3, 2))
    rest.sharex(time)
    _curve(curve, found, prepared, force)
    _time(time, rest, found, prepared, force)
    return picture


def _curve(axes, found: Identified, recording: Recording, predicted) -> None:
    units = recording.unit_names
    measured, speed = _slip_force(found, recording, predicted)
    for sign, colour in _COLOURS.items():
        side = sign * speed > 0
        if not side.any():
            continue
        v, mean, spread = _bins(speed[side], measured[side])
        label = "measured force less inertia: mean and standard deviation of a bin"
        style = {"fmt": "o", "color": "0.35", "ms": 3, "lw": 0.8, "capsize": 1.5, "zorder": 2}
        axes.errorbar(v, mean, spread, label=label if sign > 0 else None, **style)
        # From the slowest motion that counts as slip: below it there is nothing to compare with.
        line = sign * np.geomspace(np.min(np.abs(speed[side])), np.max(np.abs(speed[side])), 400)
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


def _slip_force(found: Identified, recording: Recording, predicted):
    """Measured force less all that is not friction, and velocity, at the samples in slip."""
    limits = signals.scales(recording)
    velocity = np.asarray(recording.velocity)
    friction = np.asarray(found.model.friction(recording.velocity))
    rest = np.asarray(recording.force) - predicted + friction
    slip = np.asarray(recording.mask) & (np.abs(velocity) > float(limits.slowest))
    return rest[slip], velocity[slip]


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


def _time(axes, rest, found: Identified, recording: Recording, predicted) -> None:
    mask, segment = np.asarray(recording.mask), np.asarray(recording.segment)
    # One segment at most, the longest: clocks of others may start again.
    longest = np.argmax(np.bincount(segment[mask])) if mask.any() else 0
    here = np.flatnonzero(mask & (segment == longest))
    here = slice(here[0], here[-1] + 1) if here.size else slice(0)
    # What is left out leaves a gap in the lines.
    time = np.where(mask, np.asarray(recording.time), np.nan)[here]
    force, model = np.asarray(recording.force)[here], predicted[here]
    unit = recording.unit_names["force"]
    axes.plot(time, force, color="0.55", lw=1.8, label="measured")
    axes.plot(time, model, color=_COLOURS[1], lw=0.7, label="model, inertia included")
    many = np.unique(segment[mask]).size > 1
    what = "longest segment" if many else "recording"
    axes.set_title(f"Force over the {what}; force error {float(found.force_error):.2%}")
    axes.set_ylabel(f"force [{unit}]")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.2 * (high - low))  # room for the legend
    axes.legend(fontsize=8, ncols=2, loc="upper center")
    axes.tick_params(labelbottom=False)
    rest.plot(time, force - model, color="0.35", lw=0.6)
    rest.axhline(0, color="0.8", lw=0.8, zorder=0)
    rest.set_xlabel("time [s]")
    rest.set_ylabel(f"difference [{unit}]")
