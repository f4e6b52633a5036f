"""The table of sanity: what was looked at before any physics, put right, and told first."""

import dataclasses
import math
from collections.abc import Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ...checks import Remark
from ...data.recording import Recording
from ...identification.uncertainty import Estimate
from ...simulation.errors import outliers
from ...simulators import AbstractSimulator, Attribute, Known, Mujoco
from ...simulators.columns import GAIN
from ...terms import KNOWN_FORCE
from ..explained import Explanation
from ..figures import Figures, cast
from ..finding import Finding
from . import limits, wiring
from .contact import Contact, contacts
from .faults import Faults, FaultSearch, find_each, put_right
from .preceding import p_value, with_preceding
from .rows import Part, Rows, rows_of
from .table import EQUATIONS, Check, checks_of

# Said of a force that stays at the end of its range.
CLIPPED = "force_clipped"


class CheckedSimulator(AbstractSimulator):
    """A simulator whose log has been looked at: what is put right, and the table."""

    def __init__(self, part: Part, raw: Part, faults: Faults, limit: Estimate | None,
                 blocked: Sequence[Contact], checks: list[Check],
                 power: tuple[float, float]):  # fmt: skip
        self.part, self.raw, self.faults, self.limit = part, raw, faults, limit
        self.blocked, self.checks, self.power = blocked, checks, power

    def baseline(self, units):
        return self.part.simulator.baseline(units)

    def beside(self, recording: Recording, held_out: bool = False) -> Recording:
        return self.part.simulator.beside(recording, held_out)

    def attributes(self) -> Mapping[str, Attribute]:
        return self.part.simulator.attributes()

    def standing_on(self, simulator: AbstractSimulator) -> "CheckedSimulator":
        """The same of a simulator some of whose values have been put right since."""
        part = self.part._replace(simulator=simulator)
        return CheckedSimulator(
            part, self.raw, self.faults, self.limit, self.blocked, self.checks, self.power
        )

    def logs(self, recording: Recording, holdout: Recording | None):
        """The recordings as they were put right, in the caller's precision."""
        if not self.changed:
            return recording, holdout
        kind, part = recording.time.dtype, self.part
        held = None if part.holdout is None else cast(part.holdout, kind)
        return cast(part.recording, kind), held

    def remarks(self, remarks: list[Remark]) -> list[Remark]:
        """What is said of the recording: columns that nothing can be named beside first, and
        nothing of a force at its end that is said to be a limit.
        """
        if self.limit is not None:
            remarks = [remark for remark in remarks if remark.name != CLIPPED]
        return [*([Remark("columns", self.wrong, True)] if self.wrong else []), *remarks]

    @property
    def changed(self) -> bool:
        """Whether anything was put right."""
        return bool(self.faults.zeros or self.faults.clock or self.limit or self.blocked)

    @property
    def wrong(self) -> str | None:
        """What nothing can be named beside, in words."""
        return next((check.text for check in self.checks if check.severe), None)


def check_logs(parts: Sequence[Part]) -> list[CheckedSimulator]:
    """What each joint's log differs in from its simulator that no physics is.

    **Raises:** `ValueError` if an axis hardly slips.
    """
    with jax.enable_x64(True):
        parts = [_cast(part) for part in parts]
        blocked = [contacts(part.simulator.beside(part.recording)) for part in parts]
        parts = [_apart(*each) for each in zip(parts, blocked, strict=True)]
        raw = [_rows(part) for part in parts]
        wired = wiring.wiring_of(parts, raw)
        bounds = [_limit(*each) for each in zip(parts, raw, strict=True)]
        clipped = [_arrived(part, bound) for part, bound in zip(parts, bounds, strict=True)]
        sound = [part for part in clipped if wired.sound(part.name)]
        able = {p.name: own for p, own in zip(sound, find_each(sound), strict=True)}
        seen = [
            able.get(part.name, FaultSearch(Faults(), {}, (), [own]))
            for part, own in zip(parts, raw, strict=True)
        ]
        ends = zip(bounds, blocked, strict=True)
        return [
            _corrected(*each, wired) for each in zip(parts, clipped, raw, seen, ends, strict=True)
        ]


def check_log(
    recording: Recording, simulator: AbstractSimulator, holdout: Recording | None
) -> CheckedSimulator:
    """The simulator of a recording by itself, looked at, if it is not yet.

    **Raises:** `ValueError` if an axis hardly slips, or if the simulator's force is the recorded.
    """
    if isinstance(simulator, CheckedSimulator):
        return simulator
    if isinstance(simulator, Known):
        _require_other(recording, simulator)
    return check_logs([Part(recording, holdout, simulator, getattr(simulator, "joint", ""))])[0]


def _require_other(recording: Recording, simulator: Known) -> None:
    """Raise `ValueError` if the force of a simulator from elsewhere is the recorded one."""
    known = np.asarray(simulator.beside(recording).channels[KNOWN_FORCE], float)
    mask = np.asarray(recording.mask)
    if np.array_equal(known[mask], np.asarray(recording.force, float)[mask]):
        raise ValueError(
            f"The simulator's force for {recording.source or 'the recording'} is the recorded "
            "force, to the last digit: the same column or file? Give what the simulator computes."
        )


def _cast(part: Part) -> Part:
    held = None if part.holdout is None else _sound(part.holdout)
    return part._replace(recording=_sound(part.recording), holdout=held)


def _sound(recording: Recording) -> Recording:
    """In double precision, without samples that no actuator made."""
    mask = np.asarray(recording.mask) & ~outliers(recording)
    return dataclasses.replace(cast(recording), mask=jnp.asarray(mask))


def _apart(part: Part, blocked: Sequence[Contact]) -> Part:
    """Without the samples in which something blocks the axis: there nothing is compared."""
    for contact in blocked:
        held = None if part.holdout is None else contact.without(part.holdout)
        part = part._replace(recording=contact.without(part.recording), holdout=held)
    return part


def _rows(part: Part) -> Rows:
    log = part.simulator.beside(part.recording)
    return rows_of(log, part.simulator.baseline(log.units))


def _limit(part: Part, raw: Rows) -> Estimate | None:
    """The limit of the force, where what arrived is nearer to what the motion needed."""
    bound = limits.hard_limit(part.simulator.beside(part.recording))
    if bound is None or limits.noisy(part.recording, bound):
        return None
    return bound if _rows(_arrived(part, bound)).power < raw.power else None


def _arrived(part: Part, bound: Estimate | None) -> Part:
    held = None if part.holdout is None else limits.arrived(part.holdout, bound)
    return part._replace(recording=limits.arrived(part.recording, bound), holdout=held)


def _corrected(
    raw: Part, clipped: Part, before: Rows, seen: FaultSearch,
    ends: tuple[Estimate | None, Sequence[Contact]], wired,
) -> CheckedSimulator:  # fmt: skip
    faults, (bound, blocked), (after,) = seen.faults, ends, seen.rows
    simulator = clipped.simulator
    if any(faults.zeros.values()) and isinstance(simulator, Mujoco):
        simulator = simulator.with_zeros(faults.zeros)
    held = None if clipped.holdout is None else put_right(clipped.holdout, faults)
    part = Part(put_right(clipped.recording, faults), held, simulator, clipped.name)
    table = checks_of(raw, seen, bound, blocked, wired)
    return CheckedSimulator(part, raw, faults, bound, blocked, table, (before.power, after.power))


def with_checks(found: Explanation, checked: CheckedSimulator, x64: bool) -> Explanation:
    """An explanation with what was looked at first: its table, and findings for what was wrong."""
    rows = [_beside(found, check).to_dict() for check in checked.checks]
    found = dataclasses.replace(found, sanity=rows)
    findings = [] if checked.wrong else _findings(checked)
    if not findings:
        return found
    before, after = checked.power
    left = after / before if before > 0 else 1.0
    return with_preceding(found, findings, left, _before(found, checked, x64))


def _beside(found: Explanation, check: Check) -> Check:
    """A torque constant that would do by itself, where beside the findings it is not wrong."""
    names = [name for finding in found.findings for name in finding.parameters]
    told = any(name == GAIN or name.endswith("/gear") for name in names)
    if not (check.wrong and check.effect == "force_gain" and names) or told:
        return check
    text = f"By wrong values alone: {check.text} Beside what was found it is not told from one."
    return check._replace(wrong=False, text=text)


def _before(found: Explanation, checked: CheckedSimulator, x64: bool) -> dict[str, float]:
    """The errors before anything was put right."""
    raw = checked.raw
    log = raw.simulator.beside(raw.recording)
    held = None if raw.holdout is None else raw.simulator.beside(raw.holdout, held_out=True)
    model = raw.simulator.baseline(log.units)
    figures = Figures(log, held, x64)
    size = math.sqrt(checked.power[0])
    errors = {"force_error": figures.here(model), "filtered_force_error": size}
    if held is not None and found.fit.get("holdout_force_error"):
        with jax.enable_x64(True):
            power = rows_of(cast(held), cast(model)).power
        errors["holdout_force_error"] = figures.held(model)
        errors["filtered_holdout_force_error"] = math.sqrt(power)
    return errors


def _findings(checked: CheckedSimulator) -> list[Finding]:
    before, after = checked.power
    share = 1 - after / before if before > 0 else 0.0
    found = []
    for check in checked.checks:
        if not check.wrong or check.effect not in EQUATIONS:
            continue
        value = check.value
        part = share if check.share is None else check.share
        # Where something blocks the axis noise has no say.
        chance = 0.0 if check.share is not None else p_value(value)
        found.append(
            Finding(
                check.effect, EQUATIONS[check.effect], f"{check.text} {part:.0%} of the "
                "unexplained force goes with it.", check.confusable, check.separate_by,
                {check.parameter: value}, part, None, chance, attribute=check.attribute,
            )
        )  # fmt: skip
    return found
