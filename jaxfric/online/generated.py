"""The update as C99, for a drive that follows its own friction."""

import math
import re
from importlib import resources

from . import chart
from .follower import SETTLED
from .moments import GAP, NODES, WHOLE, start


def c_source(
    slowest: float,
    fastest: float,
    *,
    keep: float = math.inf,
    false_alarms: float = 1e-4,
    nodes: int = NODES,
    name: str = "friction",
) -> str:
    """A self-contained C99 text that does what [`Follower`][jaxfric.online.Follower] does.

    For Coulomb and viscous friction, solved in closed form; forgetting by `keep`, not by a window.
    A state takes 72 bytes a node. **Arguments:** as for [`start`][jaxfric.online.start]; `name`,
    with which all names begin.

    **Raises:** `ValueError` for speeds, times or rates that are none, or no name of C.
    """
    start(slowest, fastest, keep=keep, false_alarms=false_alarms, nodes=nodes)
    if not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
        raise ValueError(f"{name!r} cannot begin a name in C: use letters, digits and _.")
    values = {
        "NAME": name, "NODES": nodes, "SLOWEST": _number(slowest), "FASTEST": _number(fastest),
        "KEEP": _number(keep), "HEIGHT": _number(chart.threshold(false_alarms)),
        "GAP": _number(GAP), "WHOLE": _number(WHOLE), "SLACK": _number(chart.SLACK),
        "SETTLED": SETTLED, "LEARNING": chart.LEARNING,
    }  # fmt: skip
    text = resources.files(__package__).joinpath("follower.c").read_text(encoding="utf-8")
    return re.sub(r"@([A-Z]+)@", lambda found: str(values[found[1]]), text)


def _number(value: float) -> str:
    return "HUGE_VAL" if math.isinf(value) else repr(float(value))
