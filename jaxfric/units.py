"""Units: a parameter has a dimension in (force, position, time); a recording says their names.

Nothing here computes with units. Numbers stay in the recording's own units throughout; this
module only writes the unit beside the number.
"""

import math
from collections.abc import Mapping
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


TURNS = {"rad": 2 * math.pi, "deg": 360.0, "rev": 1.0}
"""What angles count a revolution as."""

# What one of a unit is in the first unit of its kind.
_KINDS: tuple[Mapping[str, float], ...] = (
    {"m": 1, "km": 1e3, "cm": 1e-2, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9, "in": 0.0254, "ft": 0.3048},
    {
        "rad": 1, "mrad": 1e-3, "µrad": 1e-6, "rev": 2 * math.pi, "deg": math.pi / 180,
        "mdeg": math.pi / 180e3, "arcmin": math.pi / 10800, "arcsec": math.pi / 648000,
    },
    {
        "N": 1, "kN": 1e3, "MN": 1e6, "daN": 10, "cN": 1e-2, "mN": 1e-3, "µN": 1e-6,
        "lbf": 4.4482216153, "kgf": 9.80665,
    },
    {
        "N·m": 1, "mN·m": 1e-3, "µN·m": 1e-6, "kN·m": 1e3, "MN·m": 1e6, "cN·m": 1e-2, "N·cm": 1e-2,
        "N·mm": 1e-3, "lbf·ft": 1.3558179483, "lbf·in": 0.112984829, "ozf·in": 0.00706155181,
        "kgf·m": 9.80665, "kgf·cm": 0.0980665,
    },
    {"A": 1, "mA": 1e-3, "µA": 1e-6},
    {"V": 1, "mV": 1e-3},
)  # fmt: skip
TORQUES = frozenset(next(kind for kind in _KINDS if "N·m" in kind))
"""Units of torque."""
CURRENTS = frozenset(next(kind for kind in _KINDS if "A" in kind))
"""Units of current."""


def factor(unit: str, other: str) -> float | None:
    """What one of `unit` is in the `other`, or `None` where they are not of one kind."""
    kind = next((kind for kind in _KINDS if unit in kind and other in kind), None)
    return None if kind is None else kind[unit] / kind[other]


def written_factor(unit: str, other: str) -> str:
    """[`factor`][] as `--scale` takes it, or the word FACTOR where it is not known."""
    times = factor(unit, other)
    return "FACTOR" if times is None else f"{times:.12g}"


def check_same(
    ours: Mapping[str, str], theirs: Mapping[str, str], name: str, other: str, option: str = "scale"
) -> None:
    """Refuse a comparison of numbers in different units.

    Newton and metre are also what is taken where nothing is stated: beside a unit of another kind
    (an angle, a current) they give way.

    **Arguments:** the names of the force and the position unit of both sides; `name` and `other`,
    what these are, for the message; `option`, which factor of the other to give.

    **Raises:** `ValueError` with the factor.
    """
    for quantity, unit in theirs.items():
        wanted = ours[quantity]
        times = factor(unit, wanted)
        if unit == wanted or (times is None and SI[quantity] in (unit, wanted)):
            continue
        number = written_factor(unit, wanted)
        raise ValueError(
            f"{other}: {quantity} is in {unit}, but in {wanted} in {name}, and both are to be "
            f"compared. Convert: --{option} {quantity}={number} (in Python, jf.read(..., "
            f"scale={{{quantity!r}: {number}}}, units={{{quantity!r}: {wanted!r}}})); or, if the "
            f"numbers are alike, name one unit for both: --units {quantity}={wanted}."
        )


def is_rotary(units: dict[str, str]) -> bool:
    """Whether the axis turns: an angle for a position, or a torque for a force."""
    return units["position"] in ("rad", "deg", "rev") or units["force"] in _ROTARY_FORCES


def spell(dimension: Dimension | str, units: dict[str, str] | None = None) -> str:
    """The unit of a dimension, in the names of a recording.

    **Arguments:** `dimension`, exponents of force, position, time, or a unit's own name; `units`,
    the names of the force and the position unit (default newton and metre).

    **Returns:** for instance `"N·s/m"`; `"kg"` and `"kg·m²"` where the names allow it.
    """
    if isinstance(dimension, str):
        return dimension
    if dimension == FREQUENCY:
        return "Hz"
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
