"""A simulator's closed loop: the same reference and controller as the recording's, run again.

The controller is that of the model where it has a servo for each joint (`position` actuators);
else it is read off the log, whose force it computed: u = k_p e + k_d ė + k_b b(q, v) + …, e the
error of the position, b the force of gravity and motion that computed-torque controllers add.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from .elastic import springs_of
from .inverse import Motion

# What a law of control leaves of the command: more, and it is another one.
LEFT = 0.1
# A further part of the law has to take a tenth of the error that is left.
WORTH = 0.9
# Without the axis following, the run says nothing: this many times the motion's range.
LOST = 10.0

# The force at a joint that no attribute says, from its position, its speed and the time.
Beside = Callable[[float, float, float], float]


class Log(NamedTuple):
    """All joints of a recording, in the model's order: time, s, `(N,)`, and `(N, dof)` each."""

    time: Float[np.ndarray, " N"]
    motion: Motion
    force: Float[np.ndarray, "N dof"]
    reference: Float[np.ndarray, "N dof"]


class Law(NamedTuple):
    """A controller: the gains of its parts, `(dof, parts)`, and what it leaves of each command.

    `model`: that whose gravity and motion it computes; it stays so whatever machine it drives.
    """

    parts: tuple[str, ...]
    gains: np.ndarray
    left: np.ndarray
    model: Any

    @property
    def known(self) -> bool:
        """Whether it is the log's law."""
        return bool(np.all(self.left <= LEFT))


# In the order in which they are asked for; the first two always.
PARTS = ("position error", "velocity error", "gravity and motion", "constant", "integral",
         "acceleration")  # fmt: skip


def bias(mujoco: Any, model: Any, motion: Motion) -> np.ndarray:
    """Gravity, centrifugal and Coriolis forces along a motion, `(N, dof)`."""
    data, found = mujoco.MjData(model), np.empty(motion.position.shape)
    for i in range(len(found)):
        found[i] = _bias(mujoco, model, data, motion.position[i], motion.velocity[i])
    return found


def encoders(mujoco: Any, model: Any) -> list[int]:
    """The numbers of the joints that have an encoder: all but springs of transmissions."""
    springs = springs_of(mujoco, model)
    return [joint for joint in range(model.nv) if joint not in springs]


def _bias(mujoco: Any, model: Any, data: Any, position, velocity) -> np.ndarray:
    at = encoders(mujoco, model)
    data.qpos[at], data.qvel[at] = position, velocity
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    return data.qfrc_bias[at].copy()


def law_of(mujoco: Any, model: Any, log: Log) -> Law:
    """The controller that the log's force and reference speak of, joint by joint.

    Least squares of the recorded force by the parts of a law, of which those beyond the first two
    have to be worth it for some joint.
    """
    weight = bias(mujoco, model, log.motion)
    goal = np.gradient(log.reference, log.time, axis=0)
    error = log.reference - log.motion.position
    step = np.diff(log.time, prepend=log.time[0])[:, None]
    every = {
        "position error": error,
        "velocity error": goal - log.motion.velocity,
        "gravity and motion": weight,
        "constant": np.ones_like(error),
        "integral": np.cumsum(error * step, axis=0),
        "acceleration": np.gradient(goal, log.time, axis=0),
    }
    chosen = list(PARTS[:2])
    gains, left = _fitted(every, chosen, log.force)
    for part in PARTS[2:]:
        more, less = _fitted(every, [*chosen, part], log.force)
        if np.any(less < WORTH * left):
            chosen, gains, left = [*chosen, part], more, less
    return Law(tuple(chosen), gains, left, model)


def _fitted(every: Mapping[str, np.ndarray], chosen: Sequence[str], force: np.ndarray):
    gains, left = [], []
    for joint in range(force.shape[1]):
        columns = np.stack([every[part][:, joint] for part in chosen], axis=1)
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        solved = np.linalg.lstsq(columns / size, force[:, joint], rcond=1e-9)[0] / size
        gains.append(solved)
        rest = force[:, joint] - columns @ solved
        whole = max(float(np.linalg.norm(force[:, joint])), 1e-300)
        left.append(float(np.linalg.norm(rest)) / whole)
    return np.array(gains), np.array(left)


def servos(mujoco: Any, model: Any) -> bool:
    """Whether each joint has one actuator that follows a position, as `position` ones do."""
    joints = sorted(int(j) for j in model.actuator_trnid[:, 0])
    own = model.actuator_trntype == int(mujoco.mjtTrn.mjTRN_JOINT)
    pulls = np.isclose(model.actuator_gainprm[:, 0], -model.actuator_biasprm[:, 1])
    able = joints == encoders(mujoco, model)
    return bool(able and np.all(own) and np.all(pulls & (model.actuator_gainprm[:, 0] > 0)))


class Actuation(NamedTuple):
    """What stands between command and joint: gain, limit, N, dead time and lag, s, `(dof,)` each;
    `actuators`: by joint that of the model which takes the command, so that all this is its own.
    """

    gain: np.ndarray
    limit: np.ndarray
    delay: np.ndarray
    lag: np.ndarray
    actuators: Mapping[int, int] = {}  # noqa: RUF012 - a NamedTuple's default, never changed


def ideal(dof: int) -> Actuation:
    """Commands that arrive as they are."""
    return Actuation(np.ones(dof), np.full(dof, np.inf), np.zeros(dof), np.zeros(dof))


def run(
    mujoco: Any,
    model: Any,
    log: Log,
    law: Law | None,
    actuation: Actuation,
    beside: Mapping[int, Beside] | None = None,
) -> Float[np.ndarray, "N dof"] | None:
    """The positions of the closed loop at the log's times; `None` where it does not follow.

    **Arguments:** `law`, or `None` for the model's own servos; `beside`, forces by joint that the
    model has no attribute for.
    """
    steps = max(1, round(float(np.median(np.diff(log.time))) / model.opt.timestep))
    kept = float(model.opt.timestep)
    flags = int(model.opt.disableflags)
    if law is not None and not actuation.actuators:
        # The law's force is the joint's: what the model's actuators make of no command is not.
        model.opt.disableflags = flags | int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    data, at = mujoco.MjData(model), encoders(mujoco, model)
    data.qpos[at], data.qvel[at] = log.motion.position[0], log.motion.velocity[0]
    _begin(data, model, log, law, actuation, at)
    found = np.full(log.motion.position.shape, np.nan)
    loop = _Loop(mujoco, model, log, law, actuation)
    most = LOST * np.ptp(log.motion.position, axis=0)
    for i, (start, span) in enumerate(
        zip(log.time, np.diff(log.time, append=log.time[-1]), strict=True)
    ):
        found[i] = data.qpos[at]
        if not np.all(np.abs(data.qpos[at] - log.motion.position[i]) <= most):
            model.opt.timestep, model.opt.disableflags = kept, flags
            return None
        model.opt.timestep = max(span / steps, 1e-9)
        for k in range(steps if span > 0 else 0):
            mujoco.mj_step1(model, data)
            loop.drive(data, float(start) + k * model.opt.timestep)
            for joint, force in (beside or {}).items():
                own = at[joint]
                data.qfrc_applied[own] -= force(data.qpos[own], data.qvel[own], data.time)
            mujoco.mj_step2(model, data)
    model.opt.timestep, model.opt.disableflags = kept, flags
    return found


def _begin(data: Any, model: Any, log: Log, law: Law | None, actuation: Actuation, places) -> None:
    """The actuators' filters where the recording begins; `places` of the joints."""
    first = log.reference[0] if law is None else log.force[0]
    for i in range(model.nu):
        at, joint = int(model.actuator_actadr[i]), places.index(int(model.actuator_trnid[i, 0]))
        if at >= 0 and (law is None or joint in actuation.actuators):
            data.act[at] = first[joint]


class _Loop:
    """A controller at work."""

    def __init__(self, mujoco: Any, model: Any, log: Log, law: Law | None, actuation: Actuation):
        self.mujoco, self.known = mujoco, None if law is None else mujoco.MjData(law.model)
        self.log, self.law, self.actuation = log, law, actuation
        goal = np.gradient(log.reference, log.time, axis=0)
        self.goals = [log.reference, goal, np.gradient(goal, log.time, axis=0)]
        self.at = encoders(mujoco, model)
        self.sum, self.before = np.zeros(len(self.at)), float(log.time[0])
        driven = [self.at.index(int(j)) for j in model.actuator_trnid[:, 0]]
        self.joints = driven if law is None else []
        self.late: list[tuple[float, np.ndarray]] = []
        self.acting: np.ndarray | None = None

    def drive(self, data: Any, now: float) -> None:
        """Set the command of one step."""
        place = int(np.searchsorted(self.log.time, now, side="right")) - 1
        place = int(np.clip(place, 0, len(self.log.time) - 2))
        span = self.log.time[place + 1] - self.log.time[place]
        share = (now - self.log.time[place]) / span if span > 0 else 0.0
        wanted, speed, rate = (g[place] + share * (g[place + 1] - g[place]) for g in self.goals)
        if self.law is None:
            data.ctrl[:] = wanted[self.joints]
            data.qfrc_applied[:] = 0.0
            return
        error, span = wanted - data.qpos[self.at], now - self.before
        self.sum += error * span
        self.before = now
        values = {
            "position error": error,
            "velocity error": speed - data.qvel[self.at],
            "gravity and motion": self._weight(data),
            "constant": np.ones_like(error),
            "integral": self.sum,
            "acceleration": rate,
        }
        asked = sum(self.law.gains[:, i] * values[p] for i, p in enumerate(self.law.parts))
        acting = self._lagging(self._arriving(np.asarray(asked), now), span)
        for joint, number in self.actuation.actuators.items():
            data.ctrl[number], acting[joint] = acting[joint], 0.0
        data.qfrc_applied[self.at] = acting

    def _weight(self, data: Any) -> np.ndarray:
        """Gravity and motion as the controller knows them; zero where it does not ask."""
        assert self.law is not None
        if "gravity and motion" not in self.law.parts:
            return np.zeros(len(self.at))
        place, speed = data.qpos[self.at], data.qvel[self.at]
        return _bias(self.mujoco, self.law.model, self.known, place, speed)

    def _lagging(self, arriving: np.ndarray, span: float) -> np.ndarray:
        lag = self.actuation.lag
        if self.acting is None or not np.any(lag > 0):
            self.acting = arriving
        kept = np.exp(-span / np.where(lag > 0, lag, np.inf)) * (lag > 0)
        self.acting = arriving + kept * (self.acting - arriving)
        return self.acting.copy()

    def _arriving(self, asked: np.ndarray, now: float) -> np.ndarray:
        limit, delay = self.actuation.limit, self.actuation.delay
        asked = np.clip(asked, -limit, limit) / self.actuation.gain
        if not np.any(delay > 0):
            return asked
        self.late.append((now, asked))
        arrives = self.late[0][1].copy()
        for time, command in self.late:
            arrives = np.where(time <= now - delay, command, arrives)
        longest = float(np.max(delay))
        while len(self.late) > 1 and self.late[1][0] <= now - longest:
            self.late.pop(0)
        return arrives
