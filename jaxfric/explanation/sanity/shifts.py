"""A force that is late by more than a row: whole nodes, beside what any values make of it."""

from collections.abc import Sequence

import numpy as np

from ...terms import KNOWN_FEEDBACK
from ..least_squares import orthonormal
from ..predictions import rate
from .rows import Rows, nodes

# What a clock has to leave of what all other values leave, by itself and beside them.
HALVED = 0.5
# Shifts of up to this part of the record are tried.
FARTHEST = 8


def shift_of(rows: Sequence[Rows]) -> float:
    """How late the force is, s, where whole nodes halve what any values leave; else zero.

    A gain, inertia, friction and a constant are fitted beside each shift: where values are wrong,
    a force of the wrong size is near a shifted one too, above all where the motion repeats.
    """
    step = min(each.evidence.reach for each in rows) / 6
    first = nodes(rows[0])
    even = np.arange(first[0], first[-1], step)
    most = len(even) // FARTHEST
    inner = slice(most, len(even) - most)
    pairs = []
    for each in rows:
        at, motion = nodes(each), each.evidence.motion
        known = np.asarray(motion.channels["known_force"], float)
        speed = np.asarray(motion.velocity, float)
        plain = known, rate(each.evidence, speed), speed, np.sign(speed), np.ones_like(speed)
        columns = [np.interp(even, at, x) for x in plain]
        force = each.weight * np.interp(even, at, np.asarray(motion.force, float))
        state = np.asarray(motion.channels.get(KNOWN_FEEDBACK, np.zeros_like(speed)), float)
        state = each.weight * np.interp(even, at, state)
        pairs.append((force - state, state, orthonormal(np.stack(columns, axis=1)[inner])))

    def left(shift: int) -> float:
        moved = [((np.roll(f, -shift) + state)[inner], basis) for f, state, basis in pairs]
        return sum(float(force @ force - np.sum((basis.T @ force) ** 2)) for force, basis in moved)

    tried = {shift: left(shift) for shift in range(-most, most + 1)}
    best = min(tried, key=lambda shift: tried[shift])
    return best * step if tried[best] < HALVED * tried[0] and best > 0 else 0.0
