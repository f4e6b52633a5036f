"""The table of sanity: what was looked at before any physics, put right, and told first."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from ...checks import Remark
from ...data.recording import Recording
from ...identification.uncertainty import Estimate
from ...simulation.prediction import outliers
from ...simulators import AbstractSimulator, Attribute, Mujoco
from ...terms.effects.end_stop import END_STOP
from ..explained import Explanation
from ..figures import Figures, cast
from ..finding import Finding
from . import limits, wiring
from .contact import Contact, contacts
from .faults import Faults, Seen, find, put_right
from .rows import Part, Rows, rows_of
from .table import Check, checks_of

# Said of a force that stays at the end of its range.
CLIPPED = "force_clipped"


class Looked(AbstractSimulator):
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

    def standing_on(self, simulator: AbstractSimulator) -> "Looked":
        """The same of a simulator some of whose values have been put right since."""
        part = self.part._replace(simulator=simulator)
        return Looked(
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


def look(parts: Sequence[Part]) -> list[Looked]:
    """What each joint's log differs in from its simulator that no physics is.

    **Raises:** `ValueError` if an axis hardly slips.
    """
    with jax.enable_x64(True):
        parts = [_cast(part) for part in parts]
        blocked = [contacts(part.simulator.beside(part.recording)) for part in parts]
        parts = [_apart(*each) for each in zip(parts, blocked, strict=True)]
        raw = [_rows(part) for part in parts]
        wired = wiring.look(parts, raw)
        bounds = [_limit(part) for part in parts]
        clipped = [_arrived(part, bound) for part, bound in zip(parts, bounds, strict=True)]
        able = not wired.said or not wired.everywhere
        seen = find(clipped) if able else Seen(Faults(), {}, (), raw)
        ends = zip(bounds, blocked, strict=True)
        return [
            _looked(*each, seen, wired)
            for each in zip(parts, clipped, raw, seen.rows, ends, strict=True)
        ]


def looked_at(
    recording: Recording, simulator: AbstractSimulator, holdout: Recording | None
) -> Looked:
    """The simulator of a recording by itself, looked at, if it is not yet."""
    if isinstance(simulator, Looked):
        return simulator
    return look([Part(recording, holdout, simulator, getattr(simulator, "joint", ""))])[0]


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


def _limit(part: Part) -> Estimate | None:
    return limits.hard_limit(part.simulator.beside(part.recording))


def _arrived(part: Part, bound: Estimate | None) -> Part:
    held = None if part.holdout is None else limits.arrived(part.holdout, bound)
    return part._replace(recording=limits.arrived(part.recording, bound), holdout=held)


def _looked(
    raw: Part, clipped: Part, before: Rows, after: Rows,
    ends: tuple[Estimate | None, Sequence[Contact]], seen: Seen, wired,
) -> Looked:  # fmt: skip
    faults, (bound, blocked) = seen.faults, ends
    simulator = clipped.simulator
    if any(faults.zeros.values()) and isinstance(simulator, Mujoco):
        simulator = simulator.with_zeros(faults.zeros)
    held = None if clipped.holdout is None else put_right(clipped.holdout, faults)
    part = Part(put_right(clipped.recording, faults), held, simulator, clipped.name)
    table = checks_of(raw, seen, bound, blocked, wired)
    return Looked(part, raw, faults, bound, blocked, table, (before.power, after.power))


def told(found: Explanation, looked: Looked, x64: bool) -> Explanation:
    """An explanation with what was looked at first: its table, and findings for what was wrong."""
    rows = [check.to_dict() for check in looked.checks]
    found = dataclasses.replace(found, sanity=rows)
    findings = [] if looked.wrong else _findings(looked)
    if not findings:
        return found
    before, after = looked.power
    part = after / before if before > 0 else 1.0
    others = [f._replace(share=f.share * part) for f in found.findings]
    pictures = [None] * len(findings) + list(found.curves.get("findings", ()))
    verdicts = {"consistent": "explained", "unexplained": "partly_explained"}
    verdict = verdicts.get(found.verdict, found.verdict)
    return dataclasses.replace(
        found,
        findings=[*findings, *others],
        curves=found.curves | {"findings": pictures},
        verdict=verdict,
        fit=_errors(found, looked, x64),
    )


def _errors(found: Explanation, looked: Looked, x64: bool) -> dict[str, Any]:
    """The errors with those before anything was put right."""
    raw = looked.raw
    log = raw.simulator.beside(raw.recording)
    held = None if raw.holdout is None else raw.simulator.beside(raw.holdout, held_out=True)
    model = raw.simulator.baseline(log.units)
    figures = Figures(log, held, x64)
    fit = dict(found.fit)
    fit["force_error"] = fit["force_error"] | {"before": figures.here(model)}
    size = math.sqrt(looked.power[0])
    fit["filtered_force_error"] = fit["filtered_force_error"] | {"before": size}
    if held is not None and fit.get("holdout_force_error"):
        with jax.enable_x64(True):
            power = rows_of(cast(held), cast(model)).power
        fit["holdout_force_error"] = fit["holdout_force_error"] | {"before": figures.held(model)}
        fit["filtered_holdout_force_error"] = fit["filtered_holdout_force_error"] | {
            "before": math.sqrt(power)
        }
    return fit


def _findings(looked: Looked) -> list[Finding]:
    before, after = looked.power
    share = 1 - after / before if before > 0 else 0.0
    found = []
    for check in looked.checks:
        if not check.wrong or check.effect not in _EQUATIONS:
            continue
        value = check.value
        part = share if check.share is None else check.share
        # Where something blocks the axis noise has no say.
        sure = check.share is not None
        away = math.inf if sure else abs(float(value.value) / float(value.standard_error))
        p_value = math.erfc(away / math.sqrt(2))
        found.append(
            Finding(
                check.effect, _EQUATIONS[check.effect], f"{check.text} {part:.0%} of the "
                "unexplained force goes with it.", check.confusable, check.separate_by,
                {check.parameter: value}, part, None, p_value, attribute=check.attribute,
            )
        )  # fmt: skip
    return found


_EQUATIONS = {
    "position_zero": "f(q − z)",
    "clock": "u(t) = f(t − τ)",
    "force_limit": "u_real = clip(u, ±U)",
    END_STOP.name: "x ≤ x_s, or x ≥ x_s",
}
