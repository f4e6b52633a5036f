"""The simulator before and after, run again with the recording's reference and controller."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..data.recording import Recording
from ..simulators import Mujoco, closed
from ..simulators.actuation import COMMAND
from ..simulators.inverse import Motion
from ..simulators.loading import is_hinge, is_text, read

NO_REFERENCE = (
    "Not run again: the log has no reference of joint {joint}. Name its column: --columns "
    "{joint}_reference=NAME."
)
NO_FORCE = "Not run again: the log has no force of joint {joint}, to know its controller by."
NO_LAW = (
    "Not run again: the recorded force is no law of the reference's error, gravity and motion "
    "(joint {joint}: {left:.0%} of it is left), so that the controller is not known. Give the "
    "model a position actuator for each joint."
)
LOST = "Run again, the simulator {when} does not follow the reference."
# Points of a picture.
DRAWN = 1000
SERVOS, LAW = "the model's position actuators", "read off the log"


class Rerun(NamedTuple):
    """What the closed loops did: `said`, why there are none; else motions `(N, dof)` by joint.

    `recorded`, `before` and `after` and `reference`, rad or m; `controller` in words.
    """

    said: str = ""
    joints: tuple[str, ...] = ()
    time: np.ndarray | None = None
    reference: np.ndarray | None = None
    recorded: np.ndarray | None = None
    before: np.ndarray | None = None
    after: np.ndarray | None = None
    controller: str = ""
    units: tuple[str, ...] = ()

    def errors(self) -> list[dict[str, Any]]:
        """By joint: root mean square of the deviation from the recording and of the tracking error,
        rad or m.
        """
        if self.recorded is None:
            return []

        def rms(values: np.ndarray) -> np.ndarray:
            return np.sqrt(np.mean(values**2, axis=0))

        pairs = {"before": self.before, "after": self.after}
        off = {when: rms(run - self.recorded) for when, run in pairs.items()}
        runs = {"recorded": self.recorded, **pairs}
        track = {when: rms(run - self.reference) for when, run in runs.items()}
        return [
            {
                "joint": joint,
                "deviation": {when: float(values[i]) for when, values in off.items()},
                "tracking_error": {when: float(values[i]) for when, values in track.items()},
            }
            for i, joint in enumerate(self.joints)
        ]

    def curves(self, joint: str) -> dict[str, Any]:
        """What a picture of one joint is drawn from: how far both runs are off the recording."""
        assert self.recorded is not None and self.time is not None
        own, step = self.joints.index(joint), max(1, len(self.time) // DRAWN)
        runs = {"before": self.before, "after": self.after}
        off = {
            when: (run - self.recorded)[::step, own].tolist()
            for when, run in runs.items()
            if run is not None
        }
        return {"joint": joint, "unit": self.units[own], "time": self.time[::step].tolist()} | off

    def to_dict(self) -> dict[str, Any]:
        """The errors as plain data, or why there are none."""
        return {"remark": self.said, "controller": self.controller, "joints": self.errors()}


def rerun(
    before: str | Path, after: str, folder: Path | None, simulators: Mapping[str, Mujoco],
    logs: Mapping[str, Recording], references: Mapping[str, np.ndarray],
    acting: Mapping[str, tuple[float, float, float, float]], beside: Mapping[str, closed.Beside],
) -> Rerun:  # fmt: skip
    """Run both models again.

    **Arguments:** `before` and `after`, the models; by joint: the `simulators` of the log, its
    `logs` as they were put right, the `references`, `(N,)`, gain, limit, dead time and lag of what
    is `acting`, and the forces `beside` the model after.
    """
    some = next(iter(simulators.values()))
    mujoco, names = some.mujoco, tuple(some.recorded)
    for joint in names:
        if joint not in references:
            return Rerun(NO_REFERENCE.format(joint=joint))
        if joint not in logs:
            return Rerun(NO_FORCE.format(joint=joint))
    log = _log(some, names, logs, references)
    models = [read(mujoco, before), read(mujoco, after, None if is_text(before) else folder)]
    law = None if closed.servos(mujoco, models[0]) else _law(mujoco, models, log)
    if law is not None and not law.known:
        worst = int(np.argmax(law.left))
        return Rerun(NO_LAW.format(joint=names[worst], left=law.left[worst]))
    commanded = _commanded(simulators, logs, names)
    before_ = closed.ideal(len(names))._replace(actuators=commanded)
    plain = (1.0, np.inf, 0.0, 0.0)
    # What is between command and joint is in the model where it takes the command.
    values = [plain if i in commanded else acting.get(name, plain) for i, name in enumerate(names)]
    after_ = closed.Actuation(*np.array(values).T, actuators=commanded)
    own = {names.index(joint): force for joint, force in beside.items()}
    first = closed.run(mujoco, models[0], log, law, before_)
    second = closed.run(mujoco, models[1], log, law, after_, own)
    if first is None or second is None:
        return Rerun(LOST.format(when="before" if first is None else "after"))
    return Rerun(
        "", names, log.time, log.reference, log.motion.position, first, second,
        SERVOS if law is None else f"{LAW}: {', '.join(law.parts)}",
        tuple("rad" if is_hinge(mujoco, some.model, i) else "m" for i in _places(some)),
    )  # fmt: skip


def _log(some: Mujoco, names: Sequence[str], logs, references) -> closed.Log:
    own = logs[some.joint]
    motion = Motion(*(part[:, _places(some)] for part in some.along(own).motion))
    force = np.stack(
        [np.asarray(logs[n].channels.get(COMMAND, logs[n].force), float) for n in names], axis=1
    )
    reference = np.stack([np.asarray(references[name], float) for name in names], axis=1)
    known = np.isfinite(force) & np.isfinite(reference)
    force, reference = (np.where(known, values, 0.0) for values in (force, reference))
    return closed.Log(np.asarray(own.time, float), motion, force, reference)


def _places(some: Mujoco) -> list[int]:
    """Where the joints that have an encoder are among all."""
    return [some.joints.index(name) for name in some.recorded]


def _commanded(
    simulators: Mapping[str, Mujoco], logs: Mapping[str, Recording], names: Sequence[str]
) -> dict[int, int]:
    """By joint whose command the log holds the actuator that takes it."""
    found = {}
    for i, name in enumerate(names):
        own = simulators[name].actuator if name in simulators else None
        if own is not None and COMMAND in logs[name].channels:
            found[i] = own.number
    return found


def _law(mujoco: Any, models: Sequence[Any], log: closed.Log) -> closed.Law:
    """The log's law; the controller may know the simulator's weight, or the machine's."""
    laws = [closed.law_of(mujoco, model, log) for model in models]
    return min(laws, key=lambda law: float(np.max(law.left)))
