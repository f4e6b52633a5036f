"""The commands but the demo: identify, select, predict, models."""

import dataclasses
import os
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import jax
import numpy as np

from .. import models as known
from ..data import summary
from ..data.excerpt import MOST, excerpt
from ..data.io import READING, read_with_notes, write_bytes, write_table, write_text
from ..data.printable import printable
from ..data.recording import Recording, uniform
from ..data.targets import standard
from ..data.writing import csv_text
from ..identification import documents, tabulate
from ..identification.breakaway import breakaway
from ..identification.constant_velocity import constant_velocity
from ..identification.identified import Identified
from ..identification.identifying import identify as identify_recording
from ..identification.projections import AbstractProjection, ClosedWindows, WeakForm
from ..identification.selection import Selection
from ..looks.text import text
from ..models import Model
from ..signals import kernel_half_width, prepare
from ..simulation.errors import arrived, delay_of, force_error, in_motion, relative, residual
from ..terms.actuator import PREDICTED, REACTION
from ..units import SI, written_factor
from .messages import message, say
from .saving import saved


def read(path: str, arguments: Namespace, **more: Any) -> tuple[Recording, list[str]]:
    """The recording in a file, as the reading options say; what serves as what, and what was put in
    order.
    """
    return read_with_notes(path, **({"served": True} | reading(arguments) | more))


def reading(arguments: Namespace) -> dict[str, Any]:
    """How a file is read, as the reading options say."""
    return {name: getattr(arguments, name) for name in READING}


def stated(recording: Recording) -> str:
    """The rate and the units that a recording is read in."""
    rate = summary.facts(recording)["sample_rate"]
    named = [f"{name} in {unit}" for name, unit in recording.unit_names.items()]
    return ", ".join([f"{rate:.6g} Hz"] * bool(rate) + named)


def fitted(
    recording: Recording,
    model: str,
    projection: str = "auto",
    bounds: Mapping[str, tuple[float, float]] | None = None,
    align: bool = False,
) -> tuple[str, Identified]:
    """The name of the identified model (chosen, where it was `best`) and what was identified."""
    log = uniform(recording) if recording.num_samples <= MOST else recording
    chosen: AbstractProjection | None = None
    if projection == "closed-windows":
        chosen = ClosedWindows()
    elif projection == "weak-form":
        chosen = WeakForm(kernel_half_width(prepare(uniform(excerpt(log)))))
    try:
        found = identify_recording(model, log, projection=chosen, bounds=bounds, align=align)
    except ValueError as error:
        raise ValueError(f"{recording.source}: {error}") from error
    # Arrays of numpy: taking them apart compiles nothing.
    return model, jax.tree.map(np.asarray, found)


def select(recording: Recording, path: str) -> Selection:
    """The standings of all named models on one recording."""
    from ..identification.selection import select as select_model

    show_progress("")
    with working(f"selecting for {path}") as doing:
        doing(f"{len(known.names())} models, each judged on samples that it was not fitted to")
        try:
            return select_model(recording)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error


def selection(arguments: Namespace) -> int:
    """`jaxfric select`: which friction model each recording supports."""
    done, failures = [], 0
    for path in arguments.files:
        try:
            recording, notes = read(path, arguments)
            found = select(recording, path)
        except (ValueError, OSError) as error:
            say(f"jaxfric select: {message(error)}", file=sys.stderr)
            failures += 1
            continue
        made = documents.made("jaxfric.selection/1", path)
        done.append(made | {"file": path, "notes": notes} | found.to_dict())
        if not _printed(arguments):
            say(
                text([[f"{path}: {stated(recording)}", *notes], *tabulate.standings(done[-1])])
                + "\n" * (len(arguments.files) > 1)
            )
    if arguments.json and done:
        put(arguments.json, documents.to_json(done if len(arguments.files) > 1 else done[0]))
    return 2 if failures else 0


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
            say(f"jaxfric identify: {message(error)}", file=sys.stderr)
            failures += 1
    show_progress("")
    # First what lasts: who reads the table may close the pipe.
    if arguments.json and (done or many):
        put(arguments.json, documents.to_json(done if many else done[0]))
    if done and not _printed(arguments):
        alone = arguments.projection == "auto"
        say(tabulate.many(done) if many else tabulate.identification(done[0], automatic=alone))
    return 2 if failures else 0


def _printed(arguments: Namespace) -> bool:
    """Whether a document goes to standard output, where no table may stand beside it."""
    given = (getattr(arguments, name, None) for name in ("json", "save"))
    return any(path and standard(path) for path in given)


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
    name, chosen = arguments.model, {}
    if name == "best":
        standings = select(recording, path)
        name, chosen = standings.name, {"selection": standings.to_dict()}
    how = arguments.projection, arguments.bounds, arguments.align
    name, found = fitted(recording, name, *how)
    test, stick = constant_velocity(recording, found), breakaway(recording, found)
    error = force_error(found.model, recording)
    document = documents.identification(found, recording, notes, test, error, stick)
    document |= {"name": name} | chosen
    if arguments.save or arguments.plot:
        if not np.any(np.isfinite(np.asarray(found.model.alpha))):
            raise ValueError(f"{path}: there is no model to save or draw. {document['diagnosis']}")
    if arguments.save:
        put(arguments.save, documents.to_json(documents.saved(stick.model, recording)))
        saved(arguments.save, stick.model)
    if arguments.plot:
        draw(found, recording, arguments.plot)
    return document


def draw(found: Identified, recording: Recording, path: str | Path) -> None:
    """Write the picture of an identification."""
    from ..report import pictures

    drawn = dataclasses.replace(uniform(excerpt(recording)), source=recording.source)
    write_bytes(path, pictures.render(found, drawn, Path(path).suffix.lstrip(".").lower()))


def put(path: str, text: str) -> None:
    """Write text to a file, or to standard output for `-`."""
    if path == "-":
        sys.stdout.write(text)
    else:
        write_text(path, text)


def put_table(path: str, columns: Mapping[str, Any], notes: Sequence[str], told: str) -> None:
    """Write a table, to standard output for `-`, and say what it is."""
    if path == "-":
        arrays = {name: np.asarray(column) for name, column in columns.items()}
        sys.stdout.write(csv_text(arrays))
    else:
        write_table(path, columns)
    beside = sys.stderr if standard(path) else sys.stdout
    say("\n".join([*(f"  {note}" for note in notes), f"{path}: {told}"]), file=beside)


@contextmanager
def working(text: str) -> Iterator[Callable[[str], None]]:
    """Says on standard error what is being done, on a terminal only; by rich where it is there."""
    if not sys.stderr.isatty():
        yield lambda stage: None
        return
    try:
        from rich.console import Console
        from rich.text import Text
    except ImportError:
        show_progress(text)
        yield lambda stage: show_progress(f"{text}: {stage}")
        show_progress("")
        return
    with Console(stderr=True).status(Text(printable(text))) as status:
        yield lambda stage: status.update(Text(printable(f"{text}: {stage}")))


def show_progress(text: str) -> None:
    """One line on standard error that the next one replaces; only on a terminal."""
    if sys.stderr.isatty():
        print(f"\r\x1b[K{printable(text)}", end="", file=sys.stderr, flush=True)


def predict(arguments: Namespace) -> int:
    """`jaxfric predict`: force beside the measured one, as a table.

    The force error is that of the rows in which the column `in_motion` is 1.
    """
    model = load_model(arguments.model)
    recording, notes = read(arguments.file, arguments)
    recording = in_units(recording, model, arguments)
    needed = model.term.coordinates - {"acceleration", "time", "position", "velocity"}
    needed -= {PREDICTED, REACTION}  # predict works it out
    if missing := sorted(needed - set(recording.channels)):
        raise ValueError(
            f"{arguments.file}: the model needs {', '.join(missing)}. Name the columns: "
            f"--columns {','.join(f'{role}=NAME' for role in missing)}."
        )
    left, moving = residual(model, recording), in_motion(recording, delay_of(model))
    notes = notes + _unknown(model, ~np.isfinite(left), moving, arguments)
    measured, acting = np.asarray(recording.force), arrived(model, recording)
    force = acting - left
    columns = {"time": recording.time, "force": force, "measured_force": measured}
    if model.force_limit is not None:
        columns["arrived_force"] = acting
        limit = f"{float(model.force_limit):.5g} {dict(model.units)['force']}"
        notes = [*notes, f"The measured force counts up to the model's force limit, {limit}."]
    error = relative(left, acting, moving)
    share = f"{error:.2%}" if np.isfinite(error) else "undefined: no slip, or no force"
    columns["in_motion"] = moving.astype(int)
    notes = [stated(recording), *notes]
    put_table(arguments.out, columns, notes, f"{force.size} samples; force error {share}")
    return 0


def _unknown(model: Model, blank: np.ndarray, moving: np.ndarray, arguments) -> list[str]:
    """A note where the model says no force; raises `ValueError` where that is in motion."""
    lacking = [n for n, value in model.parameters.items() if not np.isfinite(float(value))]
    if np.any(blank & moving):
        if not lacking:
            raise ValueError(
                f"{arguments.model}: gives no finite force for {arguments.file}. Are its values "
                "those that were identified?"
            )
        raise ValueError(
            f"{arguments.model}: has no value for {', '.join(lacking)}, which "
            f"{arguments.file} needs: identify on a recording that moves in both directions."
        )
    if not blank.any():
        return []
    return [
        f"{np.count_nonzero(blank)} samples at rest have no force, as {arguments.model} has no "
        f"value for {', '.join(lacking)}."
    ]


def load_model(path: str) -> Model:
    """A saved model."""
    try:
        return known.load(Path(path).read_text(encoding="utf-8"))
    except (ValueError, UnicodeDecodeError) as error:
        raise ValueError(
            f"{path}: {error} A model is written by jaxfric identify --save."
        ) from None


def in_units(recording: Recording, model: Model, arguments: Namespace) -> Recording:
    """The recording under the model's unit names; refused where it states another unit.

    A file that states no unit is read in N and m; what is no statement gives way.
    """
    own, wanted = recording.unit_names, dict(model.units)
    for quantity, unit in own.items():
        stated = quantity in arguments.units or unit != SI[quantity]
        if unit != wanted[quantity] and stated:
            number = written_factor(unit, wanted[quantity])
            raise ValueError(
                f"{recording.source}: {quantity} is in {unit}, in the model in "
                f"{wanted[quantity]}. Convert: --scale {quantity}={number} "
                f"--units {quantity}={wanted[quantity]}."
            )
    return dataclasses.replace(recording, units=tuple(wanted.items()))


def models(arguments: Namespace) -> int:
    """`jaxfric models`: names and equations."""
    say(tabulate.models())
    return 0


def today() -> str:
    """The date in universal time; that of SOURCE_DATE_EPOCH, where a build is to be repeated."""
    stamp = os.environ.get("SOURCE_DATE_EPOCH", "")
    moment = int(stamp) if stamp.isdecimal() else time.time()
    return datetime.fromtimestamp(moment, UTC).strftime("%Y-%m-%d")
