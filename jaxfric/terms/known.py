"""A force that another program has computed for the recorded motion."""

from collections.abc import Callable
from functools import cache
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..units import DIMENSIONLESS
from .base import AbstractLaw, AbstractTerm
from .sample import Parameter, Sample
from .table import reading

# The channel that holds it, N or N·m.
KNOWN_FORCE = "known_force"
# The same in two parts, where the simulator says them: rest + d/dt momentum. Then no acceleration
# has to be derived from the recorded motion.
KNOWN_REST, KNOWN_MOMENTUM = "known_rest", "known_momentum"
# The part of a recorded force, N, that a servo makes of the motion itself: not late where its
# command is.
KNOWN_FEEDBACK = "known_feedback"
# One where a simulator's force alone says nothing and the motion is known, else zero: what has a
# memory goes on there.
KNOWN_MASKED = "known_masked"
# The part of it that is the simulator's own friction, N: guide and screw carry the rest.
KNOWN_FRICTION = "known_friction"
# Channels that begin so belong to a simulator.
KNOWN = "known_"


def at_other_times(
    recording: Recording, signal: Float[Array, " N"], move: Callable[[Any], Any]
) -> Any:
    """A signal like the recorded force with `move` done to what is no feedback of a servo."""
    feedback = recording.channels.get(KNOWN_FEEDBACK)
    return move(signal) if feedback is None else move(signal - feedback) + feedback


class KnownForce(AbstractTerm):
    """The force of another simulator along the recorded motion, as it is: u = f_known(t).

    It has no parameters: nothing of it is fitted. Recordings bring it as the channel
    `known_force`, in the unit of their force.
    """

    affine: ClassVar[tuple[Parameter, ...]] = ()  # type: ignore[misc]
    nonlinear: ClassVar[tuple[Parameter, ...]] = ()  # type: ignore[misc]
    coordinates: ClassVar[frozenset[str]] = frozenset({KNOWN_FORCE})  # type: ignore[misc]

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        return jnp.zeros((recording.num_samples, 0), recording.time.dtype)

    def offset(self, recording: Recording) -> Float[Array, " N"]:
        if KNOWN_FORCE not in recording.channels:
            raise ValueError(
                f"The model stands on another simulator's force, and {recording.source or 'the'} "
                f"recording has no channel {KNOWN_FORCE!r}. Add it: "
                f"Recording(..., channels={{{KNOWN_FORCE!r}: ...}})."
            )
        return recording.channels[KNOWN_FORCE]


class KnownGain(AbstractLaw):
    """The part by which a simulator's force is too small as a whole: u = g f_known(t).

    Of a recorded current, a torque constant that is 1 + g times the simulator's.
    """

    affine: ClassVar = (Parameter("gain", DIMENSIONLESS),)
    coordinates: ClassVar = frozenset({KNOWN_FORCE})

    def law(self, sample: Sample):
        return (reading(sample, KNOWN_FORCE),)


class KnownColumns(AbstractLaw):
    """What a simulator's own parameters add where they are others: u = Σ Δθ_i ∂f_known/∂θ_i.

    **Arguments:** `names` of the parameters, and their units as they are `spelled`. Recordings
    bring the derivatives as the channels of `channels_of`, in two parts as the force, from the
    number `first` on. Friction among them counts as carried, not `frictional`: before it is known
    which values are wrong, those of friction and of bodies may cancel each other.
    """

    names: tuple[str, ...] = eqx.field(static=True, converter=tuple)
    spelled: tuple[str, ...] = eqx.field(static=True, converter=tuple)
    first: int = eqx.field(static=True, default=0)

    def only(self, number: int) -> "KnownColumns":
        """The parameter of that number alone."""
        return KnownColumns((self.names[number],), (self.spelled[number],), self.first + number)

    @property
    def channels(self) -> tuple[tuple[str, str], ...]:
        """The channels of each parameter, the rest and what is differentiated."""
        return _channels(self.first, len(self.names))

    @property
    def affine(self):
        pairs = zip(self.names, self.spelled, strict=True)
        return tuple(Parameter(name, unit) for name, unit in pairs)

    @property
    def coordinates(self):
        return _coordinates(self.first, len(self.names))

    def law(self, sample: Sample):
        return tuple(reading(sample, rest) for rest, _ in self.channels)

    def impulse(self, sample: Sample):
        return tuple(reading(sample, momentum) for _, momentum in self.channels)


@cache
def _channels(first: int, count: int) -> tuple[tuple[str, str], ...]:
    return tuple(channels_of(first + i) for i in range(count))


@cache
def _coordinates(first: int, count: int) -> frozenset[str]:
    return frozenset(name for pair in _channels(first, count) for name in pair)


def channels_of(number: int) -> tuple[str, str]:
    """The channels of a simulator's parameter: the rest, and what is differentiated in time."""
    return f"{KNOWN}column_{number}", f"{KNOWN}column_{number}_momentum"
