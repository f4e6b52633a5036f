"""What changes at one moment: the date, the step over time, and terms that begin."""

import copy
from abc import abstractmethod

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..units import TIME
from .base import AbstractTerm, summands
from .sample import Parameter, Resolution
from .text import Syntax, literal


def inside_record(scales):
    """Inside the record but its first and last 2 %, where one level rests on too few samples."""
    margin = 0.02 * scales.duration
    return scales.start + margin, scales.start + scales.duration - margin


# Two dates of a step differ by what lies between them only: the cost is no parabola but a wedge,
# and a date is refined inside_record a step of the grid.
_MOMENTS = Resolution(1, 256, None, 256)
STEP_TIME = Parameter(
    "step_time", TIME, inside_record, logarithmic=False, resolution=_MOMENTS, moment=True
)


def around(moment: float, ramp: float) -> dict[str, tuple[float, float]]:
    """The range of time, s, in which a step shows."""
    half = ramp or 1.0
    return {"time": (moment - half, moment + half)}


def course(
    ramp: float | np.ndarray, betas: np.ndarray, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The step and its rate, 1/s, at each time, `(G, N)`, for the moments in the first column of
    `betas`, `(G, d)`; `ramp`, s, of all, or of each, `(G, 1)`.
    """
    late = time[None, :] - betas[:, :1]
    if np.all(ramp == 0):
        return np.where(late > 0, 1.0, 0.0), np.zeros_like(late)
    inside = np.abs(late) < 0.5 * ramp
    return np.clip(late / ramp + 0.5, 0.0, 1.0), np.where(inside, 1 / ramp, 0.0)


def stepped(
    time: Float[Array, " N"], moment: Float[Array, ""] | float, ramp: Float[Array, ""] | float
) -> Float[Array, " N"]:
    """A ramp of `ramp` seconds from zero to one about `moment`, s, at each `time`, s."""
    late = time - moment
    if not isinstance(ramp, jax.Array) and ramp == 0:
        return jnp.where(late > 0, jnp.ones_like(late), 0.0)
    return jnp.clip(late / ramp + 0.5, 0.0, 1.0)


def stepped_text(s: Syntax, moment: str, ramp: str | float) -> str:
    """The same in a language, the ramp by its name or a number."""
    if ramp == 0:
        return s.choose(f"t > {moment}", "1.0", "0.0")
    ramp = ramp if isinstance(ramp, str) else literal(ramp)
    return s.clip(f"(t - {moment}) / {ramp} + 0.5", "0.0", "1.0")


class Resolved(AbstractTerm):
    """A step, `term`, drawn out to a ramp of `length` seconds, a number of the recording."""

    term: AbstractTerm
    length: Float[Array, ""]

    @property
    def affine(self):
        return self.term.affine

    @property
    def nonlinear(self):
        return self.term.nonlinear

    @property
    def coordinates(self):
        return self.term.coordinates

    @property
    def inertial(self) -> bool:
        return self.term.inertial

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        return self._ramped().columns(recording)

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        return self._ramped().momentum(recording)

    def beta(self) -> Float[Array, " d"]:
        return self.term.beta()

    def with_beta(self, beta: Float[Array, " d"]) -> "Resolved":
        return Resolved(self.term.with_beta(beta), self.length)

    def _ramped(self):
        # `ramp` is static: the copy, with a traced one, must not leave this object.
        ramped = copy.copy(self.term)
        object.__setattr__(ramped, "ramp", self.length)
        return ramped


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
        share = stepped_text(s, names[0], self.ramp)
        return [f"{share} * ({column})" for columns in own for column in columns or ()]

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        share, time = stepped(recording.time, self.step_time, self.ramp), recording.time
        plain = share[:, None] * self.changed.columns(recording)
        if not isinstance(self.ramp, jax.Array) and self.ramp == 0:
            return plain
        inside = jnp.abs(time - self.step_time) < 0.5 * self.ramp
        rate = jnp.where(inside, 1 / self.ramp, 0.0)
        return plain - rate[:, None] * self.changed.momentum(recording)

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        share = stepped(recording.time, self.step_time, self.ramp)
        return share[:, None] * self.changed.momentum(recording)

    @property
    def switched(self) -> AbstractTerm:
        return self.changed

    def resolved(self, length):
        return self if self.ramp else Resolved(self, length)

    def course(self, betas, time):
        return course(self.ramp, betas, time)

    def extent(self, values):
        return self.changed.extent(values) | around(values["step_time"], self.ramp)
