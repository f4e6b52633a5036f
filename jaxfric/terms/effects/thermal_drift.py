"""Friction that falls as the machine warms."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...units import TIME
from ..base import AbstractTerm
from ..effect import Effect, Extent
from ..friction import Coulomb, Viscous
from ..sample import UNKNOWN, Parameter, Scales
from ..slow import OVER_RECORD
from ..text import signed
from ..time import AbstractModulated


def constants(scales):
    """A fiftieth to three times the record.

    Faster warming is over within a tenth of the record. Slower warming falls by x = 1/3 of an
    exponent at most and differs from a straight line by x/8 = 4 % of that fall.
    """
    return 0.02 * scales.duration, 3 * scales.duration


class ThermalDrift(AbstractModulated):
    """Friction that falls as the machine warms: F = β g(v) exp(−(t − t₀)/τ), g the law `term`.

    `time_constant` τ, s; `start` t₀, s, is a given number that only scales β.
    """

    term: AbstractTerm = Viscous()
    time_constant: Float[Array, ""] | float = UNKNOWN
    start: float = eqx.field(static=True, default=0.0)
    of_time: ClassVar = (Parameter("time_constant", TIME, constants),)
    prefix: ClassVar = "thermal"

    def factor(self, time: Float[Array, " N"]) -> Float[Array, " N"]:
        return jnp.exp(-(time - self.start) / self.time_constant)

    def factor_text(self, s, name):
        return s.call("exp", f"-(t - {signed(self.start)}) / {name}")

    def extent(self, values):
        last = self.start + 3 * values["time_constant"]
        return super().extent(values) | {"time": (self.start, last)}


def shapes(scales: Scales) -> tuple[AbstractTerm, ...]:
    """Of viscous and of Coulomb friction, from the start of the recording on."""
    start = float(scales.start)
    return tuple(ThermalDrift(kind, start=start) for kind in (Viscous(), Coulomb()))


_LAWS = {"thermal_viscous": "viscous", "thermal_coulomb": "Coulomb"}


def _of_law(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence with which friction it is, and by how much."""
    for name, words in _LAWS.items():
        if name in values:
            return (
                f"At the start {words} friction differs by {{{name}}} from where it settles, "
                "with a time constant of {time_constant}: warming"
            )
    return None


def _by_change(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence where a slow change may be the beginning of any larger one."""
    words = next((words for name, words in _LAWS.items() if name in values), None)
    if words is None:
        return None
    change = f": by {{{OVER_RECORD}:size}} over the record" if OVER_RECORD in values else ""
    verb = "rises" if values.get(OVER_RECORD, 0.0) > 0 else "falls"
    verb = verb if change else "drifts"
    return (
        f"{words[:1].upper()}{words[1:]} friction {verb} as the machine warms{change}; where it "
        "settles, and how fast, this recording cannot tell"
    )


THERMAL_DRIFT = Effect(
    "thermal_drift",
    "β g(v) exp(−(t − t₀)/τ), g viscous or Coulomb",
    "time",
    "Friction changes exponentially over the record, time constant {time_constant}: warming",
    laws=(ThermalDrift,),
    scaled=shapes,
    coordinates=("time_by_velocity", "time_by_direction"),
    confusable_with=("friction_step", "viscous_nonlinearity", "gain_drift"),
    separate_by="Repeat from cold: warming repeats, a step does not.",
    momentary=True,
    variant=_of_law,
    settles="time_constant",
    vague=_by_change,
)
