"""Friction that builds up over a distance."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...units import DIMENSIONLESS, FORCE, POSITION
from ..base import AbstractTerm
from ..effect import Effect, View, even, product
from ..friction import STRIBECK_VELOCITY
from ..presliding import AbstractBristle, AbstractStates, States, starts, travel
from ..sample import UNKNOWN, Parameter, Resolution


def _distance_bounds(scales):
    """From one sample's way at the slowest slip to a tenth of the stroke.

    A shorter transient is over before the first sample in slip. One longer than a tenth of the
    stroke leaves no steady slip to compare with: it is a function of position.
    """
    return scales.slowest * scales.interval, 0.1 * (scales.high - scales.low)


_DISTANCE = Parameter("presliding_distance", POSITION, _distance_bounds)


class Dahl(AbstractBristle):
    """Presliding that Coulomb friction lacks: F = F_p (z − sign v), dz = (dx/x_d)(1 − z sign(dx)).

    `presliding_distance` x_d, m; F_p, equal to the Coulomb level for Dahl's model, is affine, and
    the presliding stiffness is σ₀ = F_p/x_d (Dahl 1968; exponent one).
    """

    presliding_distance: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("presliding_force", FORCE),)
    nonlinear: ClassVar = (_DISTANCE,)

    def lagging(self, velocity, deflection) -> Float[Array, "N 1"]:
        return (deflection - jnp.sign(velocity))[:, None]


class LuGre(AbstractBristle):
    """Presliding with a Stribeck curve: F = (F_p + F_b exp(−(v/v_s)²)) (z − sign v), z as in Dahl.

    The LuGre model (Canudas de Wit, Olsson, Åström & Lischinsky 1995) for a bristle whose
    stiffness scales with the friction level, so that `presliding_distance` x_d is constant, and
    without micro-damping σ₁, which acts in presliding only. `stribeck_velocity` v_s, m/s.
    """

    presliding_distance: Float[Array, ""] | float = UNKNOWN
    stribeck_velocity: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (
        Parameter("presliding_force", FORCE),
        Parameter("presliding_stribeck_force", FORCE),
    )
    nonlinear: ClassVar = (_DISTANCE, STRIBECK_VELOCITY)

    def lagging(self, velocity, deflection) -> Float[Array, "N 2"]:
        lagging = deflection - jnp.sign(velocity)
        bump = jnp.exp(-((velocity / self.stribeck_velocity) ** 2))
        return jnp.stack([lagging, bump * lagging], axis=1)

    def weights(self, s, distance, width):
        return ("", s.call("exp", f"-(v / {width}) * (v / {width})"))


# Elements side by side: with many the curve differs by 3 % of the friction at a spread of 0.6, and
# by 12 % at 0.9, the widest.
_ELEMENTS = 4


class MaxwellSlip(AbstractStates):
    """Presliding of elements side by side: F = F_p (Σ z_i/4 − sign v), z_i ← clip(z_i + dx/d_i).

    Each element is a spring that slips at its own distance d_i, from −1 to 1 (Iwan 1966); so are
    the generalised Maxwell-slip model's (Al-Bender, Lampaert & Swevers 2005) at low speed. All slip
    after `presliding_distance` x_d, m, from the middle, unlike Dahl's bristle, whose end is
    exponential: d_i is evenly from (1 − ρ) x_d to x_d, ρ the `presliding_spread`.
    """

    presliding_distance: Float[Array, ""] | float = UNKNOWN
    presliding_spread: Float[Array, ""] | float = UNKNOWN
    affine: ClassVar = (Parameter("presliding_force", FORCE),)
    nonlinear: ClassVar = (
        _DISTANCE,
        Parameter(
            "presliding_spread", DIMENSIONLESS, lambda scales: (0.0, 0.9), logarithmic=False,
            resolution=Resolution(1, 2, None, 3),
        ),
    )  # fmt: skip

    @property
    def distances(self) -> Float[Array, " 4"]:
        """d_i, m."""
        part = jnp.arange(_ELEMENTS) / (_ELEMENTS - 1)
        return self.presliding_distance * (1 - self.presliding_spread * part)

    def columns(self, recording):
        distances, side = self.distances, jnp.sign(recording.velocity)

        def slip(bent, now):
            moved, begins, side = now
            bent = jnp.where(begins, side, jnp.clip(bent + moved / distances, -1.0, 1.0))
            return bent, jnp.mean(bent)

        steps = travel(recording), starts(recording), side
        bent = jax.lax.scan(slip, jnp.zeros_like(distances), steps, unroll=8)[1]
        return (bent - side)[:, None]

    def start(self, position, velocity) -> States:
        return States(jnp.full(_ELEMENTS, jnp.sign(velocity)), jnp.zeros((0,), velocity.dtype))

    def present(self, states, now):
        return (jnp.mean(states.flow) - jnp.sign(now.slip))[None]

    def rates(self, states, now):
        return jnp.where(states.flow * now.side < 1, now.velocity / self.distances, 0.0)

    def settled(self, states, now, span) -> States:
        return States(jnp.clip(states.flow, -1.0, 1.0), states.kept)

    @property
    def relief(self):
        return (1.0,)

    @property
    def stiffness(self):
        return (jnp.mean(1 / self.distances),)


def lengths(term: AbstractTerm, view: View) -> np.ndarray:
    """Distances over which friction builds up, of elements that slip together or one by one."""
    grid = even(term, view)
    if not isinstance(term, MaxwellSlip):
        return grid
    # Elements of several distances are less like a step: half as many points do for each spread.
    return product([grid[::2, 0], np.array([0.2, 0.6])])


PRESLIDING = Effect(
    "presliding",
    "F_p (z − sign v), dz = (dx/x_d)(1 − z sign(dx))",
    "reversals",
    "After a reversal friction builds up over {presliding_distance} instead of at once, "
    "{presliding_force} of it: presliding",
    laws=(Dahl, LuGre, MaxwellSlip),
    scaled=lambda scales: (Dahl(), MaxwellSlip()),
    grid=lengths,
    coordinates=("distance_since_reversal",),
    confusable_with=("backlash", "compliance", "frictional_lag", "stribeck"),
    separate_by="Reverse slowly within the presliding distance: the axis is elastic there.",
    positive=True,
    first_order=True,
    at_reversals=True,
    sizes=("presliding_force",),
    vanishes=("presliding_distance",),
)
