"""The rows of the table of sanity, each in its own words."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...identification.uncertainty import Estimate
from ...simulators import Mujoco
from ...terms.effects.end_stop import END_STOP, place
from ...terms.effects.force_limit import FORCE_LIMIT
from ...terms.effects.late import CLOCK, SENSOR_FILTER
from ...terms.effects.position_zero import POSITION_ZERO
from ...units import CURRENTS
from ..acceptance import LINEARITY
from ..quantities import quantity
from ..sentences import of_constant
from . import limits
from .contact import Contact
from .faults import DRIFT, LEAVES, OFFSET, ZERO, FaultSearch
from .rows import Part
from .wiring import Wiring


class Check(NamedTuple):
    """One thing that was looked at.

    - `effect`: its public name; `text`: what there is to say; `wrong`, `None` where that cannot be
      told, and whether nothing can be named beside it, `severe`.
    - `value` where it is one, as the `parameter`; `attribute`, the simulator's own name; `share`,
      of the mismatch, where it is this one's alone.
    """

    effect: str
    text: str
    wrong: bool | None = False
    severe: bool = False
    value: Estimate | None = None
    parameter: str = ""
    attribute: str | None = None
    confusable: tuple[str, ...] = ()
    separate_by: str = ""
    share: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """The row as plain data."""
        return {
            "check": self.effect, "wrong": self.wrong, "value": self.value and self.value.to_dict(),
            "text": self.text, "attribute": self.attribute,
        }  # fmt: skip


def _half(error: float) -> float:
    """Half the 95 % interval."""
    return float(Estimate(np.float64(0.0), np.float64(error), "").half_width())


def checks_of(
    part: Part, seen: FaultSearch, bound: Estimate | None, blocked: Sequence[Contact], wired: Wiring
) -> list[Check]:
    """The table of one joint."""
    return [
        _wiring(part, wired.said, wired.everywhere),
        *_gain(part, seen),
        *_zeros(part, seen),
        _clock(part, seen),
        _limit(part, bound),
        *map(_blocked, blocked),
        *_ends(part),
    ]


def _wiring(part: Part, said: Mapping[str, str], everywhere: bool) -> Check:
    if part.name in said:
        return Check("columns", said[part.name], True, True)
    if said and everywhere:
        return Check("columns", f"Nothing is compared: {next(iter(said.values()))}", True, True)
    return Check("columns", "No other joint's columns fit better.")


def _gain(part: Part, seen: FaultSearch) -> list[Check]:
    """Sign and size of the force as a whole, beside all else that is wrong."""
    name = next((n for n in seen.values if n == f"{part.name}: gain"), None)
    if name is None:
        return []
    value, error = seen.values[name]
    times = Estimate(np.float64(1 + value), np.float64(error), "1")
    chosen, told = name in seen.chosen, seen.left <= LEAVES and abs(value) > LINEARITY
    size = quantity(times._replace(value=np.float64(abs(1 + value))))
    if 1 + value + _half(error) < 0 and chosen and told:
        text = f"The force is counted the other way: it is {quantity(times)} times the simulator's."
        return [Check("force_sign", text, True, value=times, parameter="gain")]
    told &= 1 + value - _half(error) > 0  # else the simulator's force is not in the log at all
    if chosen and told:
        unit = _unit(1 + value)
        text = f"The torque constant is {size} times the simulator's{unit}."
        if part.recording.unit_names["force"] in CURRENTS:
            text = (
                f"The current is {size} times the simulator's{unit or f': {of_constant(times)}'}."
            )
        return [
            Check("force_sign", "The force has the simulator's sign."),
            Check("force_gain", text, True, bool(unit), value=times, parameter="gain"),
        ]
    text, unknown = f"The torque constant is the simulator's ({size} times it, by itself).", True
    if not np.isfinite(error):
        text = "The motion cannot tell the torque constant."
    elif chosen and abs(value) > LINEARITY:
        text = (
            "Wrong values do not account for the mismatch: of the torque constant they say nothing."
        )
    else:
        unknown = False
    return [
        Check("force_sign", "The force has the simulator's sign."),
        Check("force_gain", text, None if unknown else False, value=times, parameter="gain"),
    ]


# Prefixes of SI: a torque constant that is a thousand times another is a unit. A data sheet tells
# it to some per cent.
PREFIX, NEAR = 3, 0.05


def _unit(times: float) -> str:
    """What a factor near a power of a thousand is rather."""
    order = round(np.log10(times) / PREFIX)
    if order == 0 or abs(times / 10.0 ** (PREFIX * order) - 1) > NEAR:
        return ""
    return (
        f", nearly 10^{PREFIX * order}: force and simulated force are in other units (N and kN, "
        "mN·m and N·m). Name them: --units force=UNIT, or --scale known_force=FACTOR"
    )


def _zeros(part: Part, seen: FaultSearch) -> list[Check]:
    """The zeros of the encoders: of all joints, for each may show in this one's force."""
    if not isinstance(part.simulator, Mujoco):
        return []
    found = []
    unit = part.recording.unit_names["position"]
    for name, (value, error) in seen.values.items():
        if not name.startswith(ZERO):
            continue
        joint = name.removeprefix(ZERO)
        zero = seen.faults.zeros.get(joint, 0.0)
        attribute = f"joint/{joint}/ref"
        if zero:
            error = seen.faults.errors.get(name, error)
            own = Estimate(np.float64(zero), np.float64(error), unit)
            text = f"The encoder's zero of joint {joint} is at {quantity(own)} of the simulator's."
            if part.simulator.turns_all(joint):
                text += (
                    " A base that is tilted about its axis by as much the other way looks the "
                    "same, and both together by their sum: measure the one or the other."
                )
            found.append(
                Check(POSITION_ZERO.name, text, True, False, own, f"{joint} zero", attribute)
            )
        elif joint == part.name:
            own = Estimate(np.float64(value), np.float64(error), unit)
            known = np.isfinite(error) and error < 1.0
            text = f"The encoder's zero is the simulator's ({quantity(own)})."
            if not known:
                text = "The motion cannot tell the encoder's zero."
            found.append(Check(POSITION_ZERO.name, text, value=own, parameter=f"{joint} zero"))
    return found


_APART = "Log force and motion by one clock, or a step of both."


def _clock(part: Part, seen: FaultSearch) -> Check:
    faults = seen.faults
    if faults.clock:
        error = faults.errors.get(OFFSET, 0.0)
        late = Estimate(np.float64(faults.late), np.float64(max(error, 1e-12)), "s")
        way = "late" if faults.late > 0 else "early"
        size = quantity(late._replace(value=np.float64(abs(faults.late))))
        whose = "The force of this joint alone" if seen.alone else "The force"
        text = f"{whose} has another clock than the motion: it is {size} {way}"
        if faults.drift:
            error = faults.errors.get(DRIFT, 0.0)
            text += (
                f" in the middle of the log, and {abs(faults.drift) * 1e6:.0f} ± "
                f"{1e6 * _half(error):.1g} µs more {'late' if faults.drift > 0 else 'early'} each "
                "second"
            )
            if abs(faults.late) < late.half_width():
                late = Estimate(np.float64(faults.drift), np.float64(error), "1")
        near = () if faults.drift else (SENSOR_FILTER.name,)
        return Check(CLOCK.name, f"{text}.", True, False, late, "delay", None, near, _APART)
    if OFFSET not in seen.values:
        return Check(CLOCK.name, "Not looked at.")
    value, error = map(np.float64, seen.values[OFFSET])
    late = Estimate(value, error, "s")
    drift = seen.values[DRIFT]
    text = f"Force and motion are on one clock (force {quantity(late)} late"
    text += f", drift {drift[0] * 1e6:.2g} ± {1e6 * _half(drift[1]):.1g} µs a second)."
    return Check(CLOCK.name, text, value=late, parameter="delay")


def _limit(part: Part, bound: Estimate | None) -> Check:
    if bound is None:
        return Check(FORCE_LIMIT.name, "No command was cut off by a limit of the force.")
    count = limits.beyond(part.recording, bound)
    share = count / max(int(np.count_nonzero(np.asarray(part.recording.mask))), 1)
    text = (
        f"The actuator gives no more than {quantity(bound)}: in {count} samples ({share:.1%}) the "
        "command asks for more than arrives."
    )
    attribute = f"joint/{part.name}/actuatorfrcrange" if part.name else None
    return Check(FORCE_LIMIT.name, text, True, False, bound, FORCE_LIMIT.name, attribute)


def _blocked(contact: Contact) -> Check:
    """Where something that the simulator lacks blocks the axis."""
    side = "upper" if contact.upper else "lower"
    text = (
        f"At {quantity(contact.place)}, the {side} end of the stroke, something blocks the axis: "
        f"it holds up to {contact.held:.3g} {contact.unit}, more than friction can. It is a limit "
        f"of the joint or a contact that the simulator lacks. {contact.samples} samples lie "
        "beyond; nothing is compared there, nor do the errors count them."
    )
    apart = "Look at the machine there: does it touch its own end, or something beside it?"
    return Check(
        END_STOP.name, text, True, False, contact.place, place(contact.upper), separate_by=apart,
        share=contact.share,
    )  # fmt: skip


def _ends(part: Part) -> list[Check]:
    """Rows at a limit of the joint, and where bodies of the model touch."""
    simulator = part.simulator
    if not isinstance(simulator, Mujoco):
        return []
    ends = int(np.count_nonzero(simulator.limited(part.recording)))
    touch = float(np.mean(simulator.touches(part.recording)))
    text = "The joint stays within the model's range, and its bodies apart."
    said = []
    if ends:
        said.append(f"{ends} samples are at a limit of the joint in the model")
    if touch:
        said.append(f"in {touch:.0%} of the samples bodies of the model touch")
    if said:
        text = f"{' and '.join(said).capitalize()}: nothing is compared there."
        if touch >= 0.5:
            text = f"{' and '.join(said).capitalize()}, so that their contact is left out."
    return [Check("joint_limit", text, bool(said))]


# Of what is reported as a finding; a hard stop has no stiffness.
EQUATIONS = {each.name: each.equation for each in (POSITION_ZERO, CLOCK, FORCE_LIMIT)} | {
    END_STOP.name: "x ≤ x_s, or x ≥ x_s"
}
