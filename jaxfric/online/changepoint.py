"""A change among the last strokes: those before every possible moment against those after it.

The change-point model of Hawkins, Qiu & Kang (2003), "The changepoint model for statistical process
control", J. Quality Technology 35, with a covariate. It needs no strokes to learn from, and strokes
after a change do not blur what is known of those before it, as they do in a chart that has just
begun.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .chart import LEARNING, SETTLED, normal

# Strokes that are looked at: twice those that a chart learns from, so that a change while it learns
# still lies in the middle of them when it has learnt.
SPAN = 2 * (SETTLED + LEARNING)
# Strokes before a change and after it: a single one may be disturbed.
FEWEST = 2
# Mean, slope and step are fitted, and two degrees of freedom remain: of one, Student's t has tails
# so wide that no change is significant.
BEGIN = 5
# A stroke's means are sums of up to some million samples, rounded by less than this.
ROUNDING = 1e-9


class Split(NamedTuple):
    """How many `strokes` came after the change, by how much their mean force is higher than that of
    as fast ones before it, N, and the mean force `before` it, N.
    """

    strokes: int
    shift: float
    before: float


def split(
    speed: Float[np.ndarray, " n"], force: Float[np.ndarray, " n"], rate: float
) -> Split | None:
    """Where the strokes of one direction obey two levels of friction, or `None`.

    Their mean force is a line of their mean speed plus a step; the step is tested by Student's t,
    n − 3 degrees of freedom. Over all moments of the step the probability of a false alarm is at
    most `rate` (Bonferroni). **Arguments:** mean speed, m/s, and mean force, N, of each stroke.
    """
    count = len(force)
    if count < BEGIN:
        return None
    off = speed - np.mean(speed)
    level = force - np.mean(force)
    spread = float(off @ off)
    varied = spread > count * (ROUNDING * float(np.max(speed))) ** 2
    if varied:
        level = level - float(off @ level) / spread * off
    before = np.arange(FEWEST, count - FEWEST + 1)
    steps, alike = (np.cumsum(x[::-1])[::-1][before] for x in (level, off))
    size = before * (count - before) / count
    told = size - alike**2 / spread if varied else size
    least = count * (ROUNDING * float(np.max(np.abs(force)))) ** 2
    # A step that the speed makes as well is none.
    usable = told > ROUNDING * size
    gained = np.where(usable, steps**2 / np.where(usable, told, 1.0), 0.0)
    if not least > 0:
        return None
    freedom = count - 3
    remains = np.maximum(float(level @ level) - gained, least)
    ratio = gained / remains
    best = int(np.argmax(ratio))
    score = float(normal(freedom * float(ratio[best]), freedom, np))
    if not len(before) * math.erfc(score / math.sqrt(2)) < rate:
        return None
    at = int(before[best])
    return Split(count - at, float(steps[best] / told[best]), float(np.mean(force[:at])))
