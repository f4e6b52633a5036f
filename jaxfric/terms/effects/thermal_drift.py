"""Friction that falls as the machine warms."""

from ..base import AbstractTerm
from ..effect import Effect
from ..friction import Coulomb, Viscous
from ..sample import Scales
from ..time import ThermalDrift


def shapes(scales: Scales) -> tuple[AbstractTerm, ...]:
    """Of viscous and of Coulomb friction, from the start of the recording on."""
    start = float(scales.start)
    return tuple(ThermalDrift(kind, start=start) for kind in (Viscous(), Coulomb()))


THERMAL_DRIFT = Effect(
    "thermal_drift",
    "β g(v) exp(−(t − t₀)/τ), g viscous or Coulomb",
    "time",
    "Friction changes exponentially over the record, time constant {time_constant}: warming",
    laws=(ThermalDrift,),
    scaled=shapes,
    coordinates=("time_by_velocity", "time_by_direction"),
    confusable_with=("friction_step", "viscous_nonlinearity"),
    separate_by="Repeat from cold: warming repeats, a step does not.",
    momentary=True,
)
