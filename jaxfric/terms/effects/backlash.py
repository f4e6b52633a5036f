"""A gap between motor and load."""

from collections.abc import Mapping
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...data.recording import Recording
from ...units import DIMENSIONLESS, FORCE, POSITION, VELOCITY
from ..base import AbstractTerm
from ..effect import Derived, Effect, Extent, View, even, inside, product, scattered, with_parameter
from ..presliding import AbstractStates, States, starts
from ..sample import UNKNOWN, Burden, Parameter, Resolution
from ..transmission import (
    ASYMMETRY,
    DECELERATION,
    OCTAVES,
    AbstractDryLoad,
    DryLoad,
    load_motion,
)
from .compliance import coasting, uneven


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


def _flank_bounds(scales):
    """From hard steel, off which a load comes back with three quarters of its speed, to a film of
    oil that leaves it a seventh.
    """
    return 0.1, 0.95


# Of flanks that a law does not look for: a load comes back with 0.57 of its speed, as in gears.
_GEARS = 0.2
# No more than a few blows tell it: begun in the middle, and refined with the rest.
_MIDDLE = 0.5
FLANK_DAMPING = Parameter(
    "flank_damping", DIMENSIONLESS, _flank_bounds, logarithmic=False,
    resolution=Resolution(1, 1, None, 2),
)  # fmt: skip


class ElasticBacklash(AbstractDryLoad):
    """A load behind a gap, its flanks elastic: u = f + F_L (T − sign v) − (F_L/d) dv/dt.

    F_L T is what the flanks push the load of friction F_L and inertia F_L/d by. Of that the
    load's friction is the column, and its speed, beside the motor's, the momentum (`load_motion`).
    `half_gap` δ, m; `windup` e, m, by which the flanks give way under F_L, so that their stiffness
    is F_L/e; `load_deceleration` d, m/s², at which the load would coast to rest. Off a flank it
    comes back with little more than half of its speed.
    """

    half_gap: Float[Array, ""] | float = UNKNOWN
    windup: Float[Array, ""] | float = UNKNOWN
    load_deceleration: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("backlash_force", FORCE),)
    nonlinear: ClassVar[tuple[Parameter, ...]] = (
        Parameter("half_gap", POSITION, _gap_bounds, resolution=OCTAVES),
        Parameter("windup", POSITION, _windup_bounds, resolution=OCTAVES),
        DECELERATION,
    )

    def burden(self, beta, alpha) -> Burden:
        def lighter(factor: float) -> np.ndarray:
            # The rows tell the friction well, and the inertia only by how the load coasts.
            return beta * np.array([1.0, 1.0, factor])

        return Burden(float(alpha[0] / beta[2]), float(alpha[0]), lighter=lighter)

    def columns_and_momentum(self, recording):
        held, speed = load_motion(recording, *self.load)
        motor = recording.velocity.astype(speed.dtype)
        plain = held - self.load.friction(motor) - self.decay * motor
        return tuple(x[:, None] / self.load_deceleration for x in (plain, speed - motor))

    @property
    def load(self) -> DryLoad:
        known = self.pace, self.damping, self.load_deceleration, self.half_gap, self.decay
        return DryLoad(*known, swings=True)

    @property
    def damping(self):
        """The damping ratio of the load on its flank, below one."""
        return _GEARS

    @property
    def decay(self):
        """By how much a second the load's viscous friction slows it, 1/s."""
        return 0.0

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

    def present(self, states, now):
        push = self.load.push(states, now.velocity) - self.load.friction(now.side)
        return (push / self.load_deceleration)[None]


def _speed_bounds(scales):
    """From a viscous friction of three times the dry one at full speed, the most that guides and
    gears have, to nearly none.
    """
    return scales.fastest / 3, 30 * scales.fastest


class DampedBacklash(ElasticBacklash):
    """[`ElasticBacklash`][] with a load that has viscous friction too, F_L (sign w + α + w/v_s).

    `viscous_speed` v_s, m/s: there it is as large as the dry friction F_L. So a load that flies
    through the gap is slowed by (1 ± α + w/v_s) d. `load_asymmetry` α: which part of the mean of
    its dry friction is more forwards and less backwards, as it also seems to be where the load has
    a weight. When it leaves a flank, and strikes the other one, depends on it.
    """

    viscous_speed: Float[Array, ""] | float = UNKNOWN
    load_asymmetry: Float[Array, ""] | float = 0.0
    nonlinear: ClassVar[tuple[Parameter, ...]] = (
        *ElasticBacklash.nonlinear,
        Parameter("viscous_speed", VELOCITY, _speed_bounds, resolution=Resolution(0, 0.5, None, 4)),
        ASYMMETRY,
    )

    def burden(self, beta, alpha) -> Burden:
        def lighter(factor: float) -> np.ndarray:
            return np.where([p == DECELERATION for p in self.nonlinear], factor, 1.0) * beta

        return super().burden(beta[:3], alpha)._replace(lighter=lighter)

    @property
    def load(self) -> DryLoad:
        return super().load._replace(asymmetry=self.load_asymmetry)

    @property
    def relief(self):
        return (1 + abs(self.load_asymmetry),)

    def present(self, states, now):
        return super().present(states, now) - now.velocity / self.viscous_speed

    @property
    def decay(self):
        return self.load_deceleration / self.viscous_speed


class OiledBacklash(DampedBacklash):
    """[`DampedBacklash`][] with flanks of which it is found how much of a blow they give back.

    `flank_damping` ζ: the damping ratio of the load on its flank, below one. As flanks do not pull,
    e^(−ζθ/√(1 − ζ²)) of a blow's speed comes back, θ = atan2(2ζ√(1 − ζ²), 2ζ² − 1).
    """

    flank_damping: Float[Array, ""] | float = UNKNOWN
    nonlinear: ClassVar = (*DampedBacklash.nonlinear, FLANK_DAMPING)

    @property
    def damping(self):
        return self.flank_damping


def gaps(term: AbstractTerm, view: View) -> np.ndarray:
    """Gaps and windups from what is crossed in a twentieth of the kernel's reach to the widest."""
    if not isinstance(term, ElasticBacklash):
        return even(term, view)
    low, high = _ends(term, view)
    least = 0.25 * view.acceleration * (view.reach / 20) ** 2
    least = np.clip(least, low[0], 0.1 * high[0])
    # A stiff flank is soon passed, whatever its stiffness; a load's viscous friction at full speed
    # is mostly as large as its dry one, or of no account.
    widths, windups = (np.geomspace(least, high[0], n) for n in (10, 4))
    speeds = view.limits.fastest * np.array([1.0, 5.0])
    flanks = [np.array([_MIDDLE])] if isinstance(term, OiledBacklash) else []
    return product([widths, windups, coasting(view), speeds, uneven(view), *flanks])


def _ends(term: AbstractTerm, view: View) -> np.ndarray:
    """The least and the largest β, `(2, d)`."""
    return inside(term, view.limits, np.outer([0.0, 1.0], np.ones(len(term.nonlinear))))


def flights(term: AbstractTerm, view: View, count: int) -> np.ndarray:
    """Gaps, windups and decelerations of loads that the motor's own deceleration lets go of.

    When they leave a flank, and when they strike the next one, follows from all of them together:
    a tenth of one decides. A load that is slowed less than a twentieth as fast as the motor hardly
    changes its speed in flight, one that is slowed three times as fast never leaves its flank. Gaps
    are up to a thirtieth of the stroke: what has more is no gear.
    """
    if not isinstance(term, ElasticBacklash):
        return np.zeros((0, len(term.nonlinear)))
    oiled = isinstance(term, OiledBacklash)
    place, (low, high) = scattered(count, 4 + oiled), _ends(term, view)
    least = np.clip(0.25 * view.acceleration * (view.reach / 20) ** 2, low[0], 0.1 * high[0])
    stroke = view.limits.high - view.limits.low
    widest = np.maximum(stroke / 30, 2 * least)
    half_gap = least * (widest / least) ** place[:, 0]
    windup = half_gap * 10.0 ** (-3 * place[:, 1])
    slowed = view.acceleration * 0.05 * 60.0 ** place[:, 2]  # at half the full speed
    ratio = 0.05 * 30.0 ** place[:, 3]  # viscous friction by dry friction there
    speed = 0.5 * view.limits.fastest / ratio
    none = np.zeros(len(place))  # about the best of them it is looked for
    found = np.stack([half_gap, windup, slowed / (1 + ratio), speed, none], axis=1)
    if oiled:
        found = np.append(found, low[5:] + (high - low)[5:] * place[:, 4:], axis=1)
    return np.clip(found, low, high)


def _whole(values: Mapping[str, float], extent: Extent) -> dict[str, Derived]:
    """The gap from flank to flank."""
    return {"gap": Derived("half_gap", 2.0, POSITION)}


BACKLASH = Effect(
    "backlash",
    "−F_L sign(v) inside the gap 2δ, or F_L (T − sign v) − M_L a, T what the flanks push",
    "reversals",
    "After a reversal {backlash_force} of friction is absent while a gap of {gap} is crossed: "
    "backlash",
    laws=(Backlash, DampedBacklash, OiledBacklash),
    coordinates=("distance_since_reversal",),
    needs=frozenset({"position"}),
    confusable_with=("presliding", "compliance", "transport_delay"),
    separate_by="Move to and fro by less than the gap: in it the force does not grow with the way, "
    "on a spring it does. Repeat the motion at half the speed: a delay scales with force rate, a "
    "gap does not.",
    positive=True,
    first_order=True,
    at_reversals=True,
    leftover=True,
    grid=gaps,
    scatter=flights,
    variant=with_parameter(
        "load_deceleration",
        "A load with {backlash_force} of friction crosses a gap of {gap}, whose flanks "
        "give way by {windup} under that friction, after a reversal, and where the motor brakes "
        "harder than the load slows down by itself, by {load_deceleration}: backlash",
    ),
    sizes=("backlash_force", "gap"),
    derived=_whole,
    vanishes=("half_gap",),
)
