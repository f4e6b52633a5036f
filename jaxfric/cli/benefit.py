"""What feed-forward by a model would be worth: for `simulate`, `export` and the page."""

from argparse import Namespace
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..data.recording import Recording
from ..identification import documents
from ..models import Model
from ..simulation.compensation import ASSUMED, OPTIMISTIC, Benefit, benefit, usual
from ..simulation.control import AbstractController
from .commands import load_model, put, put_table


def simulated(model: Model, reference: Recording, controller, notes, arguments) -> int:
    """`simulate --compensate`: the benefit said, as JSON, and the run with it as a table."""
    drive = load_model(arguments.compensate) if arguments.compensate else model
    try:
        found, chosen = computed(model, reference, controller, drive)
    except ValueError as error:
        raise ValueError(f"{arguments.model}, {arguments.file}: {error}") from error
    if controller is None:
        notes = [*notes, f"No controller is given; taken is {chosen} (--controller)."]
    units = dict(model.units)
    by = arguments.compensate or "the model itself"
    columns = {"time": found.run.time, "force": found.run.force, "position": found.run.position}
    if arguments.json:
        files = arguments.model, arguments.file, arguments.compensate
        document = documents.made("jaxfric.benefit/1", *files)
        document |= {"units": units, "assumed": ASSUMED} | as_dict(found)
        put(arguments.json, documents.to_json(document))
    own = drive.to_dict() == model.to_dict()
    summary = f"{found.run.num_samples} samples with compensation by {by}"
    said = f"{summary}\n{told(found, units, own)}"
    put_table(arguments.out, columns | found.run.channels, notes, said)
    return 0


def computed(
    machine: Model,
    reference: Recording,
    controller: AbstractController | None = None,
    drive: Model | None = None,
) -> tuple[Benefit, str]:
    """The benefit, and the controller of it as `--controller` takes it, if none was given.

    **Raises:** `ValueError` as `benefit` does, and for a motion that grows without bound.
    """
    chosen = ""
    if controller is None:
        controller = usual(machine, reference)
        chosen = f"pd:kp={float(controller.kp):g},kd={float(controller.kd):g}"
    found = benefit(machine, reference, controller, drive)
    if not np.all(np.isfinite([*found.without, *found.compensated])):
        raise ValueError("the simulated motion grows without bound: check the gains (--controller)")
    return found, chosen


def as_dict(found: Benefit) -> dict[str, Any]:
    """The figures of both runs."""
    both = {"without": found.without._asdict(), "compensated": found.compensated._asdict()}
    return both | {"error_removed": found.error_removed, "force_removed": found.force_removed}


def told(found: Benefit, units: Mapping[str, str], own: bool) -> str:
    """The figures in two lines, and what they assume; `own`: by the machine's own model."""
    position, force = units["position"], units["force"]
    return (
        f"tracking error {found.without.error:.3g} {position} rms without, "
        f"{found.compensated.error:.3g} with compensation: {found.error_removed:.0%} removed\n"
        f"controller force {found.without.force:.3g} {force} rms without, "
        f"{found.compensated.force:.3g} with: {found.force_removed:.0%} removed\n"
        f"{ASSUMED}{f' {OPTIMISTIC}' if own else ''}"
    )


def exported(model: Model, reference: Recording, arguments: Namespace) -> str:
    """`export --reference`: what the exported force would be worth as feed-forward."""
    try:
        found, chosen = computed(model, reference)
    except ValueError as error:
        raise ValueError(f"{arguments.model}, {arguments.reference}: {error}") from error
    return (
        f"Predicted benefit as feed-forward along {arguments.reference}, with {chosen}:\n"
        f"{told(found, dict(model.units), own=True)}"
    )


def of_explanation(
    baseline: Model | None, improved: Model, recording: Recording
) -> dict[str, Any] | None:
    """The benefit along the set-point of a log, on the improved model as the machine: of the
    improved model as feed-forward, and of the baseline's; `None` where the log holds no set-point,
    or the model cannot run forward.
    """
    if "reference" not in recording.channels:
        return None
    try:
        found, chosen = computed(improved, recording)
        document = {"controller": chosen, "improved": as_dict(found), "assumed": ASSUMED}
    except ValueError:
        return None
    try:
        other = computed(improved, recording, None, baseline) if baseline is not None else None
    except ValueError:
        other = None
    return document | ({"baseline": as_dict(other[0])} if other else {})
