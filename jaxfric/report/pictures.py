"""The picture of an identification: the friction curve over the data, and force against time."""

from pathlib import Path

import jax.numpy as jnp
import numpy as np

from .. import signals
from ..identification import Identified
from ..prediction import predict
from ..recording import Recording
from ..units import VELOCITY, spell

# Points of the mean force a direction: enough to show a bump, few enough that each is a mean.
BINS = 40


def figure(found: Identified, recording: Recording):
    """A matplotlib figure: identified friction over binned measured force, and force in time.

    **Raises:** `ValueError` if matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ValueError('Pictures need matplotlib: pip install "jaxfric[report]".') from error
    prepared = signals.prepare(recording)
    picture = Figure(figsize=(9, 8), layout="constrained")
    curve, time = picture.subplots(2, 1, height_ratios=(3, 2))
    _curve(curve, found, prepared)
    _time(time, found, prepared)
    return picture


def _curve(axes, found: Identified, recording: Recording) -> None:
    units = recording.unit_names
    measured, speed = _slip_force(found, recording)
    for sign, colour in ((1, "tab:blue"), (-1, "tab:orange")):
        side = sign * speed > 0
        if not side.any():
            continue
        v, mean, error = _bins(speed[side], measured[side])
        label = "mean measured force, inertia removed (± standard error)" if sign > 0 else None
        axes.errorbar(v, mean, 2 * error, fmt=".", color="0.55", ms=4, lw=0.8, label=label)
        line = sign * np.geomspace(np.min(np.abs(speed[side])), np.max(np.abs(speed[side])), 400)
        force = np.asarray(found.model.friction(jnp.asarray(line)))
        low, high = _band(found, line, force)
        axes.fill_between(line, low, high, color=colour, alpha=0.25, lw=0)
        name = "positive" if sign > 0 else "negative"
        axes.plot(line, force, color=colour, label=f"identified, {name} direction, 95 % band")
    axes.axhline(0, color="0.8", lw=0.8, zorder=0)
    axes.axvline(0, color="0.8", lw=0.8, zorder=0)
    axes.set_xlabel(f"velocity [{spell(VELOCITY, units)}]")
    axes.set_ylabel(f"friction force [{units['force']}]")
    axes.set_title(f"Friction of {Path(recording.source).name or 'the axis'}")
    axes.legend(fontsize=8)


def _slip_force(found: Identified, recording: Recording):
    """Measured force less all that is not friction, and velocity, at the samples in slip."""
    limits = signals.scales(recording)
    velocity = np.asarray(recording.velocity)
    friction = np.asarray(found.model.friction(recording.velocity))
    rest = np.asarray(recording.force) - np.asarray(predict(found.model, recording)) + friction
    slip = np.asarray(recording.mask) & (np.abs(velocity) > float(limits.slowest))
    return rest[slip], velocity[slip]


def _bins(speed, force):
    """Mean force and its standard error in bins of equal count."""
    order = np.argsort(speed)
    groups = np.array_split(order, min(BINS, max(1, order.size // 8)))
    v = np.array([speed[g].mean() for g in groups])
    mean = np.array([force[g].mean() for g in groups])
    return v, mean, np.array([force[g].std() / np.sqrt(g.size) for g in groups])


def _band(found: Identified, velocity, force):
    """Pointwise 95 % band of the friction curve by the delta method; empty where not visible."""
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
    half = 1.96 * np.sqrt(np.maximum(np.einsum("ij,jk,ik->i", slopes, covariance, slopes), 0.0))
    return force - half, force + half


def _time(axes, found: Identified, recording: Recording) -> None:
    mask = np.asarray(recording.mask)
    time = np.where(mask, np.asarray(recording.time), np.nan)
    breaks = np.flatnonzero(np.diff(np.asarray(recording.segment)) != 0) + 1
    first = slice(0, breaks[0] if breaks.size else time.size)
    force, model = np.asarray(recording.force), np.asarray(predict(found.model, recording))
    axes.plot(time[first], force[first], color="0.6", lw=0.8, label="measured")
    axes.plot(time[first], model[first], color="tab:blue", lw=0.9, label="model")
    axes.plot(time[first], (force - model)[first], color="tab:red", lw=0.6, label="difference")
    what = "first segment" if breaks.size else "recording"
    axes.set_title(f"Force over the {what}; relative error {float(found.force_error):.2%}")
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"force [{recording.unit_names['force']}]")
    axes.legend(fontsize=8, ncols=3)
