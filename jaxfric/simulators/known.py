"""A simulator whose force along the recorded motion is given: nothing of it is fitted."""

import abc
import dataclasses
from collections.abc import Callable, Mapping
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike

from ..data.recording import Recording
from ..models import Model
from ..terms import (
    KNOWN_FORCE,
    Coulomb,
    Gravity,
    Inertia,
    KnownForce,
    KnownGain,
    Offset,
    Spring,
    Viscous,
)
from ..terms.base import AbstractTerm, Sum, summands
from ..units import TURNS

Force = ArrayLike | Callable[[Recording], ArrayLike]
# Of the motion two files of one recording differ by no more than the digits they were written with.
SAME = 1e-3


class Attribute(NamedTuple):
    """A parameter of a simulator in its own words.

    - `owner`: what it belongs to, "joint elbow" or "body forearm"; `what`: "damping"; `value` in
      the simulator, `unit`; `alike`: others whose force is the same at this joint but for a factor;
      `rest`: where a spring's force is zero; `between`: of a time, the samples that it is
      known from, s; of another value, an interval that it is anywhere within.
    """

    owner: str
    what: str
    value: float
    unit: str
    alike: tuple["Attribute", ...] = ()
    rest: float = 0.0
    between: float = 0.0

    def __str__(self) -> str:
        return f"{self.what} of {self.owner}"


class AbstractSimulator(abc.ABC):
    """Another program's simulator as a baseline: its force along a recorded motion."""

    @abc.abstractmethod
    def baseline(self, units) -> Model:
        """The simulator's force with corrections of zero."""

    @abc.abstractmethod
    def beside(self, recording: Recording, held_out: bool = False) -> Recording:
        """The recording with what the simulator says of its motion as channels."""

    @abc.abstractmethod
    def attributes(self) -> Mapping[str, Attribute]:
        """The simulator's own parameters by the names of the corrections; none where unknown."""


@dataclasses.dataclass(frozen=True)
class Known(AbstractSimulator):
    """A simulator's force along the recorded motion, as a baseline of `explain`.

    **Arguments:**

    - `force`: N or N·m, as the recording's own: `(N,)` at its samples, or a function from a
      recording to that, which serves the held-out recording too. Where it is left out the
      recordings bring the channel `known_force`.
    - `holdout`: along the held-out recording, `(N,)`, where `force` is no function.
    - `corrections`: the terms whose values in the simulator may be wrong; by default inertia,
      Coulomb and viscous friction, a constant force and the gain of all of it; on a revolute axis
      gravity and a spring, too.
    """

    force: Force | None = None
    holdout: ArrayLike | None = None
    corrections: AbstractTerm | None = None

    def baseline(self, units) -> Model:
        return self.model(units)

    def model(self, units) -> Model:
        """The simulator's force with corrections of zero."""
        terms = self.corrections or _plain(units)
        term = Sum((KnownForce(), *summands(terms)))
        return Model(term, jnp.zeros(len(term.affine)), units)

    def beside(self, recording: Recording, held_out: bool = False) -> Recording:
        """The recording with the simulator's force as the channel `known_force`.

        **Raises:** `ValueError` if there is none for it, or it is of another length or not finite.
        """
        force = self.holdout if held_out and not callable(self.force) else self.force
        if force is None and KNOWN_FORCE in recording.channels:
            force = recording.channels[KNOWN_FORCE]
        if force is None:
            missing = "holdout=" if held_out else "force="
            raise ValueError(
                f"{_name(recording, held_out)} has no simulator's force beside it. Give "
                f"Known({missing}...), a function, or the channel {KNOWN_FORCE!r}."
            )
        return along(recording, force(recording) if callable(force) else force, held_out)

    def attributes(self) -> Mapping[str, Attribute]:
        return {}


def _plain(units) -> AbstractTerm:
    """What simulators of an axis have: on a revolute one gravity too, and a spring."""
    plain = Inertia() + Coulomb() + Viscous() + Offset() + KnownGain()
    turn = TURNS.get(dict(units).get("position", ""))
    return plain if turn is None else plain + Gravity(turn) + Spring()


def along(recording: Recording, force: ArrayLike, held_out: bool = False) -> Recording:
    """A recording with another simulator's force, `(N,)`, as the channel `known_force`."""
    values = np.asarray(force, float)
    if values.shape != (recording.num_samples,):
        raise ValueError(
            f"{_name(recording, held_out)} has {recording.num_samples} samples, and the "
            f"simulator's force the shape {values.shape}. Compute it at each of them."
        )
    gone = ~np.isfinite(values)
    if gone.all():
        raise ValueError(f"The simulator's force for {_name(recording, held_out)} is not finite.")
    # Where the simulator says nothing, nothing can be compared.
    channels = recording.channels | {KNOWN_FORCE: jnp.asarray(np.where(gone, 0.0, values))}
    mask = jnp.asarray(np.asarray(recording.mask) & ~gone)
    return dataclasses.replace(recording, channels=channels, mask=mask)


def same_motion(recording: Recording, simulation: Recording) -> bool:
    """Whether a simulator's file holds its force along this recorded motion: the same samples."""
    ours = recording.velocity if recording.position is None else recording.position
    theirs = simulation.velocity if recording.position is None else simulation.position
    if theirs is None or len(theirs) != recording.num_samples:
        return False
    a, b = np.asarray(ours, float), np.asarray(theirs, float)
    both = np.isfinite(a) & np.isfinite(b)
    return bool(both.any() and np.max(np.abs(a - b)[both]) <= SAME * np.ptp(a[both]))


def _name(recording: Recording, held_out: bool) -> str:
    return recording.source or ("The held-out recording" if held_out else "The recording")
