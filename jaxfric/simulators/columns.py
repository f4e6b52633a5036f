"""What each parameter of a MuJoCo model adds to the force of a joint, by a unit of it."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from . import actuation, rigid, weights
from .actuation import Actuator
from .inverse import Along, Motion, along, with_friction
from .known import Attribute
from .loading import is_hinge

# Rest and momentum of a parameter's force, `(N,)` each.
Parts = tuple[np.ndarray, np.ndarray]
# How much of the simulator's force is recorded beyond all of it: of a torque constant, of a gear.
GAIN = "gain"
# Columns whose directions differ by less are one and the same, but for rounding.
SAME = 1e-9
# A motion on which columns are compared: a few hundred states that no two columns share by chance.
STATES = 200


class Columns(NamedTuple):
    """The parameters of a model that a joint's force tells of, and their forces along a motion."""

    attributes: Mapping[str, Attribute]
    makers: Mapping[str, Callable[[Along], Parts]]
    timed: Mapping[str, Callable[[Along, np.ndarray], Parts]] = {}  # noqa: RUF012 - never changed

    def along(self, seen: Along, time: np.ndarray) -> list[Parts]:
        """Rest and momentum of each, in the order of the attributes; `time` of the motion, s."""
        return [
            self.timed[name](seen, time) if name in self.timed else self.makers[name](seen)
            for name in self.attributes
        ]


def distinct(
    mujoco: Any, model: Any, joint: int, name: str, actuator: Actuator | None = None,
    settled: bool = False,
) -> Columns:  # fmt: skip
    """The parameters that a joint's force depends on, one for each that no motion tells apart.

    `actuator`: where the log is of its command, whose own values then show too; `settled`: without
    those of bodies, which all joints together have told.
    """
    every = {**_of_joint(mujoco, model, joint, name), **_of_bodies(mujoco, model, joint)}
    if actuator is not None:
        every = _of_actuator(every, actuator, joint, name)
    draw = np.random.default_rng(0)
    motion = Motion(*draw.uniform(-1.5, 1.5, (3, STATES, model.nv)))
    seen = along(mujoco, model, motion)
    attributes: dict[str, Attribute] = {}
    directions: dict[str, np.ndarray] = {}
    whole = np.linalg.norm(seen.force[:, joint])
    for key, (attribute, maker) in every.items():
        direction = np.concatenate(maker(seen))
        size = np.linalg.norm(direction)
        if size * (abs(attribute.value) or 1.0) <= SAME * whole:
            continue
        direction = direction / size
        twin = next((k for k, d in directions.items() if abs(d @ direction) > 1 - SAME), None)
        if twin is None:
            attributes[key], directions[key] = attribute, direction
        else:
            own = attributes[twin]
            attributes[twin] = own._replace(alike=(*own.alike, attribute))
    if settled:
        attributes = {key: each for key, each in attributes.items() if key[:5] != "body/"}
    makers = {key: every[key][1] for key in attributes}
    if actuator is None or not actuator.constant:
        return Columns(attributes, makers)
    key, made = actuator.path("dynprm[0]"), actuator
    timed = {key: lambda seen, time: actuation.by_constant(made, joint, seen, time)}
    return Columns(attributes | {key: actuation.constant(made)}, makers, timed)


def _of_actuator(every, actuator: Actuator, joint: int, name: str):
    """With the values of an actuator in place of the force's gain, the joint's own values first."""
    spring = every[f"joint/{name}/stiffness"][0]
    rests = spring._replace(what="springref", value=spring.rest, alike=())
    sprung = rests if spring.value else None
    gained = {
        GAIN: (actuation.gain(actuator), lambda s: actuation.by_gain(actuator, joint, s)),
        **actuation.columns(actuator, joint, sprung),
    }
    # A servo's speed is that of one moment or another within half an integrator's step: its damping
    # times that much is inertia.
    armature, parts = every[f"joint/{name}/armature"]
    unsure = abs(actuator.gear**2 * actuator.bias[2] * actuator.ahead)
    every = every | {f"joint/{name}/armature": (armature._replace(between=unsure), parts)}
    return {key: gained.pop(key, own) for key, own in every.items()} | gained


def _of_joint(mujoco: Any, model: Any, joint: int, name: str):
    per = "N·m·s/rad", "N·m/rad", "N·m", "kg·m²"
    damping, stiffness, force, inertia = (
        per if is_hinge(mujoco, model, joint) else ("N·s/m", "N/m", "N", "kg")
    )
    owner, centre = f"joint {name}", float(model.qpos_spring[joint])

    def friction(seen: Along) -> Parts:
        rms = float(np.sqrt(np.mean(seen.force[:, joint] ** 2)))
        step = 0.1 * max(float(model.dof_frictionloss[joint]), 0.1 * rms, 1e-6)
        more = with_friction(mujoco, model, seen.motion, joint, step)
        return _resting((more - seen.friction[:, joint]) / step)

    def armature(seen: Along) -> Parts:
        speed = seen.motion.velocity[:, joint]
        return np.zeros_like(speed), speed

    found = {
        "damping": (damping, model.dof_damping, lambda s: _resting(s.motion.velocity[:, joint])),
        "frictionloss": (force, model.dof_frictionloss, friction),
        "armature": (inertia, model.dof_armature, armature),
        "stiffness": (
            stiffness, model.jnt_stiffness, lambda s: _resting(s.motion.position[:, joint] - centre)
        ),
    }  # fmt: skip
    named = {
        f"joint/{name}/{what}": (
            Attribute(owner, what, float(values[joint]), unit, rest=centre),
            maker,
        )
        for what, (unit, values, maker) in found.items()
    }
    gear = Attribute(owner, "gain", 1.0, "1")
    if (number := actuation.only(mujoco, model, joint)) is not None:
        name = f"actuator {actuation.label(model, number)}"
        gear = Attribute(name, "gear", float(model.actuator_gear[number, 0]), "1")
    return named | {GAIN: (gear, lambda s: (s.rest[:, joint], s.momentum[:, joint]))}


def _of_bodies(mujoco: Any, model: Any, joint: int):
    found = {}
    for body in range(1, model.nbody):
        if model.body_mass[body] <= 0 or joint not in _moved_by(model, body):
            continue
        label = weights.label(model, body)
        own = weights.weight_of(mujoco, model, body)
        values = own.values()
        for what, slope in rigid.slopes(*own).items():
            attribute = weights.worded(label, what, float(values[what]))
            maker = _body(slope, body, joint, model.opt.gravity)
            found[f"body/{label}/{what}"] = (attribute, maker)
    return found


def moved(model: Any, joint: int) -> set[str]:
    """The names of the bodies that a joint moves."""
    return {weights.label(model, b) for b in range(1, model.nbody) if joint in _moved_by(model, b)}


def _body(slope, body: int, joint: int, gravity) -> Callable[[Along], Parts]:
    def parts(seen: Along) -> Parts:
        rest, momentum = rigid.regressor(seen.frames[body - 1], joint, gravity)
        return slope @ rest, slope @ momentum

    return parts


def _moved_by(model: Any, body: int) -> set[int]:
    """The joints between a body and the world."""
    found: set[int] = set()
    while body:
        first = int(model.body_jntadr[body])
        found |= set(range(first, first + int(model.body_jntnum[body])))
        body = int(model.body_parentid[body])
    return found


def _resting(values: np.ndarray) -> Parts:
    return values, np.zeros_like(values)
