"""Another axis that pulls along."""

from typing import ClassVar

import jax.numpy as jnp

from ...units import DAMPING, Dimension
from ..base import AbstractLaw
from ..effect import Effect
from ..sample import Parameter, Sample
from ..table import reading


class CrossAxis(AbstractLaw):
    """Coupling from another axis: u = d(C v₂)/dt + h v₂.

    Needs that axis' velocity as the channel `neighbour_velocity`; its acceleration is never
    formed, the weak form differentiates the kernel instead.
    """

    affine: ClassVar = (
        Parameter("coupling_inertia", Dimension(force=1, position=-1, time=2)),
        Parameter("coupling_viscous", DAMPING),
    )
    coordinates: ClassVar = frozenset({"neighbour_velocity"})

    def law(self, sample: Sample):
        other = reading(sample, "neighbour_velocity")
        return (jnp.zeros_like(other), other)

    def impulse(self, sample: Sample):
        other = reading(sample, "neighbour_velocity")
        return (other, jnp.zeros_like(other))


CROSS_AXIS = Effect(
    "cross_axis",
    "d(C v₂)/dt + h v₂",
    "neighbour",
    "The other axis pulls along: {coupling_inertia} times its acceleration and {coupling_viscous} "
    "times its velocity",
    laws=(CrossAxis,),
    coordinates=("neighbour",),
    needs=frozenset({"neighbour_velocity"}),
    confusable_with=("load_drift", "periodic_disturbance"),
    separate_by="Hold the other axis still.",
)
