"""Forces that come with acceleration, and the constant one."""

from typing import ClassVar

import jax.numpy as jnp

from ..units import FORCE, INERTIA
from .base import AbstractLaw
from .sample import Parameter, Sample


class Inertia(AbstractLaw):
    """Force that accelerates the moving mass: u = d(M v)/dt (Newton's second law)."""

    in_joint: ClassVar = "inertia"
    affine: ClassVar = (Parameter("inertia", INERTIA),)
    coordinates: ClassVar = frozenset({"acceleration"})

    def law(self, sample: Sample):
        return (jnp.zeros_like(sample.velocity),)

    def impulse(self, sample: Sample):
        return (sample.velocity,)

    def text(self, s):
        return ("a",)


class Offset(AbstractLaw):
    """Constant force: u = F₀ (weight of a vertical axis, amplifier offset)."""

    in_joint: ClassVar = "constant"
    affine: ClassVar = (Parameter("offset", FORCE),)
    coordinates: ClassVar = frozenset()

    def law(self, sample: Sample):
        return (jnp.ones_like(sample.velocity),)

    def text(self, s):
        return ("1.0",)
