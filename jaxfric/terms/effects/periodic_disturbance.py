"""A tone in time."""

from ..effect import Effect, Waves
from ..time import PeriodicDisturbance

PERIODIC_DISTURBANCE = Effect(
    "periodic_disturbance",
    "A sin(2πf t + φ)",
    "time",
    "A force periodic in time, {frequency}, amplitude {amplitude}",
    laws=(PeriodicDisturbance,),
    coordinates=("time_lines", "time"),
    confusable_with=("cogging", "load_drift"),
    separate_by="Change the speed: a line in position keeps its pitch, a tone its frequency.",
    momentary=True,
    waves=lambda term: Waves("time", False),
)
