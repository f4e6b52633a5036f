"""Where several joints of a robot say different things of one body."""

import dataclasses
import itertools
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ..data.printable import listed_and
from ..identification.uncertainty import Estimate
from ..simulators.weights import worded
from ..terms.effects import EFFECTS
from .explained import Explanation
from .finding import Finding, Moved
from .quantities import quantity

CONTRADICTION = "joints_contradict"


class Said(NamedTuple):
    """What a joint says of a body: its value, and of a change when that was."""

    joint: str
    value: Moved
    moment: Estimate | None


def with_contradictions(found: Mapping[str, Explanation]) -> dict[str, Explanation]:
    """The explanations of joints, those that contradict each other on a body with a warning.

    One body has one mass. Where two joints say two that are further apart than their intervals
    allow, at least one of them stands for something else: neither is `explained`.
    """
    warned = dict(found)
    for (_, key), said in _values(found).items():
        apart = [pair for pair in itertools.combinations(said, 2) if _contradict(*pair)]
        joints = [each for each in said if any(each in pair for pair in apart)]
        for each in joints:
            told = warned[each.joint]
            text = {"name": CONTRADICTION, "text": _text(key, joints), "severe": False}
            verdict = "partly_explained" if told.verdict == "explained" else told.verdict
            warned[each.joint] = dataclasses.replace(
                told, verdict=verdict, warnings=[*told.warnings, text]
            )
    return warned


def _values(found: Mapping[str, Explanation]) -> dict[tuple[str, str], list[Said]]:
    """What joints say of bodies, by effect and name of the value."""
    values: dict[tuple[str, str], list[Said]] = {}
    for joint, told in found.items():
        for finding in told.findings:
            for key, value in finding.parameters.items():
                if isinstance(value, Moved) and key.startswith("body/"):
                    said = Said(joint, value, _moment(finding))
                    values.setdefault((finding.effect, key), []).append(said)
    return values


def _moment(finding: Finding) -> Estimate | None:
    effect = EFFECTS.get(finding.effect)
    moment = finding.parameters.get(effect.moment) if effect is not None and effect.moment else None
    return moment if isinstance(moment, Estimate) else None


def _contradict(one: Said, other: Said) -> bool:
    """Whether two values are further apart than their intervals allow, at one moment."""
    if one.moment is not None and other.moment is not None and _apart(one.moment, other.moment):
        return False
    return _apart(one.value.estimate, other.value.estimate)


def _apart(one: Estimate, other: Estimate) -> bool:
    reach = np.hypot(float(one.half_width()), float(other.half_width()))
    return bool(abs(float(one.value) - float(other.value)) > reach)


def _text(key: str, said: list[Said]) -> str:
    _, body, what = key.split("/")
    own = worded(body, what, said[0].value.before)
    each = listed_and([f"{quantity(s.value.estimate, smaller=False)} by {s.joint}" for s in said])
    return (
        f"The joints contradict each other on the {own}: {each}. It has one value, so that these "
        "stand for something else: another body, or a load whose centre of mass is elsewhere."
    )
