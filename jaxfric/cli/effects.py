"""`jaxfric effects`: the physics that a model can leave out."""

from argparse import Namespace

from ..identification import documents
from ..terms import glossary
from .commands import put
from .messages import say


def run(arguments: Namespace) -> int:
    """Print all effects or one, as text or as JSON."""
    if arguments.json:
        names = [arguments.name] if arguments.name else []
        put(arguments.json, documents.to_json(glossary.document(names)))
    elif arguments.name:
        say(glossary.detail(arguments.name))
    else:
        say(glossary.overview())
    return 0
