"""The update as C99, for a drive that follows its own friction."""

import math
import re
from importlib import resources

from . import changepoint, chart
from .moments import ABOVE, GAP, NODES, WHOLE, start


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
    A state takes 72 bytes a node and 1.5 kB. **Arguments:** as for
    [`start`][jaxfric.online.start]; `name`, with which all names begin.

    **Raises:** `ValueError` for speeds, times or rates that are none, or no name of C.
    """
    start(slowest, fastest, keep=keep, false_alarms=false_alarms, nodes=nodes)
    if not re.fullmatch(r"[A-Za-z]\w*", name, re.ASCII):
        raise ValueError(f"{name!r} cannot begin a name in C: use letters, digits and _.")
    values = {
        "NAME": name, "NODES": nodes, "SLOWEST": _number(slowest), "FASTEST": _number(fastest),
        "KEEP": _number(keep), "HEIGHT": _number(chart.threshold(0.5 * false_alarms)),
        "GAP": _number(GAP), "WHOLE": _number(WHOLE), "SLACK": _number(chart.SLACK),
        "SETTLED": chart.SETTLED, "LEARNING": chart.LEARNING, "ABOVE": _number(ABOVE),
        "RATE": _number(0.5 * false_alarms), "SPAN": changepoint.SPAN, "BEGIN": changepoint.BEGIN,
        "FEWEST": changepoint.FEWEST, "ROUNDING": _number(changepoint.ROUNDING),
    }  # fmt: skip
    text = resources.files(__package__).joinpath("follower.c").read_text(encoding="utf-8")
    return re.sub(r"@([A-Z]+)@", lambda found: str(values[found[1]]), text)


def _number(value: float) -> str:
    return "HUGE_VAL" if math.isinf(value) else repr(float(value))
