"""What a body weighs, and where: some of its values as given, the others as they belong to them."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from . import rigid
from .inverse import Along, weighed
from .known import Attribute

# A mass whose inertia goes along with it in proportion, as of another density; one whose inertia
# about its centre stays, as where another number stands in the file.
MASS, MASS_ALONE = "mass", "mass_alone"
# By how much an inertia that is raised to be possible passes the bound: what a number's digits and
# MuJoCo's own check may differ by, relative.
MARGIN = 1e-5


class Weight(NamedTuple):
    """Mass, kg; centre, m `(3,)`; principal inertias, kg·m² `(3,)`, their axes `(3, 3)`: all in the
    body's frame, the inertias about the centre.
    """

    mass: float
    centre: np.ndarray
    inertia: np.ndarray
    axes: np.ndarray

    def parameters(self) -> Float[np.ndarray, "10"]:
        """The ten parameters that its force is linear in."""
        return rigid.about_origin(*self)

    def values(self) -> dict[str, float]:
        """Its values by name: mass (twice), centre_x … z, inertia_x … z."""
        named = zip("xyz", self.centre, self.inertia, strict=True)
        found = {MASS: self.mass, MASS_ALONE: self.mass}
        pairs = [(letter, float(c), float(i)) for letter, c, i in named]
        found |= {f"centre_{letter}": c for letter, c, _ in pairs}
        return found | {f"inertia_{letter}": i for letter, _, i in pairs}

    def extent(self) -> float:
        """How far out its mass lies, m: the largest radius of gyration about its frame."""
        return float(np.sqrt(np.max(self.inertia) / self.mass + self.centre @ self.centre))

    def with_values(self, own: Mapping[str, float], any_: bool = False) -> "Weight":
        """The same with the values that are given; inertias that are not given stay, go along with
        `mass`, or are raised as little as makes the body physically possible.

        **Arguments:** `any_`: as the numbers say, be it possible or not.

        **Raises:** `ValueError` for a body that cannot be.
        """
        mass, centre, inertia = self.mass, np.array(self.centre), np.array(self.inertia)
        if MASS_ALONE in own:
            mass = own[MASS_ALONE]
        if MASS in own:
            mass, inertia = own[MASS], inertia * own[MASS] / self.mass
        for k, letter in enumerate("xyz"):
            centre[k] = own.get(f"centre_{letter}", centre[k])
            inertia[k] = own.get(f"inertia_{letter}", inertia[k])
        if any_:
            return Weight(mass, centre, inertia, self.axes)
        given = [k for k, letter in enumerate("xyz") if f"inertia_{letter}" in own]
        if mass <= 0 or np.any(inertia < 0):
            what = "mass" if mass <= 0 else f"inertia {'xyz'[int(np.argmin(inertia))]}"
            raise ValueError(f"the body's {what} would be below zero")
        return Weight(mass, centre, possible(inertia, given) if given else inertia, self.axes)


def possible(inertia: np.ndarray, given: Sequence[int]) -> Float[np.ndarray, "3"]:
    """Principal inertias of which none is more than the other two together (A + B ≥ C), as those of
    any body: those that are not given are raised by as little as that takes.

    **Raises:** `ValueError` where those that are given leave no room for it.
    """
    found = np.array(inertia)
    for k in range(3):
        if found[k] > np.sum(found) - found[k]:
            lacking = (2 + MARGIN) * found[k] - np.sum(found)
            free = [i for i in range(3) if i != k and i not in given]
            if not free:
                raise ValueError(
                    "no body has an inertia that is more than the other two together "
                    f"({', '.join(f'{each:.4g}' for each in found)} kg·m²)"
                )
            found[free] += lacking / len(free)
    return found


def weight_of(mujoco: Any, model: Any, body: int) -> Weight:
    """What a body of a model weighs."""
    return Weight(*weighed(mujoco, model, body))


def label(model: Any, body: int) -> str:
    """The name of a body."""
    return model.body(body).name or f"body{body}"


def weights(mujoco: Any, model: Any) -> dict[str, Weight]:
    """What the bodies of a model weigh, by name; those without mass left out."""
    bodies = [b for b in range(1, model.nbody) if model.body_mass[b] > 0]
    return {label(model, b): weight_of(mujoco, model, b) for b in bodies}


def linear(mujoco: Any, model: Any, joint: int, seen: Along) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rest and momentum `(N,)` of a joint's force by each of the ten parameters of each body with
    mass, in the order of [`weights`][].
    """
    found = []
    for b in range(1, model.nbody):
        if model.body_mass[b] > 0:
            parts = rigid.regressor(seen.frames[b - 1], joint, model.opt.gravity)
            found += list(zip(*parts, strict=True))
    return found


# Gravity along the axes of the world, as a file's values.
GRAVITY = tuple(f"option/gravity/{letter}" for letter in "xyz")


# Mass and first moment: what of a body gravity pulls on.
PULLED = 4


def by_gravity(mujoco: Any, model: Any, joint: int, seen: Along) -> list[np.ndarray]:
    """A joint's force, `(N,)`, by 1 m/s² of gravity along each axis of the world."""
    found = np.zeros((3, len(seen.rest)))
    parts = pulled(mujoco, model, joint, seen)
    bodies = [b for b in range(1, model.nbody) if model.body_mass[b] > 0]
    for b, own in zip(bodies, np.reshape(parts, (-1, PULLED, 3, len(seen.rest))), strict=True):
        theta = weight_of(mujoco, model, b).parameters()[:PULLED]
        found += np.tensordot(theta, own, 1)
    return list(found)


def pulled(mujoco: Any, model: Any, joint: int, seen: Along) -> list[np.ndarray]:
    """A joint's force, `(N,)`, by 1 m/s² of gravity along each axis of the world on a unit of mass
    and of first moment of each body with mass, in the order of [`weights`][].
    """
    found = []
    for b in range(1, model.nbody):
        if model.body_mass[b] <= 0:
            continue
        frame = seen.frames[b - 1]
        moving, turning = (each[joint] for each in frame.jacobians)
        found += list(-moving)
        for k in range(3):
            # J_wᵀ (r × g) is g · (J_w × r), r the frame's own axis.
            found += list(-np.cross(turning, frame.rotation[:, k], axis=0))
    return found


def attribute(weight: Weight, body: str, what: str) -> Attribute:
    """A value of a body in words."""
    words = {MASS: "mass with its inertia in proportion", MASS_ALONE: "mass"}
    own = worded(body, what, weight.values()[what])
    return own._replace(what=words.get(what, own.what))


def worded(body: str, what: str, value: float) -> Attribute:
    """A value of a body by its name in a file, in words."""
    unit = {"mass": "kg", "centre": "m"}.get(what.partition("_")[0], "kg·m²")
    words = what.replace("centre_", "centre of mass ").replace("_", " ")
    return Attribute(f"body {body}", words, value, unit)
