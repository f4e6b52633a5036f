"""The force errors of a written file: read again, along the recordings."""

import dataclasses

from ..data.recording import Recording
from ..explanation import Explanation
from ..explanation.errors import through_kernel
from ..models import Model
from ..simulators import Mujoco, actuation
from ..simulators.columns import GAIN
from ..simulators.patching import folder_of
from ..terms import KnownForce
from ..terms.base import Sum, summands

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
    """The force errors through the kernel: before, of the file, and with the forces beside it."""
    delay = told.fit["filtered_force_error"]["force_taken_later"]
    found = {}
    for name, log in zip(FIGURES, recordings, strict=False):
        made = _made(before, after, log)
        error = {
            "before": through_kernel(before.baseline(log.units), before.beside(log), delay),
            "file": through_kernel(after.baseline(log.units), after.beside(made), delay),
        }
        if forces is not None:
            model = Model(Sum((KnownForce(), *summands(forces.term))), forces.alpha, log.units)
            error["forces"] = through_kernel(model, after.beside(made), delay)
        found[name] = error
    return found


def _made(before: Mujoco, after: Mujoco, log: Recording) -> Recording:
    """The recording with the joint's force that the model after makes of the command."""
    if after.actuator is not None:
        return after.driven(dataclasses.replace(log, force=log.channels[actuation.COMMAND]))
    gear = 1.0
    if GAIN in after.attributes() and after.attributes()[GAIN].what == "gear":
        gear = before.attributes()[GAIN].value / after.attributes()[GAIN].value
    return dataclasses.replace(log, force=log.force / gear)
