"""Values as an engineer writes them: with a prefix, half their 95 % interval, per revolution."""

import math

from ..identification.uncertainty import Estimate
from ..units import TURNS

# Smaller units, by the unit that a value is in; a value takes the first that makes it at least one.
_SMALLER = {
    "m": (("mm", 1e-3), ("µm", 1e-6)),
    "s": (("ms", 1e-3), ("µs", 1e-6)),
    "N": (("mN", 1e-3),),
    "N·m": (("mN·m", 1e-3), ("µN·m", 1e-6)),
    "A": (("mA", 1e-3),),
}
UNSEEN = "an amount that this recording cannot tell"
# What is not known, in words, by its unit.
_KINDS = {"Hz": "a frequency", "1/s": "a frequency", "s": "a time"}
# Below this, a smaller unit is used.
SMALL = 0.05


def quantity(estimate: Estimate, smaller: bool = True) -> str:
    """A value with its unit and half its 95 % interval: "1.90 N ± 0.20 N".

    `smaller`: in a smaller unit where it is small; not so beside another value.
    """
    value, error = float(estimate.value), float(estimate.standard_error)
    if math.isinf(error):  # the data cannot see it, and its value is any
        return unseen(estimate)
    half = float(estimate.half_width()) if error > 0 else 0.0
    name, scale = _unit(estimate.unit, max(abs(value), half) if smaller else 1.0)
    value, half = value / scale, half / scale
    unit = f" {name}" if name not in ("", "1") else ""
    if not half > 0:
        return f"{value:.3g}{unit}"
    digits = max(0, 1 - math.floor(math.log10(half)))
    if abs(value) >= 1e5 or 0 < abs(value) < 1e-3:
        return f"{value:.3g}{unit} ± {half:.1g}{unit}"
    return f"{value:.{digits}f}{unit} ± {half:.{digits}f}{unit}"


def unseen(estimate: Estimate) -> str:
    """In place of a value that is not known: "a time that this recording cannot tell"."""
    return UNSEEN.replace("an amount", _KINDS.get(estimate.unit, "an amount"))


def _unit(unit: str, size: float) -> tuple[str, float]:
    """The unit to write a value of that size in, and what one of it is in the given unit."""
    if unit == "1/s":
        return "Hz", 1.0
    if not 0 < size < SMALL:
        return unit, 1.0
    for smaller in _SMALLER.get(unit, ()):
        if size >= smaller[1]:
            return smaller
    return _SMALLER[unit][-1] if unit in _SMALLER else (unit, 1.0)


def nil(estimate: Estimate) -> bool:
    """Whether a size may be nil: it is no larger than half its interval, as they are written."""
    value, half = abs(float(estimate.value)), float(estimate.half_width())
    return 0 < half < math.inf and value <= 1.05 * half


def per_pole_pair(period: Estimate, pairs: int) -> str:
    """How often a period of an angle goes into a pole pair: " That is 6 times per pole pair."."""
    count, times = _count(period, pairs)
    if times:
        return f" That is {times} per pole pair."
    text = f" That is {count:.3g} times per pole pair, so not of the electrical period."
    return text if count else ""


def turns(period: Estimate) -> str:
    """How often a period of an angle goes into a revolution: " (5 times per revolution)"."""
    count, times = _count(period)
    if times:
        return f" ({times} per revolution)"
    return f" ({count:.3g} per revolution)" if count else ""


def _count(period: Estimate, parts: int = 1) -> tuple[float, str]:
    """How often a period of an angle goes into a part of a revolution, 0 where it is none of an
    angle, and that in words where it is a whole number, as a wave of the motor or its gear does.
    """
    turn = TURNS.get(period.unit)
    value, error = float(period.value), float(period.half_width())
    if turn is None or not value > 0 or not math.isfinite(error) or value > 1.5 * turn:
        return 0.0, ""
    count, half = turn / value / parts, turn * error / value**2 / parts
    whole = round(count)
    if not whole or abs(count - whole) > max(half, 0.01 * whole):
        return count, ""
    return count, "once" if whole == 1 else f"{whole} times"


def rise(before: float, after: float) -> str:
    """Two errors in words, "2.312% to 2.314%", with the digits that tell them apart, up to four."""
    apart = (d for d in (2, 3) if round(100 * before, d) != round(100 * after, d))
    digits = next(apart, 4)
    return f"{before:.{digits}%} to {after:.{digits}%}"


# A larger error tells no more than that it is larger.
MOST_PERCENT = 10.0


def percent(error: float) -> str:
    """A force error relative to the force: "12.30%", and "over 1000%" beyond that."""
    return f"{error:.2%}" if error <= MOST_PERCENT else f"over {MOST_PERCENT:.0%}"
