"""Pictures by matplotlib, from plain arrays, on axes that are given."""

from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np

FORWARDS, BACKWARDS = "#0b5fa5", "#c4570a"
BEFORE, AFTER, MEASURED = "#c4570a", "#0b5fa5", "0.6"
# Of a longer signal two points a column of the screen, its least and its greatest value, show all.
COLUMNS = 2000


def library():
    """The class `Figure` of matplotlib; raises `ValueError` if it is not installed."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ValueError('Pictures need matplotlib: pip install "jaxfric[report]".') from error
    return Figure


def figure(width: float, height: float):
    """A new figure of `matplotlib.pyplot`, which notebooks show; raises as [`library`][]."""
    library()
    from matplotlib import pyplot

    return pyplot.figure(figsize=(width, height), layout="constrained")


def saved(picture, format: str, dpi: int) -> bytes:
    """A figure as the content of a file: `png`, `pdf` or `svg`."""
    buffer = BytesIO()
    picture.savefig(buffer, format=format, dpi=dpi)
    return buffer.getvalue()


def panels(ax, count: int, height: float = 1.9) -> np.ndarray:
    """The axes that are given, or else new ones, one below the other with the abscissa shared.

    **Raises:** `ValueError` unless there are as many as wanted, or without matplotlib.
    """
    if ax is None:
        new = figure(8, 0.6 + height * count)
        return new.subplots(count, sharex=True, squeeze=False)[:, 0]
    given = np.atleast_1d(np.asarray(ax, object)).ravel()
    if given.size != count:
        raise ValueError(f"plot() draws {count} pictures, but ax= holds {given.size} axes.")
    return given


class Side(NamedTuple):
    """A friction curve in one direction, each array `(K,)`; what was measured, in bins, `(M,)`.

    `sign`: 1 or -1; `low`, `high`: the 95 % band; `mean`, `spread`: of the force less inertia.
    """

    sign: int
    velocity: np.ndarray
    force: np.ndarray
    low: np.ndarray
    high: np.ndarray
    at: np.ndarray = np.empty(0)
    mean: np.ndarray = np.empty(0)
    spread: np.ndarray = np.empty(0)


def friction(axes, sides: Sequence[Side], units: Mapping[str, str], speed: str, name: str = ""):
    """Identified friction with its band, over binned measured force.

    **Arguments:** `speed`, the unit of velocity; `name`, of the axis.
    """
    label: str | None = "measured less inertia, mean ± std"
    for side in sides:
        if side.at.size:
            style = {"fmt": "o", "color": "0.35", "ms": 3, "lw": 0.8, "capsize": 1.5, "zorder": 2}
            axes.errorbar(side.at, side.mean, side.spread, label=label, **style)
            label = None
        colour = FORWARDS if side.sign > 0 else BACKWARDS
        style = {"color": colour, "alpha": 0.3, "lw": 0, "zorder": 1}
        axes.fill_between(side.velocity, side.low, side.high, **style)
        way = "forwards" if side.sign > 0 else "backwards"
        axes.plot(
            side.velocity, side.force, color=colour, lw=1.8, label=f"identified, {way}, 95 % band"
        )
    _over_velocity(axes, speed)
    axes.set_ylabel(f"friction force [{plain(units['force'])}]")
    axes.set_title(plain(f"Friction of {name}") if name else "Identified friction")
    if sides:
        axes.legend(fontsize=8, loc="upper left")
    axes.grid(color="0.93")


def held(axes, test: Any) -> None:
    """The points of a constant-velocity test, and a strip below the speeds that have none.

    **Arguments:** `test`: its `points` and `not_evaluated`, as of `identification`.
    """
    for wrong, colour, name in (
        (False, "k", "at constant velocity, 95 %"),
        (True, "#c00000", "at constant velocity, contradicts"),
    ):
        some = [p for p in test.points if p.contradicts is wrong]
        if some:
            speed, force = [p.velocity for p in some], np.array([p.force for p in some])
            reach = np.array([[f - p.low, p.high - f] for f, p in zip(force, some, strict=True)]).T
            style = {"fmt": "D", "mfc": "w", "ms": 5, "capsize": 3, "lw": 1.2, "zorder": 4}
            axes.errorbar(speed, force, reach, color=colour, label=name, **style)
    label: str | None = "not evaluated at constant velocity"
    for gap in test.not_evaluated:
        style = {"ymax": 0.025, "color": "0.7", "hatch": "////", "ec": "w", "lw": 0, "zorder": 1}
        axes.axvspan(gap.low, gap.high, label=label, **style)
        label = None


def broken_away(axes, test: Any) -> None:
    """The break-away levels at zero velocity with their intervals.

    **Arguments:** `test`: its `levels`, as of `identification`.
    """
    label: str | None = "break-away"
    for level in test.levels:
        reach = [[level.value - level.low], [level.high - level.value]]
        style = {"fmt": "^" if level.direction > 0 else "v", "mfc": "w", "ms": 6, "capsize": 4}
        axes.errorbar(0.0, level.value, reach, color="#5b2a86", label=label, zorder=5, **style)
        label = None


def plain(words: str) -> str:
    """Text in which matplotlib reads no formula; it comes from files."""
    return words.replace("$", r"\$")


def thinned(time: np.ndarray, *signals: np.ndarray) -> list[np.ndarray]:
    """Time and signals in their order, fewer samples: of each column the least and the greatest.

    A gap in a signal is NaN and stays one.
    """
    step = -(-time.size // COLUMNS)
    if step <= 2:
        return [time, *signals]
    whole = time.size // step * step
    middle = time[:whole].reshape(-1, step)
    places = np.stack([middle[:, 0], middle[:, step // 2]], 1).ravel()
    pairs = []
    for signal in signals:
        columns = signal[:whole].reshape(-1, step)
        pairs.append(np.stack([columns.min(1), columns.max(1)], 1).ravel())
    return [places, *pairs]


class Signal(NamedTuple):
    """A recorded signal: its name, its unit, its values `(N,)`, and its set-point or `None`."""

    name: str
    unit: str
    values: np.ndarray
    wanted: np.ndarray | None = None


def signals(panels: Sequence[Any], time: np.ndarray, shown: Sequence[Signal], clock: str) -> None:
    """Each signal on axes of its own over time; NaN is a gap. `clock`: what the time is."""
    for axes, signal in zip(panels, shown, strict=True):
        if signal.wanted is not None:
            places, wanted = thinned(time, signal.wanted)
            axes.plot(places, wanted, color=BACKWARDS, lw=1.6, alpha=0.6, label="reference")
        places, values = thinned(time, signal.values)
        axes.plot(places, values, color=FORWARDS, lw=0.9, label="recorded")
        axes.set_ylabel(plain(label(signal.name, signal.unit)))
        axes.grid(color="0.93")
        if signal.wanted is not None and not any(each.get_legend() for each in panels):
            place = {"loc": "lower right", "bbox_to_anchor": (1, 1), "borderaxespad": 0.2}
            axes.legend(fontsize=8, ncols=2, frameon=False, **place)
    panels[-1].set_xlabel(clock)


def label(quantity: str, unit: str | None) -> str:
    """A quantity with its unit in brackets, if it has one."""
    return quantity.replace("_", " ") + (f" [{unit}]" if unit else "")


def in_time(axes, rest, time, measured, model, unit: str, clock: str = "time [s]") -> None:
    """Measured force and that of a model, and below what is left; NaN is a gap."""
    axes.plot(time, measured, color="0.55", lw=1.8, label="measured")
    axes.plot(time, model, color=FORWARDS, lw=0.8, label="model in motion, inertia included")
    axes.set_ylabel(f"force [{plain(unit)}]")
    _legend(axes, 2)
    axes.tick_params(labelbottom=False)
    rest.plot(time, measured - model, color="0.35", lw=0.7)
    rest.axhline(0, color="0.8", lw=0.8, zorder=0)
    rest.set_xlabel(clock)
    rest.set_ylabel(f"difference [{plain(unit)}]")


def _over_velocity(axes, speed: str) -> None:
    """Lines through rest and no force, and the name of the axis."""
    axes.axhline(0, color="0.8", lw=0.8, zorder=0)
    axes.axvline(0, color="0.8", lw=0.8, zorder=0)
    axes.set_xlabel(f"velocity [{plain(speed)}]")


def _legend(axes, columns: int) -> None:
    """A legend above what is drawn, with room for it."""
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.2 * (high - low))
    axes.legend(fontsize=8, ncols=columns, loc="upper center")


def residual(axes, entry: Mapping[str, Any], force: str) -> None:
    """The mean residual over a coordinate, before and after.

    **Arguments:** `entry`, lists `at`, `before`, `after` and `error`, and `coordinate`, `unit`.
    """
    at = entry["at"]
    name = "before, ± standard error" if entry.get("error") else "before"
    axes.plot(at, entry["before"], color=BEFORE, lw=1.3, label=name)
    if entry.get("error"):
        axes.errorbar(at, entry["before"], entry["error"], fmt="none", ecolor=BEFORE, lw=0.6)
    if entry.get("after"):
        axes.plot(at, entry["after"], color=AFTER, lw=1.3, label="after")
    axes.axhline(0, color="0.8", lw=0.8, zorder=0)
    axes.set_xlabel(plain(label(entry["coordinate"], entry.get("unit"))))
    axes.set_ylabel(f"mean residual [{plain(force)}]")
    axes.grid(color="0.93")
    _legend(axes, 2)


def compared(axes, curves: Mapping[str, Any], force: str, left: bool = False) -> None:
    """Measured force over time with that of the models before and after; or what they leave."""
    measured = _numbers(curves["measured"])
    if not left:
        axes.plot(curves["time"], measured, color=MEASURED, lw=1.8, label="measured")
    for key, colour in (("before", BEFORE), ("after", AFTER)):
        if curves.get(key):
            model = _numbers(curves[key])
            values = measured - model if left else model
            axes.plot(curves["time"], values, color=colour, lw=0.8, label=key)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(f"{'residual' if left else 'force'} [{plain(force)}]")
    axes.grid(color="0.93")
    _legend(axes, 3)


def curves(axes, friction: Mapping[str, Any], force: str, speed: str) -> None:
    """Friction curves before and after; the jump at zero velocity stays a gap."""
    velocity = _numbers(friction["velocity"])
    for key, colour in (("before", BEFORE), ("after", AFTER)):
        if friction.get(key):
            values = _numbers(friction[key])
            for side in (-1, 1):
                at = side * velocity > 0
                name = key if side > 0 else None
                axes.plot(velocity[at], values[at], color=colour, lw=1.3, label=name)
    _over_velocity(axes, speed)
    axes.locator_params(axis="x", nbins=6)
    what = "correction" if friction.get("corrects") else "friction force"
    axes.set_ylabel(f"{what} [{plain(force)}]")
    axes.grid(color="0.93")
    axes.legend(fontsize=8, loc="upper left")


def _numbers(values: Sequence[float | None]) -> np.ndarray:
    return np.array([np.nan if value is None else value for value in values], float)
