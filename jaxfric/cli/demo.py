"""`jaxfric demo`: a machine with something concealed is recorded, identified and explained."""

from argparse import Namespace
from pathlib import Path

from ..data.io import read, write_table, write_text
from ..explanation import explain
from ..identification import documents, tabulate
from ..report import page, pictures
from ..simulation.errors import force_error
from ..validation import concealed
from . import commands
from .commands import today
from .messages import say

# One of the random machines: a linear axis of 57 mm stroke, 1.1 kHz, with an encoder and noise.
SEED = 868
EFFECT = "cogging"
SIZE = 0.12


def run(arguments: Namespace) -> int:
    """Record, identify and explain; then say what was concealed."""
    folder = Path(arguments.out)
    folder.mkdir(parents=True, exist_ok=True)
    machine = concealed.draw(SEED, (EFFECT,), SIZE)
    _record(machine, folder)
    recording, holdout = (read(folder / f"{name}.csv") for name in ("axis", "holdout"))
    name, fitted = commands.fitted(recording, machine.baseline)
    error = force_error(fitted.model, recording)
    document = documents.identification(fitted, recording, force_error=error) | {"name": name}
    say("A simulated axis in closed loop, with an encoder, noise, and something concealed.\n")
    say(tabulate.identification(document))
    say("\nWhat does this model leave out?\n")
    found = explain(recording, machine.baseline, holdout)
    told = found.to_dict()
    say(tabulate.explanation(told))
    say(f"\nConcealed was: {_truth(machine)}")
    write_text(folder / "identification.json", documents.to_json(document))
    write_text(folder / "explanation.json", documents.to_json(told))
    write_text(
        folder / "model.json", documents.to_json(documents.saved(found.model, recording, holdout))
    )
    written = ["axis.csv", "holdout.csv", "identification.json", "explanation.json", "model.json"]
    missing = ""
    try:
        pictures.library()
        page.library()
        commands.draw(fitted, recording, folder / "friction.png")
        text = page.render(told, found.curves, arguments.typed, today())
        write_text(folder / "explanation.html", text)
        written += ["friction.png", "explanation.html"]
    except ValueError as error:
        missing = f"\nNo pictures: {error}"
    say(f"\nWritten to {folder}: {', '.join(written)}{missing}")
    files = f"{folder / 'axis.csv'} --holdout {folder / 'holdout.csv'}"
    say(f"The same by hand: jaxfric explain {files} --baseline {machine.baseline}")
    return 0


def _record(machine: concealed.Machine, folder: Path) -> None:
    runs = concealed.record(machine)
    for name, made in (("axis", runs.recording), ("holdout", runs.holdout)):
        columns = {"time": made.time, "force": made.force, "position": made.position}
        write_table(folder / f"{name}.csv", columns | made.channels)


def _truth(machine: concealed.Machine) -> str:
    truth = machine.truth[EFFECT]
    sizes = ", ".join(f"{amplitude:.3g} N" for amplitude in truth["amplitudes"])
    return f"cogging with a pitch of {truth['pitch']:.4g} m; amplitudes of its harmonics {sizes}."
