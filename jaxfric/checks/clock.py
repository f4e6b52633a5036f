"""The clock of a recording, found once for all checks of it."""

from typing import NamedTuple

import numpy as np


class Clock(NamedTuple):
    """The sampling interval, s, and whether sample i and i + 1 belong together, `(N - 1,)`."""

    interval: float
    linked: np.ndarray
