"""A model's file with some of its values changed, and nothing else."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from . import actuators
from .loading import is_hinge, is_text, joints_of, read
from .tags import Bodies, Tag, bodies, edited, number as _number, tags
from .weights import MASS, label, weight_of

# What a file's number may differ from the value that it stands for, relative.
ROUNDING = 1e-5


class Patched(NamedTuple):
    """A model's text, the attributes that were changed in it, and what could not be, with why."""

    text: str
    written: tuple[str, ...]
    left: Mapping[str, str]


def patched(
    mujoco: Any, source: str | Path, values: Mapping[str, float], folder: Path | None = None
) -> Patched:
    """The model with other values of its attributes, `joint/elbow/damping` for instance.

    A URDF becomes a MuJoCo model, for it has no stiffness and no armature. Each change is read back
    by MuJoCo; what it does not take is not written. `folder`: in which a text's meshes lie.
    """
    folder = folder or folder_of(source)
    text, model = text_of(mujoco, source), read(mujoco, source, folder)
    written: list[str] = []
    left: dict[str, str] = {}
    for group in _groups(values):
        try:
            changed = _changed(mujoco, text, model, group)
            _check(mujoco, read(mujoco, changed, folder), model, group)
        except ValueError as error:
            left |= dict.fromkeys(group, str(error))
            continue
        text = changed
        written += group
    return Patched(text, tuple(written), left)


def with_inertial(mujoco: Any, source: str | Path, folder: Path | None = None) -> set[str]:
    """The names of the bodies whose mass and inertia stand apart in the file, in an `inertial`; of
    others, which geoms weigh, the inertia goes along with the mass.
    """
    tree = bodies(tags(text_of(mujoco, source)))
    model = read(mujoco, source, folder)
    if len(tree.bodies) != model.nbody - 1:
        return set()
    every = enumerate(tree.children, 1)
    return {label(model, body) for body, children in every if children["inertial"]}


def text_of(mujoco: Any, source: str | Path) -> str:
    """The MJCF of a model's file or text; of a URDF that of MuJoCo's own translation."""
    text = str(source) if is_text(source) else Path(source).read_text(encoding="utf-8")
    if tags(text)[0].name == "mujoco":
        return text
    if is_text(source):
        spec = mujoco.MjSpec.from_string(text)
    else:
        spec = mujoco.MjSpec.from_file(str(source))
    spec.compile()
    return spec.to_xml()


def folder_of(source: str | Path) -> Path | None:
    """Where the meshes of a model's file lie."""
    return None if is_text(source) else Path(source).resolve().parent


def _groups(values: Mapping[str, float]) -> list[dict[str, float]]:
    """Changes that belong together: those of one body's weight, those of one spring."""
    found: dict[str, dict[str, float]] = {}
    for key, value in values.items():
        kind, owner, what = key.split("/")
        whole = kind in ("body", "option") or what in ("stiffness", "springref", "ref")
        # An actuator's law is written whole; its gear and its delay are attributes beside it.
        whole |= kind == "actuator" and what not in ("gear", "delay")
        found.setdefault(f"{kind}/{owner}" if whole else key, {})[key] = value
    return list(found.values())


def _changed(mujoco: Any, text: str, model: Any, group: Mapping[str, float]) -> str:
    found = tags(text)
    tree = bodies(found)
    names = joints_of(mujoco, model)
    if len(tree.bodies) != model.nbody - 1 or len(tree.joints) != model.njnt:
        raise ValueError(
            "its bodies are not all written out in this file (include, replicate, attach)"
        )
    changes: dict[int, dict[str, str | None]] = {}
    new: dict[int, str] = {}
    kind, owner, _ = next(iter(group)).split("/")
    own = {key.split("/")[2]: value for key, value in group.items()}
    if kind == "option":
        _of_gravity(model, own, found, changes, new)
    elif kind == "joint":
        joint = names.index(owner)
        changes[tree.joints[joint]] = _of_joint(mujoco, model, joint, own, found)
    elif kind == "actuator":
        changes, renamed = actuators.changed(mujoco, model, owner, own, found)
        return edited(text, changes, new, renamed)
    else:
        body = next(b for b in range(1, model.nbody) if label(model, b) == owner)
        _of_body(mujoco, model, body, own, found, tree, changes, new)
    return edited(text, changes, new)


def _of_joint(mujoco: Any, model: Any, joint: int, own: Mapping[str, float], found: list[Tag]):
    below = [name for name, value in own.items() if name not in ANGLES and value < 0]
    if below:
        raise ValueError(f"its {below[0]} would be below zero")
    degrees = is_hinge(mujoco, model, joint) and _in_degrees(found)
    scale = 180 / np.pi if degrees else 1.0
    own = dict(own)
    if "ref" in own and "springref" not in own and model.jnt_stiffness[joint]:
        # The spring rests where it did, in angles that count from elsewhere.
        own["springref"] = float(model.qpos_spring[joint] + own["ref"] - model.qpos0[joint])
    written: dict[str, str | None] = {
        name: _number(value * (scale if name in ANGLES else 1.0)) for name, value in own.items()
    }
    if LIMIT in own:
        written[LIMIT] = f"{_number(-own[LIMIT])} {_number(own[LIMIT])}"
    return written


# Attributes that are positions of a joint; the range of all actuators' force at a joint.
ANGLES, LIMIT = ("springref", "ref"), "actuatorfrcrange"


def _in_degrees(found: list[Tag]) -> bool:
    angles = [
        t.attributes["angle"] for t in found if t.name == "compiler" and "angle" in t.attributes
    ]
    return not angles or angles[-1] != "radian"


def _of_gravity(model: Any, own: Mapping[str, float], found: list[Tag], changes, new) -> None:
    """Gravity in the file's `option`, there already or added."""
    values = [own.get(k, float(g)) for k, g in zip("xyz", model.opt.gravity, strict=True)]
    gravity = " ".join(map(_number, values))
    options = [i for i, tag in enumerate(found) if tag.name == "option"]
    if options:
        changes[options[-1]] = {"gravity": gravity}
    else:
        new[0] = f'<option gravity="{gravity}"/>'


def _of_body(mujoco, model, body, own, found: list[Tag], tree: Bodies, changes, new) -> None:
    """The weight of a body: its geom's mass, or its `inertial`, there already or added."""
    mass, centre, inertia, _ = weight_of(mujoco, model, body).with_values(own)
    children = tree.children[body - 1]
    geoms = children["geom"]
    if set(own) == {MASS} and not children["inertial"] and len(geoms) == 1:
        if "mass" in found[geoms[0]].attributes:
            changes[geoms[0]] = {"mass": _number(mass)}
            return
    written: dict[str, str | None] = {
        "mass": _number(mass),
        "pos": " ".join(map(_number, centre)),
        "diaginertia": " ".join(map(_number, inertia)),
    }
    if children["inertial"]:
        tag = found[children["inertial"][0]]
        kept = _as_it_was(own)
        if "fullinertia" in tag.attributes and "diaginertia" not in kept:
            written |= {"fullinertia": None, "quat": _quat(model, body)}
        changes[children["inertial"][0]] = {k: v for k, v in written.items() if k not in kept}
        return
    written["quat"] = _quat(model, body)
    inner = " ".join(f'{name}="{value}"' for name, value in written.items())
    new[tree.bodies[body - 1]] = f"<inertial {inner}/>"


def _as_it_was(own: Mapping[str, float]) -> set[str]:
    """The attributes of an `inertial` that values of a body leave alone."""
    changed = {name.partition("_")[0] for name in own} | ({"inertia"} if MASS in own else set())
    attributes = {"mass": "mass", "centre": "pos", "inertia": "diaginertia"}
    return {name for what, name in attributes.items() if what not in changed}


def _quat(model: Any, body: int) -> str:
    return " ".join(map(_number, model.body_iquat[body]))


def _check(mujoco: Any, new: Any, old: Any, group: Mapping[str, float]) -> None:
    """Raise `ValueError` where MuJoCo reads another value than was meant."""
    names = joints_of(mujoco, new)
    for key, value in group.items():
        kind, owner, what = key.split("/")
        if kind == "joint":
            joint = names.index(owner)
            place = {
                "stiffness": new.jnt_stiffness, "springref": new.qpos_spring,
                "damping": new.dof_damping, "frictionloss": new.dof_frictionloss,
                "armature": new.dof_armature, "ref": new.qpos0, LIMIT: new.jnt_actfrcrange[:, 1],
            }  # fmt: skip
            read_back = float(place[what][joint])
        elif kind == "option":
            read_back = float(new.opt.gravity["xyz".index(what)])
        elif kind == "actuator":
            read_back = actuators.value(mujoco, new, owner, what)
        else:
            body = next(b for b in range(1, new.nbody) if label(new, b) == owner)
            own = {k.split("/")[2]: v for k, v in group.items()}
            whole, there = (
                weight_of(mujoco, old, body).with_values(own),
                weight_of(mujoco, new, body),
            )
            same = (
                np.isclose(there[0], whole[0], rtol=ROUNDING)
                and np.allclose(there[1], whole[1], rtol=ROUNDING, atol=ROUNDING)
                and np.allclose(there[2], whole[2], rtol=1e-3)
            )
            if not same:
                raise ValueError("MuJoCo takes the body's weight from elsewhere (inertiafromgeom)")
            continue
        if abs(read_back - value) > ROUNDING * max(abs(value), 1e-6):
            raise ValueError(f"MuJoCo reads {read_back:.6g} for it")
