"""A force that acts for a while, as of something that touches the axis or pulls at it."""

from typing import ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from ...units import FORCE, TIME
from ..base import AbstractLaw
from ..change import STEP_TIME, Resolved, course, inside_record, stepped, stepped_text
from ..effect import Effect, View
from ..inertia import Offset
from ..sample import UNKNOWN, Parameter, Resolution, Sample
from .steps import RAMP_SHARE, ramp

# What lasts longer is a step that ends; what is shorter than two flanks is a push at one moment.
LONGEST, SHORTEST = 0.5, 2 * RAMP_SHARE


def _durations(scales):
    """From two flanks to half of the record."""
    return SHORTEST * scales.duration, LONGEST * scales.duration


PUSH_TIME = STEP_TIME._replace(name="push_time")
PUSH_DURATION = Parameter(
    "push_duration", TIME, _durations, resolution=Resolution(0, 2, None, 16), lasting=True
)


class DisturbanceForce(AbstractLaw):
    """A constant force that acts for a while: F = A 1(t_1 < t < t_1 + T).

    `push_time` t_1 and `push_duration` T, s. Both flanks are straight ramps of `ramp` seconds about
    these moments, so that they can be refined, as in [`FrictionStep`][].
    """

    push_time: Float[Array, ""] | float = UNKNOWN
    push_duration: Float[Array, ""] | float = UNKNOWN
    ramp: float = eqx.field(static=True, default=0.0)
    affine: ClassVar = (Parameter("push_force", FORCE),)
    nonlinear: ClassVar = (PUSH_TIME, PUSH_DURATION)
    coordinates: ClassVar = frozenset({"time"})

    def law(self, sample: Sample):
        end = self.push_time + self.push_duration
        begun, over = (stepped(sample.time, moment, self.ramp) for moment in (self.push_time, end))
        return (begun - over,)

    def text(self, s, begin, duration):
        end = f"({begin} + {duration})" if self.ramp else f"{begin} + {duration}"
        begun, over = (stepped_text(s, moment, self.ramp) for moment in (begin, end))
        return (f"({begun} - {over})",)

    @property
    def switched(self):
        return Offset()

    def course(self, betas, time):
        flanks = (course(self.ramp, moments, time) for moments in (betas, betas.sum(1)[:, None]))
        (begun, rise), (over, fall) = flanks
        return begun - over, rise - fall

    def resolved(self, length):
        return self if self.ramp else Resolved(self, length)

    def extent(self, values):
        begin, half = values["push_time"], self.ramp or 1.0
        return {"time": (begin - half, begin + values["push_duration"] + half)}


def whiles(term: DisturbanceForce, view: View) -> np.ndarray:
    """Beginnings half a duration apart, for durations half an octave apart."""
    low, high = (float(end) for end in inside_record(view.limits))
    shares = LONGEST * 2.0 ** -np.arange(0.0, 5.0, 0.5)
    pairs = [
        (begin, share * float(view.limits.duration))
        for share in shares
        for begin in np.linspace(low, high, 1 + int(2 / share))[:-1]
    ]
    return np.array(pairs)


DISTURBANCE_FORCE = Effect(
    "disturbance_force",
    "A 1(t₁ < t < t₁ + T)",
    "time",
    "From t = {push_time} on a constant force of {push_force} acts for {push_duration}: something "
    "touched the axis or pulled at it",
    laws=(DisturbanceForce,),
    scaled=lambda scales: (DisturbanceForce(ramp=ramp(scales)),),
    coordinates=("time",),
    confusable_with=("load_drift", "parameter_step", "payload_change", "disturbance_pulses"),
    separate_by="Repeat the motion: what belongs to the machine comes again.",
    momentary=True,
    leftover=True,
    grid=whiles,
    moment="push_time",
    lasting="push_duration",
    drawn=False,
)
