"""A chart that says when the mean of a sequence has changed, with a stated false-alarm rate.

Self-starting cumulative sums (Hawkins 1987, "Self-starting CUSUM charts for location and scale",
The Statistician 36): each value is compared with the mean and the deviation of those before it,
which for independent normal values gives exactly independent standard normal scores, though nothing
is known in advance. Their two cumulative sums run against the threshold of Siegmund (1985).
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

# Half of the shift, in deviations, that the sums find soonest: one deviation.
SLACK = 0.5
# Values that only feed mean and deviation: with fewer degrees of freedom the scores say little.
LEARNING = 8
# Strokes of a direction from which the curve is identified that the values are compared with.
SETTLED = 8


class Chart(NamedTuple):
    """Charts side by side, each field `(...)`: the number of values, their mean, the sum of squared
    deviations, and the two cumulative sums, upward and downward, in deviations.
    """

    number: Float[Array, "..."]
    mean: Float[Array, "..."]
    square: Float[Array, "..."]
    up: Float[Array, "..."]
    down: Float[Array, "..."]


def empty(like: Float[Array, "..."]) -> Chart:
    """Charts that have seen nothing, as many as `like` has entries."""
    zero = jnp.zeros_like(like)
    return Chart(zero, zero, zero, zero, zero)


def threshold(rate: float) -> float:
    """The height at which a sum alarms, for `rate` false alarms a value of one chart.

    The mean number of values to a false alarm of both sums is half of Siegmund's
    (e^{2kb} − 1 − 2kb)/2k², b = h + 1.166, k = 1/2 (Siegmund 1985, eq. 2.57).

    **Raises:** `ValueError` unless the rate is between 0 and 0.1.
    """
    if not 0 < rate <= 0.1:
        raise ValueError(f"A rate of false alarms is over 0 and up to 0.1 a cycle, not {rate!r}.")
    wanted, low, high = 2 / rate, 0.0, 200.0
    for _ in range(100):
        middle = 0.5 * (low + high)
        exponent = 2 * SLACK * middle
        length = (math.exp(exponent) - 1 - exponent) / (2 * SLACK**2)
        low, high = (middle, high) if length < wanted else (low, middle)
    return 0.5 * (low + high) - 1.166


def add(
    chart: Chart, value: Float[Array, "..."], height: float
) -> tuple[Chart, Bool[Array, "..."]]:
    """The chart with one more value, and whether it alarms; an alarm starts it anew."""
    moved, alarm = _add(chart, value, height, jnp)
    fresh = jax.tree.map(jnp.zeros_like, moved)
    return jax.tree.map(lambda new, old: jnp.where(alarm, new, old), fresh, moved), alarm


def _add(chart: Chart, value, height, numpy):
    """The same in another array library, without starting anew."""
    count, mean, square, up, down = chart
    score = numpy.where(count >= LEARNING, _score(count, mean, square, value, numpy), 0.0)
    up = numpy.maximum(0.0, up + score - SLACK)
    down = numpy.maximum(0.0, down - score - SLACK)
    off = value - mean
    mean = mean + off / (count + 1)
    square = square + off * (value - mean)
    return Chart(count + 1, mean, square, up, down), numpy.maximum(up, down) > height


def _score(count, mean, square, value, numpy):
    """The standard normal score of a value, by Student's t of the values before it.

    T = √(n/(n+1)) (x − mean)/s has n − 1 degrees of freedom.
    """
    freedom = numpy.maximum(count - 1, 1.0)
    variance = square / freedom
    safe = numpy.where(variance > 0, variance, 1.0)
    size = normal(count / (count + 1) * (value - mean) ** 2 / safe, freedom, numpy)
    return numpy.where(variance > 0, numpy.sign(value - mean) * size, 0.0)


def normal(square, freedom, numpy):
    """The magnitude of the standard normal as improbable as a Student's t (Wallace 1959).

    z = (8ν+1)/(8ν+3) √(ν ln(1 + T²/ν)) of T² `square`, ν `freedom`.
    """
    size = (8 * freedom + 1) / (8 * freedom + 3)
    return size * numpy.sqrt(freedom * numpy.log1p(square / freedom))
