"""A constant force that wanders."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import legendre

from ...units import FORCE
from ..base import AbstractLaw, AbstractTerm
from ..effect import RECURS, Effect, Extent
from ..sample import Parameter, Sample, Scales
from ..slow import RANGE
from ..text import literal, signed


class LoadDrift(AbstractLaw):
    """Constant force that wanders: F = Σ_n F_n P_n(τ), τ = 2 (t − t₀)/T − 1, n = 1 … `degree`.

    P_n are Legendre's polynomials over the record that starts at `start` t₀ and lasts `duration`
    T, s, both given numbers; n = 0 is the offset. Outside the record the ends' values hold.
    """

    start: float = eqx.field(static=True, default=0.0)
    duration: float = eqx.field(static=True, default=1.0)
    degree: int = eqx.field(static=True, default=3)
    coordinates: ClassVar = frozenset({"time"})

    @property
    def affine(self):
        return tuple(Parameter(f"load_drift_{n}", FORCE) for n in range(1, self.degree + 1))

    def law(self, sample: Sample):
        tau = jnp.clip(2 * (sample.time - self.start) / self.duration - 1, -1.0, 1.0)
        polynomials = [jnp.ones_like(tau), tau]
        for n in range(1, self.degree):  # Bonnet's recursion
            newer = ((2 * n + 1) * tau * polynomials[-1] - n * polynomials[-2]) / (n + 1)
            polynomials.append(newer)
        return tuple(polynomials[1 : self.degree + 1])

    def text(self, s):
        tau = f"2.0 * (t - {signed(self.start)}) / {literal(self.duration)} - 1.0"
        place = s.clip(tau, "-1.0", "1.0")
        degrees = range(1, self.degree + 1)
        return tuple(_horner(legendre.leg2poly([0.0] * n + [1.0]), place) for n in degrees)

    def extent(self, values):
        return {"time": (self.start, self.start + self.duration)}


def _horner(coefficients, variable: str) -> str:
    """A polynomial as text, the constant first."""
    text = literal(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        text = f"({text} * {variable}"
        text += f" + {literal(coefficient)})" if coefficient else ")"
    return text


# A straight line, a cubic, and as much as follows a wave up to where it is a tone: of k periods in
# the record, polynomials above the degree πk + 3 have less than a fiftieth.
DEGREES = (1, 3, 6, int(np.pi * RECURS + 3))


def shapes(scales: Scales) -> tuple[AbstractTerm, ...]:
    """Polynomials of several degrees over the recording."""
    start, duration = float(scales.start), float(scales.duration)
    return tuple(LoadDrift(start, duration, degree) for degree in DEGREES)


def moved(values: Mapping[str, float], extent: Extent) -> str | None:
    """Another sentence where it is known how far it moves."""
    if RANGE not in values:
        return None
    return (
        f"A constant force wanders slowly over the record, by {{{RANGE}}} from its least to its "
        "greatest"
    )


LOAD_DRIFT = Effect(
    "load_drift",
    "Σ F_n P_n(t)",
    "time",
    "A constant force wanders slowly over the record",
    laws=(LoadDrift,),
    scaled=shapes,
    coordinates=("time",),
    confusable_with=("periodic_disturbance", "cross_axis", "friction_step"),
    separate_by="Record longer.",
    momentary=True,
    ubiquitous=True,
    wanders=True,
    variant=moved,
)
