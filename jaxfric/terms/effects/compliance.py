"""A load on a spring."""

from collections.abc import Mapping
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...data.recording import Recording
from ...units import DIMENSIONLESS, FORCE, FREQUENCY, INERTIA
from ..base import AbstractTerm
from ..effect import GRID, PASSED, Effect, Extent, View, inside, product
from ..presliding import AbstractStates, Instant, States, starts
from ..sample import UNKNOWN, Burden, Parameter, Resolution
from ..transmission import ASYMMETRY, DECELERATION, AbstractDryLoad, DryLoad, load_motion


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


class Compliance(AbstractStates):
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
        loads = (known.get(p.name, 0.0) for p in (_LOAD_INERTIA, _LOAD_FRICTION))
        return Burden(*loads, resonance=float(beta[0]))

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

    # As states: of each column r, and dr/dt, or the load's speed dr/dt + v where inertia drives it.

    @property
    def shed(self):
        return tuple(float(parameter == _LOAD_INERTIA) for parameter in self.affine)

    @property
    def relief(self):
        return tuple(float(parameter == _LOAD_FRICTION) for parameter in self.affine)

    @property
    def stiffness(self):
        return tuple(share * self.pace**2 for share in self.shed)

    @property
    def pace(self):
        return 2 * jnp.pi * self.load_resonance

    def start(self, position, velocity) -> States:
        shed, dry = jnp.asarray([self.shed, self.relief], velocity.dtype)
        flow = jnp.concatenate([-dry * jnp.sign(velocity) / self.pace**2, shed * velocity])
        return States(flow, jnp.zeros((0,), velocity.dtype))

    def present(self, states: States, now: Instant):
        return self.rates(states, now)[len(self.affine) :]

    def rates(self, states: States, now: Instant):
        shed, dry = jnp.asarray([self.shed, self.relief], states.flow.dtype)
        stretch, speed = jnp.split(states.flow, 2)
        rate = speed - shed * now.velocity
        pull = 2 * self.damping_ratio * self.pace * rate + self.pace**2 * stretch
        return jnp.concatenate([rate, -pull - dry * now.side])


_LOAD_INERTIA = Parameter("load_inertia", INERTIA)
_LOAD_FRICTION = Parameter("load_friction", FORCE)
_DRIVES = {
    "inertia": (_LOAD_INERTIA,),
    "friction": (_LOAD_FRICTION,),
    "both": (_LOAD_INERTIA, _LOAD_FRICTION),
}


# What dry friction takes besides makes the resonance as wide as at a damping of 0.15 or so.
_DRY = Resolution(0, 4, None, 32)


class DryCompliance(AbstractDryLoad):
    """A load with dry friction on a spring and a damper: u = f + M_L (p − d sign v) − M_L dv/dt.

    M_L p is what the spring pushes the load by (`load_motion`): [`Compliance`][] for a load whose
    friction lets it stick, M_L d of it. `load_inertia` M_L, kg; `load_resonance` ω/2π, Hz;
    `damping_ratio` ζ; `load_deceleration` d, m/s², by 1 + `load_asymmetry` of it forwards and by
    1 − that backwards.
    """

    load_resonance: Float[Array, ""] | float = UNKNOWN
    damping_ratio: Float[Array, ""] | float = UNKNOWN
    load_deceleration: Float[Array, ""] | float = UNKNOWN
    load_asymmetry: Float[Array, ""] | float = 0.0
    affine: ClassVar = (_LOAD_INERTIA,)
    nonlinear: ClassVar = (
        Parameter("load_resonance", FREQUENCY, _resonance_bounds, resolution=_DRY),
        *Compliance.nonlinear[1:],
        DECELERATION,
        ASYMMETRY,
    )

    def burden(self, beta, alpha) -> Burden:
        resonance, _, slow, _ = beta
        give = slow / (2 * np.pi * resonance) ** 2
        return Burden(float(alpha[0]), float(alpha[0] * beta[2]), give, resonance=float(resonance))

    def columns_and_momentum(self, recording):
        held, speed = load_motion(recording, *self.load)
        motor = recording.velocity.astype(speed.dtype)
        return (held - self.load.friction(motor))[:, None], (speed - motor)[:, None]

    @property
    def load(self) -> DryLoad:
        known = self.pace, self.damping_ratio, self.load_deceleration
        return DryLoad(*known, asymmetry=self.load_asymmetry)

    @property
    def shed(self):
        return (1.0,)

    @property
    def relief(self):
        return (self.load_deceleration * (1 + abs(self.load_asymmetry)),)

    @property
    def stiffness(self):
        return (self.pace**2,)

    @property
    def pace(self):
        return 2 * jnp.pi * self.load_resonance

    def present(self, states, now):
        push = self.load.push(states, now.velocity)
        return (push - self.load.friction(now.side))[None]


# Damping ratios tried: a drive train's, a belt's, a soft coupling's.
_DAMPING = (0.05, 0.15, 0.45)
# A load's friction in parts of what its inertia asks for, where it shows at all.
_COASTING = (0.2, 0.6, 2.0, 6.0)
# With more damping a load does not swing: its second half-wave is below a tenth of the first.
SWINGING = 0.5


# Decelerations of a grid lie a factor of two and more apart: what changes one by a tenth is no
# point of its own.
_EVEN = 0.1


def uneven(view: View) -> np.ndarray:
    """Asymmetries of a load: none, or that of all the machine's friction."""
    return np.unique([0.0, view.asymmetry if abs(view.asymmetry) > _EVEN else 0.0])


def coasting(view: View) -> np.ndarray:
    """Decelerations, m/s², at which a load would coast to rest."""
    return view.acceleration * np.array(_COASTING)


def resonances(term: AbstractTerm, view: View) -> np.ndarray:
    """Frequencies up to what the kernel still passes, with a few dampings each."""
    count = len(term.nonlinear)
    low, most = inside(term, view.limits, np.array([[0.0] * count, [1.0] * count]))[:, 0]
    high = max(min(most, PASSED / view.reach), 2 * low)
    swinging = [(f, z) for z in _DAMPING for f in np.geomspace(low, high, GRID)]
    if isinstance(term, DryCompliance):
        own = product([coasting(view), uneven(view)])
        return np.array([(*place, *slowed) for place in swinging for slowed in own])
    return np.array(swinging)


def creeping(values: Mapping[str, float], extent: Extent) -> str | None:
    """Another sentence for a load that is too damped to swing."""
    if values.get("damping_ratio", 0.0) < SWINGING:
        return None
    return (
        "A part of the mass follows the drive late, with a resonance at {load_resonance} and a "
        "damping ratio of {damping_ratio}: too damped to swing, as with rubber, grease or a "
        "slipping coupling"
    )


COMPLIANCE = Effect(
    "compliance",
    "M_L r̈, r̈ + 2ζω ṙ + ω² r = −a − (F_L/M_L) sign(v)",
    "reversals",
    "With the motor held the load swings on the drive at {load_resonance}, with a damping ratio of "
    "{damping_ratio}: compliance",
    laws=(Compliance, DryCompliance),
    scaled=lambda scales: (
        *(Compliance(driven=by) for by in ("inertia", "friction", "both")),
        DryCompliance(),
    ),
    coordinates=("acceleration", "time_since_reversal"),
    confusable_with=("transport_delay", "actuator_lag", "backlash", "presliding"),
    separate_by="Excite with a sweep up to the resonance, or measure on the load side.",
    positive=True,
    sizes=("damping_ratio",),
    at_reversals=True,
    sharp=True,
    delays=True,
    leftover=True,
    grid=resonances,
    variant=creeping,
)
