"""What changes at one moment: friction, the load, a gain."""

import dataclasses
from abc import abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...data.recording import Recording
from ...units import (
    DIMENSIONLESS,
    TIME,
)
from ..actuator import PREDICTED
from ..base import AbstractLaw, AbstractTerm, Sum, summands, vector
from ..effect import GRID, Effect, Extent, View, even
from ..friction import Coulomb
from ..inertia import Inertia, Offset
from ..known import KnownColumns
from ..position import Gravity
from ..sample import UNKNOWN, Parameter, Resolution, Sample, Scales
from ..table import reading
from ..text import Syntax, literal
from ..time import AbstractModulated


def _within(scales):
    """Inside the record but its first and last 2 %, where one level rests on too few samples."""
    margin = 0.02 * scales.duration
    return scales.start + margin, scales.start + scales.duration - margin


# Two dates of a step differ by what lies between them only: the cost is no parabola but a wedge,
# and a date is refined within a step of the grid.
_MOMENTS = Resolution(1, 256, None, 256)
STEP_TIME = Parameter("step_time", TIME, _within, logarithmic=False, resolution=_MOMENTS)


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
        return _stepped(self, time)

    def factor_text(self, s, name):
        return _stepped_text(self, s, name)

    @property
    def switched(self):
        return None if self.term.nonlinear else self.term

    def course(self, betas, time):
        return _course(self.ramp, betas, time)

    def extent(self, values):
        return super().extent(values) | _about(values["step_time"], self.ramp)


# A step in friction cannot be dated better than to about one kernel of the weak form, some
# thousandths of the record.
RAMP_SHARE = 0.005


def _durations(scales):
    """From what is a step to a quarter of the record: what takes longer is a drift."""
    return RAMP_SHARE * scales.duration, 0.25 * scales.duration


class FrictionRamp(AbstractModulated):
    """Friction that changes from one level to another in some time: F = ΔF g(v) φ(t), g the law
    `term`; φ rises in a straight line from 0 to 1 over T about t_c.

    `step_time` t_c and `step_duration` T, s. [`FrictionStep`][] is the same at once.
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
        return jnp.clip((time - self.step_time) / self.step_duration + 0.5, 0.0, 1.0)

    def factor_text(self, s, moment, duration):
        return s.clip(f"(t - {moment}) / {duration} + 0.5", "0.0", "1.0")

    @property
    def switched(self):
        return None if self.term.nonlinear else self.term

    def course(self, betas, time):
        return _course(betas[:, 1:2], betas, time)

    def extent(self, values):
        return super().extent(values) | _about(values["step_time"], values["step_duration"])


def _about(moment: float, ramp: float) -> dict[str, tuple[float, float]]:
    half = ramp or 1.0
    return {"time": (moment - half, moment + half)}


def _course(
    ramp: float | np.ndarray, betas: np.ndarray, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The step and its rate at each time, for the moments in the first column of `betas`."""
    late = time[None, :] - betas[:, :1]
    if np.all(ramp == 0):
        return np.where(late > 0, 1.0, 0.0), np.zeros_like(late)
    inside = np.abs(late) < 0.5 * ramp
    return np.clip(late / ramp + 0.5, 0.0, 1.0), np.where(inside, 1 / ramp, 0.0)


def _stepped(step, time):
    """A ramp of `step.ramp` seconds from zero to one about `step.step_time`, s."""
    late = time - step.step_time
    if not isinstance(step.ramp, jax.Array) and step.ramp == 0:
        return jnp.where(late > 0, jnp.ones_like(late), 0.0)
    return jnp.clip(late / step.ramp + 0.5, 0.0, 1.0)


def _stepped_text(step, s: Syntax, name: str) -> str:
    """The same in a language."""
    if step.ramp == 0:
        return s.choose(f"t > {name}", "1.0", "0.0")
    return s.clip(f"(t - {name}) / {literal(step.ramp)} + 0.5", "0.0", "1.0")


class AbstractChange(AbstractTerm):
    """Terms that begin at one moment: F = φ f, φ(t) = 1(t > t_c), f the force of `changed`.

    Momentum comes and goes with the axis' own speed, so that there is no impulse: φ dp/dt is
    d/dt(φ p) − φ̇ p. `step_time` t_c, s; the step is a ramp as in [`FrictionStep`][]. A concrete
    class gives the `prefix` of its affine parameters.
    """

    step_time: eqx.AbstractVar[Float[Array, ""] | float]
    ramp: eqx.AbstractVar[float]
    prefix: eqx.AbstractClassVar[str]

    @property
    @abstractmethod
    def changed(self) -> AbstractTerm:
        """The terms that begin."""

    @property
    def affine(self):
        return tuple(p._replace(name=f"{self.prefix}_{p.name}") for p in self.changed.affine)

    @property
    def nonlinear(self):
        return (STEP_TIME,)

    @property
    def coordinates(self):
        return self.changed.coordinates | {"time"}

    @property
    def inertial(self) -> bool:
        return self.changed.inertial

    def text(self, s, *names):
        own = [term.text(s) for term in summands(self.changed)]
        if any(columns is None for columns in own):
            return None
        share = _stepped_text(self, s, names[0])
        return [f"{share} * ({column})" for columns in own for column in columns or ()]

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        share, time = _stepped(self, recording.time), recording.time
        plain = share[:, None] * self.changed.columns(recording)
        if not isinstance(self.ramp, jax.Array) and self.ramp == 0:
            return plain
        inside = jnp.abs(time - self.step_time) < 0.5 * self.ramp
        rate = jnp.where(inside, 1 / self.ramp, 0.0)
        return plain - rate[:, None] * self.changed.momentum(recording)

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        return _stepped(self, recording.time)[:, None] * self.changed.momentum(recording)

    def offset(self, recording: Recording) -> Float[Array, " N"]:
        return jnp.zeros_like(recording.time)

    def beta(self) -> Float[Array, " d"]:
        return vector([self.step_time])

    def with_beta(self, beta: Float[Array, " d"]) -> "AbstractChange":
        return eqx.tree_at(lambda term: term.step_time, self, beta[0])

    @property
    def switched(self) -> AbstractTerm:
        return self.changed

    def course(self, betas, time):
        return _course(self.ramp, betas, time)

    def extent(self, values):
        return self.changed.extent(values) | _about(values["step_time"], self.ramp)


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
        return (_stepped(self, sample.time) * reading(sample, PREDICTED),)

    def text(self, s, *names):
        return (f"{_stepped_text(self, s, names[0])} * f",)


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
    low, high = (float(end) for end in _within(view.limits))
    pairs = [
        (moment, share * float(view.limits.duration))
        for share in shares
        for moment in np.linspace(low, high, 2 + int(1.5 / share))
    ]
    return np.array(pairs)


def _gradual(values: Mapping[str, float], extent: Extent) -> str | None:
    if "step_duration" not in values:
        return None
    return (
        "Coulomb friction changes by {step_coulomb} in the course of {step_duration}, about "
        "t = {step_time}"
    )


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
    variant=_gradual,
    moment="step_time",
)


def hanging(
    term: PayloadChange, base: AbstractTerm, turn: float | None
) -> tuple[AbstractTerm, ...]:
    """On a turning axis the load's weight goes with the angle; of another simulator's axis it is
    more mass of the last body, which has the load's place. The weight may rest on something else.
    """
    for part in summands(base):
        masses = [i for i, n in enumerate(getattr(part, "names", ())) if n.endswith("/mass")]
        if isinstance(part, KnownColumns) and masses:
            return (dataclasses.replace(term, load=part.only(masses[-1])),)
    weight = Offset() if turn is None else Gravity(turn)
    loads = Sum((Inertia(), weight)), Inertia()
    return tuple(dataclasses.replace(term, load=load) for load in loads)


def weighed(values: Mapping[str, float], extent: Extent) -> str | None:
    """The sentence with the load's weight, where it has one."""
    mass = next((name for name in values if name.endswith("/mass")), None)
    if mass is not None:
        body = mass.split("/")[1]
        return f"At t = {{step_time}} the mass of body {body} changes by {{{mass}}}: {PICKED}"
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
