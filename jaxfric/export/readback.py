"""The force errors of a written file: read again, along the recordings."""

import dataclasses
from typing import NamedTuple

from ..data.recording import Recording
from ..explanation import Explanation
from ..explanation.errors import through_kernel
from ..models import Model
from ..simulators import Mujoco, actuation
from ..simulators.columns import GAIN
from ..simulators.patching import folder_of
from ..terms import KnownForce
from ..terms.base import Sum, summands
from ..terms.effects import EFFECTS

# The figures by recording.
HELD = "holdout_force_error"
FIGURES = ("force_error", HELD)


def pair(source, text: str, joint: str, recordings, shared) -> tuple[Mujoco, Mujoco]:
    """The simulators of a joint by the file as it was, and by a text."""
    commanded = actuation.COMMAND in recordings[0].channels
    return (
        Mujoco(source, joint, shared=shared, commanded=commanded),
        Mujoco(text, joint, folder_of(source), shared, commanded=commanded),
    )


def errors(told: Explanation, before: Mujoco, after: Mujoco, recordings, forces: Model | None):
    """The force errors through the kernel: before, of the file, and with the forces beside it.

    On both recordings through the kernel of the first, as the answer's own.
    """
    known = told.fit["filtered_force_error"]
    found = {}

    def left(model: Model, log: Recording, delay: float) -> float:
        return through_kernel(model, log, delay, known["width"], known["across_reversals"])

    for name, log in zip(FIGURES, recordings, strict=False):
        made, own = _made(before, after, log), known["force_taken_later"]
        late = own if _later(before, after) == NOT else known["force_taken_later_after"]
        error = {
            "before": left(before.baseline(log.units), before.beside(log), own),
            "file": left(after.baseline(log.units), after.beside(made), late),
        }
        if forces is not None:
            model = Model(Sum((KnownForce(), *summands(forces.term))), forces.alpha, log.units)
            error["forces"] = left(model, after.beside(made), late)
        found[name] = error
    return found


def _made(before: Mujoco, after: Mujoco, log: Recording) -> Recording:
    """The recording with the joint's force that the model after makes of the command."""
    if after.actuator is not None:
        return after.driven(dataclasses.replace(log, force=log.channels[actuation.COMMAND]))
    gear = 1.0
    if GAIN in after.attributes() and after.attributes()[GAIN].what == "gear":
        gear = before.attributes()[GAIN].value / after.attributes()[GAIN].value
    log = dataclasses.replace(log, force=log.force / gear)
    later = _later(before, after)
    for effect in EFFECTS.values():
        time = later.delay if effect.shift else later.lag
        if effect.undone is not None and not effect.logged and time > 0:
            log = effect.undone(log, time)
    return log


class _Later(NamedTuple):
    """By how much an actuator's force is later than another's, s: a dead time, and a lag."""

    delay: float
    lag: float


NOT = _Later(0.0, 0.0)


def _later(before: Mujoco, after: Mujoco) -> _Later:
    """By how much the actuator after is later; not at all where only MuJoCo knows its law."""
    try:
        was, now = (actuation.read(s.mujoco, s.model, s.number) for s in (before, after))
    except ValueError:
        return NOT
    return _Later(now.delay - was.delay, now.constant - was.constant)
