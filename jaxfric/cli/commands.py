"""The commands but the demo: identify, predict, simulate, models."""

import dataclasses
import sys
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .. import documents, models as known, tabulate
from ..identification import identify as identify_recording
from ..identified import Identified
from ..io import read_with_notes, write_bytes, write_table, write_text
from ..models import Model
from ..programs import kept_in
from ..projections import AbstractProjection, ClosedWindows, WeakForm
from ..recording import Recording, uniform
from ..signals import kernel_half_width, prepare
from ..units import SI
from .options import message


def read(path: str, arguments: Namespace, **more: Any) -> tuple[Recording, list[str]]:
    """The recording in a file, as the reading options say, and what was put in order."""
    return read_with_notes(
        path,
        columns=arguments.columns,
        scale=arguments.scale,
        units=arguments.units,
        **more,
    )


def fitted(
    recording: Recording,
    model: str,
    projection: str = "auto",
    bounds: Mapping[str, tuple[float, float]] | None = None,
) -> tuple[str, Identified]:
    """The name of the identified model (chosen, where it was `best`) and what was identified."""
    if model == "best":
        from ..selection import select

        model = select(recording).name
    with kept_in(programs_folder()):
        prepared = prepare(uniform(recording))
        chosen: AbstractProjection | None = None
        if projection == "closed-windows":
            chosen = ClosedWindows()
        elif projection == "weak-form":
            chosen = WeakForm(kernel_half_width(prepared))
        try:
            found = identify_recording(model, prepared, projection=chosen, bounds=bounds)
        except ValueError as error:
            raise ValueError(f"{recording.source}: {error}") from error
    # Arrays of numpy: taking them apart compiles nothing.
    return model, jax.tree.map(np.asarray, found)


def programs_folder() -> Path | None:
    """Beside jax's own cache, if there is one."""
    folder = jax.config.values["jax_compilation_cache_dir"]
    return None if folder is None else Path(folder) / "programs"


def identify(arguments: Namespace) -> int:
    """`jaxfric identify`: one recording in full, or many in a table."""
    many = len(arguments.files) > 1
    if arguments.model != "best":
        check_bounds(arguments.model, arguments.bounds)
    if many and (arguments.plot or arguments.save):
        raise ValueError("--plot and --save take one recording; for many, use --json.")
    if arguments.plot:
        from ..report import pictures

        pictures.library()
    done, failures = [], 0
    for i, path in enumerate(arguments.files):
        show_progress(f"{i + 1}/{len(arguments.files)} {path}")
        try:
            done.append(_identify(path, arguments))
        except (ValueError, OSError) as error:
            show_progress("")
            print(f"jaxfric identify: {message(error)}", file=sys.stderr)
            failures += 1
    show_progress("")
    if arguments.json != "-" and done:
        alone = arguments.projection == "auto"
        text = tabulate.many(done) if many else tabulate.identification(done[0], automatic=alone)
        print(text)
    if arguments.json and (done or many):
        put(arguments.json, documents.to_json(done if many else done[0]))
    return 2 if failures else 0


def check_bounds(model: str, bounds: Mapping[str, tuple[float, float]]) -> None:
    """Raises `ValueError` for a model that is not known, and for bounds of what it has not."""
    searched = [p.name for p in known.named(model).nonlinear]
    if unknown := sorted(set(bounds) - set(searched)):
        raise ValueError(
            f"--bounds names {', '.join(unknown)}, which {model} does not search; it searches "
            f"{', '.join(searched) or 'nothing'}."
        )


def _identify(path: str, arguments: Namespace) -> dict[str, Any]:
    """The document of one file; its model and picture are written."""
    recording, notes = read(path, arguments)
    name, found = fitted(recording, arguments.model, arguments.projection, arguments.bounds)
    document = documents.identification(found, recording, notes) | {"name": name}
    if arguments.save or arguments.plot:
        if not np.all(np.isfinite([float(v) for v in found.model.parameters.values()])):
            raise ValueError(f"{path}: there is no model to save or draw. {document['diagnosis']}")
    if arguments.save:
        put(arguments.save, documents.to_json(found.model.to_dict()))
    if arguments.plot:
        draw(found, recording, arguments.plot)
    return document


def draw(found: Identified, recording: Recording, path: str | Path) -> None:
    """Write the picture of an identification."""
    from ..report import pictures

    drawn = dataclasses.replace(uniform(recording), source=recording.source)
    write_bytes(path, pictures.render(found, drawn, Path(path).suffix.lstrip(".").lower()))


def put(path: str, text: str) -> None:
    """Write text to a file, or to standard output for `-`."""
    if path == "-":
        sys.stdout.write(text)
    else:
        write_text(path, text)


def show_progress(text: str) -> None:
    """One line on standard error that the next one replaces; only on a terminal."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{text}", end="", file=sys.stderr, flush=True)


def predict(arguments: Namespace) -> int:
    """`jaxfric predict`: force beside the measured one, as a table."""
    from ..prediction import predict as predict_force, relative_error

    model = _load(arguments.model)
    recording, notes = read(arguments.file, arguments)
    recording = _in_units(recording, model, arguments)
    needed = model.term.coordinates - {"acceleration", "time", "position", "velocity"}
    if missing := sorted(needed - set(recording.channels)):
        raise ValueError(
            f"{arguments.file}: the model needs {', '.join(missing)}. Name the columns: "
            f"--columns {','.join(f'{role}=NAME' for role in missing)}."
        )
    prepared = prepare(uniform(recording))
    force = np.asarray(predict_force(model, prepared))[: recording.num_samples]
    columns = {"time": recording.time, "force": force, "measured_force": recording.force}
    write_table(arguments.out, columns)
    for note in notes:
        print(f"  {note}")
    error = float(relative_error(model, prepared))
    share = f"{error:.2%}" if np.isfinite(error) else "undefined: no slip, or no force"
    print(f"{arguments.out}: {force.size} samples; force error {share}")
    return 0


def simulate(arguments: Namespace) -> int:
    """`jaxfric simulate`: motion and force of a model, as a table."""
    from .. import control
    from ..simulation import simulate as simulate_model

    model = _load(arguments.model)
    controller = None
    if arguments.controller:
        kinds = {"pd": control.PD, "pid": control.PID, "cascade": control.Cascade}
        kind, gains = arguments.controller
        controller = kinds[kind](**gains)
    reference, notes = read(arguments.file, arguments, set_point=True)
    reference = _in_units(reference, model, arguments)
    if controller is None and not np.any(np.asarray(reference.force)):
        raise ValueError(
            f"{arguments.file}: no force drives the axis. Name the column (--columns force=NAME) "
            "or follow a set-point (--controller pd:kp=…,kd=…)."
        )
    run = simulate_model(model, reference, controller)
    if not np.all(np.isfinite(np.asarray(run.position))):
        raise ValueError(
            f"{arguments.file}: the simulated motion grows without bound. Check the gains and "
            "the sample rate (a gain must act slower than the clock) and the model's units."
        )
    columns = {"time": run.time, "force": run.force, "position": run.position}
    if run.velocity is not None:
        columns["velocity"] = run.velocity
    write_table(arguments.out, columns | run.channels)
    for note in notes:
        print(f"  {note}")
    print(f"{arguments.out}: {run.num_samples} samples")
    return 0


def _load(path: str) -> Model:
    try:
        return known.load(Path(path).read_text(encoding="utf-8"))
    except (ValueError, UnicodeDecodeError) as error:
        raise ValueError(
            f"{path}: {error} A model is written by jaxfric identify --save."
        ) from None


def _in_units(recording: Recording, model: Model, arguments: Namespace) -> Recording:
    """The recording under the model's unit names; refused where it states another unit.

    A file that states no unit is read in N and m; what is no statement gives way.
    """
    own, wanted = recording.unit_names, dict(model.units)
    for quantity, unit in own.items():
        stated = quantity in arguments.units or unit != SI[quantity]
        if unit != wanted[quantity] and stated:
            raise ValueError(
                f"{recording.source}: {quantity} is in {unit}, in the model in "
                f"{wanted[quantity]}. Convert: --scale {quantity}=FACTOR "
                f"--units {quantity}={wanted[quantity]}."
            )
    return dataclasses.replace(recording, units=tuple(wanted.items()))


def models(arguments: Namespace) -> int:
    """`jaxfric models`: names and equations."""
    print(tabulate.models())
    return 0
