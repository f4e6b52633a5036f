"""Lone samples that no motion or actuator made, and how many samples a test needs."""

import numpy as np

# A drive's peak force is three to four times what it works with: a lone sample ten times beyond all
# but a thousandth of the others was made by no actuator.
LONE, BEYOND, RAREST = 3, 10.0, 1e-3
# Samples in a span over which a force and what the velocity gains are compared.
SPAN = 16
# Pieces of fewer samples hold no kernel.
PIECE = 32
# The shortest kernel of the weak form reaches 16 samples each way: of a cycle that is no longer it
# averages most of the motion away.
CYCLE = 16


def lone(values: np.ndarray) -> np.ndarray:
    """Samples that no motion or actuator made: at most three in a row, far beyond all others."""
    middle = np.median(values)
    size = values - middle
    np.abs(size, out=size)
    at = len(size) - 1 - beyond_usual(len(size))
    size.partition(at)  # in place: of a long recording each copy counts
    usual = size[at]
    np.abs(np.subtract(values, middle, out=size), out=size)
    far = (size > BEYOND * usual) & (usual > 0)
    ends = np.flatnonzero(np.diff(np.pad(far, 1).astype(np.int8)))
    for first, last in zip(ends[::2], ends[1::2], strict=True):
        if last - first > LONE:
            far[first:last] = False
    return far


def beyond_usual(count: int) -> int:
    """How many of so many samples may lie beyond the usual ones."""
    return max(LONE, int(RAREST * count))
