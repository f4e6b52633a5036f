"""MuJoCo's inverse dynamics along a recorded motion (MuJoCo reads MJCF and URDF)."""

import dataclasses
import hashlib
from collections.abc import Mapping
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from .. import signals
from ..data.recording import Recording
from ..models import Model
from ..terms import KNOWN_MOMENTUM, KNOWN_REST, KnownColumns, KnownForce, Offset, channels_of
from ..terms.base import Sum
from . import columns, inverse
from .known import AbstractSimulator, Attribute, along
from .loading import joints_of, library, read

# Of a limit that is reached, what rounding and the solver leave.
ROUNDING = 1e-6


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
    meshes of a model that is given as text lie; `shared`, a memory for several joints of one log.

    **Raises:** `ValueError` for a model that MuJoCo cannot read, for free and ball joints, closed
    loops, and a joint or channel that is not there.
    """

    def __init__(
        self,
        model: str | Path,
        joint: str | None = None,
        folder: Path | None = None,
        shared: dict[bytes, inverse.Along] | None = None,
    ):
        self.mujoco, self._source = library(), str(model)
        self._shared = {} if shared is None else shared
        self.model = read(self.mujoco, model, folder)
        self.joints = joints_of(self.mujoco, self.model)
        if joint is None and len(self.joints) > 1:
            raise ValueError(
                f"The model has {len(self.joints)} joints: {', '.join(self.joints)}. Say which one "
                f"the recording is of: joint={self.joints[0]!r} (--joint {self.joints[0]})."
            )
        joint = self.joints[0] if joint is None else joint
        if joint not in self.joints:
            raise ValueError(
                f"The model has no joint {joint!r}. Its joints are {', '.join(self.joints)}."
            )
        self.joint, self.number = joint, self.joints.index(joint)
        self.columns = columns.distinct(self.mujoco, self.model, self.number, joint)

    def __call__(self, recording: Recording) -> Float[np.ndarray, " N"]:
        """The generalised force at the joint, N or N·m, `(N,)`."""
        return self.along(recording).force[:, self.number]

    def baseline(self, units) -> Model:
        """The model's force, with corrections of zero to its parameters and a constant force."""
        own = self.attributes()
        names, spelled = tuple(own), tuple(each.unit for each in own.values())
        term = Sum((KnownForce(), KnownColumns(names, spelled), Offset()))
        return Model(term, jnp.zeros(len(term.affine)), units)

    def attributes(self) -> Mapping[str, Attribute]:
        """The model's parameters that the joint's force tells of, by the corrections' names."""
        return self.columns.attributes

    def beside(self, recording: Recording, held_out: bool = False) -> Recording:
        """The recording with the model's force and what each parameter adds, as channels."""
        seen, own = self.along(recording), self.number
        found = {KNOWN_REST: seen.rest[:, own], KNOWN_MOMENTUM: seen.momentum[:, own]}
        for number, parts in enumerate(self.columns.along(seen)):
            found |= dict(zip(channels_of(number), parts, strict=True))
        force = np.where(self._sticks(seen), np.nan, seen.force[:, own])
        known = along(recording, force, held_out)
        sound = {name: jnp.asarray(np.nan_to_num(values)) for name, values in found.items()}
        return dataclasses.replace(known, channels=known.channels | sound)

    def along(self, recording: Recording) -> inverse.Along:
        """What the model says of all joints along a recorded motion."""
        logs = [self._position(recording, name) for name in self.joints]
        places = [np.asarray(log.position).tobytes() for log in logs]
        source = self._source.encode()
        key = hashlib.sha256(
            b"".join([source, *places, np.asarray(logs[0].time).tobytes()])
        ).digest()
        if key not in self._shared:
            parts = np.array([derived(log) for log in logs])
            motion = inverse.Motion(*np.moveaxis(parts, 0, -1))
            self._shared[key] = inverse.along(self.mujoco, self.model, motion)
        return self._shared[key]

    def _sticks(self, seen: inverse.Along) -> Bool[np.ndarray, " N"]:
        """Where the model's dry friction is below its limit: it creeps to rest there, `(N,)`.

        MuJoCo's friction is a stiff function of the acceleration then (Todorov 2014, soft
        constraints), ten times that of the inertia by default: of a recorded motion, whose
        acceleration has to be derived, it may be anything up to break-away, as at rest.
        """
        limit = float(self.model.dof_frictionloss[self.number])
        return np.abs(seen.friction[:, self.number]) < (1 - ROUNDING) * limit

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


def mujoco(model: str | Path, joint: str | None = None) -> Mujoco:
    """A MuJoCo model (MJCF or URDF) as a baseline of `explain`.

    See [`Mujoco`][jaxfric.simulators.Mujoco].
    """
    return Mujoco(model, joint)
