"""Laws as text: how a language spells arithmetic, and numbers in it.

A law's text is one expression for each column, of the signals `x`, `v`, `a`, `t` (position,
velocity, acceleration, time), and `f`, the force that the motion needs of a faultless actuator,
for terms that read the signal `predicted_force`; `r`, what of that is no friction, for those that
read `predicted_reaction`. That text and law agree is tested by compiling the one and calling the
other.
"""

from collections.abc import Mapping
from typing import NamedTuple

TURN = 6.283185307179586


def literal(value: float) -> str:
    """A number that reads back as the same double, with a decimal point or an exponent."""
    return repr(float(value))


def signed(value: float) -> str:
    """A number to be subtracted: in parentheses if negative."""
    return f"({literal(value)})" if value < 0 else literal(value)


class Syntax(NamedTuple):
    """The spelling of one language: function names, and templates where it has no function.

    `power` and `choice` are templates of two and three expressions.
    """

    functions: Mapping[str, str]
    power: str
    choice: str
    helpers: Mapping[str, str]

    def call(self, function: str, *arguments: str) -> str:
        """A call of `sign`, `abs`, `exp`, `sin`, `cos`, `min` or `max`."""
        return f"{self.functions.get(function, function)}({', '.join(arguments)})"

    def raised(self, base: str, exponent: str) -> str:
        """`base` to the power of `exponent`, `base` not negative."""
        return self.power.format(base, exponent)

    def choose(self, condition: str, yes: str, no: str) -> str:
        """One of two expressions by a condition."""
        return self.choice.format(condition, yes, no)

    def clip(self, value: str, low: str, high: str) -> str:
        """A value held inside two limits."""
        return self.call("min", self.call("max", value, low), high)

    def waves(self, signal: str, period: str, harmonics: int = 1) -> tuple[str, ...]:
        """Sine and cosine of each harmonic."""
        angles = [f"{literal(n * TURN)} * {signal} / {period}" for n in range(1, harmonics + 1)]
        return tuple(self.call(function, angle) for angle in angles for function in ("sin", "cos"))
