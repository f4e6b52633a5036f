"""The values that all joints of a robot say are wrong, in words."""

from collections.abc import Mapping

import numpy as np

from ..simulators import Attribute
from ..simulators.columns import GAIN
from ..simulators.weights import GRAVITY, attribute
from .attributes import CONSTANT, listed
from .bodies import Bodies
from .finding import Moved
from .quantities import quantity

# A base is set up to a tenth of a degree.
STRAIGHT = 0.1
# What no value of a body or of gravity stands for.
GEOMETRY = (
    "the file's geometry (lengths of links, axes, couplings of joints), which is not among what is "
    "asked"
)


def worded(
    moved: Mapping[str, Moved], instead: Mapping[str, tuple[str, ...]], rows: Bodies,
    own: Mapping[str, Mapping[str, Attribute]],
) -> str:  # fmt: skip
    """The wrong values in words, each with what would do as well; `own`: each joint's values."""
    texts = []
    for name, m in moved.items():
        said = quantity(m.estimate, smaller=False)
        text = f"{_value(name, rows)} {m.before:.4g} → {said}"
        if others := instead.get(name):
            alike = dict.fromkeys(_said(other, rows, own) for other in others)
            text += f" (or {listed(list(alike), 'others')}: these motions cannot tell them apart)"
        texts.append(text)
    return "; ".join([*texts, *_turned(moved, rows), *_raised(moved, rows), *geometry(moved, rows)])


def _value(name: str, rows: Bodies) -> str:
    """A value of a body or of gravity in words."""
    if name in GRAVITY:
        return f"gravity along {name[-1]}"
    body, what = rows.owner[name]
    value = attribute(rows.weights[body], body, what)
    return f"{value.owner}: {value.what}"


def _turned(moved: Mapping[str, Moved], rows: Bodies) -> list[str]:
    """By how much gravity has another direction than in the file, as of a base that is askew."""
    if not any(name in moved for name in GRAVITY):
        return []
    before = np.array([rows.before[name] for name in GRAVITY])
    after = np.array([moved[n].value if n in moved else rows.before[n] for n in GRAVITY], float)
    sizes = np.linalg.norm(before), np.linalg.norm(after)
    if not all(sizes):
        return []
    angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(before, after)), before @ after))
    text = f"gravity is {sizes[1]:.4g} m/s²"
    if angle < STRAIGHT:
        return [f"{text} and of the same direction"]
    how = "is tilted" if angle < 45 else "is mounted another way"
    return [f"{text} and {angle:.3g}° from the file's direction: the base {how}"]


def _said(name: str, rows: Bodies, own: Mapping[str, Mapping[str, Attribute]]) -> str:
    """A number that would do as well, in words."""
    if name in GRAVITY:
        return _value(name, rows)
    if name in rows.owner:
        body, what = rows.owner[name]
        return str(attribute(rows.weights[body], body, what))
    joint, _, key = name.partition(":")
    if key == CONSTANT or key not in own[joint]:
        return f"a constant force at joint {joint}"
    return (
        f"gain of joint {joint}"
        if key == GAIN and own[joint][key].what == GAIN
        else str(own[joint][key])
    )


def geometry(moved: Mapping[str, Moved], rows: Bodies) -> list[str]:
    """A doubt where values of several bodies differ: a part that is bolted on changes one."""
    bodies = dict.fromkeys(rows.owner[name][0] for name in moved if name in rows.owner)
    if len(bodies) < 2:
        return []
    return [f"these are values of {len(bodies)} bodies at once: look first at {GEOMETRY}"]


def _raised(moved: Mapping[str, Moved], rows: Bodies) -> list[str]:
    """The inertias that go along because no body could be without."""
    state = {n: float(m.value) for n, m in moved.items() if n in rows.owner}
    return [
        f"body {body}: inertia {letter} {before:.4g} → {after:.4g} kg·m², the least that a "
        "body with the others can have: these motions do not show it"
        for body, letter, before, after in rows.raised(state)
    ]
