"""How three languages spell the same arithmetic."""

import re

from ..terms.text import Syntax as Syntax, literal as literal, signed as signed


def identifier(parameter: str) -> str:
    """A parameter's name as an identifier: `coulomb+` becomes `coulomb_plus`."""
    if parameter.endswith(("+", "-")):
        parameter = parameter[:-1] + ("_plus" if parameter.endswith("+") else "_minus")
    return re.sub(r"\W", "_", parameter)


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
