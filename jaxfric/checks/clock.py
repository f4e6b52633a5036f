"""The clock of a recording, found once for all checks of it."""

from typing import NamedTuple

import numpy as np

from .. import signals
from ..data.recording import Recording


class Clock(NamedTuple):
    """The sampling interval, s, and whether sample i and i + 1 belong together, `(N - 1,)`."""

    interval: float
    linked: np.ndarray


def clock_of(recording: Recording) -> Clock:
    """The clock of a recording, signals of shape `(N,)`."""
    interval = signals.host_interval(recording)
    return Clock(interval, signals.host_continuous(recording, interval))
