"""A clock and a velocity that name another unit than seconds, converted."""

import math
from collections.abc import Mapping

from ..units import factor
from .columns import units as named_units
from .roles import stated_unit

_SECONDS = {"ms": 1e-3, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}


def per_second(
    chosen: Mapping[str, str], scale: Mapping[str, float], units: Mapping[str, str], source: str
) -> tuple[dict[str, float], dict[str, str]]:
    """The factors that make time s, velocity the position's unit per second, that of a neighbour
    too, and a reference that unit; and the units.

    Only names that state a unit are judged, and a role with a `scale` is the user's own word. The
    speed of a turning axis (rpm) without a position is in rad/s then.

    **Arguments:** `chosen`, role to column name; `scale` and `units` as the user gives them.

    **Raises:** `ValueError` where the factor does not follow from the names, with what to give.
    """
    stated = {r: stated_unit(name, r) for r, name in chosen.items() if scale.get(r) is None}
    found, named = {}, dict(units)
    if (time := stated.get("time")) in _SECONDS:
        found["time"] = _SECONDS[time]
    if stated.get("velocity") is not None:
        found |= _own(chosen, scale, units, stated, named, source)
    wanted = named_units(chosen, scale, named).get("position", "m")
    for role in ("reference", "neighbour_velocity"):
        if (unit := stated.get(role)) is None:
            continue
        length, seconds = (unit, 1.0) if role == "reference" else _parts(unit)
        # Of an axis that turns beside one that does not, the unit is the name's own.
        times = 1.0 if wanted == length else factor(length, wanted)
        if times is not None and times != seconds:
            found[role] = times / seconds
    return found, named


def _own(
    chosen: Mapping[str, str],
    scale: Mapping[str, float],
    units: Mapping[str, str],
    stated: Mapping[str, str | None],
    named: dict[str, str],
    source: str,
) -> dict[str, float]:
    """The factor of the velocity, if it needs one; `named` gets the position's unit of a rate."""
    velocity = str(stated["velocity"])
    length, seconds = _parts(velocity)
    wanted = units.get("position") or stated.get("position")
    if wanted is None and not velocity.endswith("rpm"):
        wanted = length
    elif wanted is None:  # an angle beside a torque is in rad
        others = {role: name for role, name in chosen.items() if role != "velocity"}
        known = named_units(others, scale, units).get("position")
        wanted = known if "position" in chosen else "rad"
    if wanted is not None and seconds != 1:
        named["position"] = wanted
    times = 1.0 if wanted == length else factor(length, wanted or "")
    if times is None:
        raise ValueError(_unrelated(chosen, velocity, wanted, source))
    return {} if times == seconds else {"velocity": times / seconds}


def _parts(velocity: str) -> tuple[str, float]:
    """The unit of length or angle in a unit of velocity, and the seconds that it goes by."""
    if velocity.endswith("rpm"):
        return "rev", 60.0 if velocity == "rpm" else 0.06
    length, _, per = velocity.rpartition("/")
    return length, {"s": 1.0, "min": 60.0, "h": 3600.0}[per]


def _unrelated(chosen: Mapping[str, str], velocity: str, wanted: str | None, source: str) -> str:
    column = f"{source}: the column {chosen['velocity']!r} is in {velocity}"
    if wanted is None:
        return (
            f"{column}, but the unit of {chosen['position']!r} is not known. Name it: --units "
            f"position=rad (deg, rev); or give the factor: --scale velocity={math.tau / 60:.12g} "
            "for rad/s."
        )
    return (
        f"{column}, but the position is in {wanted}: one of them needs a factor, --scale "
        "velocity=FACTOR (or position=)."
    )
