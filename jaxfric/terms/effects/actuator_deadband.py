"""Force lost around zero command."""

from typing import ClassVar

import jax.numpy as jnp

from ...units import FORCE
from ..actuator import PREDICTED
from ..base import AbstractLaw
from ..effect import Effect
from ..sample import Parameter, Sample
from ..table import reading


class ActuatorDeadband(AbstractLaw):
    """Force lost around zero command: u = f + δ sign(f), exact away from f = 0."""

    affine: ClassVar = (Parameter("deadband", FORCE),)
    coordinates: ClassVar = frozenset({PREDICTED})

    def law(self, sample: Sample):
        return (jnp.sign(reading(sample, PREDICTED)),)

    def text(self, s):
        return (s.call("sign", "f"),)


ACTUATOR_DEADBAND = Effect(
    "actuator_deadband",
    "δ sign(f)",
    "actuator",
    "{deadband} of command is lost around zero force: a dead-band",
    laws=(ActuatorDeadband,),
    coordinates=("predicted_force",),
    needs=frozenset({"predicted_force"}),
    confusable_with=("load_dependent_friction", "gain_asymmetry"),
    separate_by="Decelerate hard, so that force and velocity have opposite signs.",
    positive=True,
    switches=True,
    sizes=("deadband",),
)
