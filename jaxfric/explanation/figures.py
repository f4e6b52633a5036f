"""The force errors that a user gets: a saved model, `predict`, and a subtraction."""

import dataclasses
from collections.abc import Collection, Hashable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .. import signals
from ..data.cleaning.pieces import some
from ..data.excerpt import MOST
from ..data.recording import Recording
from ..data.shifting import shifted
from ..models import Model
from ..simulation.errors import delay_of, in_motion, power, relative, residual, unseen
from ..simulation.prediction import Prepared, inertial
from ..terms.base import AbstractTerm
from .beyond import Samples, without
from .counts import answered
from .locate import Structure
from .predictions import PREDICTED

# Parts of a record that are compared: none shares more than its ends with another.
PARTS = 16


def cast(tree, dtype=float):
    """Every floating-point array in double (or another) precision; anything else as it is."""

    def one(leaf):
        inexact = eqx.is_array(leaf) and jnp.issubdtype(leaf.dtype, jnp.floating)
        return jnp.asarray(np.asarray(leaf), dtype) if inexact else leaf

    return tree if isinstance(tree, str) else jax.tree.map(one, tree)


def _of_inertia(term: AbstractTerm) -> bool:
    """Whether a term is of the motion alone and has momentum."""
    return term.inertial and not term.coordinates & PREDICTED


class InSlip(NamedTuple):
    """Samples in slip, `(C,)` each: velocity, m/s, what a model leaves of the force, N, and the
    part of the record.
    """

    velocity: np.ndarray
    left: np.ndarray
    part: np.ndarray


class Figures:
    """Force errors of models on a recording and a held-out one, in the caller's own precision.

    What is computed in double precision inside would not be what the caller reproduces.
    """

    def __init__(self, recording: Recording, holdout: Recording | None, x64: bool):
        self.dtype, self.x64 = recording.time.dtype, x64
        # Figures that differ by less differ by rounding.
        self.rounding = float(np.sqrt(jnp.finfo(self.dtype).eps))
        self._recordings = {"here": recording, "held": holdout}
        self._prepared: dict[str, Prepared] = {}
        self._moving: dict[Hashable, np.ndarray] = {}
        self._known: dict[Hashable, np.ndarray] = {}
        self._sampled: dict[Hashable, Samples] = {}
        self._answered: dict[Hashable, float] = {}
        self._errors: dict[Hashable, tuple[float, np.ndarray]] = {}

    def held_from(self, place: float) -> None:
        """Count the position of the held-out recording from another place, m."""
        held = self._recordings["held"]
        position = held.position + jnp.asarray(place, held.position.dtype)
        self._recordings["held"] = dataclasses.replace(held, position=position)
        for known in (self._prepared, self._moving, self._known, self._errors):
            known.clear()

    def own(self, model: Model) -> Model:
        """The model in the precision of the recording."""
        return cast(model, self.dtype)

    def here(self, model: Model, delay: float | None = None) -> float:
        """As [`force_error`][jaxfric.simulation.errors.force_error], on the recording itself.

        `delay`: that of another model, s, whose samples the figure is to be taken over.
        """
        return self._figure(model, "here", delay)[0]

    def held(self, model: Model, delay: float | None = None) -> float:
        """On the held-out recording, of which there has to be one."""
        return self._figure(model, "held", delay)[0]

    def parts(self, model: Model, where: str, delay: float | None = None) -> np.ndarray:
        """What the model leaves of each part of the samples of a figure, N², `(PARTS,)`."""
        return self._figure(model, where, delay)[1]

    def in_slip(self, model: Model, differences: bool = False) -> InSlip | None:
        """The samples in slip, with the velocity of the instant at which the force acts; `None` of
        a long recording.

        `differences`: the acceleration of inertia is the difference of neighbouring velocities, and
        not the smoothed one of `predict`.
        """
        if self._recordings["here"].num_samples > MOST:
            return None
        delay = delay_of(model)
        moving, _ = self._samples("here", delay)
        left, motion = self._left(model, "here"), self._motion("here")
        time, velocity, segment = (
            np.asarray(values)[: len(left)]
            for values in (
                motion.recording.time,
                motion.recording.velocity,
                motion.recording.segment,
            )
        )

        def acting(signal: np.ndarray) -> np.ndarray:
            return shifted(time, signal.astype(float), segment, delay)

        velocity = acting(velocity)
        if differences:
            with jax.enable_x64(self.x64):
                momentum, rate = (
                    np.asarray(values, float)[: len(left)]
                    for values in inertial(self.own(model).only(_of_inertia), motion)
                )
            left = left + acting(rate - np.gradient(momentum, time))
        slips = moving & np.isfinite(velocity) & np.isfinite(left)
        slips &= np.abs(velocity) > float(signals.host_scales(motion.recording)[0].slowest)
        many = int(np.count_nonzero(slips))
        return InSlip(velocity[slips], left[slips], np.arange(many) * PARTS // max(many, 1))

    def _figure(self, model: Model, where: str, delay: float | None) -> tuple[float, np.ndarray]:
        """A figure and its parts, computed once."""
        delay = delay_of(model) if delay is None else delay
        key = *self._key(model, where), delay
        if key not in self._errors:
            moving, force = self._samples(where, delay)
            left, count = self._left(model, where), np.cumsum(moving, dtype=np.int32)
            share, more = divmod(int(count[-1]), PARTS)  # as evenly as they divide
            before = [part * share + min(part, more) for part in range(1, PARTS)]
            starts = [0, *np.searchsorted(count, before, "right").tolist(), len(left)]
            spans = map(slice, starts[:-1], starts[1:])
            parts = np.array([power(left[span], moving[span]) for span in spans])
            self._errors[key] = relative(left, force, moving), parts
        return self._errors[key]

    def as_seen(self, model: Model) -> Model:
        """The model in the caller's precision, without values of a direction in which the recording
        does not move.
        """
        own = self.own(model)
        lacking = self.unseen(own.parameters)
        return own.with_parameters(dict.fromkeys(lacking, np.nan)) if lacking else own

    def unseen(self, names: Collection[str]) -> list[str]:
        """The names of parameters of a direction in which the recording does not move."""
        if not any(name.endswith(("+", "-")) for name in names):
            return []
        moving, _ = self._samples("here", 0.0)
        return unseen(names, self._motion("here"), moving)

    def _samples(self, where: str, delay: float) -> tuple[np.ndarray, np.ndarray]:
        """Which samples a figure is taken over, and the force, N, both `(N,)`."""
        recording = self._recordings[where]
        if (where, delay) not in self._moving:
            with jax.enable_x64(self.x64):
                self._moving[where, delay] = in_motion(recording, delay, self._motion(where))
        return self._moving[where, delay], np.asarray(recording.force, float)

    def _motion(self, where: str) -> Prepared:
        """The recording with its velocity, in the caller's precision; once."""
        if where not in self._prepared:
            self._prepared[where] = Prepared.of(self._recordings[where])
        return self._prepared[where]

    def _key(self, model: Model, where: str) -> tuple[Hashable, ...]:
        leaves, structure = jax.tree.flatten(self.own(model))
        return where, structure, tuple(np.asarray(leaf).tobytes() for leaf in leaves)

    def _left(self, model: Model, where: str) -> np.ndarray:
        """What a model leaves of the force, N, `(N,)`; computed once, and kept but of a long
        recording.
        """
        recording, key = self._recordings[where], self._key(model, where)
        if key in self._known:
            return self._known[key]
        with jax.enable_x64(self.x64):
            left = residual(self.own(model), recording, self._motion(where))
        if recording.num_samples <= MOST:
            self._known[key] = left
        return left

    def samples(self, model: Model) -> Samples:
        """What a model leaves of the recording, sample by sample; computed once."""
        key = self._key(model, "here")
        if key not in self._sampled:
            counted, force = self._samples("here", delay_of(model))
            time = np.asarray(self._recordings["here"].time, float)
            self._sampled[key] = Samples.of(self._left(model, "here"), force, time, counted)
        return self._sampled[key]

    def of_counts(self, model: Model) -> float:
        """What of the force that a model leaves answers the counts of the encoder, N, root mean
        square.
        """
        rest = self.samples(model).rest
        return float(np.sqrt(np.mean(rest**2))) * self._answers(model, "here")

    def _answers(self, model: Model, where: str) -> float:
        """The part of it in amplitude; computed once."""
        key = self._key(model, where)
        if key not in self._answered:
            moving, _ = self._samples(where, delay_of(model))
            share = answered(self._left(model, where), moving, self._motion(where))
            self._answered[key] = float(np.sqrt(share))
        return self._answered[key]

    def floor(
        self, model: Model, lag: float, tone: Structure | None = None, where: str = "here"
    ) -> float:
        """The force error that noise alone makes, by samples of the residual `lag` seconds apart.

        What is so far apart differs by noise and by what changes faster (von Neumann 1941), but for
        a `tone`. No less than counts of the force make, and with what the loop makes of the
        encoder's, in bursts.
        """
        recording = self._recordings[where]
        moving, force = self._samples(where, delay_of(model))
        steps = np.diff(np.asarray(recording.time, float)[moving])
        steps = some(steps, steps > 0)
        count = 1
        if steps.size:
            count = max(1, round(lag / float(np.median(steps, overwrite_input=True))))
        del steps
        rest = self._left(model, where)
        whole = relative(rest, force, moving)
        if tone is not None:
            rest = without(tone, rest, np.asarray(recording.time, float), moving)
        both = moving[count:] & moving[:-count]
        if not both.any():
            return float("nan")
        apart = some(rest[count:], both) - some(rest[:-count], both)
        np.abs(apart, out=apart)
        noise = float(np.median(apart, overwrite_input=True)) / 0.6745 / np.sqrt(2)
        step, many = signals.count_of(force[:MOST]), np.sqrt(np.mean(force[:MOST] ** 2))
        if 2 * step <= many:  # of few levels it is how the force is made, and no rounding
            noise = max(noise, step / np.sqrt(12))
        total = power(force, moving)
        alone = noise * np.sqrt(np.count_nonzero(moving) / total) if total > 0 else float("nan")
        counted = relative(rest, force, moving) * self._answers(model, where)
        return min(float(np.hypot(alone, counted)), whole)  # noise is no more than all of it
