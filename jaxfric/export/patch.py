"""What an explanation says of a simulator, written into the simulator's own file."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from ..data.recording import Recording
from ..explanation import Explanation
from ..explanation.attributes import CONSTANT
from ..identification.uncertainty import Estimate
from ..models import Model
from ..simulators import Mujoco, actuation
from ..simulators.columns import GAIN
from ..simulators.loading import library
from ..simulators.patching import Patched, folder_of, patched, text_of
from ..simulators.weights import MASS, MASS_ALONE
from ..terms import KnownColumns, KnownForce
from ..terms.base import AbstractTerm, Sum
from ..terms.effects import EFFECTS, Effect, traits
from ..terms.effects.force_limit import FORCE_LIMIT
from ..terms.effects.parameter_mismatch import MISMATCH
from ..terms.effects.position_zero import POSITION_ZERO
from . import callback, readback
from .errors import as_read, from_to, miss, reached, worse
from .held import kept
from .parts import Part
from .rerun import Rerun, rerun
from .springs import new_springs


class Again(NamedTuple):
    """What a closed loop needs: by joint the log's simulators, its recordings with the commands as
    they were given, and the references, `(N,)`.
    """

    simulators: dict[str, Mujoco]
    logs: dict[str, Recording]
    references: dict[str, np.ndarray]


# A time that is not there.
NONE = Estimate(np.float64(0.0), np.float64(0.0), "s")


class Patch(NamedTuple):
    """A simulator's file with what was found, and what it is worth.

    - `text`: the model; `forces`: Python beside it, `None` where nothing needs it; `module`: its
      file's name.
    - `written` and `left`: what was changed, and what was not and why, a line each.
    - `errors`: force errors through the kernel of the explanation, by recording ("force_error",
      "holdout_force_error"): `before`, of the `file` alone, and with the `forces` beside it; from
      the file as it was read again. `misses`: where that is more than the joint's answer leaves.
      `as_read`: what was left of joints whose log has been put right since.
    """

    text: str
    forces: str | None
    written: list[str]
    left: list[str]
    errors: dict[str, dict[str, dict[str, float]]]
    module: str
    misses: tuple[str, ...] = ()
    rerun: Rerun = Rerun()
    as_read: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """What was done as plain data, without the texts."""
        return {
            "written": self.written, "left": self.left, "errors": self.errors,
            "misses": list(self.misses), "as_read": list(self.as_read),
            "rerun": self.rerun.to_dict(),
        }  # fmt: skip

    def after(self, joint: str) -> dict[str, float]:
        """What the file alone leaves of a joint's force, by recording."""
        return {name: each["file"] for name, each in self.errors[joint].items()}

    def with_forces(self, joint: str) -> dict[str, float]:
        """What the file leaves with the forces beside it, by recording; empty without any."""
        errors = self.errors[joint].items()
        return {name: each["forces"] for name, each in errors if "forces" in each}


def patch(
    source: str | Path,
    found: dict[str, Explanation],
    recordings: dict[str, list[Recording]],
    name: str,
    again: Again | None = None,
    given: str | Path | None = None,
) -> Patch:
    """The simulator's file with the findings of its joints.

    The file is read again as it was written. Values with which a joint is worse than before, on any
    recording, are not written: neither where the file by itself is, nor with the forces beside it.

    **Arguments:** `source`, the file, or its text with springs in transmissions; by joint the
    explanations, and the recordings (the first is the one explained, the second held out); `name`
    of the file to be, for the module beside it; `again`, what a closed loop needs to be run again;
    `given`, the file as it was, where `source` is a text with springs.
    """
    files = Files(source, source if given is None else given)
    values: dict[str, tuple[float, float]] = {}
    left: list[str] = []
    for joint, told in reversed(found.items()):
        attributes, more = _put_right(files, joint, told)
        values |= attributes
        left += more
        for key, moved in _moved(told).items():
            if key == GAIN:
                left.append(_unwritten(joint, moved))
            elif key != CONSTANT:
                before, _ = values.get(key, (float(moved.before), 0.0))
                values[key] = before, float(moved.value)
    apart = _contradicted(found)
    left += [f"{_label(key)}: {why}" for key, why in apart.items()]
    values = {key: pair for key, pair in values.items() if key not in apart}
    done = files.patched({key: to for key, (_, to) in values.items()})
    done, models, unable, errors = _without_harm(files, done, values, found, recordings)
    left += unable
    springs = new_springs(files.given, done.text)
    speeds = {joint: _speed(recordings[joint][0]) for joint in models}
    module = f"{Path(name).stem}_forces.py"
    if why := [spring.why for spring in springs if spring.why]:
        return _as_given(files, why, found, recordings, module)
    forces = callback.callback(models, speeds, module) if models else None
    written = [spring.text for spring in springs] + [
        f"{_label(key)}: {values[key][0]:.5g} → {values[key][1]:.5g}" for key in done.written
    ]
    written += [
        f"{module}: joint {joint}: {', '.join(p.name for p in callback.parts(model))}"
        for joint, model in models.items()
    ]
    left += [f"{_label(key)} → {values[key][1]:.5g}: {why}" for key, why in done.left.items()]
    misses = tuple(miss(joint, told, errors[joint]) for joint, told in found.items())
    notes = tuple(as_read(joint, told, errors[joint]) for joint, told in found.items())
    patch = Patch(
        done.text, forces, written, left, errors, module, tuple(filter(None, misses)),
        as_read=tuple(filter(None, notes)),
    )  # fmt: skip
    return patch if again is None else patch._replace(rerun=_again(files, patch, found, again))


class Files(NamedTuple):
    """The model that is changed, a file or a text with springs, and the file as it was given."""

    source: str | Path
    given: str | Path

    def patched(self, values: Mapping[str, float]) -> Patched:
        """The model with other values."""
        return patched(library(), self.source, values, folder_of(self.given))


def _as_given(files: Files, why: list[str], found, recordings, module: str) -> Patch:
    """The file as it was, where it does not take a spring: all else holds only beside that."""
    text = text_of(library(), files.given)
    errors = _read_again(files.given, text, found, recordings, {})
    return Patch(text, None, [], why, errors, module)


def _forces(
    given, text: str, found: dict[str, Explanation], recordings
) -> tuple[dict[str, Model], list[str]]:
    """The forces beside the file by joint, and why others are not written, a line each."""
    models: dict[str, Model] = {}
    left: list[str] = []
    for joint, told in found.items():
        model = _beside(told)
        able, others = ([], []) if model is None else callback.told(model)
        left += [
            f"joint {joint}: {p.name}: it is no function of the joint's own position and speed"
            for p in others
        ]
        good = _confirmed(given, text, joint, told, recordings[joint], model, able)
        left += [f"joint {joint}: {p.name}: {WORSE}" for p in able if p not in good]
        if good:
            models[joint] = callback.only(model, good)
    return models, left


# Why a force is not written.
WORSE = "the held-out recording is worse with it"


def _confirmed(
    given, text: str, joint: str, told: Explanation, recordings, model, able: Sequence[Part]
) -> list[Part]:
    """The forces of a joint beside the file that make its held-out recording no worse."""
    if model is None or len(recordings) < 2 or not able:
        return list(able)
    both = readback.pair(given, text, joint, recordings, {})

    def error(some: Sequence[Part]) -> float:
        forces = callback.only(model, some) if some else None
        return reached(readback.errors(told, *both, recordings, forces)[readback.HELD])

    return kept(able, error)


# Kinds of values that every joint feels.
SHARED = ("body/", "option/")


def _without_harm(files: Files, done: Patched, values, found, recordings):
    """The file without values that make a joint worse than it was, first those of bodies, then the
    joint's own; the forces beside it by joint, and why others are not written; and the force
    errors of all joints by it.
    """
    models, unable = _forces(files.given, done.text, found, recordings)
    errors = _read_again(files.given, done.text, found, recordings, models)
    for own in (False, True):
        joints = [joint for joint, each in errors.items() if worse(each)]
        mine = {key for joint in joints for key in _moved(found[joint])}
        harm = [k for k in done.written if (k in mine if own else k.startswith(SHARED))]
        if not joints or not harm:
            continue
        said = [f"joint {joint} would be worse: {from_to(errors[joint])}" for joint in joints]
        kept = {key: values[key][1] for key in done.written if key not in harm}
        left = {**done.left, **dict.fromkeys(harm, "; ".join(said))}
        done = files.patched(kept)._replace(left=left)
        models, unable = _forces(files.given, done.text, found, recordings)
        errors = _read_again(files.given, done.text, found, recordings, models)
    return done, models, unable, errors


def _contradicted(found: Mapping[str, Explanation]) -> dict[str, str]:
    """The values of bodies of which joints say different things, each with what they say."""
    said: dict[str, dict[str, dict[str, float]]] = {}
    for joint, told in found.items():
        for key, moved in _moved(told).items():
            if key.startswith("body/"):
                own = said.setdefault(key.split("/")[1], {})
                own.setdefault(joint, {})[key] = float(moved.value)
    texts = {}
    for own in said.values():
        if any(values != next(iter(own.values())) for values in own.values()):
            for key in dict.fromkeys(key for values in own.values() for key in values):
                each = [f"{own[j][key]:.5g} by {j}" for j in own if key in own[j]]
                texts[key] = f"the joints contradict each other on its body ({', '.join(each)})"
    return texts


def _label(key: str) -> str:
    """A value's name, with what of the body goes along with it."""
    if key.endswith(f"/{MASS_ALONE}"):
        return key.removesuffix(MASS_ALONE) + MASS
    return f"{key} (its inertia in proportion)" if key.endswith(f"/{MASS}") else key


def _read_again(given, text: str, found, recordings, models) -> dict[str, dict[str, Any]]:
    """The force errors of all joints by the file as it was written, see `Patch.errors`."""
    errors: dict[str, dict[str, Any]] = {}
    shared: dict[bytes, Any] = {}
    for joint, told in found.items():
        both = readback.pair(given, text, joint, recordings[joint], shared)
        errors[joint] = readback.errors(told, *both, recordings[joint], models.get(joint))
    return errors


def _put_right(files: Files, joint: str, told: Explanation):
    """What was put right before any physics, and a dead time, as attributes; and what has none."""
    model = Mujoco(files.source, joint, folder_of(files.given))
    values: dict[str, tuple[float, float]] = {}
    left: list[str] = []
    for finding in told.findings:
        if finding.effect == POSITION_ZERO.name and finding.attribute:
            (zero,) = finding.parameters.values()
            before = float(model.model.qpos0[model.joints.index(finding.attribute.split("/")[1])])
            values[finding.attribute] = before, before + float(zero.value)
        elif finding.effect == FORCE_LIMIT.name and finding.attribute:
            (limit,) = finding.parameters.values()
            values[finding.attribute] = float("inf"), float(limit.value)
        elif finding.effect in EFFECTS and EFFECTS[finding.effect].logged:
            what = finding.effect.replace("_", " ")
            left.append(f"joint {joint}: the {what} of the force: it is the log's, not the model's")
        elif finding.effect in EFFECTS and EFFECTS[finding.effect].shift:
            _late(model, "delay", "a delay", finding.parameters["delay"], values, left)
        elif finding.effect in EFFECTS and EFFECTS[finding.effect].late:
            _late(model, "dynprm[0]", "a lag", finding.parameters["lag"], values, left)
    return values, left


def _late(model: Mujoco, what: str, said: str, time, values, left: list[str]) -> None:
    """A delay or a lag as the value of the joint's actuator, or that it has none."""
    try:
        own = actuation.read(model.mujoco, model.model, model.number)
    except ValueError:
        text = f"joint {model.joint}: {said} of {float(time.value):.4g} s"
        left.append(f"{text}: it has no actuator for it")
        return
    before = own.delay if what == "delay" else own.constant
    values[own.path(what)] = before, before + float(time.value)


def _again(files: Files, patch: Patch, found: dict[str, Explanation], again: Again) -> Rerun:
    """Both models run again, the one after with what its file cannot hold beside it."""
    space: dict[str, Any] = {}
    if patch.forces is not None:
        exec(compile(patch.forces, patch.module, "exec"), space)
    return rerun(
        files.given, patch.text, folder_of(files.given), again.simulators, again.logs,
        again.references, {joint: _acting(told) for joint, told in found.items()},
        space.get("FORCES", {}),
    )  # fmt: skip


def _acting(told: Explanation) -> tuple[float, float, float, float]:
    """Gain, limit, dead time and lag between the recorded command and the joint."""
    gain, limit, delay, lag = 1.0, np.inf, 0.0, 0.0
    for name, moved in _moved(told).items():
        if name == GAIN:
            gain = float(moved.value)
        elif name.endswith("/gear"):
            gain = float(moved.before) / float(moved.value)
    for finding in told.findings:
        if finding.effect == FORCE_LIMIT.name:
            limit = float(next(iter(finding.parameters.values())).value)
        elif finding.effect in EFFECTS and _acts_late(EFFECTS[finding.effect]):
            delay = float(finding.parameters.get("delay", NONE).value)
            lag = float(finding.parameters.get("lag", NONE).value)
    return gain, limit, delay, lag


def _acts_late(effect: Effect) -> bool:
    return effect.late and not effect.logged


def _moved(told: Explanation):
    found: dict[str, Any] = {}
    for finding in told.findings:
        if finding.effect == MISMATCH:
            found |= finding.parameters
    return found


def _unwritten(joint: str, moved) -> str:
    value = float(moved.value)
    return (
        f"joint {joint}: the recorded force is {value:.4g} times the simulator's; it has no "
        f"actuator whose gear could say so. Scale the log: --scale force={1 / value:.5g}"
    )


def _beside(told: Explanation) -> Model | None:
    """What was found beside attributes: the terms, and a constant force that no spring makes."""
    sprung = CONSTANT not in _moved(told)

    def beside(term: AbstractTerm) -> bool:
        constant = [p.name for p in term.affine] == [CONSTANT]
        known = isinstance(term, KnownForce | KnownColumns)
        return not known and not (constant and sprung) and not traits(term).late

    kept = [(term, alpha) for term, alpha in told.model.pairs() if beside(term) and np.any(alpha)]
    if not kept:
        return None
    terms, alphas = zip(*kept, strict=True)
    return Model(Sum(terms), jnp.concatenate(alphas), told.model.units)


def _speed(recording: Recording) -> float:
    moved = np.abs(np.diff(np.asarray(recording.position, float)))
    return float(np.quantile(moved / np.diff(np.asarray(recording.time, float)), 0.98))
