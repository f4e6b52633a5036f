"""What lies between motor and load, as far as one mass can tell."""

from typing import ClassVar

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..recording import Recording
from ..units import FORCE, POSITION, Dimension
from .base import AbstractLaw, Parameter, Sample
from .presliding import AbstractMemory, starts
from .table import reading

UNKNOWN = float("nan")


def play(recording: Recording, half_gap: Float[Array, ""]) -> Float[Array, " N"]:
    """Where the motor side stands inside a gap, from −1 to 1 (the flanks), `(N,)`.

    The play operator y ← clip(y, x − δ, x + δ) (Krasnosel'skii & Pokrovskii 1989): the load y is
    dragged by the flanks. A segment starts at the flank that its velocity pushes, or in the
    middle if at rest.
    """
    x = recording.position
    begins = starts(recording)
    first = x - half_gap * jnp.sign(recording.velocity)
    low = jnp.where(begins, first, x - half_gap)
    high = jnp.where(begins, first, x + half_gap)

    def drag(load, flanks):
        load = jnp.clip(load, *flanks)
        return load, load

    dragged = jax.lax.scan(drag, x[0], (low, high), unroll=8)[1]
    return (x - dragged) / half_gap


def _gap_bounds(scales):
    """From one sample's way at the slowest slip to a tenth of the stroke, as for presliding."""
    return scales.slowest * scales.interval, 0.1 * (scales.high - scales.low)


class Backlash(AbstractMemory):
    """Load that rests while the motor crosses a gap: u = f − F_L sign(v) (1 − (w/δ)⁸).

    w is the place in the gap from −δ to δ ([`play`][]), so the bracket is one inside and zero at
    the flanks; `half_gap` δ, m. First order: the load's friction F_L is absent, while its inertia,
    the impact and the ringing after it, which take a second mass, are left out.
    """

    half_gap: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("backlash_force", FORCE),)
    nonlinear: ClassVar = (Parameter("half_gap", POSITION, _gap_bounds),)
    coordinates: ClassVar = frozenset({"position", "velocity"})

    def columns(self, recording: Recording) -> Float[Array, "N 1"]:
        inside = 1 - play(recording, self.half_gap) ** 8
        return (-jnp.sign(recording.velocity) * inside)[:, None]


class Compliance(AbstractLaw):
    """Load M_L behind a spring k, position on the motor: u = f − (M_L²/k) d²a/dt²: first order.

    x_L = x − (M_L/k) ẍ_L, so that u = M ẍ + M_L ẍ_L = (M + M_L) a − (M_L²/k) ä + …, valid well
    below the resonance; ringing at it takes a second mass. Needs the jerk ȧ of the motion as the
    channel `predicted_jerk`; the last derivative sits on the kernel.
    """

    affine: ClassVar = (Parameter("compliance", Dimension(force=1, position=-1, time=4)),)
    coordinates: ClassVar = frozenset({"predicted_jerk"})

    def law(self, sample: Sample):
        return (jnp.zeros_like(sample.time),)

    def impulse(self, sample: Sample):
        return (-reading(sample, "predicted_jerk"),)
