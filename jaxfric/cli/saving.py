"""What is said of a model that was saved."""

import sys
import textwrap

from ..export import unwritten
from ..models import Model
from .messages import say


def saved(path: str, model: Model) -> None:
    """Say on the error stream what exported code will lack of a model that was saved."""
    head = f"{path}: C, Structured Text and FMU leave out"
    try:
        missing = unwritten(model)
    except ValueError as error:
        head, missing = f"{path}: no target takes this model.", (str(error),)
    if model.bristles is not None:
        missing = (*missing, "the bristles: their friction jumps at rest")
    for text in missing:
        say(textwrap.fill(f"{head} {text}", 98, subsequent_indent="    "), file=sys.stderr)
