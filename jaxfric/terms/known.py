"""A force that another program has computed for the recorded motion."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..data.recording import Recording
from ..units import DIMENSIONLESS
from .base import AbstractLaw, AbstractTerm
from .sample import Parameter, Sample
from .table import reading

# The channel that holds it, N or N·m.
KNOWN_FORCE = "known_force"


class KnownForce(AbstractTerm):
    """The force of another simulator along the recorded motion, as it is: u = f_known(t).

    It has no parameters: nothing of it is fitted. Recordings bring it as the channel
    `known_force`, in the unit of their force.
    """

    affine: ClassVar[tuple[Parameter, ...]] = ()  # type: ignore[misc]
    nonlinear: ClassVar[tuple[Parameter, ...]] = ()  # type: ignore[misc]
    coordinates: ClassVar[frozenset[str]] = frozenset({KNOWN_FORCE})  # type: ignore[misc]

    @property
    def inertial(self) -> bool:
        return False

    def columns(self, recording: Recording) -> Float[Array, "N p"]:
        return jnp.zeros((recording.num_samples, 0), recording.time.dtype)

    def momentum(self, recording: Recording) -> Float[Array, "N p"]:
        return self.columns(recording)

    def offset(self, recording: Recording) -> Float[Array, " N"]:
        if KNOWN_FORCE not in recording.channels:
            raise ValueError(
                f"The model stands on another simulator's force, and {recording.source or 'the'} "
                f"recording has no channel {KNOWN_FORCE!r}. Add it: "
                f"Recording(..., channels={{{KNOWN_FORCE!r}: ...}})."
            )
        return recording.channels[KNOWN_FORCE]

    def beta(self) -> Float[Array, " d"]:
        return jnp.zeros((0,))

    def with_beta(self, beta: Float[Array, " d"]) -> "KnownForce":
        return self


class KnownGain(AbstractLaw):
    """The part by which a simulator's force is too small as a whole: u = g f_known(t).

    Of a recorded current, a torque constant that is 1 + g times the simulator's.
    """

    affine: ClassVar = (Parameter("gain", DIMENSIONLESS),)
    coordinates: ClassVar = frozenset({KNOWN_FORCE})

    def law(self, sample: Sample):
        return (reading(sample, KNOWN_FORCE),)
