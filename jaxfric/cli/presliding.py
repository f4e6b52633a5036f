"""`jaxfric presliding`: stiffness and damping of bristles, and whether a recording shows them."""

import os
from argparse import Namespace
from typing import Any

from ..data.provenance import versions
from ..data.recording import Recording, uniform
from ..data.summary import facts
from ..data.targets import standard
from ..identification import documents
from ..identification.identified import Identified
from ..identification.identifying import identify
from ..identification.presliding import Presliding, comparison, doubt, presliding, sentence
from ..looks.text import Block, text
from ..models import name_of, named
from ..simulation.errors import force_error
from ..terms.base import AbstractTerm, Sum, summands
from ..terms.presliding import AbstractBristle
from .commands import load_model, put, read, working
from .messages import say
from .saving import saved

SCHEMA = "jaxfric.presliding/1"


def run(arguments: Namespace) -> int:
    """Bristles of one recording, beside the friction that jumps at rest."""
    recording, notes = read(arguments.file, arguments)
    structure = _structure(arguments.model)
    with working(arguments.file):
        try:
            log = uniform(recording)
            found = identify(structure, log)
            test = presliding(log, found)
        except ValueError as error:
            raise ValueError(f"{arguments.file}: {error}") from error
    errors = {"jumping": force_error(found.model, recording)}
    if test.model is not None:
        errors["bristles"] = force_error(test.model, recording)
    if arguments.save:
        if test.model is None:
            raise ValueError(f"{arguments.file}: there are no bristles to save; {test.why}.")
        put(arguments.save, documents.to_json(documents.saved(test.model, recording)))
        saved(arguments.save, test.model)
    if arguments.json:
        put(arguments.json, documents.to_json(_document(found, test, errors, recording, notes)))
    if not any(path and standard(path) for path in (arguments.json, arguments.save)):
        say(text(_told(arguments.file, found, test, errors)))
    return 0


def _structure(model: str) -> AbstractTerm:
    """The sum of a name or of a saved model, without bristles of its own."""
    term = load_model(model).term if os.path.isfile(model) else named(model)
    return Sum(tuple(each for each in summands(term) if not isinstance(each, AbstractBristle)))


def _document(
    found: Identified,
    test: Presliding,
    errors: dict[str, float],
    recording: Recording,
    notes: list[str],
) -> dict[str, Any]:
    model = found.model if test.model is None else test.model
    return {
        "schema": SCHEMA,
        "recording": facts(recording, notes),
        "name": name_of(found.model.term),
        **test.to_dict(),
        "force_error": errors,
        "model": model.to_dict(),
        "versions": versions(),
    }


def _told(file: str, found: Identified, test: Presliding, errors: dict[str, float]) -> list[Block]:
    said = [sentence(test, dict(found.model.units))]
    if "bristles" in errors:
        before, after = errors["jumping"], errors["bristles"]
        said.append(f"Force error of predict: {before:.2%} where friction jumps, {after:.2%} with.")
    if against := doubt(test, found):
        said.append(f"The friction beside it is {against}")
    return [[f"{file}: model {name_of(found.model.term)}"], *comparison(test), said]
