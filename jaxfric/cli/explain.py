"""`jaxfric explain`: what a model leaves out of a recording."""

from argparse import Namespace
from pathlib import Path

from .. import documents, tabulate
from ..explanation import Explanation, explain
from ..io import write_text
from ..models import Model, load, named
from ..programs import kept_in
from ..recording import Recording
from ..report import page
from .commands import programs_folder, put, read


def run(arguments: Namespace) -> int:
    """Explain one recording; print it, and write what was asked for."""
    recording, notes = read(arguments.file, arguments)
    holdout = read(arguments.holdout, arguments)[0] if arguments.holdout else None
    baseline = _baseline(arguments)
    try:
        with kept_in(programs_folder()):
            found = explain(
                recording, baseline, holdout, fixed=arguments.fixed, simulate=arguments.simulate
            )
    except ValueError as error:
        raise ValueError(f"{arguments.file}: {error}") from error
    document = found.to_dict()
    document["recording"]["notes"] = notes
    if arguments.json != "-":
        print(tabulate.explanation(document))
    write(found, document, arguments)
    return 0


def write(found: Explanation, document: dict, arguments: Namespace) -> None:
    """The JSON, the model and the page, each where it was asked for."""
    if arguments.json:
        put(arguments.json, documents.to_json(document))
    if arguments.save:
        put(arguments.save, documents.to_json(found.model.to_dict()))
    if arguments.report:
        write_text(arguments.report, page.render(document, found.curves))


def _baseline(arguments: Namespace) -> str | Model | Recording:
    if arguments.simulation:
        return read(arguments.simulation, arguments)[0]
    text = arguments.baseline
    if not text.endswith(".json"):
        if Path(text).is_file():
            raise ValueError(
                f"--baseline {text}: a model is a .json file; another simulator's output goes to "
                "--simulation."
            )
        named(text)
        return text
    try:
        return load(Path(text).read_text(encoding="utf-8"))
    except (ValueError, UnicodeDecodeError) as error:
        raise ValueError(
            f"{text}: {error} A model is written by jaxfric identify --save."
        ) from None
