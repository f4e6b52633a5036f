"""Friction that differs with the direction."""

from typing import ClassVar

import jax.numpy as jnp

from ...units import (
    DAMPING,
    FORCE,
)
from ..base import AbstractLaw
from ..effect import Effect
from ..sample import Parameter, Sample


class FrictionAsymmetry(AbstractLaw):
    """Half the difference of the two directions' friction: F = ΔFc abs(sign v) + ΔFv abs(v).

    For a baseline that ties the directions. In slip the Coulomb part is exactly a constant
    force; only sticking tells the two apart.
    """

    affine: ClassVar = (
        Parameter("coulomb_asymmetry", FORCE),
        Parameter("viscous_asymmetry", DAMPING),
    )

    def law(self, sample: Sample):
        return (jnp.abs(jnp.sign(sample.velocity)), jnp.abs(sample.velocity))

    def text(self, s):
        return (s.call("abs", s.call("sign", "v")), s.call("abs", "v"))


ASYMMETRIC_FRICTION = Effect(
    "asymmetric_friction",
    "ΔFc abs(sign v) + ΔFv abs(v)",
    "friction",
    "Friction differs with the direction: half the difference is {viscous_asymmetry} with speed "
    "and, at any speed, {coulomb_asymmetry}",
    laws=(FrictionAsymmetry,),
    coordinates=("velocity",),
    confusable_with=("load_drift",),
    separate_by="Let the axis stick: a constant force shifts both break-away levels alike.",
)
