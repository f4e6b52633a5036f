"""Friction that follows velocity late."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...data.recording import Recording
from ...units import TIME
from ..base import AbstractTerm, leaves
from ..effect import Effect, View, inside, product
from ..friction import AbstractBump, Gaussian
from ..presliding import AbstractStates, Instant, States, low_pass, starts
from ..sample import UNKNOWN, Burden, Parameter
from ..vectors import joined, vector


def _memory_bounds(scales):
    """From one sample to a fiftieth of the record: what lasts longer is no transient."""
    return scales.interval, 0.02 * scales.duration


# Knots of the speeds of the past, straight between them: a sixtieth of a dead time apart.
_PAST = 64


class FrictionalLag(AbstractStates):
    """A Stribeck bump late by a dead time or lags: F = F_b sign(v) (g(s) − g(abs v)), s late abs v.

    `bump` is g, in the steady state; constant and viscous friction have no memory (Armstrong-
    Hélouvry, Dupont & Canudas de Wit 1994, section 2.4). `frictional_lag` τ, s, is the whole delay
    of the memory: a dead time without `poles` (Hess & Soom 1990: a few to tens of milliseconds), so
    many equal first-order lags otherwise. Through a reversal they differ: a filtered speed does not
    vanish there, and the bump is not built up in full. To first order in τ only τ F_b shows.
    """

    frictional_lag: Float[Array, ""] | float = UNKNOWN
    bump: AbstractBump = Gaussian()
    poles: int = eqx.field(static=True, default=0)

    @property
    def affine(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        return self.bump.affine

    @property
    def nonlinear(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        return (Parameter("frictional_lag", TIME, _memory_bounds), *self.bump.nonlinear)

    def beta(self) -> Float[Array, " d"]:
        own = vector([self.frictional_lag])
        return joined([own, self.bump.beta()])

    def with_beta(self, beta: Float[Array, " d"]) -> "FrictionalLag":
        return dataclasses.replace(
            self, frictional_lag=beta[..., 0], bump=self.bump.with_beta(beta[..., 1:])
        )

    def burden(self, beta, alpha) -> Burden:
        return Burden(0.0, float(alpha[0]), curved=True)

    def columns(self, recording: Recording) -> Float[Array, "N 1"]:
        direction, speed = jnp.sign(recording.velocity), jnp.abs(recording.velocity)
        least = jnp.finfo(speed.dtype).tiny
        late = jnp.maximum(self._late(recording, speed), least)
        change = self.bump.shape(late) - self.bump.shape(jnp.maximum(speed, least))
        return (direction * change)[:, None]

    def _late(self, recording, speed):
        begins = starts(recording)
        steps = jnp.pad(jnp.diff(recording.time), (1, 0))
        steps = jnp.where(begins, 0.0, jnp.maximum(steps, 0.0))
        if not self.poles:
            elapsed = jnp.cumsum(steps)
            begin = jax.lax.cummax(jnp.where(begins, elapsed, 0.0))
            return jnp.interp(jnp.maximum(elapsed - self.frictional_lag, begin), elapsed, speed)
        for _ in range(self.poles):
            speed = low_pass(speed, steps * self.poles / self.frictional_lag, begins)
        return speed

    # As states: the speed after each pole; of a dead time the late speed, ages and past speeds.

    @property
    def relief(self):
        return (1.0,)

    @property
    def pace(self):
        return max(self.poles, 1) / self.frictional_lag

    def start(self, position, velocity) -> States:
        speed = jnp.abs(velocity)
        if self.poles:
            return States(speed + jnp.zeros(self.poles, speed.dtype), speed[None][:0])
        ages = 2 * self.frictional_lag * jnp.linspace(0.0, 1.0, _PAST, dtype=speed.dtype)
        return States(speed[None][:0], jnp.concatenate([speed[None], ages, speed + 0 * ages]))

    def present(self, states: States, now: Instant):
        least = jnp.finfo(now.slip.dtype).tiny
        late = states.flow[-1:] if self.poles else states.kept[:1]
        change = self.bump.shape(jnp.maximum(late, least))
        return now.side * (change - self.bump.shape(jnp.maximum(jnp.abs(now.slip), least)))

    def rates(self, states: States, now: Instant):
        speed = now.side * now.velocity
        before = jnp.concatenate([speed[None], states.flow])[:-1]
        return self.pace * (before - states.flow) if self.poles else states.flow

    def ready(self, states: States, now: Instant, span):
        if self.poles:
            return states
        ages, speeds = jnp.split(states.kept[1:], 2)
        # The speed that is late by τ in the middle of the span.
        late = jnp.interp(self.frictional_lag - 0.5 * span, ages, speeds)
        return States(states.flow, states.kept.at[0].set(late))

    def settled(self, states: States, now: Instant, span):
        if self.poles:
            return states
        ages, speeds = jnp.split(states.kept[1:], 2)
        # The newest knot is replaced until it is far enough from the one before it.
        full = ages[1] >= self.frictional_lag / (_PAST - 2)
        ages, speeds = (jnp.where(full, jnp.roll(x, 1), x) for x in (ages + span, speeds))
        ages, speeds = ages.at[0].set(0.0), speeds.at[0].set(jnp.abs(now.velocity))
        return States(states.flow, jnp.concatenate([states.kept[:1], ages, speeds]))


# Times and widths of a bump that is late (a factor of 1.7 in either changes little), and exponents.
_COUNTS = (12, 8, 3)


def suited(
    term: FrictionalLag, base: AbstractTerm, turn: float | None
) -> tuple[FrictionalLag, ...]:
    """With the kind of bump that the baseline has, or a Gaussian one."""
    own = (leaf for leaf in leaves(base) if isinstance(leaf, AbstractBump))
    return (dataclasses.replace(term, bump=next(own, Gaussian())),)


def memories(term: AbstractTerm, view: View) -> np.ndarray:
    """All combinations of times, widths and exponents."""
    along = [(np.arange(n) + 0.5) / n for n in _COUNTS[: len(term.nonlinear)]]
    return inside(term, view.limits, product(along))


FRICTIONAL_LAG = Effect(
    "frictional_lag",
    "F_b sign(v) (exp(−(s/v_s)²) − exp(−(v/v_s)²)), s = abs v(t − τ) or filtered",
    "reversals",
    "Friction follows velocity {frictional_lag} late",
    laws=(FrictionalLag,),
    scaled=lambda scales: tuple(FrictionalLag(poles=poles) for poles in (0, 1, 2)),
    suited=suited,
    coordinates=("time_since_reversal", "acceleration"),
    confusable_with=("actuator_lag", "presliding", "transport_delay"),
    separate_by="Cycle at low speed without a reversal: the loop in force over speed remains.",
    positive=True,
    at_reversals=True,
    sharp=True,
    grid=memories,
    sizes=("stribeck_force",),
    vanishes=("frictional_lag",),
)
