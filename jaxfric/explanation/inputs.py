"""What an explanation is given: recordings and baseline, checked, and without faults of sensors."""

import dataclasses
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from .. import checks, signals
from ..checks import Remark
from ..data.cleaning import between_updates, held_for
from ..data.recording import Recording, check_same_units, require, require_force
from ..identification.identified import Identified
from ..identification.uncertainty import Estimate
from ..models import NAMED, Model
from ..simulation.errors import outliers
from ..simulators import AbstractSimulator, Attribute, Known, same_motion
from ..terms import KNOWN, KNOWN_FORCE
from ..terms.base import AbstractTerm
from . import sanity
from .baseline import baseline_of
from .earlier import Earlier
from .evidence import shortened
from .figures import Figures, cast
from .sanity import CheckedSimulator


class Inputs(NamedTuple):
    """Recordings and baseline as the search takes them.

    - `recording`, `holdout`: with another simulator's force where the baseline stands on one.
    - `sound`, `sound_holdout`: the same without samples that no actuator made; of long ones pieces.
    - `baseline`: a name, a sum of terms, a model, or a recording; `fixed`: its values stay.
    - `figures`: force errors in the caller's precision; `remarks`: about the recordings.
    - `checked`: what was checked before any physics where the baseline is a simulator, whose
      `attributes` are those values that may be wrong; `arrived`: whether the force is what arrived
      of a command; `free`: whether samples at a hard stop have been taken out.
    """

    recording: Recording
    holdout: Recording | None
    sound: Recording
    sound_holdout: Recording | None
    baseline: Any
    fixed: bool
    figures: Figures
    remarks: list[Remark]
    checked: CheckedSimulator | None
    attributes: Mapping[str, Attribute]
    arrived: bool = False
    free: bool = False

    def cut_off(self, limit: Estimate) -> "Inputs":
        """With what arrives of the command at a limit of the force, N."""
        return self._each(lambda log: sanity.arrived(log, limit))._replace(arrived=True)

    def without(self, taken: Callable[[Recording], Recording]) -> "Inputs":
        """Without the samples at a hard stop, which `taken` takes out of a log."""
        return self._each(taken)._replace(free=True)

    def _each(self, change: Callable[[Recording], Recording]) -> "Inputs":
        """With all its recordings changed alike, and the figures of these."""
        logs = (self.recording, self.holdout, self.sound, self.sound_holdout)
        recording, holdout, sound, sound_holdout = (
            None if log is None else change(log) for log in logs
        )
        assert recording is not None and sound is not None
        figures = Figures(recording, holdout, self.figures.x64)
        return self._replace(
            recording=recording, holdout=holdout, sound=sound, sound_holdout=sound_holdout,
            figures=figures,
        )  # fmt: skip

    def in_double_precision(self) -> tuple[Recording, Recording | None, Any]:
        """Recording, held-out recording and baseline as the search takes them."""
        return cast(self.sound), cast(self.sound_holdout), cast(self.baseline)


def prepare(
    recording: Recording, baseline, holdout: Recording | None, fixed: bool,
    doing: Callable[[str], None],
) -> Inputs:  # fmt: skip
    """The arguments of [`explain`][] checked, and recordings inspected.

    **Raises:** `ValueError` for what cannot be explained.
    """
    _check(recording, baseline, holdout)
    recording, seldom = interpolated(recording)
    holdout = None if holdout is None else interpolated(holdout)[0]
    baseline, checked = _simulator(recording, baseline, holdout), None
    if isinstance(baseline, AbstractSimulator):
        doing("looking at signs, zeros, clocks and limits")
        baseline = checked = sanity.check_log(recording, baseline, holdout)
        recording, holdout = checked.logs(recording, holdout)
    attributes = baseline.attributes() if isinstance(baseline, AbstractSimulator) else {}
    recording, baseline, holdout, fixed = _beside(recording, baseline, holdout, fixed)
    if isinstance(baseline, Earlier):
        baseline = baseline.recording
    recording, baseline, holdout = _placed(recording, baseline, holdout)
    if not isinstance(baseline, Recording):
        baseline_of(baseline)
    figures = Figures(recording, holdout, jnp.zeros(()).dtype == jnp.float64)
    short = shortened(recording)
    sound, remarks = inspected(short)
    remarks += seldom
    remarks += checks.cut(short.num_samples / recording.num_samples)
    sound_holdout, more = (None, []) if holdout is None else inspected(shortened(holdout))
    baseline = shortened(baseline) if isinstance(baseline, Recording) else baseline
    remarks = _of_both(remarks, more)
    remarks = remarks if checked is None else checked.remarks(remarks)
    return Inputs(
        recording, holdout, sound, sound_holdout, baseline, fixed, figures, remarks, checked,
        attributes,
    )  # fmt: skip


def _of_both(remarks: list[Remark], held: list[Remark]) -> list[Remark]:
    """The remarks on a recording and on the held-out one; once what is the same but for numbers."""
    theirs = {_words(each): each for each in held}
    both = {_words(each) for each in remarks} & set(theirs)
    return [
        *(
            each._replace(text=f"On both recordings: {each.text}") if _words(each) in both else each
            for each in remarks
        ),
        *(
            each._replace(text=f"On the held-out recording: {each.text}")
            for words, each in theirs.items()
            if words not in both
        ),
    ]


def _words(remark: Remark) -> str:
    return re.sub(r"[\d.e+-]*\d", "", remark.text)


def _check(recording: Recording, baseline, holdout: Recording | None) -> None:
    require(recording, "explain")
    require_force(recording, "explain")
    if holdout is not None:
        require(holdout, "explain (holdout)")
        require_force(holdout, "explain (holdout)")
    other = baseline.recording if isinstance(baseline, Earlier) else baseline
    if isinstance(other, Recording):
        require(other, "explain (baseline)")
    for each in (holdout, other):
        if isinstance(each, Recording):
            check_same_units(recording, each)


def _simulator(recording: Recording, baseline, holdout: Recording | None):
    """The baseline, as a simulator where it gives another program's force along this motion."""
    if isinstance(baseline, Recording) and holdout is None and same_motion(recording, baseline):
        return Known(baseline.force)
    if any(
        baseline is make for make in NAMED.values()
    ):  # the function that makes a model, not called
        return baseline()
    given_as = type | Model | Identified | AbstractTerm | AbstractSimulator
    return (
        Known(baseline) if callable(baseline) and not isinstance(baseline, given_as) else baseline
    )


def _beside(recording: Recording, baseline, holdout: Recording | None, fixed: bool):
    """The recordings with another simulator's force where the baseline stands on one, and the
    baseline as a model of corrections to it, which stay zero unless they are found wrong.
    """
    if isinstance(baseline, AbstractSimulator):
        held = None if holdout is None else baseline.beside(holdout, held_out=True)
        recording = baseline.beside(recording)
        return recording, baseline.baseline(recording.units), held, True
    given = baseline.model if isinstance(baseline, Identified) else baseline
    term = given.term if isinstance(given, Model) else given
    if isinstance(term, AbstractTerm) and KNOWN_FORCE in term.coordinates:
        return recording, baseline, holdout, fixed
    held = None if holdout is None else _alone(holdout)
    return _alone(recording), baseline, held, fixed


def _alone(recording: Recording) -> Recording:
    """The recording without another simulator's force, which this baseline does not stand on."""
    channels = {k: v for k, v in recording.channels.items() if not k.startswith(KNOWN)}
    return dataclasses.replace(recording, channels=channels)


def interpolated(recording: Recording) -> tuple[Recording, list[Remark]]:
    """A recording with a curve through the updates of a position that is held; and what to say."""
    position = None if recording.position is None else np.asarray(recording.position)
    every = 1 if position is None else held_for(position)
    if every == 1:
        return recording, []
    time, segment = np.asarray(recording.time), np.asarray(recording.segment)
    fresh = between_updates(time, position, segment, every).astype(position.dtype)
    text = (
        f"{recording.source or 'The recording'}: the position is new at every {every} samples "
        "only, at a lower rate than the force: interpolated by cubics. Log both alike."
    )
    remarks = [Remark("position_held", text, False)]
    curve = dataclasses.replace(recording, position=jnp.asarray(fresh), position_every=every)
    return curve, remarks


def _placed(*given: Any) -> tuple[Any, ...]:
    """Recordings of velocity alone with its integral as their position; none of them where that is
    not known of each, since what is found over position could not be looked for there.
    """
    found = tuple(signals.placed(g) if isinstance(g, Recording) else g for g in given)
    lacking = any(isinstance(each, Recording) and each.position is None for each in found)
    return given if lacking else found


# What is said of lone samples in other words, as they are left out here.
SPIKES = "force_spikes"


def inspected(recording: Recording) -> tuple[Recording, list[Remark]]:
    """A recording without samples that no actuator made, and what is to be said of it.

    Every check of a recording by itself belongs here: where a remark is severe, nothing is
    searched.
    """
    recorded = recording
    if recording.position_every == 0:
        recorded = dataclasses.replace(recording, position=None)
    remarks = [remark for remark in checks.inspect(recorded) if remark.name != SPIKES]
    spikes = outliers(recording)
    if not spikes.any():
        return recording, remarks
    mask = jnp.asarray(np.asarray(recording.mask) & ~spikes)
    return dataclasses.replace(recording, mask=mask), [*remarks, _spikes(recording, spikes)]


def _spikes(recording: Recording, lone: np.ndarray) -> Remark:
    force = np.asarray(recording.force, float)
    known = np.asarray(recording.mask) & np.isfinite(force)
    share = float(np.sum(force[lone] ** 2) / np.sum(force[known] ** 2))
    count, at = int(lone.sum()), float(np.asarray(recording.time)[np.argmax(lone)])
    unit = recording.unit_names["force"]
    which = f"one sample of the force, {force[np.argmax(lone)]:.3g} {unit} at t = {at:.6g} s, holds"
    if count > 1:
        which = f"{count} lone samples of the force, the first at t = {at:.6g} s, hold"
    return Remark(
        SPIKES,
        f"{recording.source or 'The recording'}: {which} {share:.0%} of its power, which no "
        "actuator does: left out. Look for a fault of the sensor, the bus or the file.",
        False,
    )
