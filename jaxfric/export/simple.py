"""A joint with dry friction, damping and (for some) a spring: what simulators of robots know."""

from typing import Any, NamedTuple

import numpy as np

from ..models import Model
from ..units import is_rotary
from . import cost
from .cost import Range
from .outcome import ForceError
from .parts import Part, burst, left_out, levels, parts


class Joint(NamedTuple):
    """The joint nearest to a model.

    `friction` F, `damping` D: F sign(v) + D v. `inertia` M. `stiffness` k and `rest` x₀ of a
    spring k (x − x₀), zero where the target has none. In the units of the model.
    """

    friction: float
    damping: float
    inertia: float
    stiffness: float
    rest: float
    rotary: bool
    force_error: ForceError
    left_out: tuple[str, ...]
    remarks: tuple[str, ...]
    speed: Range


def joint(
    model: Model, speed: Range | None = None, position: Range | None = None, spring: bool = False
) -> Joint:
    """Fit the joint to the model's slip friction and count what it lacks.

    **Arguments:** `speed`, `position`: the ranges to fit and count over (default: those of the
    model, [`cost.speed_range`][] and [`cost.natural`][]); `spring`, whether the target has one.
    """
    known = cost.ranges(model, speed, position)
    where = cost.motion(known)
    counted = cost.forces(model, known, where)
    velocity = np.asarray(where.recording.velocity, float)
    slips = [counted[part.key] for part in parts(model) if part.slips]
    slip = sum(slips, np.zeros_like(velocity))
    level, slope = cost.fit(velocity, slip, where.weight)
    stiffness, rest, sprung = _spring(model, spring)
    given = level * np.sign(velocity) + slope * velocity
    given += sum(
        (counted[part.key] for part in sprung if part.key in counted), np.zeros_like(velocity)
    )
    constant = 0.0
    if sprung:  # that of the spring, which a model has as an offset or between both directions
        constant = float(np.average(slip - level * np.sign(velocity) - slope * velocity,
                                    weights=where.weight))  # fmt: skip
        rest, given = rest - constant / stiffness, given + constant
        sprung += [part for part in parts(model) if part.law.in_joint == "constant"]
    wanted = sum(counted.values(), np.zeros_like(velocity))
    missing = _missing(model, sprung)
    bursts = sum(burst(model, part) for part in missing)
    unit = dict(model.units)["force"]
    return Joint(
        level,
        slope,
        sum(_inertia(model)),
        stiffness,
        rest,
        is_rotary(dict(model.units)),
        cost.error(where, wanted, given, unit, bursts),
        (*(_told(model, part, counted, where, unit) for part in missing), *_stick(model)),
        (*_units(model), *_shifted(model, constant, rest)),
        known["velocity"],
    )


def _stick(model: Model) -> list[str]:
    """That a joint's dry friction is one level, at rest and in slip."""
    return [
        f"{name}: {value:.4g} {unit}; the joint sticks at the level at which it slips"
        for name, value, unit in levels(model)
    ]


def _shifted(model: Model, constant: float, rest: float) -> tuple[str, ...]:
    """That a spring holds a constant force, for which a joint has no other place."""
    units = dict(model.units)
    if abs(constant) < 1e-9:
        return ()
    return (
        f"The constant force of {constant:.4g} {units['force']} is in the spring, which rests at "
        f"{rest:.4g} {units['position']}.",
    )


def _inertia(model: Model) -> list[float]:
    held = [part for part in parts(model) if part.law.in_joint == "inertia"]
    return [float(model.parameters[part.affine[0]]) for part in held]


def _spring(model: Model, wanted: bool) -> tuple[float, float, list[Part]]:
    """Stiffness, rest and parts of the spring; none where it pushes away, which no joint holds."""
    for part in parts(model):
        if wanted and part.term.in_joint == "spring":
            stiffness = float(model.parameters[part.affine[0]])
            spring: Any = part.term
            if stiffness > 0:
                return stiffness, spring.rest, [part]
    return 0.0, 0.0, []


def _missing(model: Model, sprung: list[Part]) -> list[Part]:
    held = {part.key for part in sprung}
    taken = ("friction", "damping", "inertia")
    return [p for p in parts(model) if p.law.in_joint not in taken and p.key not in held]


def _told(model: Model, part: Part, counted, where: cost.Motion, unit: str) -> str:
    """One part that the joint lacks, with its size."""
    if part.key in counted:
        force = counted[part.key]
        size = f"{where.rms(force):.3g} {unit} rms, {np.max(np.abs(force)):.3g} {unit} at most"
        taken_up = part.slips and part.law.in_joint != "constant"
        return f"{part.name}: {size}" + ", before the fit takes up what it can" * taken_up
    if most := burst(model, part):
        return f"{part.name}: up to {most:.3g} {unit} around a reversal, in the worst case only"
    if part.remembered or not part.sampled:
        return f"{left_out(model, part)} (not counted)"
    if "acceleration" in part.term.coordinates:
        return f"{part.name}: not counted, for it depends on acceleration"
    return f"{part.name}: not counted without the range of the position (--position LOW:HIGH)"


def _units(model: Model) -> tuple[str, ...]:
    units = dict(model.units)
    si = ("N·m", "N*m", "Nm") if is_rotary(units) else ("N",)
    if units["force"] in si and units["position"] in ("m", "rad"):
        return ()
    return (
        f"Numbers are in {units['force']}, {units['position']} and s, as in the model; the target "
        "expects SI units: identify with --scale and --units to have them.",
    )
