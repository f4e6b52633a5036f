"""`jaxfric export`: a model for another program."""

import sys
import textwrap
from argparse import Namespace

from ..data.io import write_bytes
from ..data.targets import standard
from ..export import Exported, export
from ..models import Model
from ..units import VELOCITY, spell
from .commands import in_units, load_model, put, read
from .messages import say


def run(arguments: Namespace) -> int:
    """Write the model's text, and say what its form costs."""
    model = load_model(arguments.model)
    worth = ""
    if arguments.reference:
        from . import benefit

        reference = in_units(
            read(arguments.reference, arguments, set_point=True)[0], model, arguments
        )
        worth = "\n" + benefit.exported(model, reference, arguments)
    try:
        found = export(
            model,
            arguments.to,
            name=arguments.name,
            speed=arguments.speed,
            position=arguments.position,
        )
    except ValueError as error:
        raise ValueError(f"{arguments.model}: {error}") from error
    alone = standard(arguments.out)
    if not alone:
        write_bytes(arguments.out, found.content)
    elif found.data is None:
        put(arguments.out, found.text)
    else:
        raise ValueError(f"{arguments.to} is an archive: give it a file, -o {arguments.name}.fmu.")
    head = "" if alone else f"{arguments.out}: "
    say(
        f"{head}{summary(found, model, arguments.to)}{worth}",
        file=sys.stderr if alone else sys.stdout,
    )
    return 0


def summary(found: Exported, model: Model, target: str) -> str:
    """The cost in a few lines."""
    lines = [f"{target}, force error {_cost(found, model)}"]
    for text in (*(f"left out: {entry}" for entry in found.left_out), *found.remarks):
        lines += textwrap.wrap(text, 98, initial_indent="  ", subsequent_indent="    ")
    return "\n".join(lines)


def _cost(found: Exported, model: Model) -> str:
    rms, relative, worst, unit = found.force_error
    if found.speed is None:
        return "none but rounding" + " in what is written" * bool(found.left_out)
    low, high = found.speed
    speeds = f"{low:.4g} to {high:.4g} {spell(VELOCITY, dict(model.units))}"
    return f"{relative:.2%} ({rms:.3g} {unit} rms, {worst:.3g} {unit} at most) over {speeds}"
