"""A gap between motor and load."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...data.recording import Recording
from ...units import (
    FORCE,
    POSITION,
)
from ..base import AbstractTerm
from ..effect import Effect, View, even, inside, product
from ..presliding import AbstractStates, States, starts
from ..sample import UNKNOWN, Burden, Parameter
from ..transmission import DECELERATION, OCTAVES, DryLoad, pushed
from .compliance import coasting


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


class Backlash(AbstractStates):
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

    # As states: the load's position, dragged at the end of a step, and the bracket over the step.

    @property
    def relief(self):
        return (1.0,)

    @property
    def stiffness(self):
        return (8 / self.half_gap,)

    def start(self, position, velocity) -> States:
        dragged = position - self.half_gap * jnp.sign(velocity)
        return States(jnp.zeros((0,), position.dtype), jnp.stack([dragged, 0 * dragged]))

    def present(self, states, now):
        return -now.side * states.kept[1:]

    def ready(self, states, now, span):
        load = states.kept[0]
        place = jnp.clip((now.position - load) / self.half_gap, -1.0, 1.0)
        # The mean over the way that the motor goes, which may be longer than the gap.
        way = now.velocity * span / self.half_gap
        goes = jnp.abs(way) > jnp.sqrt(jnp.finfo(way.dtype).eps)
        after = jnp.clip(place + way, -1.0, 1.0)
        crossed = (after - place) - (after**9 - place**9) / 9
        inside = jnp.where(goes, crossed / jnp.where(goes, way, 1.0), 1 - place**8)
        return States(states.flow, jnp.stack([load, inside]))

    def settled(self, states, now, span):
        load, inside = states.kept
        load = jnp.clip(load, now.position - self.half_gap, now.position + self.half_gap)
        return States(states.flow, jnp.stack([load, inside]))


def _windup_bounds(scales):
    """From what a rigid flank is like to as much as the widest gap."""
    low, high = _gap_bounds(scales)
    return 0.1 * low, high


# Flanks in touch: a load that strikes them comes back with half its speed, as in steel gears.
_FLANKS = 0.2


class ElasticBacklash(AbstractStates):
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
        Parameter("half_gap", POSITION, _gap_bounds, resolution=OCTAVES),
        Parameter("windup", POSITION, _windup_bounds, resolution=OCTAVES),
        DECELERATION,
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

    @property
    def _load(self) -> DryLoad:
        return DryLoad(self.pace, _FLANKS, self.load_deceleration, self.half_gap)

    @property
    def shed(self):
        return (1 / self.load_deceleration,)

    @property
    def relief(self):
        return (1.0,)

    @property
    def stiffness(self):
        return (1 / self.windup,)

    @property
    def pace(self):
        return jnp.sqrt(self.load_deceleration / self.windup)

    def start(self, position, velocity) -> States:
        return self._load.start(velocity)

    def present(self, states, now):
        return (self._load.push(states, now.velocity) / self.load_deceleration - now.side)[None]

    def rates(self, states, now):
        return self._load.rates(states, now)

    def ready(self, states, now, span):
        return self._load.ready(states, now)

    def settled(self, states, now, span):
        return self._load.settled(states)


def gaps(term: AbstractTerm, view: View) -> np.ndarray:
    """Gaps and windups from what is crossed in a twentieth of the kernel's reach to the widest."""
    if not isinstance(term, ElasticBacklash):
        return even(term, view)
    low, high = inside(term, view.limits, np.array([[0.0] * 3, [1.0] * 3]))
    least = 0.25 * view.acceleration * (view.reach / 20) ** 2
    least = np.clip(least, low[0], 0.1 * high[0])
    widths, windups = (np.geomspace(least, high[0], n) for n in (10, 7))
    return product([widths, windups, coasting(view)])


BACKLASH = Effect(
    "backlash",
    "−F_L sign(v) inside the gap 2δ, or F_L (T − sign v) − M_L a, T what the flanks push",
    "reversals",
    "After a reversal {backlash_force} of friction is absent while a gap of twice {half_gap} is "
    "crossed: backlash",
    laws=(Backlash, ElasticBacklash),
    coordinates=("distance_since_reversal",),
    needs=frozenset({"position"}),
    confusable_with=("presliding", "compliance", "transport_delay"),
    separate_by="Repeat the motion at half the speed: a delay scales with force rate, a gap does "
    "not.",
    positive=True,
    first_order=True,
    at_reversals=True,
    leftover=True,
    grid=gaps,
    sizes=("backlash_force",),
    vanishes=("half_gap",),
)
