"""Isolated pushes: candidates whose places the residual itself has to say."""

import numpy as np

from .. import terms as laws
from ..effects import EFFECTS
from .candidates import Candidate
from .evidence import Evidence
from .regression import Fit

# Standard deviations that a push must stand out by: of ten thousand places, noise reaches five in
# one record of two hundred.
OUTSTANDING = 5.0
# More pushes than this, or more of the time than that, are no isolated ones.
MOST, LARGEST_PART = 12, 0.2


def pulses(evidence: Evidence, now: Fit) -> list[Candidate]:
    """The pushes that stand out of a residual, for the width that makes most of them.

    A matched filter with the pulse's shape at each width; its spread is taken from the median, so
    that the pushes themselves do not raise it (Hampel 1974).
    """
    if not evidence.clock:
        return []
    time = np.asarray(evidence.motion.time)[evidence.centre]
    spacing = 0.5 * evidence.reach
    widths = spacing * np.geomspace(3.0, max(4.0, 0.02 * len(time)), 8)
    best, found = 0.0, None
    for width in widths:
        places, weight = _outstanding(now.residual, time, width, spacing)
        covered = 2 * width * len(places)
        if len(places) and covered <= LARGEST_PART * (time[-1] - time[0]) and weight > best:
            best, found = weight, (places, width)
    if found is None:
        return []
    term = laws.DisturbancePulses(tuple(found[0]), float(found[1]))
    return [Candidate(EFFECTS["disturbance_pulses"], term, np.zeros((1, 0)))]


def _outstanding(residual, time, width, spacing) -> tuple[list[float], float]:
    """Times of the pushes of one width, and how much they stand out together."""
    reach = int(np.ceil(width / spacing))
    shape = (
        np.cos(0.5 * np.pi * np.clip(np.arange(-reach, reach + 1) * spacing / width, -1, 1)) ** 2
    )
    if 2 * len(shape) > len(residual):
        return [], 0.0
    height = np.convolve(residual, shape / np.sqrt(shape @ shape), "same")
    spread = np.median(np.abs(height)) / 0.6745
    size = np.abs(height) / max(spread, 1e-300)
    places, left = [], size.copy()
    for _ in range(MOST + 1):
        peak = int(np.argmax(left))
        if left[peak] < OUTSTANDING:
            return [float(time[i]) for i in sorted(places)], float(np.sum(size[places] ** 2))
        places.append(peak)
        left[max(0, peak - 2 * reach) : peak + 2 * reach + 1] = 0.0
    return [], 0.0
