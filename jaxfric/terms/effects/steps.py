"""What changes at one moment: friction, the load, a gain."""

import dataclasses
from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import numpy as np
from jaxtyping import Array, Float

from ...units import DIMENSIONLESS, TIME
from ..actuator import PREDICTED
from ..base import AbstractLaw, AbstractTerm, Sum, summands
from ..change import (
    STEP_TIME,
    AbstractChange,
    Resolved,
    around,
    course,
    inside_record,
    stepped,
    stepped_text,
)
from ..effect import GRID, Effect, Extent, View, even, with_parameter
from ..friction import Coulomb
from ..inertia import Inertia, Offset
from ..known import KnownColumns
from ..position import Gravity
from ..sample import UNKNOWN, Parameter, Resolution, Sample, Scales
from ..table import reading
from ..time import AbstractModulated


class FrictionStep(AbstractModulated):
    """Friction that changes at one moment: F = ΔF g(v) 1(t > t_c), g the law `term`.

    `step_time` t_c, s. The step is a straight ramp of `ramp` seconds, so that t_c can be refined;
    give a length that the recording cannot resolve, or zero.
    """

    term: AbstractTerm = Coulomb()
    step_time: Float[Array, ""] | float = UNKNOWN
    ramp: float = eqx.field(static=True, default=0.0)
    of_time: ClassVar = (STEP_TIME,)
    prefix: ClassVar = "step"

    def factor(self, time: Float[Array, " N"]) -> Float[Array, " N"]:
        return stepped(time, self.step_time, self.ramp)

    def factor_text(self, s, name):
        return stepped_text(s, name, self.ramp)

    @property
    def switched(self):
        return None if self.term.nonlinear else self.term

    def resolved(self, length):
        return self if self.ramp else Resolved(self, length)

    def course(self, betas, time):
        return course(self.ramp, betas, time)

    def extent(self, values):
        return super().extent(values) | around(values["step_time"], self.ramp)


# A step in friction cannot be dated better than to about one kernel of the weak form, some
# thousandths of the record.
RAMP_SHARE = 0.005


def _durations(scales):
    """From what is a step to a quarter of the record: what takes longer is a drift."""
    return RAMP_SHARE * scales.duration, 0.25 * scales.duration


class FrictionRamp(AbstractModulated):
    """Friction that changes from one level to another in some time: F = ΔF g(v) φ(t), g the law
    `term`; φ rises in a straight line from 0 to 1 over T about t_c.

    ΔF, N for Coulomb friction, is affine; `step_time` t_c and `step_duration` T, s, are not.
    [`FrictionStep`][] is the same at once.
    """

    term: AbstractTerm = Coulomb()
    step_time: Float[Array, ""] | float = UNKNOWN
    step_duration: Float[Array, ""] | float = UNKNOWN
    of_time: ClassVar = (
        STEP_TIME,
        Parameter("step_duration", TIME, _durations, resolution=Resolution(0, 2, None, 16)),
    )
    prefix: ClassVar = "step"

    def factor(self, time: Float[Array, " N"]) -> Float[Array, " N"]:
        return stepped(time, self.step_time, self.step_duration)

    def factor_text(self, s, moment, duration):
        return stepped_text(s, moment, duration)

    @property
    def switched(self):
        return None if self.term.nonlinear else self.term

    def course(self, betas, time):
        return course(betas[:, 1:2], betas, time)

    def extent(self, values):
        return super().extent(values) | around(values["step_time"], values["step_duration"])


class PayloadChange(AbstractChange):
    """A load that is taken up or put down: F = φ (ΔM a + ΔF), φ(t) = 1(t > t_c).

    `load` holds the laws of what is carried: inertia, and gravity or a constant weight.
    `step_time` t_c, s; the step is a ramp as in [`FrictionStep`][].
    """

    load: AbstractTerm = Sum((Inertia(), Offset()))
    step_time: Float[Array, ""] | float = UNKNOWN
    ramp: float = eqx.field(static=True, default=0.0)
    prefix: ClassVar = "payload"

    @property
    def changed(self) -> AbstractTerm:
        return self.load


class GainStep(AbstractLaw):
    """A gain that changes at one moment: u = f + κ f 1(t > t_c), f what the motion needs.

    `step_time` t_c, s; the step is a straight ramp of `ramp` seconds, as in [`FrictionStep`][].
    """

    step_time: Float[Array, ""] | float = UNKNOWN
    ramp: float = eqx.field(static=True, default=0.0)
    affine: ClassVar = (Parameter("step_gain", DIMENSIONLESS),)
    nonlinear: ClassVar = (STEP_TIME,)
    coordinates: ClassVar = frozenset({"time", PREDICTED})

    def law(self, sample: Sample):
        return (stepped(sample.time, self.step_time, self.ramp) * reading(sample, PREDICTED),)

    def text(self, s, *names):
        return (f"{stepped_text(s, names[0], self.ramp)} * f",)


# Machines whose mass or gain changes while they run are not drawn: of a seed of `prove` every case
# stays what it was before these effects.


def ramp(scales: Scales) -> float:
    """How long a step takes, s, so that its moment can be refined."""
    return RAMP_SHARE * float(scales.duration)


def moments(term: AbstractTerm, view: View) -> np.ndarray:
    """Dates, as near to each other as a ramp is long."""
    return even(term, view, 8 * GRID)


def _changes(term: FrictionStep | FrictionRamp, view: View) -> np.ndarray:
    """Dates; of ramps two thirds of their duration apart, for durations an octave apart, down to
    where a step and its refinement do.
    """
    if isinstance(term, FrictionStep):
        return moments(term, view)
    shares = 2.0 ** -np.arange(2.5, 6.0)
    low, high = (float(end) for end in inside_record(view.limits))
    pairs = [
        (moment, share * float(view.limits.duration))
        for share in shares
        for moment in np.linspace(low, high, 2 + int(1.5 / share))
    ]
    return np.array(pairs)


FRICTION_STEP = Effect(
    "friction_step",
    "ΔF sign(v) 1(t > t_c)",
    "time",
    "At t = {step_time} Coulomb friction changes by {step_coulomb}",
    laws=(FrictionStep, FrictionRamp),
    scaled=lambda scales: (FrictionStep(Coulomb(), ramp=ramp(scales)), FrictionRamp()),
    coordinates=("time_by_direction",),
    confusable_with=("thermal_drift",),
    separate_by="Repeat from cold: warming repeats, a step does not.",
    momentary=True,
    grid=_changes,
    variant=with_parameter(
        "step_duration",
        "Coulomb friction changes by {step_coulomb} in the course of {step_duration}, about "
        "t = {step_time}",
    ),
    moment="step_time",
)


def hanging(
    term: PayloadChange, base: AbstractTerm, turn: float | None
) -> tuple[AbstractTerm, ...]:
    """On a turning axis the load's weight goes with the angle; of another simulator's axis it is
    more mass of the last body, which has the load's place or moves there. The weight may rest on
    something else.
    """
    for part in summands(base):
        names = getattr(part, "names", ())
        masses = [i for i, name in enumerate(names) if name.endswith("/mass")]
        if isinstance(part, KnownColumns) and masses:
            body = names[masses[-1]].rpartition("/")[0]
            loads: list[AbstractTerm] = [part.only(masses[-1])]
            for values in ("centre_", "inertia_"):
                own = [i for i, name in enumerate(names) if name.startswith(f"{body}/{values}")]
                if own:
                    loads.append(Sum((*summands(loads[-1]), *map(part.only, own))))
            return tuple(dataclasses.replace(term, load=load) for load in loads)
    weight = Offset() if turn is None else Gravity(turn)
    either = Sum((Inertia(), weight)), Inertia()
    return tuple(dataclasses.replace(term, load=load) for load in either)


def weighed(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence with the load's weight, where it has one."""
    mass = next((name for name in values if name.endswith("/mass")), None)
    if mass is not None:
        body = mass.split("/")[1]
        text = f"At t = {{step_time}} the mass of body {body} changes by {{{mass}}}"
        moved = " and ".join(f"{n[-1]} by {{{n}}}" for n in values if "/centre_" in n)
        turned = any("/inertia_" in name for name in values)
        if not moved and not turned:
            return f"{text}: {PICKED}, if its centre of mass is where that of body {body} is"
        text += f" and its centre of mass along {moved}" * bool(moved)
        return f"{text}{' and its inertia' * turned}, or what makes the same force: {PICKED}"
    weight = next((name for name in ("amplitude", "payload_offset") if name in values), None)
    if weight is None:
        return None
    return f"{PAYLOAD_CHANGE.sentence}, and its weight by {{{weight}}}: {PICKED}"


PICKED = "something was picked up or put down"


PAYLOAD_CHANGE = Effect(
    "payload_change",
    "(ΔM a + ΔF) 1(t > t_c)",
    "time",
    "At t = {step_time} the load changes: its inertia by {payload_inertia}",
    laws=(PayloadChange,),
    scaled=lambda scales: (PayloadChange(ramp=ramp(scales)),),
    suited=hanging,
    coordinates=("time",),
    confusable_with=("gain_step", "load_drift", "friction_step"),
    separate_by="Move the same way with and without the payload, each in a recording.",
    momentary=True,
    grid=moments,
    variant=weighed,
    moment="step_time",
    drawn=False,
)
GAIN_STEP = Effect(
    "gain_step",
    "κ f 1(t > t_c)",
    "time",
    "At t = {step_time} the force needed for the same motion changes by {step_gain} of it: a gain, "
    "a torque constant or a transmission that switched",
    laws=(GainStep,),
    scaled=lambda scales: (GainStep(ramp=ramp(scales)),),
    coordinates=("predicted_force", "time"),
    needs=frozenset({"predicted_force"}),
    confusable_with=("payload_change", "friction_step"),
    separate_by="Coast: a gain changes the force, not how friction brakes the free axis.",
    momentary=True,
    grid=moments,
    moment="step_time",
    drawn=False,
)
