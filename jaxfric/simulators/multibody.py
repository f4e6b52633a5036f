"""MuJoCo's inverse dynamics along a recorded motion (MuJoCo reads MJCF and URDF)."""

import dataclasses
import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from .. import signals
from ..data.recording import Recording
from ..models import Model
from ..terms import (
    KNOWN_FRICTION,
    KNOWN_MASKED,
    KNOWN_MOMENTUM,
    KNOWN_REST,
    KnownColumns,
    KnownForce,
    Offset,
    channels_of,
)
from ..terms.base import Sum
from ..terms.effects.cross_axis import force_channels, neighbour_channel
from . import actuation, columns, elastic, inverse
from .known import AbstractSimulator, Attribute, along
from .loading import is_hinge, joints_of, library, read
from .touching import alone, at_limit, touching

# Of a limit that is reached, what rounding and the solver leave.
ROUNDING = 1e-6
# Bodies that touch in most of a motion are drawn too large: that is no event of the motion.
MOSTLY = 0.5


class Standing(ValueError):
    """A joint stands, or is at a limit of the model, in a whole recording: there is nothing to
    compare.
    """


class Mujoco(AbstractSimulator):
    """The force that a MuJoCo model needs at one joint for a recorded motion.

    A baseline of `explain`, and a function from a recording to that force, `(N,)`. For `explain`
    the momentum stands apart, so that its derivative goes through the same kernel as the recorded
    force; only MuJoCo's soft dry friction sees a smoothed acceleration. What the model's own
    parameters change is a column each: damping, frictionloss, armature and stiffness of the joint,
    gear of its actuator; mass, centre of mass and inertia of each body that it moves.

    **Arguments:** `model`: a file (MJCF or URDF) or its text; `joint`: name of the joint that the
    recording is of, where there are several. The positions of the others are channels of the
    recording by their joints' names, in the model's own units, rad or m; `folder`, in which the
    meshes of a model that is given as text lie; `shared`, a memory for several joints of one log;
    `zeros`, where the encoders' zeros are in the model's angles, rad or m by joint; `commanded`:
    the log is of the command of the joint's actuator (MuJoCo's `ctrl`), and its recordings are
    passed through `driven` first. Then the actuator's bias, gain and time constant are columns too;
    `settled`: the bodies have been told by all joints together, and are no columns.

    Nothing is compared where the joint is at a limit of the model, or bodies of it touch.

    **Raises:** `ValueError` for a model that MuJoCo cannot read, for free and ball joints, closed
    loops, and a joint or channel that is not there.
    """

    def __init__(
        self,
        model: str | Path,
        joint: str | None = None,
        folder: Path | None = None,
        shared: dict[bytes, Any] | None = None,
        zeros: Mapping[str, float] | None = None,
        commanded: bool = False,
        settled: bool = False,
    ):
        self.mujoco, self._source, self._folder = library(), str(model), folder
        self._shared = {} if shared is None else shared
        self.model = read(self.mujoco, model, folder)
        self.joints = joints_of(self.mujoco, self.model)
        self.recorded = elastic.logged(self.mujoco, self.model, self.joints)
        alone(self.mujoco, self.model)
        self.zeros = dict(zeros or {})
        shift = np.array([self.zeros.get(name, 0.0) for name in self.joints])
        self.model.qpos0[:] += shift
        self.model.qpos_spring[:] += shift
        self.model.jnt_range[:] += shift[:, None]
        names = self.recorded
        if joint is None and len(names) > 1:
            raise ValueError(
                f"The model has {len(names)} joints: {', '.join(names)}. Say which one "
                f"the recording is of: joint={names[0]!r} (--joint {names[0]})."
            )
        joint = names[0] if joint is None else joint
        if joint not in names:
            raise ValueError(
                f"The model has no joint {joint!r}. Its joints are {', '.join(names)}."
            )
        self.joint, self.number = joint, self.joints.index(joint)
        self.settled = settled
        own = actuation.read(self.mujoco, self.model, self.number) if commanded else None
        self.actuator: actuation.Actuator | None = own
        self.columns = columns.distinct(self.mujoco, self.model, self.number, joint, own, settled)

    def __call__(self, recording: Recording) -> Float[np.ndarray, " N"]:
        """The generalised force at the joint, N or N·m, `(N,)`."""
        return self.along(recording).force[:, self.number]

    def baseline(self, units) -> Model:
        """The model's force, with corrections of zero to its parameters and a constant force."""
        own = self.attributes()
        names, spelled = tuple(own), tuple(each.unit for each in own.values())
        # A constant force is the actuator's bias where the log is of its command.
        constant = () if self.actuator is not None else (Offset(),)
        term = Sum((KnownForce(), KnownColumns(names, spelled), *constant))
        return Model(term, jnp.zeros(len(term.affine)), units)

    def attributes(self) -> Mapping[str, Attribute]:
        """The model's parameters that the joint's force tells of, by the corrections' names."""
        return self.columns.attributes

    def bodies(self) -> set[str]:
        """The names of the bodies that the joint moves."""
        return columns.moved(self.model, self.number)

    def beside(self, recording: Recording, held_out: bool = False) -> Recording:
        """The recording with the model's force and what each parameter adds, as channels."""
        key = f"beside {self.joint}".encode() + self._key(recording)
        if key not in self._shared:
            self._shared[key] = self._channels(recording)
        force, sound = self._shared[key]
        if self.actuator is not None and actuation.COMMAND not in recording.channels:
            raise ValueError(
                f"{recording.source or 'The recording'} is not of the joint's force but of the "
                "actuator's command: pass it through the simulator's driven(recording) first."
            )
        known = along(recording, force, held_out)
        # What is soft has a force, by which it goes on: it is only not compared.
        soft = np.asarray(sound[KNOWN_MASKED]) > 0
        known = dataclasses.replace(known, mask=np.asarray(known.mask) & ~soft)
        masked = np.where(soft & np.asarray(recording.mask), 1.0, 0.0)
        sound = sound | {KNOWN_MASKED: jnp.asarray(masked)}
        # Where the other joints are is in the force; by their names programs would differ.
        kept = {name: each for name, each in known.channels.items() if name not in self.joints}
        return dataclasses.replace(known, channels=kept | sound)

    def _channels(self, recording: Recording):
        """The force, NaN where nothing is compared, and what stands beside it by channel."""
        seen, own = self.along(recording), self.number
        found = {KNOWN_REST: seen.rest[:, own], KNOWN_MOMENTUM: seen.momentum[:, own]}
        damped = float(self.model.dof_damping[own]) * seen.motion.velocity[:, own]
        found[KNOWN_FRICTION] = seen.friction[:, own] + damped
        time = np.asarray(recording.time, float)
        for number, parts in enumerate(self.columns.along(seen, time)):
            found |= dict(zip(channels_of(number), parts, strict=True))
        found |= self._neighbours(seen)
        soft, gone = self._sticks(seen), self.limited(recording)
        soft |= elastic.ringing(self.mujoco, self.model, recording)
        if np.mean(touches := self.touches(recording)) < MOSTLY:
            gone |= touches
        if (gone | soft).all():
            raise Standing(
                f"{recording.source or 'The recording'}: the joint {self.joint} stands, or is at a "
                "limit of the model, in all samples, so that nothing can be compared. Is it the "
                "column of a joint that moved?"
            )
        found[KNOWN_MASKED] = np.where(soft & ~gone, 1.0, 0.0)
        sound = {name: jnp.asarray(np.nan_to_num(values)) for name, values in found.items()}
        return np.where(gone, np.nan, seen.force[:, own]), sound

    def _neighbours(self, seen: inverse.Along) -> dict[str, np.ndarray]:
        """The velocities of the other joints that move, m/s or rad/s, and the forces that they
        need, by channel; springs of transmissions have none.
        """
        found = {}
        for i in [self.joints.index(name) for name in self.recorded if name != self.joint]:
            if np.ptp(seen.motion.velocity[:, i]) <= 0:
                continue
            named = self.joints[i], "rad" if is_hinge(self.mujoco, self.model, i) else "m"
            found[neighbour_channel(*named)] = seen.motion.velocity[:, i]
            # A machine's dry friction is at its limit as soon as it slips, MuJoCo's a while later.
            dry = float(self.model.dof_frictionloss[i]) * np.sign(seen.motion.velocity[:, i])
            parts = seen.rest[:, i] - seen.friction[:, i] + dry, seen.momentum[:, i]
            found |= dict(zip(force_channels(*named), parts, strict=True))
        return found

    def turns_all(self, name: str) -> bool:
        """Whether a joint is a hinge by which all that the model moves turns: then its zero and a
        tilt of the base about its axis are one.
        """
        first = self.joints.index(name)
        top = int(self.model.jnt_bodyid[first])

        def below(body: int) -> bool:
            while body not in (0, top):
                body = int(self.model.body_parentid[body])
            return body == top

        own = int(self.model.body_jntadr[top]) == first
        return (
            own
            and is_hinge(self.mujoco, self.model, first)
            and all(map(below, self.model.jnt_bodyid))
        )

    def limited(self, recording: Recording) -> Bool[np.ndarray, " N"]:
        """Where the joint is at a limit of the model, `(N,)`."""
        place = self.along(recording).motion.position[:, self.number]
        return at_limit(self.model, self.number, place)

    def touches(self, recording: Recording) -> Bool[np.ndarray, " N"]:
        """Where bodies of the model touch, `(N,)`."""
        key = b"touches" + self._key(recording)
        if key not in self._shared:
            motion = self.along(recording).motion
            self._shared[key] = touching(self.mujoco, self.model, motion)
        return self._shared[key]

    def along(self, recording: Recording) -> inverse.Along:
        """What the model says of all joints along a recorded motion."""
        key = b"along" + self._key(recording)
        if key not in self._shared:
            logs = [self._position(recording, name) for name in self.recorded]
            place = b"motion" + self._places(logs)
            if place not in self._shared:
                parts = np.array([derived(log) for log in logs])
                self._shared[place] = inverse.Motion(*np.moveaxis(parts, 0, -1))
            motion = self._with_springs(self._shared[place], recording)
            self._shared[key] = inverse.along(self.mujoco, self.model, motion)
        return self._shared[key]

    def _with_springs(self, motion: inverse.Motion, recording: Recording) -> inverse.Motion:
        """The motion of all joints, those that are springs of a transmission too."""
        if len(self.recorded) == len(self.joints):
            return motion
        at = [self.joints.index(name) for name in self.recorded]
        parts = []
        for part in motion:
            whole = np.zeros((len(part), len(self.joints)))
            whole[:, at] = part
            parts.append(whole)
        return elastic.deflected(self.mujoco, self.model, inverse.Motion(*parts), recording)

    def _key(self, recording: Recording) -> bytes:
        """What the force along a motion depends on."""
        logs = [self._position(recording, name) for name in self.recorded]
        zeros = repr(sorted(self.zeros.items()))
        known = f"{self._source} {zeros} {self.actuator} {self.settled}"
        own = hashlib.sha256(known.encode()).digest()
        return own + self._places(logs)

    @staticmethod
    def _places(logs: list[Recording]) -> bytes:
        places = [np.asarray(log.position).tobytes() for log in logs]
        return hashlib.sha256(b"".join([*places, np.asarray(logs[0].time).tobytes()])).digest()

    def moved(
        self, recording: Recording, zeros: Mapping[str, float], index: np.ndarray
    ) -> Float[np.ndarray, " n"]:
        """The force at some samples if the encoders' zeros were elsewhere, rad or m by joint."""
        key = f"moved {sorted(zeros.items())} {len(index)}".encode() + self._key(recording)
        if key not in self._shared:
            motion = self.along(recording).motion
            shift = np.array([zeros.get(name, 0.0) for name in self.joints])
            at = inverse.Motion(*(part[index] for part in motion))
            at = at._replace(position=at.position - shift)
            self._shared[key] = inverse.forces(self.mujoco, self.model, at)
        return self._shared[key][:, self.number]

    def turned(
        self, recording: Recording, order: Sequence[int], signs: np.ndarray, index: np.ndarray
    ) -> Float[np.ndarray, "n dof"]:
        """The forces of all joints at some samples if the positions were in another order, or
        counted the other way.
        """
        motion = self.along(recording).motion
        at = inverse.Motion(*(signs * part[index][:, list(order)] for part in motion))
        return inverse.forces(self.mujoco, self.model, at)

    def references(self, joints: Sequence[str]) -> dict[str, float]:
        """Where some joints stand by the model itself, rad or m."""
        return {name: float(self.model.qpos0[self.joints.index(name)]) for name in joints}

    def with_zeros(self, zeros: Mapping[str, float]) -> "Mujoco":
        """The same simulator with other zeros of the joints' encoders: their attribute `ref`."""
        zeros = {**self.zeros, **zeros}
        return Mujoco(
            self._source, self.joint, self._folder, self._shared, zeros,
            self.actuator is not None, self.settled,
        )  # fmt: skip

    @property
    def standing(self) -> list[str]:
        """What of the actuator the log tells, and what it does not, in words."""
        return actuation.standing(self.mujoco, self.model, self.number, self.actuator)

    def driven(self, recording: Recording) -> Recording:
        """The recording of a command as one of the joint's force, which the actuator makes of it.

        **Arguments:** `recording`, whose force is the command of the joint's actuator, in the
        actuator's own unit. It stays as the channel `known_command`.
        """
        if self.actuator is None:
            raise ValueError("Say that the log is of the actuator's command: commanded=True.")
        return actuation.driven(self.actuator, recording, self.along(recording), self.number)

    def _sticks(self, seen: inverse.Along) -> Bool[np.ndarray, " N"]:
        """Where the model's dry friction does not resist at its limit: it creeps to rest, `(N,)`.

        MuJoCo's friction is a stiff function of the acceleration then (Todorov 2014, soft
        constraints), ten times that of the inertia by default: of a recorded motion, whose
        acceleration has to be derived, it may be anything up to break-away, as at rest. Of one that
        turns quickly it is at the limit already, against the acceleration, while the axis still
        moves on: there it drives, as no friction of a machine does.
        """
        limit = float(self.model.dof_frictionloss[self.number])
        forward = np.sign(seen.motion.velocity[:, self.number])
        return (limit > 0) & (forward * seen.friction[:, self.number] < (1 - ROUNDING) * limit)

    def _position(self, recording: Recording, joint: str) -> Recording:
        """The recording with the position of a joint as its own, and nothing derived from it."""
        if joint != self.joint:
            if joint not in recording.channels:
                raise ValueError(
                    f"{recording.source or 'The recording'} lacks the position of the joint "
                    f"{joint!r}, which moves {self.joint!r} too. Name its column: --columns "
                    f"{joint}=NAME (channels={{{joint!r}: ...}})."
                )
            recording = dataclasses.replace(
                recording, position=recording.channels[joint], velocity=None
            )
        if recording.position is None:
            raise ValueError(
                f"{recording.source or 'The recording'} has no position, which a simulator needs. "
                "Name its column: --columns position=NAME."
            )
        return dataclasses.replace(recording, velocity=None, channels={})


def derived(recording: Recording):
    """Position, velocity and acceleration by smoothing derivatives of the position, `(N,)` each.

    The velocity is that of [`prepare`][jaxfric.signals.prepare]; the acceleration is of the width
    that is best for a second derivative.
    """
    position = np.asarray(recording.position, float)
    first, second = (signals.choose(recording, order=order) for order in (1, 2))
    velocity = signals.derivative(recording, position, first.half_width, first.degree)
    rough = signals.derivative(recording, position, second.half_width, second.degree)
    acceleration = signals.derivative(recording, rough, second.half_width, second.degree)
    return position, velocity, acceleration


def mujoco(model: str | Path, joint: str | None = None, *, commanded: bool = False) -> Mujoco:
    """A MuJoCo model (MJCF or URDF) as a baseline of `explain`.

    See [`Mujoco`][jaxfric.simulators.Mujoco].
    """
    return Mujoco(model, joint, commanded=commanded)
