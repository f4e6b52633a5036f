"""An actuator's values, written into its element of a model's file and read back."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from . import actuation
from .tags import Tag, number

# What a general actuator says in attributes of its own.
SHORT = ("kp", "kv", "dampratio", "timeconst", "inheritrange")


def changed(
    mujoco: Any, model: Any, owner: str, values: Mapping[str, float], found: list[Tag]
) -> tuple[dict[int, dict[str, str | None]], dict[int, str]]:
    """The attributes to be set, by the number of the tag, and the tags that get another name.

    A motor has neither bias nor filter: it becomes a general actuator with the law that it has.
    """
    tag = _tag(model, owner, found)
    own, kind = _index(model, owner), found[tag].name
    if "gear" in values:
        before = found[tag].attributes.get("gear", "1").split()
        return {tag: {"gear": " ".join([number(values["gear"]), *before[1:]])}}, {}
    if "delay" in values:
        # As many commands are kept as the delay holds.
        count = int(np.ceil(values["delay"] / model.opt.timestep)) + 1
        return {tag: {"delay": number(values["delay"]), "nsample": str(count)}}, {}
    short = ("kp", "kv") if kind == "position" else ("kv",) if kind == "velocity" else ()
    # A damping ratio is of the gain: what it makes of it would change with it.
    if set(values) <= set(short) and "dampratio" not in found[tag].attributes:
        return {tag: {name: number(value) for name, value in values.items()}}, {}
    law = _law(mujoco, model, own, values)
    gone = dict.fromkeys(name for name in SHORT if name in found[tag].attributes)
    return {tag: {**gone, **law}}, {} if kind == "general" else {tag: "general"}


def _index(model: Any, owner: str) -> int:
    return next(i for i in range(model.nu) if actuation.label(model, i) == owner)


def _tag(model: Any, owner: str, found: list[Tag]) -> int:
    """The number of an actuator's tag."""
    section = [i for i, tag in enumerate(found) if tag.name == "actuator"]
    own = [i for i, tag in enumerate(found) if tag.parent in section]
    if len(own) != model.nu:
        raise ValueError("its actuators are not all written out in this file")
    return own[_index(model, owner)]


def _law(
    mujoco: Any, model: Any, number_: int, values: Mapping[str, float]
) -> dict[str, str | None]:
    """A general actuator's law with other values."""
    own = actuation.read(mujoco, model, int(model.actuator_trnid[number_, 0]))
    gain, bias, constant = own.gain, list(own.bias), own.constant
    for what, value in values.items():
        if what == "dynprm[0]":
            constant = value
        elif what.startswith("biasprm"):
            bias[int(what[8])] = value
        elif what == "kv" and own.servo == 1:
            bias[2] = -value
        else:  # the gain, and what of the bias is its own
            gain = value
            if own.servo:
                bias[own.servo] = -value
    if constant < 0:
        raise ValueError("its time constant would be below zero")
    law: dict[str, str | None] = {
        "gaintype": "fixed", "gainprm": number(gain),
        "biastype": "affine" if any(bias) else "none", "biasprm": " ".join(map(number, bias)),
    }  # fmt: skip
    law["dyntype"] = "filterexact" if constant else "none"
    if constant:
        law["dynprm"] = number(constant)
    if np.isfinite(own.control[0]):
        law |= {"ctrllimited": "true", "ctrlrange": " ".join(map(number, own.control))}
    return law


def value(mujoco: Any, model: Any, owner: str, what: str) -> float:
    """The value of an actuator's attribute in a compiled model."""
    at = _index(model, owner)
    if what == "gear":
        return float(model.actuator_gear[at, 0])
    if what == "delay":
        return float(model.actuator_delay[at])
    own = actuation.read(mujoco, model, int(model.actuator_trnid[at, 0]))
    if what.startswith("biasprm"):
        return own.bias[int(what[8])]
    if what == "dynprm[0]":
        return own.constant
    return -own.bias[2] if what == "kv" and own.servo == 1 else own.gain
