"""Structure without a law: a curve over one coordinate, for what no effect of the library names."""

from itertools import pairwise

import equinox as eqx
import jax.numpy as jnp

from ..units import FORCE
from .base import AbstractLaw
from .sample import Parameter, Sample
from .text import literal, signed


class Table(AbstractLaw):
    """Piecewise linear curve over one coordinate: F = Σ_k F_k Λ_k(c), Λ_k the hat on knot k.

    Not a law of physics: it interpolates between `knots`, is constant outside them and zero at
    the first one, since a constant belongs to offset and Coulomb friction.
    `Directional(Table(...))` holds a curve for each direction of motion.

    **Arguments:** `coordinate`: "time", "position", "velocity" or a channel; `knots`: places in
    the unit of the coordinate, increasing, two or more.

    **Raises:** `ValueError` if the knots do not increase.
    """

    coordinate: str = eqx.field(static=True)
    knots: tuple[float, ...] = eqx.field(static=True, converter=lambda k: tuple(map(float, k)))

    def __check_init__(self):
        if len(self.knots) < 2 or any(a >= b for a, b in pairwise(self.knots)):
            raise ValueError(
                f"Table(knots={self.knots}) needs two knots or more, each above the one before."
            )

    @property
    def affine(self):
        return tuple(Parameter(f"table_{k}", FORCE) for k in range(2, len(self.knots) + 1))

    @property
    def coordinates(self):
        return frozenset({self.coordinate})

    def law(self, sample: Sample):
        value = reading(sample, self.coordinate)
        values = jnp.asarray(self.knots, value.dtype)
        place = jnp.interp(value, values, jnp.arange(values.shape[0], dtype=value.dtype))
        return tuple(jnp.maximum(1 - jnp.abs(place - k), 0.0) for k in range(1, values.shape[0]))

    def text(self, s):
        if self.coordinate not in _SIGNALS:
            return None
        # A hat on each knot but the first, the last one going on level.
        signal, rises, hats = _SIGNALS[self.coordinate], list(pairwise(self.knots)), []
        for k, (low, top) in enumerate(rises):
            up = f"({signal} - {signed(low)}) / {literal(top - low)}"
            down = "1.0"
            if k + 1 < len(rises):
                high = rises[k + 1][1]
                down = f"({signed(high)} - {signal}) / {literal(high - top)}"
            hats.append(s.call("max", s.call("min", up, down), "0.0"))
        return tuple(hats)

    def extent(self, values):
        return {self.coordinate: (self.knots[0], self.knots[-1])}


_SIGNALS = {"position": "x", "velocity": "v", "time": "t"}


def reading(sample: Sample, name: str):
    """A signal of a sample by name; raises `ValueError` for a channel that it lacks."""
    if name in ("time", "position", "velocity"):
        return getattr(sample, name)
    if name not in sample.channels:
        present = ", ".join(["time", "position", "velocity", *sample.channels])
        raise ValueError(
            f"A term needs the signal {name!r}; the recording has {present}. Add it: "
            f"Recording(..., channels={{{name!r}: ...}})."
        )
    return sample.channels[name]
