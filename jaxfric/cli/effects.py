"""`jaxfric effects`: the physics that a model can leave out."""

from argparse import Namespace

from .. import documents, glossary
from .commands import put


def run(arguments: Namespace) -> int:
    """Print all effects or one, as text or as JSON."""
    if arguments.json:
        names = [arguments.name] if arguments.name else []
        put(arguments.json, documents.to_json(glossary.document(names)))
    elif arguments.name:
        print(glossary.detail(arguments.name))
    else:
        print(glossary.overview())
    return 0
