"""What of a residual is the loop's answer to the counts of the encoder."""

import numpy as np
from jaxtyping import Bool, Float

from .. import signals
from ..data.excerpt import MOST
from ..simulation.prediction import Prepared

# The answer to a count is looked for among so many samples before and after it: it is over within a
# few cycles of the controller (12 took 66 %, 24 took 68 % of a residual), and a slower loop answers
# the motion that is seen.
LAGS = 24
# Samples that are enough for as many numbers as there are lags.
ENOUGH = 1 << 16
# A rounding error is half a count at most, and the smooth motion's own error as much: what differs
# by more is motion.
ROUNDED = 1.0


def answered(
    rest: Float[np.ndarray, " N"], moving: Bool[np.ndarray, " N"], motion: Prepared
) -> float:
    """The part of the power of a residual `rest`, N, that answers the rounding of the position.

    A controller answers each count with a force that accelerates the axis by less than a count
    shows, so that the recorded motion does not hold it. By least squares on the rounding error, the
    position less a smooth one, some samples before and after. Of the samples `moving`, where no
    other motion shows beside the counts; zero where the position is not counted, or such are few.
    """
    place = motion.recorded.position
    if place is None:
        return 0.0
    rest, moving = rest[:MOST], moving[:MOST]
    position = np.asarray(place, float)[: len(rest)]
    count = signals.count_of(position)
    half, degree = motion.choices[0].half_width, motion.choices[0].degree
    if not count or len(rest) < 2 * (half + LAGS):
        return 0.0
    powers = np.vander(np.arange(-half, half + 1) / half, degree + 1, increasing=True)
    error = position - np.convolve(position, np.linalg.pinv(powers)[0][::-1], "same")
    inner = np.zeros_like(moving)
    inner[half + LAGS : -half - LAGS] = moving[half + LAGS : -half - LAGS]
    moved = np.abs(error) > ROUNDED * count
    calm = inner & (np.convolve(moved, np.ones(2 * LAGS + 1), "same") < 0.5)
    if np.count_nonzero(calm) < 0.5 * np.count_nonzero(inner) or not calm.any():
        return 0.0
    chosen = np.flatnonzero(calm)
    chosen = chosen[:: -(-len(chosen) // ENOUGH)]
    lags = error[chosen[:, None] + np.arange(-LAGS, LAGS + 1)]
    answer = lags @ np.linalg.lstsq(lags, rest[chosen], rcond=None)[0]
    share = np.count_nonzero(calm) / len(chosen)
    return float(share * (answer @ answer) / max(float(rest[inner] @ rest[inner]), 1e-300))
