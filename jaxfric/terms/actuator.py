"""What an amplifier or motor does to the force it was asked for.

Let f be the force that the motion needs. A faulty actuator delivers f when it is told u ≠ f; each
law is u − f to first order in the fault, a function of f. The measured force must not stand in
for f, since it would explain itself: the channel `predicted_force` holds f as the model without
the fault predicts it from the motion, free of the force's noise.
"""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..units import DIMENSIONLESS, FORCE, TIME
from .base import AbstractLaw
from .sample import Parameter, Sample
from .table import reading

UNKNOWN = float("nan")
PREDICTED = "predicted_force"


class ActuatorDeadband(AbstractLaw):
    """Force lost around zero command: u = f + δ sign(f), exact away from f = 0."""

    affine: ClassVar = (Parameter("deadband", FORCE),)
    coordinates: ClassVar = frozenset({PREDICTED})

    def law(self, sample: Sample):
        return (jnp.sign(reading(sample, PREDICTED)),)


def _knee_bounds(scales):
    """A half to three times the root-mean-square force.

    Below, most samples lie beyond the knee and the law is a gain plus a dead-band; three times
    the root mean square is the peak of all but the most impulsive duty.
    """
    return 0.5 * scales.force, 3 * scales.force


class ActuatorSaturation(AbstractLaw):
    """Gain that falls at high force (magnetic saturation): u = f + c max(abs(f) − U, 0) sign(f).

    `knee` U, N. A hard limit is not this law: there u − f depends on the controller alone, and
    the samples at the limit are to be masked.
    """

    knee: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("saturation", DIMENSIONLESS),)
    nonlinear: ClassVar = (Parameter("knee", FORCE, _knee_bounds),)
    coordinates: ClassVar = frozenset({PREDICTED})

    def law(self, sample: Sample):
        force = reading(sample, PREDICTED)
        return (jnp.sign(force) * jnp.maximum(jnp.abs(force) - self.knee, 0.0),)


class GainAsymmetry(AbstractLaw):
    """Different gain for positive force: u = f + κ max(f, 0)."""

    affine: ClassVar = (Parameter("gain_asymmetry", DIMENSIONLESS),)
    coordinates: ClassVar = frozenset({PREDICTED})

    def law(self, sample: Sample):
        return (jnp.maximum(reading(sample, PREDICTED), 0.0),)


class TransportDelay(AbstractLaw):
    """Force that acts τ late: u = f(t + τ) = f + τ df/dt + O(τ²): first order.

    The same column as [`ActuatorLag`][]; only the second order, ½ τ² d²f/dt², tells them apart.
    """

    affine: ClassVar = (Parameter("delay", TIME),)
    coordinates: ClassVar = frozenset({PREDICTED})

    def law(self, sample: Sample):
        return (jnp.zeros_like(sample.time),)

    def impulse(self, sample: Sample):
        return (reading(sample, PREDICTED),)


class ActuatorLag(AbstractLaw):
    """First-order lag of the force: u = f + T df/dt (exact)."""

    affine: ClassVar = (Parameter("lag", TIME),)
    coordinates: ClassVar = frozenset({PREDICTED})

    def law(self, sample: Sample):
        return (jnp.zeros_like(sample.time),)

    def impulse(self, sample: Sample):
        return (reading(sample, PREDICTED),)
