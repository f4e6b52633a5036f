"""A spring in a transmission, as it is told: before what a joint's answer says beside it."""

import dataclasses

from ..data.printable import listed_and
from ..simulators.elastic import ENDING
from ..terms.effects.compliance import COMPLIANCE
from ..terms.effects.parameter_mismatch import MISMATCH
from .acceptance import LINEARITY
from .elasticity import DAMPING, STIFFNESS, ElasticJoint, Suspicion
from .explained import Explanation
from .finding import Finding
from .quantities import quantity
from .sanity.preceding import p_value, with_preceding

EQUATION = "s ẍ + (d + c) ẋ + (g + k) x = −f"
WRONG = "Wrong in the simulator: "


def with_spring(
    found: Explanation, first: Explanation, spring: ElasticJoint, joint: str
) -> Explanation:
    """A joint's explanation by the model with a spring, with the spring before it.

    **Arguments:** `first`, the explanation by the model without it; `joint`, whose these are. It is
    told of the spring's own joint, and of others that feel it by more than a sensor resolves.
    """
    name = "filtered_force_error"
    before, left = (each.fit[name]["before"] for each in (first, found))
    if joint != spring.joint and before**2 <= left**2 + LINEARITY**2:
        return found
    part = (left / before) ** 2 if before > 0 else 1.0
    names = ("force_error", name, "holdout_force_error", "filtered_holdout_force_error")
    errors = {n: first.fit[n]["before"] for n in names if first.fit[n] and found.fit[n]}
    held = None
    if first.fit[names[-1]] and found.fit[names[-1]]:
        held = 1 - (found.fit[names[-1]]["before"] / first.fit[names[-1]]["before"]) ** 2
    finding = Finding(
        COMPLIANCE.name, EQUATION, _sentence(spring), (),
        COMPLIANCE.separate_by, spring.estimates, max(1 - part, 0.0), held,
        p_value(spring.estimates[STIFFNESS]),
        attribute=f"joint/{spring.joint}{ENDING}/{STIFFNESS}",
        confirmed=None if held is None else held > 0,
    )  # fmt: skip
    return with_preceding(found, [finding], part, errors)


def _sentence(spring: ElasticJoint) -> str:
    """The same for all joints, which are told of it together."""
    stiffness, damping = (spring.estimates[name] for name in (STIFFNESS, DAMPING))
    about = quantity(damping._replace(standard_error=0.0))
    return (
        f"The transmission of joint {spring.joint} gives: between its motor, where the encoder is, "
        f"and its link there is a spring of {quantity(stiffness, smaller=False)}, with a damping "
        f"of some {about}, which this motion does not tell; {spring.share:.0%} of what no value of "
        "the simulator explains."
    )


DOUBTED = "transmission_may_give"


def unsure(found: Explanation, doubt: Suspicion) -> Explanation:
    """An explanation none of whose values is sure, because a transmission may give."""
    findings = [_doubted(f) if f.effect == MISMATCH else f for f in found.findings]
    text = (
        f"The transmission of joint {doubt.joint} may give: {doubt.why}. Wrong values of joint "
        f"{listed_and(sorted(doubt.felt))} may stand for it: none is sure, and none is written. "
        f"To tell: record faster motions of joint {doubt.joint}, or where the link is."
    )
    warning = {"name": DOUBTED, "text": text, "severe": False}
    verdict = "partly_explained" if found.verdict == "explained" else found.verdict
    return dataclasses.replace(
        found, findings=findings, verdict=verdict, warnings=[*found.warnings, warning]
    )


def _doubted(finding: Finding) -> Finding:
    return finding._replace(
        sentence=f"{WRONG}not sure, {finding.sentence.removeprefix(WRONG)}",
        parameters={}, attribute=None, untold=(*finding.parameters, *finding.untold),
    )  # fmt: skip
