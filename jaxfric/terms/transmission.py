"""What lies between motor and load, as far as one mass can tell."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..units import ACCELERATION, DIMENSIONLESS, FORCE, FREQUENCY, INERTIA, POSITION
from .presliding import AbstractMemory, starts
from .sample import Burden, Parameter, Resolution

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

    w is the place in the gap from −δ to δ (`play`), so the bracket is one inside and zero at
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


def _windup_bounds(scales):
    """From what a rigid flank is like to as much as the widest gap."""
    low, high = _gap_bounds(scales)
    return 0.1 * low, high


def _coasting_bounds(scales):
    """From a load that coasts for the whole record to one that stops within a sample."""
    return scales.fastest / scales.duration, scales.fastest / scales.interval


# Flanks in touch: a load that strikes them comes back with half its speed, as in steel gears.
_FLANKS = 0.2


# Three together: a factor of two from one to the next, and the refinement goes on from there.
_OCTAVES = Resolution(0, 1, None, 12)


class ElasticBacklash(AbstractMemory):
    """A load behind a gap, its flanks elastic: u = f + F_L (T − sign v) − (F_L/d) dv/dt.

    F_L T is what the flanks push the load of friction F_L and inertia F_L/d by (`pushed`).
    `half_gap` δ, m; `windup` e, m, by which the flanks give way under F_L, so that their stiffness
    is F_L/e; `load_deceleration` d, m/s², at which the load would coast to rest.
    """

    half_gap: Float[Array, ""] | float = UNKNOWN
    windup: Float[Array, ""] | float = UNKNOWN
    load_deceleration: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("backlash_force", FORCE),)
    nonlinear: ClassVar = (
        Parameter("half_gap", POSITION, _gap_bounds, resolution=_OCTAVES),
        Parameter("windup", POSITION, _windup_bounds, resolution=_OCTAVES),
        Parameter("load_deceleration", ACCELERATION, _coasting_bounds, resolution=_OCTAVES),
    )
    coordinates: ClassVar = frozenset({"position", "velocity", "time"})

    stepped: ClassVar = True
    swings: ClassVar = True

    @property
    def inertial(self) -> bool:
        return True

    def burden(self, beta, alpha) -> Burden:
        def lighter(factor: float) -> np.ndarray:
            # The rows tell the friction well, and the inertia only by how the load coasts.
            return beta * np.array([1.0, 1.0, factor])

        return Burden(float(alpha[0] / beta[2]), float(alpha[0]), lighter=lighter)

    def momentum(self, recording: Recording) -> Float[Array, "N 1"]:
        return -recording.velocity[:, None] / self.load_deceleration

    def columns(self, recording: Recording) -> Float[Array, "N 1"]:
        omega = jnp.sqrt(self.load_deceleration / self.windup)
        push = pushed(recording, omega, _FLANKS, self.load_deceleration, self.half_gap)
        return (push / self.load_deceleration - jnp.sign(recording.velocity))[:, None]


# Steps between samples.
_STEPS = 4


def pushed(
    recording: Recording,
    omega: Float[Array, ""],
    damping: Float[Array, ""] | float,
    deceleration: Float[Array, ""],
    half_gap: Float[Array, ""] | float | None = None,
) -> Float[Array, " N"]:
    """What a load with dry friction is pushed by, per mass, m/s², `(N,)`.

    For its speed w, dw/dt = p − d sign(w), and at rest it sticks. Without `half_gap` p = ω² s + 2ζω
    ds/dt, s, m, the way by which the motor, at the recording's position, is ahead; with it, δ, the
    spring has a dead zone from −δ to δ, and flanks do not pull. `omega` ω, 1/s; `damping` ζ;
    `deceleration` d, m/s². Stepped semi-implicitly, stable for any stiffness. A segment starts in
    slip.
    """
    begins, speed = starts(recording), recording.velocity
    span = jnp.where(begins, 0.0, jnp.pad(jnp.diff(recording.time), (1, 0))) / _STEPS
    way = jnp.where(begins, 0.0, jnp.pad(jnp.diff(recording.position), (1, 0))) / _STEPS
    last = jnp.where(begins, speed, jnp.roll(speed, 1))
    stiffness, drag = omega**2, 2 * damping * omega
    gap = 0.0 if half_gap is None else half_gap

    def substep(state, span, way, speed):
        ahead, load = state
        ahead = ahead + way - span * load
        over = jnp.sign(ahead) * jnp.maximum(jnp.abs(ahead) - gap, 0.0)
        push = stiffness * over + drag * (speed - load)
        push = push if half_gap is None else jnp.where(push * over > 0, push, 0.0)
        push = push / (1 + span * drag + span**2 * stiffness)
        free = load + span * push
        left = jnp.maximum(jnp.abs(free) - span * deceleration, 0.0)
        return (ahead, jnp.sign(free) * left), push

    def step(state, now):
        span, way, last, speed, begin = now
        total = jnp.zeros_like(speed)
        for number in range(_STEPS):
            at = last + (number + 0.5) / _STEPS * (speed - last)
            state, push = substep(state, span, way, at)
            total = total + push / _STEPS
        ahead, load = state
        side = jnp.sign(speed)
        wound = side * (gap + deceleration / stiffness)
        state = jnp.where(begin, wound, ahead), jnp.where(begin, speed, load)
        return state, jnp.where(begin, side * deceleration, total)

    zero = jnp.zeros_like(speed[0])
    push = jax.lax.scan(step, (zero, zero), (span, way, last, speed, begins))[1]
    # Means over the spans before the samples; what is wanted belongs to the samples.
    return 0.5 * (push + jnp.where(jnp.roll(begins, -1), push, jnp.roll(push, -1)))


def _resonance_bounds(scales):
    """From four periods in the record to four samples a period."""
    return 4.0 / scales.duration, 0.25 / scales.interval


def _damping_bounds(scales):
    """From a bare steel shaft to what no longer overshoots much."""
    return 0.01, 0.7


# A speed below this part of the root mean square is rest or the noise of it, and no direction.
_REST = 0.03


# A resonance is 2ζ of its frequency wide, 15 % of an octave at ζ = 0.05; a lighter damping is
# refined from there. Damping ratios a factor of four apart differ in height by less than that.
_RESONANCES = Resolution(0, 12, None, 96)
_DAMPINGS = Resolution(0, 0.5, None, 4)


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
        Parameter("load_resonance", FREQUENCY, _resonance_bounds, resolution=_RESONANCES),
        Parameter("damping_ratio", DIMENSIONLESS, _damping_bounds, resolution=_DAMPINGS),
    )
    swings: ClassVar = True

    def __check_init__(self):
        if self.driven not in _DRIVES:
            raise ValueError(f"driven is one of {', '.join(_DRIVES)}, not {self.driven!r}.")

    @property
    def affine(self):
        return _DRIVES[self.driven]

    @property
    def inertial(self) -> bool:
        return True

    def burden(self, beta, alpha) -> Burden:
        known = {p.name: float(a) for p, a in zip(self.affine, alpha, strict=True)}
        return Burden(known.get("load_inertia", 0.0), known.get("load_friction", 0.0))

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


# What dry friction takes besides makes the resonance as wide as at a damping of 0.15 or so.
_DRY = Resolution(0, 4, None, 32)


class DryCompliance(AbstractMemory):
    """A load with dry friction on a spring and a damper: u = f + M_L (p − d sign v) − M_L dv/dt.

    M_L p is what the spring pushes the load by (`pushed`): [`Compliance`][] for a load whose
    friction lets it stick, M_L d of it. `load_inertia` M_L, kg; `load_resonance` ω/2π, Hz;
    `damping_ratio` ζ; `load_deceleration` d, m/s².
    """

    load_resonance: Float[Array, ""] | float = UNKNOWN
    damping_ratio: Float[Array, ""] | float = UNKNOWN
    load_deceleration: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (_LOAD_INERTIA,)
    nonlinear: ClassVar = (
        Parameter("load_resonance", FREQUENCY, _resonance_bounds, resolution=_DRY),
        *Compliance.nonlinear[1:],
        *ElasticBacklash.nonlinear[2:],
    )
    coordinates: ClassVar = frozenset({"position", "velocity", "time"})

    stepped: ClassVar = True
    swings: ClassVar = True

    @property
    def inertial(self) -> bool:
        return True

    def burden(self, beta, alpha) -> Burden:
        resonance, _, slow = beta
        give = slow / (2 * np.pi * resonance) ** 2
        return Burden(float(alpha[0]), float(alpha[0] * beta[2]), give)

    def momentum(self, recording: Recording) -> Float[Array, "N 1"]:
        return -recording.velocity[:, None]

    def columns(self, recording: Recording) -> Float[Array, "N 1"]:
        omega = 2 * jnp.pi * self.load_resonance
        push = pushed(recording, omega, self.damping_ratio, self.load_deceleration)
        return (push - self.load_deceleration * jnp.sign(recording.velocity))[:, None]
