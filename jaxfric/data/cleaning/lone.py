"""Lone samples that no motion or actuator made: of the sensor, the bus or the file."""

import numpy as np

from .pieces import adjacent, some

# A drive's peak force is three to four times what it works with: a lone sample ten times beyond all
# but a thousandth of the others was made by no actuator.
LONE, BEYOND, RAREST = 3, 10.0, 1e-3
# Of fewer samples those three are no small part.
FEWEST = 100
# From one end of its range to the other goes a position modulo a turn, at rest beside the seam.
SEAM = 0.9


def lone(values: np.ndarray) -> np.ndarray:
    """Samples that no motion or actuator made: at most three in a row, far beyond all others."""
    found = _far(values)
    ends = np.flatnonzero(np.diff(np.pad(found, 1).astype(np.int8)))
    for first, last in zip(ends[::2], ends[1::2], strict=True):
        if last - first > LONE:
            found[first:last] = False
    return found


def _far(values: np.ndarray, each: int = 1) -> np.ndarray:
    """Values ten times as far from the median as all others but for a thousandth of the samples,
    of which each makes so many values.
    """
    middle = np.median(values)
    size = values - middle
    np.abs(size, out=size)
    at = len(size) - 1 - each * beyond_usual(len(size))
    size.partition(at)  # in place: of a long recording each copy counts
    usual = size[at]
    np.abs(np.subtract(values, middle, out=size), out=size)
    return (size > BEYOND * usual) & (usual > 0)


def beyond_usual(count: int) -> int:
    """How many of so many samples may lie beyond the usual ones."""
    return max(LONE, int(RAREST * count))


def far_forces(force: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Which of the known samples have a force that no actuator made, `(N,)`."""
    found = np.zeros_like(known)
    if np.count_nonzero(known) > 2 * LONE:
        found[known] = lone(some(force, known))
    return found


def lone_samples(
    signals: dict[str, np.ndarray], mask: np.ndarray, segment: np.ndarray
) -> dict[str, np.ndarray]:
    """The lone samples of force, position and velocity, `(N,)` each; of signals that have some.

    At most three in a row: a force far beyond all others; a position or velocity that goes where no
    motion does, and back. A velocity does so by more than the top speed.
    """
    if np.count_nonzero(mask) < FEWEST:
        return {}
    found = {"force": far_forces(signals["force"], mask)} if "force" in signals else {}
    linked = adjacent(signals["time"], mask, segment)
    whole = linked[1:] & linked[:-1]
    if np.count_nonzero(whole) > FEWEST:
        if "position" in signals:
            found["position"] = _strays(signals["position"], whole, 0.0)
        if "velocity" in signals:
            top = float(np.quantile(np.abs(signals["velocity"]), 0.98))
            found["velocity"] = _strays(signals["velocity"], whole, top)
    return {role: bad for role, bad in found.items() if bad.any()}


def _strays(values: np.ndarray, whole: np.ndarray, least: float) -> np.ndarray:
    """Samples that go far and back, `(N,)`: the second difference is far beyond all others around
    them, and is not where they are on a straight line.

    `whole`, where that difference is known, `(N - 2,)`; `least`, what it has to exceed.
    """
    bend = np.diff(values, 2)
    beyond = np.zeros_like(whole)
    beyond[whole] = _far(some(bend, whole), LONE + 2)
    at = np.flatnonzero(beyond)
    astray = []
    for group in np.split(at, np.flatnonzero(np.diff(at) > LONE) + 1):
        if not len(group) or not 2 <= group[-1] - group[0] <= LONE + 1:
            continue
        # The second difference i is around the sample i + 1: the last good one, and the next.
        before, after = group[0] + 1, group[-1] + 1
        largest = np.max(np.abs(bend[group]))
        line = values[before - 1 : after + 2].copy()
        line[1:-1] = np.linspace(values[before], values[after], after - before + 1)
        if largest > least and np.all(np.abs(np.diff(line, 2)) < largest / BEYOND):
            astray.append(slice(before + 1, after))
    found = np.zeros(len(values), bool)
    for samples in astray:
        found[samples] = True
    if astray:
        low, high = np.min(values[~found]), np.max(values[~found])
        for samples in astray:
            own = values[samples]
            inside = low <= np.min(own) and np.max(own) <= high
            if inside and abs(own[0] - values[samples.start - 1]) > SEAM * (high - low):
                found[samples] = False
    return found
