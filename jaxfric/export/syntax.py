"""How three languages spell the same arithmetic."""

import re
from collections.abc import Mapping
from typing import NamedTuple


def literal(value: float) -> str:
    """A number that reads back as the same double, with a decimal point or an exponent."""
    return repr(float(value))


def signed(value: float) -> str:
    """A number to be subtracted: in parentheses if negative."""
    return f"({literal(value)})" if value < 0 else literal(value)


def identifier(parameter: str) -> str:
    """A parameter's name as an identifier: `coulomb+` becomes `coulomb_plus`."""
    if parameter.endswith(("+", "-")):
        parameter = parameter[:-1] + ("_plus" if parameter.endswith("+") else "_minus")
    return re.sub(r"\W", "_", parameter)


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


C = Syntax(
    functions={"abs": "fabs", "min": "fmin", "max": "fmax", "sign": "sign_of"},
    power="pow({0}, {1})",
    choice="({0} ? {1} : {2})",
    helpers={
        "sign_of": "static double sign_of(double value)\n"
        "{\n    return (double)((value > 0.0) - (value < 0.0));\n}\n"
    },
)
PYTHON = Syntax(
    functions={"sign": "sign_of", "exp": "math.exp", "sin": "math.sin", "cos": "math.cos"},
    power="({0}) ** ({1})",
    choice="({1} if {0} else {2})",
    helpers={"sign_of": "def sign_of(value):\n    return math.tanh(value / SLOW)\n"},
)
MODELICA = Syntax(
    functions={}, power="({0})^({1})", choice="(if {0} then {1} else {2})", helpers={}
)
