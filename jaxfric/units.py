"""Units: a parameter has a dimension in (force, position, time); a recording says their names.

Nothing here computes with units. Numbers stay in the recording's own units throughout; this
module only writes the unit beside the number.
"""

from typing import NamedTuple


class Dimension(NamedTuple):
    """Exponents of force, position and time."""

    force: int = 0
    position: int = 0
    time: int = 0


DIMENSIONLESS = Dimension()
FORCE = Dimension(force=1)
POSITION = Dimension(position=1)
TIME = Dimension(time=1)
VELOCITY = Dimension(position=1, time=-1)
ACCELERATION = Dimension(position=1, time=-2)
FREQUENCY = Dimension(time=-1)
STIFFNESS = Dimension(force=1, position=-1)
DAMPING = Dimension(force=1, position=-1, time=1)
INERTIA = Dimension(force=1, position=-1, time=2)

SI = {"force": "N", "position": "m"}
_ROTARY_FORCES = ("N·m", "N*m", "Nm")


def is_rotary(units: dict[str, str]) -> bool:
    """Whether the axis turns: an angle for a position, or a torque for a force."""
    return units["position"] in ("rad", "deg", "rev") or units["force"] in _ROTARY_FORCES


def spell(dimension: Dimension, units: dict[str, str] | None = None) -> str:
    """The unit of a dimension, in the names of a recording.

    **Arguments:** `dimension`, exponents of force, position, time; `units`, the names of the
    force and the position unit (default newton and metre).

    **Returns:** for instance `"N·s/m"`; `"kg"` and `"kg·m²"` where the names allow it.
    """
    units = SI | (units or {})
    if dimension == INERTIA:
        if units == SI:
            return "kg"
        if units["force"] in _ROTARY_FORCES and units["position"] == "rad":
            return "kg·m²"
    names = (units["force"], "s", units["position"])
    exponents = (dimension.force, dimension.time, dimension.position)
    parts = list(zip(names, exponents, strict=True))
    over = "·".join(_power(name, exponent) for name, exponent in parts if exponent > 0)
    under = [_power(name, -exponent) for name, exponent in parts if exponent < 0]
    if not under:
        return over or "1"
    below = under[0] if len(under) == 1 else "(" + "·".join(under) + ")"
    return f"{over or '1'}/{below}"


def _power(name: str, exponent: int) -> str:
    superscript = {1: "", 2: "²", 3: "³", 4: "⁴"}[exponent]
    return f"({name}){superscript}" if superscript and "·" in name else name + superscript
