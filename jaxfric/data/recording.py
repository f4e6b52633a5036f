"""One log of one axis, as arrays: the only thing that the rest of the library reads."""

import dataclasses
import os
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ..looks import drawing, html, text
from ..units import SI, check_same
from . import summary
from .printable import short

# Padding goes to a power of two, so that one compiled program serves many lengths: to compile an
# identification takes a hundred times as long as to run it on 8000 samples. Of long recordings it
# takes as long, and padding goes to the next of these multiples.
SHORTEST, LONG = 2**11, 2**16
PADDING = (1.0, 1.25, 1.5, 1.75, 2.0)


def _array(value, dtype=None):
    """An array of jax; one of numpy is moved as it is, for which nothing is compiled."""
    if isinstance(value, jax.Array):
        wanted = jax.dtypes.canonicalize_dtype(value.dtype if dtype is None else dtype)
        if value.dtype == wanted:
            return value
    if isinstance(value, np.ndarray):
        return jax.device_put(value if dtype is None else value.astype(dtype, copy=False))
    return jnp.asarray(value, dtype)


def _flags(value):
    return None if value is None else _array(value, bool)


def _whole(value):
    return None if value is None else _array(value, np.int32)


def _signal(value):
    """A floating-point array; whole numbers (encoder counts) become the default float."""
    if value is None:
        return None
    try:
        value = _array(value)
    except TypeError as error:
        raise ValueError(
            f"A signal of a Recording is an array of numbers, not {described(value)}: {error}"
        ) from None
    return value if jnp.issubdtype(value.dtype, jnp.floating) else value.astype(float)


class Recording(eqx.Module):
    """A log of motion and force of one axis; a pytree, so that logs stack into batches.

    **Arguments:** (shapes for one recording; a batch made by [`stack`][] has a leading axis)

    - `time`: s, shape `(N,)`, increasing inside a segment.
    - `force`: measured or commanded actuator force, N (N·m, A, V, …), shape `(N,)`.
    - `position`: m (rad), shape `(N,)`, or `None`.
    - `velocity`: m/s (rad/s), shape `(N,)`, or `None`: then it is derived from the position.
    - `mask`: which samples are valid, shape `(N,)`; all of them by default.
    - `segment`: whole numbers that change where the record is interrupted (the clock restarts,
      samples are missing), shape `(N,)`, numbered from 0 in order; one segment by default.
    - `channels`: further signals by role (`reference`, `load`, `temperature`, …), each `(N,)`.
    - `units`: names of the force and the position unit, `{"force": "N", "position": "m"}`.
    - `source`: where the recording comes from, for messages; `sha256`: of that file.
    - `num_segments`: a static bound on the number of segments; counted where `None`.
    - `position_every`: of a position that came at every so many samples only, and is a curve
      through these since; 0 of one that is the integral of the velocity.

    **Raises:** `ValueError` if the shapes differ or if neither position nor velocity is given.
    """

    time: Float[Array, " N"] = eqx.field(converter=_signal)
    force: Float[Array, " N"] = eqx.field(converter=_signal)
    position: Float[Array, " N"] | None = eqx.field(converter=_signal, default=None)
    velocity: Float[Array, " N"] | None = eqx.field(converter=_signal, default=None)
    mask: Bool[Array, " N"] | None = eqx.field(converter=_flags, default=None)
    segment: Int[Array, " N"] | None = eqx.field(converter=_whole, default=None)
    channels: dict[str, Float[Array, " N"]] = eqx.field(default_factory=dict)
    units: tuple[tuple[str, str], ...] = eqx.field(
        static=True, default=(), converter=lambda units: tuple(sorted((SI | dict(units)).items()))
    )
    source: str = eqx.field(static=True, default="")
    sha256: str = eqx.field(static=True, default="", kw_only=True)
    num_segments: int | None = eqx.field(static=True, default=None)
    position_every: int = eqx.field(static=True, default=1, kw_only=True)

    def __post_init__(self):
        shape = np.shape(self.time)  # equinox converts the fields afterwards: it may be a list
        if self.mask is None:
            self.mask = np.ones(shape, bool)
        if self.segment is None:
            self.segment = np.zeros(shape, np.int32)
            self.num_segments = 1
        elif self.num_segments is None:
            if isinstance(self.segment, jax.core.Tracer):
                raise ValueError(
                    "Recording(segment=...) inside jax.jit needs num_segments=, because the "
                    "number of segments decides the shapes of the compiled program."
                )
            self.num_segments = int(np.max(np.asarray(self.segment), initial=0)) + 1
        self.channels = {name: _signal(value) for name, value in self.channels.items()}

    def __check_init__(self):
        for name in ("time", "force"):
            if getattr(self, name) is None:
                raise ValueError(f"A Recording needs {name}, an array of shape (N,); it is None.")
        if self.position is None and self.velocity is None:
            raise ValueError(
                "A Recording needs position or velocity beside time and force; "
                f"{self.source or 'this one'} has neither."
            )
        signals = {"force": self.force, "position": self.position, "velocity": self.velocity}
        signals |= {"mask": self.mask, "segment": self.segment, **self.channels}
        for name, signal in signals.items():
            if signal is not None and signal.shape != self.time.shape:
                raise ValueError(
                    f"Recording signals must have one shape: time has {self.time.shape}, "
                    f"{name} has {signal.shape}."
                )

    @property
    def unit_names(self) -> dict[str, str]:
        """The names of the force and the position unit."""
        return dict(self.units)

    @property
    def num_samples(self) -> int:
        """Samples along the time axis, padding included."""
        return self.time.shape[-1]

    def __repr__(self) -> str:
        return text.shown(self, summary.blocks)

    def _repr_html_(self) -> str:
        return html.shown(self, summary.blocks, self._sketch)

    def _sketch(self, figure) -> None:
        names = summary.main_signals(self)
        figure.set_size_inches(8, 0.6 + 1.5 * len(names))
        self.plot(*names, ax=figure.subplots(len(names), sharex=True, squeeze=False)[:, 0])

    def plot(self, *names: str, ax=None):
        """The signals over time, by matplotlib.

        **Arguments:** `names` of signals or channels, by default position, velocity and force;
        `ax`, matplotlib's axes to draw on, one for each name; a single one without a name gets the
        force.

        **Returns:** the axes, an array of as many as names; a single one for a single name or `ax`.

        **Raises:** `ValueError` for a batch, for a name there is not, or without matplotlib.
        """
        if self.time.ndim != 1:
            raise ValueError(
                "plot() draws one recording. Of a batch take a row: "
                "jax.tree.map(lambda x: x[0], batch)."
            )
        alone = ax is not None and np.ndim(ax) == 0
        names = names or (("force",) if alone else tuple(summary.main_signals(self)))
        panels = drawing.panels(ax, len(names))
        summary.draw(text.on_host(self), names, panels)
        return panels[0] if alone or len(names) == 1 else panels


def require(recording: object, verb: str, least: int = 2, batch: bool = False) -> None:
    """Raise `ValueError`, with the remedy, where an argument is no recording that a verb can use.

    **Arguments:** `verb`, the function's name; `least`, the fewest samples; `batch`, whether a
    stacked batch will do.
    """
    if not isinstance(recording, Recording):
        hint = " Read the file first: jaxfric.read(path)."
        if not isinstance(recording, str | os.PathLike):
            hint = " Make one: jaxfric.read(path), or Recording(time=, force=, position=)."
        raise ValueError(f"{verb} needs a Recording, not {described(recording)}.{hint}")
    shape = jnp.shape(recording.time)
    if len(shape) == 2 and not batch:
        raise ValueError(
            f"{verb} takes one recording, not a batch of {shape[0]}: give a row, "
            "jax.tree.map(lambda x: x[i], batch), or each of them in turn."
        )
    if len(shape) not in (1, 2) or 0 in shape[:-1]:
        raise ValueError(f"{verb} needs signals of shape (N,); those given have {shape}.")
    if shape[-1] < least:
        name = recording.source or "the recording"
        raise ValueError(f"{verb} needs {least} samples or more; {name} has {shape[-1]}.")


def require_force(recording: Recording, verb: str) -> None:
    """Raise `ValueError` where the force is zero throughout, which no drive's is."""
    force = np.asarray(recording.force)[np.asarray(recording.mask)]
    if not np.any(force):
        raise ValueError(
            f"{verb}: the force of {recording.source or 'the recording'} is zero at every sample. "
            'Is it in another column? --columns force=NAME (columns={"force": NAME}).'
        )


def described(value: object) -> str:
    """What a wrong argument is, in few words."""
    if value is None:
        return "None"
    if isinstance(value, str | os.PathLike):
        return f"the path or name {short(os.fspath(value))!r}"
    if isinstance(value, type):
        return f"the class {value.__name__}"
    return f"a {type(value).__name__}"


def pad(recording: Recording, length: int) -> Recording:
    """A recording lengthened with masked samples, so that recordings of unequal length stack.

    **Arguments:** `recording`, signals of shape `(N,)`; `length`, at least `N`.

    **Raises:** `ValueError` if `length` is below `N`.
    """
    extra = length - recording.num_samples
    if extra < 0:
        raise ValueError(f"Cannot pad {recording.num_samples} samples to {length}.")
    if extra == 0:
        return recording

    def lengthen(x, **how):
        # On the host nothing has to be compiled for each length anew.
        numpy = jnp if isinstance(x, jax.core.Tracer) else np
        return _array(numpy.pad(x, (0, extra), **how))

    padded = jax.tree.map(lambda x: lengthen(x, mode="edge"), recording)
    return eqx.tree_at(lambda r: r.mask, padded, lengthen(recording.mask))


def uniform(recording: Recording) -> Recording:
    """A recording without what makes one compiled program serve it alone: length, name, pieces."""
    power = max(SHORTEST, 1 << (recording.num_samples.bit_length() - 1))
    steps = PADDING if power >= LONG else (1, 2)
    length = next(int(f * power) for f in steps if f * power >= recording.num_samples)
    pieces = 1 << (recording.num_segments - 1).bit_length()
    return anonymous(pad(recording, length), pieces)


def row_of(batch: Any, number: int) -> Any:
    """One row of a batch: every array without its leading axis."""
    return jax.tree.map(lambda x: x[number], batch)


def stack(recordings: Sequence[Recording]) -> Recording:
    """Recordings as one batch: every signal gains a leading axis, shape `(B, N)`.

    Shorter recordings are padded with masked samples to the longest. Signals that not every
    recording has are an error, since one compiled program serves the whole batch.

    **Raises:** `ValueError` if the list is empty or the recordings differ in signals or units.
    """
    if isinstance(recordings, Recording) or not len(recordings):
        raise ValueError("stack() needs a list of at least one recording.")
    for recording in recordings:
        require(recording, "stack()", least=0)
    first = recordings[0]
    for i, other in enumerate(recordings):
        if _kinds(other) != _kinds(first):
            raise ValueError(
                f"Recordings of one batch must have the same signals and units; number {i} "
                f"({other.source or 'unnamed'}) has {_kinds(other)}, number 0 has {_kinds(first)}."
            )
    length = max(recording.num_samples for recording in recordings)
    segments = max(recording.num_segments or 1 for recording in recordings)
    leaves = [jax.tree.leaves(pad(recording, length)) for recording in recordings]
    structure = jax.tree.structure(anonymous(first, segments))
    return jax.tree.unflatten(
        structure, [jnp.stack(column) for column in zip(*leaves, strict=True)]
    )


def check_same_units(ours: Recording, theirs: Recording, option: str = "scale") -> None:
    """Refuse two recordings of one comparison that state different units.

    **Arguments:** `option`, which factor of the other recording a user has to give.

    **Raises:** `ValueError` with the factor.
    """
    name, other = ours.source or "the recording", theirs.source or "the other recording"
    check_same(ours.unit_names, theirs.unit_names, name, other, option)


def _kinds(recording: Recording) -> Mapping[str, object]:
    present = [n for n in ("position", "velocity") if getattr(recording, n) is not None]
    return {"signals": (*present, *sorted(recording.channels)), "units": recording.unit_names}


def anonymous(recording: Recording, segments: int = 1) -> Recording:
    """A recording without what else a compiled program would be made for, but units and signals."""
    return dataclasses.replace(
        recording, source="", sha256="", num_segments=segments, position_every=1
    )
