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
    """The position by cubics through its updates, each of which is right when it comes.

    Their slopes are those of parabolas through three updates (Catmull & Rom, "A class of local
    interpolating splines", 1974). Straight lines err by (ωT)²/8 of a wave, with 15 updates T a
    cycle by a fiftieth, and their bends look like forces. `time`, s, and `position`, m, `(N,)`;
    `every`, the samples from one update to the next.
    """
    first = int(np.flatnonzero(np.diff(position) != 0)[0] + 1) % every
    found = np.array(position, float)
    for span in spans(segment):
        start, stop = span.start, span.stop
        fresh = np.arange(start + (first - start) % every, stop, every)
        if len(fresh) > 1:
            clock = time[span] if np.all(np.diff(time[span]) > 0) else np.arange(start, stop)
            found[span] = _through(clock[fresh - start], found[fresh], clock)
    return found


def _through(time: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Cubics through `values` at `time`, `(n,)`, at other times `wanted`, `(m,)`; constant beyond
    the ends.
    """
    slope = np.gradient(values, time, edge_order=2 if len(time) > 2 else 1)
    left = np.clip(np.searchsorted(time, wanted, "right") - 1, 0, len(time) - 2)
    span = time[left + 1] - time[left]
    u = np.clip((wanted - time[left]) / span, 0.0, 1.0)
    rise = values[left + 1] - values[left]
    first, last = span * slope[left] - rise, rise - span * slope[left + 1]
    return values[left] + u * rise + u * (1 - u) * ((1 - u) * first + u * last)
