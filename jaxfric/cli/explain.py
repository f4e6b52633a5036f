"""`jaxfric explain`: what a model leaves out of a recording."""

import dataclasses
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np

from ..data.provenance import sha256
from ..data.recording import Recording, check_same_units
from ..data.targets import standard
from ..explanation import Earlier, Explanation, explain
from ..explanation.baseline import baseline_of
from ..explanation.quantities import per_pole_pair
from ..identification import documents, tabulate
from ..identification.constant_velocity import held
from ..identification.uncertainty import Estimate
from ..models import Model, named
from ..report import page
from ..simulators import Known, same_motion
from ..terms import KNOWN_FORCE
from ..terms.effects import EFFECTS
from . import benefit, robot
from .commands import load_model, put, read, today, working
from .messages import say
from .saving import saved


def run(arguments: Namespace) -> int:
    """Explain one recording; print it, and write what was asked for."""
    if arguments.joint and not arguments.mujoco:
        raise ValueError("--joint names a joint of the model of --mujoco, which is not given.")
    if arguments.mujoco:
        return robot.run(arguments)
    if arguments.report:
        page.library()
    recording, notes = read(arguments.file, arguments)
    holdout = None
    if arguments.holdout:
        holdout, more = _beside(arguments.holdout, recording, arguments)
        if _same(recording, holdout):
            raise ValueError(
                f"--holdout {arguments.holdout}: these are the samples of {arguments.file} itself, "
                "which cannot judge what was fitted to them. Give another recording, or none."
            )
        notes = notes + [f"Held out: {note}" for note in more if note != notes[0]]
    baseline = _baseline(arguments, recording, holdout)
    try:
        with working(f"explaining {arguments.file}") as doing:
            found = explain(
                recording,
                baseline,
                holdout,
                fixed=arguments.fixed,
                simulate=arguments.simulate,
                doing=doing,
            )
    except ValueError as error:
        raise ValueError(f"{arguments.file}: {error}") from error
    document = found.to_dict()
    document["recording"]["notes"] = notes
    if arguments.pole_pairs:
        _per_pole_pair(found, document, arguments.pole_pairs)
    for path in (arguments.baseline, arguments.simulation):
        if path and (digest := sha256(path)):
            document["baseline"] |= {"file": path, "sha256": digest}
    if arguments.report or arguments.simulate:
        worth = benefit.of_explanation(found.baseline, found.model, recording)
        document |= {"benefit": worth} if worth else {}
    texts = written(found, document, arguments, (recording, holdout))
    # First what lasts: who reads the table may close the pipe.
    for path, text in texts.items():
        put(path, text)
    if not any(standard(path) for path in texts):
        say(tabulate.explanation(document))
    if arguments.save:
        saved(arguments.save, found.model)
    return 0


def _same(ours: Recording, theirs: Recording) -> bool:
    """Whether two recordings hold the same force at the same times, whatever their files."""
    pairs = ((ours.time, theirs.time), (ours.force, theirs.force))
    return all(np.array_equal(mine, other, equal_nan=True) for mine, other in pairs)


def _per_pole_pair(found: Explanation, document: dict, pairs: int) -> None:
    """Add to the sentences how often a period goes into a pole pair of the motor."""
    for finding, entry in zip(found.findings, document["findings"], strict=True):
        known = EFFECTS.get(finding.effect)
        for name in known.periods if known else ():
            if isinstance(period := finding.parameters.get(name), Estimate):
                entry["sentence"] += per_pole_pair(period, pairs)


def written(
    found: Explanation, document: dict, arguments: Namespace, recordings: tuple
) -> dict[str, str]:
    """The JSON, the model and the page by the path that was given for each, all of them ready."""
    texts = {}
    if arguments.json:
        texts[arguments.json] = documents.to_json(document)
    if arguments.save:
        texts[arguments.save] = documents.to_json(documents.saved(found.model, *recordings))
    if arguments.report:
        curves = _with_held(found, recordings[0])
        texts[arguments.report] = page.render(document, curves, arguments.typed, today())
    return texts


def _with_held(found: Explanation, recording: Recording) -> dict[str, Any]:
    """The curves of the page with the mean forces at constant velocity (`constant_velocity`).

    Not where a term reads what the recording lacks.
    """
    friction = found.curves.get("friction")
    known = {"time", "position", "velocity", "acceleration", *recording.channels}
    if not friction or not friction["velocity"] or not found.model.term.coordinates <= known:
        return found.curves
    return found.curves | {"friction": friction | {"held": held(recording, found.model)}}


def _simulation(
    arguments: Namespace, recording: Recording, holdout: Recording | None
) -> Recording | Known:
    """Another simulator's force along the recorded motion, or its run of the same reference."""
    ours = _beside(arguments.simulation, recording, arguments, along=recording)[0]
    if not same_motion(recording, ours):
        if arguments.simulation_holdout:
            raise ValueError(
                f"{arguments.simulation}: this is not the recorded motion, so that its force is "
                "not the simulator's along it; --simulation-holdout needs that. Compute the force "
                "at the recorded positions (inverse dynamics), one row for each sample."
            )
        return ours
    if holdout is None:
        return Known(ours.force)
    if not arguments.simulation_holdout:
        return ours
    theirs = _beside(arguments.simulation_holdout, recording, arguments, along=holdout)[0]
    if not same_motion(holdout, theirs):
        raise ValueError(
            f"{arguments.simulation_holdout}: this is not the motion of {arguments.holdout}. "
            "Compute the simulator's force at its positions, one row for each sample."
        )
    return Known(ours.force, theirs.force)


def _beside(
    path: str, recording: Recording, arguments: Namespace, along: Recording | None = None
) -> tuple[Recording, list[str]]:
    """Another recording of the comparison, in the units of the first, and its notes; of time and
    force alone where it is `along` one.
    """
    scale = arguments.scale | arguments.other_scale
    other, notes = read(path, arguments, scale=scale, along=along)
    units = recording.unit_names
    scaled = {role: units[role] for role in arguments.other_scale if role in units}
    other = dataclasses.replace(other, units=tuple((other.unit_names | scaled).items()))
    check_same_units(recording, other, "other-scale")
    return other, notes


def _baseline(
    arguments: Namespace, recording: Recording, holdout: Recording | None
) -> str | Model | Recording | Earlier | Known:
    if arguments.simulation:
        return _simulation(arguments, recording, holdout)
    if arguments.simulation_holdout:
        raise ValueError("--simulation-holdout goes with --simulation, which is not given.")
    if arguments.baseline is None:
        return Known() if KNOWN_FORCE in recording.channels else "gaussian"
    text = arguments.baseline
    if not text.endswith(".json"):
        if Path(text).is_file():
            other = _beside(text, recording, arguments)[0]
            if other.sha256 == recording.sha256:
                raise ValueError(
                    f"--baseline {text}: this is {arguments.file} itself. Give an earlier "
                    "recording of the machine."
                )
            return Earlier(other)
        named(text)
        return text
    model = load_model(text)
    try:
        baseline_of(model)
    except ValueError as error:
        raise ValueError(f"{text}: {error}") from None
    return model
