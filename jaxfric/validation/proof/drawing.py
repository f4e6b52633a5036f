"""The pictures of a proof: confusion matrix and power."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...looks.drawing import library
from . import counting as counted
from .counting import rate
from .scoring import Score

CONFUSION, POWER = "confusion.png", "power.png"


def draw(scores: Sequence[Score], folder: Path) -> list[str]:
    """Draw what can be drawn of the scores into a folder; returns the files' names.

    **Raises:** `ValueError` without matplotlib.
    """
    library()
    import matplotlib

    drawn = []
    with matplotlib.rc_context({"font.size": 8, "figure.dpi": 120}):
        if any(s.kind != "pair" for s in scores):
            _save(_confusion(scores), folder / CONFUSION)
            drawn.append(CONFUSION)
        if counted.binned(scores):
            _save(_power(scores), folder / POWER)
            drawn.append(POWER)
    return drawn


def _save(figure, file: Path) -> None:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure).print_png(str(file))


def _figure(width: float, height: float):
    figure = library()(figsize=(width, height), layout="constrained")
    return figure, figure.add_subplot()


def _confusion(scores):
    true, named, counts = counted.confusion(scores)
    share = np.array(counts) / np.maximum(np.sum(counts, axis=1, keepdims=True), 1)
    figure, axes = _figure(3 + 0.24 * len(named), 2.5 + 0.24 * len(true))
    axes.imshow(share, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    axes.set_xticks(range(len(named)), named, rotation=90)
    axes.set_yticks(range(len(true)), true)
    axes.set_xlabel("named first")
    axes.set_ylabel("concealed")
    for i, row in enumerate(counts):
        for j, count in enumerate(row):
            if count:
                colour = "white" if share[i, j] > 0.5 else "black"
                axes.text(j, i, str(count), ha="center", va="center", color=colour, fontsize=6)
    return figure


def _power(scores):
    groups = counted.binned(scores)
    figure, axes = _figure(6.0, 3.6)
    for shift, label, holds, colour in (
        (-0.06, "named exactly", lambda s: s.exact, "#0b5fa5"),
        (0.06, "named or declared confusable", lambda s: s.within, "#c4570a"),
    ):
        rates = [rate(some, holds) for _, some in groups]
        middles = [r.share for r in rates]
        ends = np.array([r.interval for r in rates])
        # Rounding may leave the share a hair outside its interval.
        bars = np.maximum([middles - ends[:, 0], ends[:, 1] - middles], 0.0)
        at = np.arange(len(groups)) + shift
        axes.errorbar(at, middles, bars, fmt="o-", color=colour, capsize=3, label=label)
    axes.set_xticks(range(len(groups)), [f"{name}\n{len(some)} cases" for name, some in groups])
    axes.set_ylim(0, 1.03)
    axes.set_xlabel("size of the concealed force, of the Coulomb level")
    axes.set_ylabel("share of machines with one effect")
    axes.legend(loc="lower right")
    axes.grid(axis="y", alpha=0.3)
    return figure
