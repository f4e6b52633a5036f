"""What lies between motor and load, as far as one mass can tell."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..recording import Recording
from ..units import DIMENSIONLESS, FORCE, FREQUENCY, INERTIA, POSITION
from .base import Parameter
from .presliding import AbstractMemory, starts

UNKNOWN = float("nan")


def play(recording: Recording, half_gap: Float[Array, ""]) -> Float[Array, " N"]:
    """Where the motor side stands inside a gap, from −1 to 1 (the flanks), `(N,)`.

    The play operator y ← clip(y, x − δ, x + δ) (Krasnosel'skii & Pokrovskii 1989): the load y is
    dragged by the flanks. A segment starts at the flank that its velocity pushes, or in the
    middle if at rest.
    """
    x = recording.position
    begins = starts(recording)
    first = x - half_gap * jnp.sign(recording.velocity)
    low = jnp.where(begins, first, x - half_gap)
    high = jnp.where(begins, first, x + half_gap)

    def drag(load, flanks):
        load = jnp.clip(load, *flanks)
        return load, load

    dragged = jax.lax.scan(drag, x[0], (low, high), unroll=8)[1]
    return (x - dragged) / half_gap


def _gap_bounds(scales):
    """From one sample's way at the slowest slip to a tenth of the stroke, as for presliding."""
    return scales.slowest * scales.interval, 0.1 * (scales.high - scales.low)


class Backlash(AbstractMemory):
    """Load that rests while the motor crosses a gap: u = f − F_L sign(v) (1 − (w/δ)⁸).

    w is the place in the gap from −δ to δ ([`play`][]), so the bracket is one inside and zero at
    the flanks; `half_gap` δ, m. First order: the load's friction F_L is absent, while its inertia,
    the impact and the ringing after it, which take a second mass, are left out.
    """

    half_gap: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("backlash_force", FORCE),)
    nonlinear: ClassVar = (Parameter("half_gap", POSITION, _gap_bounds),)
    coordinates: ClassVar = frozenset({"position", "velocity"})

    def columns(self, recording: Recording) -> Float[Array, "N 1"]:
        inside = 1 - play(recording, self.half_gap) ** 8
        return (-jnp.sign(recording.velocity) * inside)[:, None]


def _resonance_bounds(scales):
    """From four periods in the record to four samples a period."""
    return 4.0 / scales.duration, 0.25 / scales.interval


def _damping_bounds(scales):
    """From a bare steel shaft to what no longer overshoots much."""
    return 0.01, 0.7


# A speed below this part of the root mean square is rest or the noise of it, and no direction.
_REST = 0.03


class Compliance(AbstractMemory):
    """Load on a spring and a damper, position on the motor: u = f + M_L r̈.

    With r = x_L − x: r̈ + 2ζω ṙ + ω² r = −a − (F_L/M_L) sign(v). `load_inertia` M_L, kg;
    `load_friction` F_L, N, the part of the friction that acts on the load and so reaches the motor
    by the spring; `load_resonance` ω/2π, Hz, at which the load swings against a held motor;
    `damping_ratio` ζ. What excites it, `driven`, is "inertia", "friction" or "both"; what does
    not is left out. The oscillator is exact for a velocity that is straight between the samples;
    to first order the load goes the way of the motor, and none at rest. A segment starts with the
    load at rest on its spring.
    """

    load_resonance: Float[Array, ""] | float = UNKNOWN
    damping_ratio: Float[Array, ""] | float = UNKNOWN
    driven: str = eqx.field(static=True, default="inertia")
    nonlinear: ClassVar = (
        Parameter("load_resonance", FREQUENCY, _resonance_bounds),
        Parameter("damping_ratio", DIMENSIONLESS, _damping_bounds),
    )

    def __check_init__(self):
        if self.driven not in _DRIVES:
            raise ValueError(f"driven is one of {', '.join(_DRIVES)}, not {self.driven!r}.")

    @property
    def affine(self):
        return _DRIVES[self.driven]

    @property
    def inertial(self) -> bool:
        return True

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        return jnp.zeros((recording.num_samples, len(self.affine)), recording.time.dtype)

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        span = jnp.pad(jnp.diff(recording.time), (1, 0))
        real = ~starts(recording) & (span > 0)
        span = jnp.where(real, span, 1.0)
        speed = recording.velocity
        rate = jnp.pad(jnp.diff(speed), (1, 0)) / span
        mean = 0.5 * (speed + jnp.roll(speed, 1))
        rest = _REST * jnp.sqrt(jnp.mean(speed**2)) + jnp.finfo(speed.dtype).tiny
        pulls = {_LOAD_INERTIA: jnp.where(real, rate, 0.0)}
        pulls[_LOAD_FRICTION] = jnp.clip(jnp.where(real, mean, speed) / rest, -1.0, 1.0)
        pull = jnp.stack([pulls[parameter] for parameter in self.affine], axis=1)
        return self._swinging(pull, span, real)

    def _swinging(self, pull, span, real):
        """ṙ, m/s, of each column of `pull`, m/s² `(N, p)`, over the span before each sample."""
        omega = 2 * jnp.pi * self.load_resonance
        decay = self.damping_ratio * omega
        swing = omega * jnp.sqrt(1 - self.damping_ratio**2)
        fading = jnp.exp(-decay * span)
        cosine = fading * jnp.cos(swing * span)
        sine = fading * jnp.sin(swing * span) / swing
        sunk = pull / omega**2

        def step(state, now):
            stretch, rate = state
            cosine, sine, sunk, real = now
            # Free vibration about where the pull would hold the spring.
            away = stretch + sunk
            stretch = away * (cosine + decay * sine) + rate * sine - sunk
            rate = rate * (cosine - decay * sine) - away * omega**2 * sine
            state = jnp.where(real, stretch, -sunk), jnp.where(real, rate, 0.0)
            return state, state[1]

        rest = jnp.zeros_like(sunk[0])
        return jax.lax.scan(step, (rest, rest), (cosine, sine, sunk, real), unroll=4)[1]


_LOAD_INERTIA, _LOAD_FRICTION = (
    Parameter("load_inertia", INERTIA),
    Parameter("load_friction", FORCE),
)
_DRIVES = {
    "inertia": (_LOAD_INERTIA,),
    "friction": (_LOAD_FRICTION,),
    "both": (_LOAD_INERTIA, _LOAD_FRICTION),
}
