"""A position that is logged at a lower rate than the force, and held between its updates."""

import numpy as np

from .pieces import spans

# Changes of the position that all fall on multiples of one number of samples: an encoder that is
# coarse changes at any sample, and so many times at every second one by a chance of 2⁻³¹.
ENOUGH = 32


def held_for(position: np.ndarray) -> int:
    """For how many samples a position keeps each value, as a logger holds it; 1 where it does not.

    Where the axis stands or its encoder is coarse a value stays longer, for a multiple of that.
    """
    changes = np.flatnonzero(np.diff(position) != 0) + 1
    if len(changes) <= ENOUGH:
        return 1
    return int(np.gcd.reduce(np.diff(changes)))


def between_updates(
    time: np.ndarray, position: np.ndarray, segment: np.ndarray, every: int
) -> np.ndarray:
    """The position straight between its updates, each of which is right when it comes."""
    first = int(np.flatnonzero(np.diff(position) != 0)[0] + 1) % every
    found = np.array(position, float)
    for span in spans(segment):
        start, stop = span.start, span.stop
        fresh = np.arange(start + (first - start) % every, stop, every)
        if len(fresh) > 1:
            found[span] = np.interp(time[span], time[fresh], position[fresh])
    return found
