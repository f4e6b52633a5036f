"""The picture of an identification: the friction curve over the data, and force against time."""

import numpy as np

from .. import signals
from ..data.recording import Recording
from ..identification import curves
from ..identification.breakaway import breakaway
from ..identification.constant_velocity import constant_velocity
from ..identification.identified import Identified
from ..looks import drawing
from ..looks.drawing import library as library
from ..units import VELOCITY, spell


def render(found: Identified, recording: Recording, format: str = "png") -> bytes:
    """The picture as the content of a file, `png`, `pdf` or `svg`; raises as [`figure`][]."""
    return drawing.saved(figure(found, recording), format, 130)


def figure(found: Identified, recording: Recording):
    """A matplotlib figure: identified friction over binned measured force, and force in time.

    **Arguments:** `found`, what was identified from `recording`, signals of shape `(N,)`.

    **Raises:** `ValueError` if matplotlib is not installed.
    """
    picture = library()(figsize=(9, 9.5), layout="constrained")
    prepared = curves.prepared(recording)
    rows = curves.rows(found, prepared)
    kernel = 2 * rows.width * float(signals.interval(prepared))
    curve, time, rest = picture.subplots(3, 1, height_ratios=(6, 3, 2))
    rest.sharex(time)
    units = prepared.unit_names
    sides = curves.measured(found, prepared, rows)
    drawing.held(curve, constant_velocity(prepared, found))
    drawing.broken_away(curve, breakaway(prepared, found))
    drawing.friction(curve, sides, units, spell(VELOCITY, units), curves.name(recording.source))
    _time(time, rest, rows, units["force"])
    time.set_title(
        f"Force, averaged over {1e3 * kernel:.3g} ms; "
        f"filtered force error {float(found.filtered_force_error):.2%}"
    )
    return picture


def _time(axes, rest, rows: curves.Force, unit: str) -> None:
    # The longest segment only: the clocks of the others may start again. At rest friction is
    # whatever holds the axis, which no model of slip says: there the lines have gaps.
    used = rows.segment[rows.moving & (rows.segment >= 0)].astype(int)
    here = rows.segment == (np.argmax(np.bincount(used)) if used.size else 0)
    model = np.where(rows.moving, rows.predicted, np.nan)[here]
    several = " of the longest segment" if np.unique(used).size > 1 else ""
    clock = f"time{several} [s]"
    drawing.in_time(axes, rest, rows.time[here], rows.measured[here], model, unit, clock)
