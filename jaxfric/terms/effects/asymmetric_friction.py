"""Friction that differs with the direction."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp

from ...units import DAMPING, FORCE
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


SIDES = ("forwards", "backwards")


class CoulombAsymmetry(AbstractLaw):
    """Coulomb friction of one direction: F = ΔFc max(sign v, 0) forwards, ΔFc min(sign v, 0)
    backwards.

    Beside values of friction that are right in the other direction than `side`. With "both" half
    the difference, F = ΔFc abs(sign v), beside values that are right in the mean.
    """

    side: str = eqx.field(static=True, default="forwards")

    def __check_init__(self):
        if self.side not in (*SIDES, "both"):
            raise ValueError(f"side is {', '.join(SIDES)} or both, not {self.side!r}.")

    @property
    def affine(self):
        name = f"coulomb_{self.side}" if self.side in SIDES else "coulomb_asymmetry"
        return (Parameter(name, FORCE),)

    def law(self, sample: Sample):
        sign = jnp.sign(sample.velocity)
        if self.side == "both":
            return (jnp.abs(sign),)
        zero = jnp.zeros_like(sign)
        return (jnp.maximum(sign, zero) if self.side == "forwards" else jnp.minimum(sign, zero),)

    def text(self, s):
        sign = s.call("sign", "v")
        if self.side == "both":
            return (s.call("abs", sign),)
        return (s.clip(sign, *(("0.0", "1.0") if self.side == "forwards" else ("-1.0", "0.0"))),)


def _one_number(values, extent):
    """The sentence where Coulomb friction alone differs."""
    for side in SIDES:
        if f"coulomb_{side}" in values:
            return (
                f"Friction differs with the direction: {side} there is {{coulomb_{side}}} of "
                "Coulomb friction beyond the model's"
            )
    if "viscous_asymmetry" not in values:
        return (
            "Friction differs with the direction: at any speed, half the difference is "
            "{coulomb_asymmetry}"
        )
    return None


ASYMMETRIC_FRICTION = Effect(
    "asymmetric_friction",
    "ΔFc abs(sign v) + ΔFv abs(v)",
    "friction",
    "Friction differs with the direction: half the difference is {viscous_asymmetry} with speed "
    "and, at any speed, {coulomb_asymmetry}",
    variant=_one_number,
    laws=(FrictionAsymmetry, CoulombAsymmetry),
    scaled=lambda scales: (FrictionAsymmetry(), *map(CoulombAsymmetry, (*SIDES, "both"))),
    coordinates=("velocity",),
    confusable_with=("load_drift",),
    separate_by="Let the axis stick: a constant force shifts both break-away levels alike.",
)
