"""Forces that change with time, and terms that do."""

from abc import abstractmethod
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float
from numpy.polynomial import legendre

from ..data.recording import Recording
from ..units import DIMENSIONLESS, FORCE, FREQUENCY, TIME
from .base import AbstractLaw, AbstractTerm, Sum, joined, vector
from .friction import Coulomb, Viscous
from .inertia import Inertia, Offset
from .position import wave, waves
from .sample import Parameter, Resolution, Sample
from .table import reading
from .text import TURN, Syntax, literal, signed

UNKNOWN = float("nan")


class AbstractModulated(AbstractTerm):
    """A force law times a factor of time with one nonlinear parameter; `term` is the law.

    A concrete class names its parameter in `parameter`, the field of the same name, gives the
    `prefix` for the affine parameters, and `factor(time)`.
    """

    term: eqx.AbstractVar[AbstractTerm]
    parameter: eqx.AbstractClassVar[Parameter]
    prefix: eqx.AbstractClassVar[str]

    def __check_init__(self):
        if self.term.inertial:
            raise ValueError(
                f"{type(self).__name__} changes a force law in time; {type(self.term).__name__} "
                "has momentum. Give friction, for instance terms.Viscous()."
            )

    @abstractmethod
    def factor(self, time: Float[Array, " N"]) -> Float[Array, " N"]:
        """The factor at each time, s, dimensionless."""

    def factor_text(self, s: Syntax, name: str) -> str | None:
        """The factor in a language, of the parameter's name; `None` where it has no text."""
        return None

    @property
    def affine(self):
        return tuple(p._replace(name=f"{self.prefix}_{p.name}") for p in self.term.affine)

    @property
    def nonlinear(self):
        inner = (p._replace(name=f"{self.prefix}_{p.name}") for p in self.term.nonlinear)
        return (self.parameter, *inner)

    @property
    def coordinates(self):
        return self.term.coordinates | {"time"}

    @property
    def inertial(self) -> bool:
        return False

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        return self.factor(recording.time)[:, None] * self.term.columns(recording)

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        return self.term.momentum(recording)

    def offset(self, recording: Recording) -> Float[Array, " N"]:
        return jnp.zeros_like(recording.time)

    def beta(self) -> Float[Array, " d"]:
        own = vector([getattr(self, self.parameter.name)])
        return joined([own, self.term.beta()])

    def with_beta(self, beta: Float[Array, " d"]) -> "AbstractModulated":
        name = self.parameter.name
        where = lambda term: (getattr(term, name), term.term)  # noqa: E731
        return eqx.tree_at(where, self, (beta[0], self.term.with_beta(beta[1:])))


def _constant_bounds(scales):
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
    parameter: ClassVar = Parameter("time_constant", TIME, _constant_bounds)
    prefix: ClassVar = "thermal"

    def factor(self, time: Float[Array, " N"]) -> Float[Array, " N"]:
        return jnp.exp(-(time - self.start) / self.time_constant)

    def factor_text(self, s, name):
        return s.call("exp", f"-(t - {signed(self.start)}) / {name}")

    def extent(self, values):
        last = self.start + 3 * values["time_constant"]
        return super().extent(values) | {"time": (self.start, last)}


def _within(scales):
    """Inside the record but its first and last 2 %, where one level rests on too few samples."""
    margin = 0.02 * scales.duration
    return scales.start + margin, scales.start + scales.duration - margin


# Two dates of a step differ by what lies between them only: the cost is no parabola but a wedge,
# and a date is refined within a step of the grid.
_MOMENTS = Resolution(1, 256, None, 256)


class FrictionStep(AbstractModulated):
    """Friction that changes at one moment: F = ΔF g(v) 1(t > t_c), g the law `term`.

    `step_time` t_c, s. The step is a straight ramp of `ramp` seconds, so that t_c can be refined;
    give a length that the recording cannot resolve, or zero.
    """

    term: AbstractTerm = Coulomb()
    step_time: Float[Array, ""] | float = UNKNOWN
    ramp: float = eqx.field(static=True, default=0.0)
    parameter: ClassVar = Parameter(
        "step_time", TIME, _within, logarithmic=False, resolution=_MOMENTS
    )
    prefix: ClassVar = "step"

    def factor(self, time: Float[Array, " N"]) -> Float[Array, " N"]:
        return _stepped(self, time)

    def factor_text(self, s, name):
        if self.ramp == 0:
            return s.choose(f"t > {name}", "1.0", "0.0")
        return s.clip(f"(t - {name}) / {literal(self.ramp)} + 0.5", "0.0", "1.0")

    def extent(self, values):
        at, half = values["step_time"], self.ramp or 1.0
        return super().extent(values) | {"time": (at - half, at + half)}


def _stepped(step, time):
    """A ramp of `step.ramp` seconds from zero to one about `step.step_time`, s."""
    late = time - step.step_time
    if not isinstance(step.ramp, jax.Array) and step.ramp == 0:
        return jnp.where(late > 0, jnp.ones_like(late), 0.0)
    return jnp.clip(late / step.ramp + 0.5, 0.0, 1.0)


class PayloadChange(AbstractTerm):
    """A load that is taken up or put down: F = φ (ΔM a + ΔF), φ(t) = 1(t > t_c).

    It comes and goes with the axis' own speed, so that there is no impulse: φ ΔM a is
    d/dt(φ ΔM v) − φ̇ ΔM v. `load` holds the laws of what is carried: inertia, and gravity or a
    constant weight. `step_time` t_c, s; the step is a ramp as in [`FrictionStep`][].
    """

    load: AbstractTerm = Sum((Inertia(), Offset()))
    step_time: Float[Array, ""] | float = UNKNOWN
    ramp: float = eqx.field(static=True, default=0.0)
    parameter: ClassVar = FrictionStep.parameter

    @property
    def affine(self):
        return tuple(p._replace(name=f"payload_{p.name}") for p in self.load.affine)

    @property
    def nonlinear(self):
        return (self.parameter,)

    @property
    def coordinates(self):
        return self.load.coordinates | {"time"}

    @property
    def inertial(self) -> bool:
        return self.load.inertial

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        share, time = _stepped(self, recording.time), recording.time
        plain = share[:, None] * self.load.columns(recording)
        if not isinstance(self.ramp, jax.Array) and self.ramp == 0:
            return plain
        inside = jnp.abs(time - self.step_time) < 0.5 * self.ramp
        rate = jnp.where(inside, 1 / self.ramp, 0.0)
        return plain - rate[:, None] * self.load.momentum(recording)

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        return _stepped(self, recording.time)[:, None] * self.load.momentum(recording)

    def offset(self, recording: Recording) -> Float[Array, " N"]:
        return jnp.zeros_like(recording.time)

    def beta(self) -> Float[Array, " d"]:
        return vector([self.step_time])

    def with_beta(self, beta: Float[Array, " d"]) -> "PayloadChange":
        return eqx.tree_at(lambda term: term.step_time, self, beta[0])


class GainStep(AbstractLaw):
    """A gain that changes at one moment: u = f + κ f 1(t > t_c), f what the motion needs.

    `step_time` t_c, s; the step is a straight ramp of `ramp` seconds, as in [`FrictionStep`][].
    """

    step_time: Float[Array, ""] | float = UNKNOWN
    ramp: float = eqx.field(static=True, default=0.0)
    affine: ClassVar = (Parameter("step_gain", DIMENSIONLESS),)
    nonlinear: ClassVar = (FrictionStep.parameter,)
    coordinates: ClassVar = frozenset({"time", "predicted_force"})

    def law(self, sample: Sample):
        return (_stepped(self, sample.time) * reading(sample, "predicted_force"),)


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


def _frequency_bounds(scales):
    """From one and a half periods in the record to half of Nyquist's frequency.

    Fewer periods are a drift; above, a force held over a sample is no longer the tone that acts.
    """
    return 1.5 / scales.duration, 0.25 / scales.interval


def _record(scales):
    return scales.duration


# As for a pitch: out of step by a cycle over the record, the tone is another one.
_TONES = Resolution(1, 4, _record, 4096)


class PeriodicDisturbance(AbstractLaw):
    """A tone in time: F = A sin(2πf t + φ). `frequency` f, Hz."""

    frequency: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = wave("tone", FORCE)
    nonlinear: ClassVar = (
        Parameter("frequency", FREQUENCY, _frequency_bounds, resolution=_TONES, repeats=True),
    )
    coordinates: ClassVar = frozenset({"time"})

    def law(self, sample: Sample):
        return waves(2 * jnp.pi * self.frequency * sample.time)

    def text(self, s, frequency):
        angle = f"{literal(TURN)} * {frequency} * t"
        return (s.call("sin", angle), s.call("cos", angle))


class DisturbancePulses(AbstractLaw):
    """Isolated pushes: F = Σ_i A_i cos²(π (t − t_i)/(2w)) for abs(t − t_i) < w.

    `times` t_i and `width` w, s, are given numbers.
    """

    times: tuple[float, ...] = eqx.field(static=True, converter=lambda t: tuple(map(float, t)))
    width: float = eqx.field(static=True)
    coordinates: ClassVar = frozenset({"time"})

    @property
    def affine(self):
        return tuple(Parameter(f"pulse_{i + 1}", FORCE) for i in range(len(self.times)))

    @property
    def chosen(self) -> int:
        return len(self.times) + 1

    def law(self, sample: Sample):
        places = [jnp.clip((sample.time - at) / self.width, -1.0, 1.0) for at in self.times]
        return tuple(jnp.cos(0.5 * jnp.pi * place) ** 2 for place in places)

    def text(self, s):
        half = literal(0.25 * TURN)
        shapes = []
        for at in self.times:
            place = s.clip(f"(t - {signed(at)}) / {literal(self.width)}", "-1.0", "1.0")
            wave = s.call("cos", f"{half} * {place}")
            shapes.append(f"{wave} * {wave}")
        return tuple(shapes)

    def extent(self, values):
        return {"time": (min(self.times) - self.width, max(self.times) + self.width)}
