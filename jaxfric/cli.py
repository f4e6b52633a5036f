"""The command `jaxfric`: the only place that parses arguments, prints, and switches on float64."""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

# A file is padded to the next of these multiples of a power of two, so that one compiled program
# serves many files; at most a fifth of the samples is padding.
PADDING = (1.0, 1.25, 1.5, 1.75)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit status: 0 done, 2 bad input or usage."""
    arguments = _parser().parse_args(argv)
    _configure()
    try:
        return arguments.run(arguments)
    except (ValueError, OSError, MemoryError) as error:
        print(f"jaxfric {arguments.command}: {_message(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"jaxfric {arguments.command}: interrupted", file=sys.stderr)
        return 130


def _message(error: BaseException) -> str:
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror or error}"
    return str(error) or type(error).__name__


def _configure() -> None:
    """float64, and compiled programs kept in the user's cache folder (`JAXFRIC_CACHE`, or off)."""
    import jax

    jax.config.update("jax_enable_x64", True)
    cache = os.environ.get("JAXFRIC_CACHE", "")
    if cache == "off":
        return
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    folder = Path(cache) if cache else Path(base or Path.home() / ".cache") / "jaxfric"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="jaxfric",
        description="Friction of drive axes, identified without mass and without acceleration.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    command = commands.add_parser("demo", help="identify the friction of an embedded machine")
    command.add_argument("--out", default="jaxfric-demo", help="folder for what it writes")
    command.set_defaults(run=_demo)

    command = commands.add_parser("identify", help="friction of one or many recordings")
    command.add_argument("files", nargs="+", metavar="FILE")
    command.add_argument(
        "--model", default="gaussian", help="a model's name (jaxfric models), or best (default: gaussian)"
    )
    command.add_argument(
        "--projection", choices=("auto", "closed-windows", "weak-form"), default="auto"
    )
    command.add_argument("--bounds", default="", metavar="NAME=LOW:HIGH,…")
    command.add_argument("--json", metavar="OUT", help="write the identification; - prints it")
    command.add_argument("--save", metavar="MODEL.json", help="write the identified model")
    command.add_argument("--plot", metavar="OUT.png", help="write a picture (extra: report)")
    _reading(command)
    command.set_defaults(run=_identify)

    command = commands.add_parser("predict", help="the force that a recorded motion needs")
    command.add_argument("model", metavar="MODEL.json")
    command.add_argument("file", metavar="FILE")
    command.add_argument("-o", "--out", required=True, metavar="OUT.csv")
    _reading(command)
    command.set_defaults(run=_predict)

    command = commands.add_parser("simulate", help="run a model forward, with stick and slip")
    command.add_argument("model", metavar="MODEL.json")
    command.add_argument("file", metavar="REFERENCE.csv")
    command.add_argument("-o", "--out", required=True, metavar="OUT.csv")
    command.add_argument(
        "--controller",
        default="",
        metavar="KIND:GAIN=VALUE,…",
        help="pd:kp=,kd= | pid:kp=,ki=,kd= | cascade:kp=,kv= ; without one, the force column drives",
    )
    _reading(command)
    command.set_defaults(run=_simulate)

    command = commands.add_parser("models", help="the friction models, with their equations")
    command.set_defaults(run=_models)
    return parser


def _reading(command: argparse.ArgumentParser) -> None:
    group = command.add_argument_group("reading")
    group.add_argument("--columns", default="", metavar="ROLE=NAME,…")
    group.add_argument("--scale", default="", metavar="ROLE=FACTOR,…")
    group.add_argument("--units", default="", metavar="force=N,position=m")


def _pairs(text: str, option: str) -> dict[str, str]:
    pairs = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        key, equals, value = item.partition("=")
        if not equals or not key.strip():
            raise ValueError(f"{option}: {item!r} is not of the form NAME=VALUE.")
        pairs[key.strip()] = value.strip()
    return pairs


def _number(text: str, option: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{option}: {text!r} is not a number.") from None


def _read(path: str, arguments, set_point: bool = False):
    from .io import read_with_notes

    return read_with_notes(
        path,
        columns=_pairs(arguments.columns, "--columns"),
        scale={k: _number(v, "--scale") for k, v in _pairs(arguments.scale, "--scale").items()},
        units=_pairs(arguments.units, "--units"),
        set_point=set_point,
    )


def _padded(recording):
    from .recording import pad

    count = recording.num_samples
    power = 1 << max(8, count.bit_length() - 1)
    fits = [int(f * power) for f in (*PADDING, 2.0) if int(f * power) >= count]
    return pad(recording, fits[0])


def _identify(arguments) -> int:
    from . import documents, tabulate
    from .identification import identify
    from .models import named
    from .projections import ClosedWindows, WeakForm
    from .signals import kernel_half_width, prepare

    bounds = _bounds(arguments.bounds)
    if arguments.model != "best":
        named(arguments.model)
    if len(arguments.files) > 1 and (arguments.plot or arguments.save):
        raise ValueError("--plot and --save take one recording; for many, use --json.")
    found, failures = [], 0
    for path in arguments.files:
        try:
            recording, notes = _read(path, arguments)
            padded = prepare(_padded(recording))
            model = arguments.model if arguments.model != "best" else _best(recording)
            weak = WeakForm(kernel_half_width(padded))
            projection = {"closed-windows": ClosedWindows(), "weak-form": weak}
            fit = identify(
                model, padded, projection=projection.get(arguments.projection), bounds=bounds
            )
        except (ValueError, OSError) as error:
            if len(arguments.files) == 1:
                raise
            print(f"jaxfric identify: {_message(error)}", file=sys.stderr)
            failures += 1
            continue
        document = documents.identification(fit, recording, notes) | {"name": model}
        found.append(document)
        if arguments.json != "-":
            print(tabulate.identification(document))
        _write_identified(arguments, fit, recording)
    if arguments.json and found:
        text = documents.to_json(found[0] if len(arguments.files) == 1 else found)
        _put(arguments.json, text)
    return 2 if failures else 0


def _best(recording) -> str:
    from .selection import select

    return select(recording).name


def _bounds(text: str) -> dict[str, tuple[float, float]]:
    bounds = {}
    for name, span in _pairs(text, "--bounds").items():
        low, colon, high = span.partition(":")
        limits = (_number(low, "--bounds"), _number(high, "--bounds")) if colon else (1.0, 0.0)
        if not limits[0] < limits[1]:
            raise ValueError(f"--bounds: {name}={span} is not of the form NAME=LOW:HIGH.")
        bounds[name] = limits
    return bounds


def _write_identified(arguments, fit, recording) -> None:
    from . import documents
    from .io import write_text

    if arguments.save:
        write_text(arguments.save, documents.to_json(fit.model.to_dict()))
    if arguments.plot:
        _save_picture(fit, recording, arguments.plot)


def _save_picture(fit, recording, path) -> None:
    import io as memory

    from .io import write_bytes
    from .report.pictures import figure

    suffix = Path(path).suffix.lstrip(".").lower() or "png"
    if suffix not in ("png", "pdf", "svg"):
        raise ValueError(f"{path}: pictures are written as .png, .pdf or .svg.")
    buffer = memory.BytesIO()
    figure(fit, recording).savefig(buffer, format=suffix, dpi=130)
    write_bytes(path, buffer.getvalue())


def _put(path: str, text: str) -> None:
    from .io import write_text

    if path == "-":
        sys.stdout.write(text)
    else:
        write_text(path, text)


def _load(path: str):
    import json

    from .models import load

    try:
        return load(Path(path).read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise ValueError(
            f"{path}: not a JSON document ({error}). A model is written by jaxfric identify --save."
        ) from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _predict(arguments) -> int:
    import numpy as np

    from .io import write_table
    from .prediction import predict

    model = _load(arguments.model)
    recording, _ = _read(arguments.file, arguments)
    force = np.asarray(predict(model, recording))
    measured = np.asarray(recording.force)
    columns = {"time": recording.time, "force": force, "measured": measured}
    write_table(arguments.out, columns)
    mask = np.asarray(recording.mask)
    error = np.linalg.norm((measured - force)[mask]) / np.linalg.norm(measured[mask])
    print(f"{arguments.out}: {force.size} samples; norm(measured - predicted)/norm = {error:.2%}")
    return 0


def _simulate(arguments) -> int:
    from .io import write_table
    from .simulation import simulate

    model = _load(arguments.model)
    controller = _controller(arguments.controller)
    reference, _ = _read(arguments.file, arguments, set_point=True)
    run = simulate(model, reference, controller)
    columns = {"time": run.time, "force": run.force, "position": run.position}
    if run.velocity is not None:
        columns["velocity"] = run.velocity
    write_table(arguments.out, columns | run.channels)
    print(f"{arguments.out}: {run.num_samples} samples")
    return 0


def _controller(text: str):
    if not text:
        return None
    from . import control

    kinds = {"pd": control.PD, "pid": control.PID, "cascade": control.Cascade}
    kind, _, gains = text.partition(":")
    if kind not in kinds:
        raise ValueError(f"--controller: no {kind!r}; there are {', '.join(kinds)}.")
    values = {k: _number(v, "--controller") for k, v in _pairs(gains, "--controller").items()}
    try:
        return kinds[kind](**values)
    except TypeError as error:
        raise ValueError(f"--controller {kind}: {str(error).split('() ')[-1]}") from None


def _models(arguments) -> int:
    from . import tabulate

    print(tabulate.models())
    return 0


def _demo(arguments) -> int:
    import jax

    from . import documents, scenario, tabulate
    from .identification import identify
    from .io import write_table, write_text

    folder = Path(arguments.out)
    folder.mkdir(parents=True, exist_ok=True)
    machine = scenario.machine()
    noise = 0.02 * float(machine.parameters["coulomb+"])
    recording = scenario.record(machine, periods=2, force_noise=noise, key=jax.random.key(0))
    signals = {name: getattr(recording, name) for name in ("time", "force", "position", "velocity")}
    write_table(folder / "axis.csv", signals)
    fit = identify("lorentzian", recording)
    document = documents.identification(fit, recording) | {"name": "lorentzian"}
    truth = {name: float(value) for name, value in machine.parameters.items()}
    print(tabulate.identification(document, truth))
    write_text(folder / "identification.json", documents.to_json(document))
    write_text(folder / "model.json", documents.to_json(fit.model.to_dict()))
    written = ["axis.csv", "identification.json", "model.json"]
    try:
        _save_picture(fit, recording, folder / "friction.png")
        written.append("friction.png")
    except ValueError as error:
        print(error)
    print(f"\nWritten to {folder}: {', '.join(written)}")
    return 0
