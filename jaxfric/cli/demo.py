"""`jaxfric demo`: a simulated machine is recorded, identified and compared with the truth."""

from argparse import Namespace
from pathlib import Path

import jax

from .. import documents, scenario, tabulate
from ..io import read, write_table, write_text
from ..report import pictures
from . import commands

MODEL = "lorentzian"
# Of the Coulomb friction, as the noise of a servo drive's torque signal.
NOISE = 0.02


def run(arguments: Namespace) -> int:
    """Write a recording, identify it from that file, print true and identified parameters."""
    folder = Path(arguments.out)
    folder.mkdir(parents=True, exist_ok=True)
    machine = scenario.machine()
    truth = {name: float(value) for name, value in machine.parameters.items()}
    _record(machine, NOISE * truth["coulomb+"], folder / "axis.csv")
    recording = read(folder / "axis.csv")
    name, found = commands.fitted(recording, MODEL)
    document = documents.identification(found, recording) | {"name": name}
    print("A simulated ball-screw axis, controlled over two periods, noise on its force.\n")
    print(tabulate.identification(document, truth))
    write_text(folder / "identification.json", documents.to_json(document))
    write_text(folder / "model.json", documents.to_json(found.model.to_dict()))
    written = ["axis.csv", "identification.json", "model.json"]
    missing = ""
    try:
        pictures.library()
        commands.draw(found, recording, folder / "friction.png")
        written.append("friction.png")
    except ValueError as error:
        missing = f"\nNo picture: {error}"
    print(f"\nWritten to {folder}: {', '.join(written)}{missing}")
    print(f"The same by hand: jaxfric identify {folder / 'axis.csv'} --model {MODEL}")
    return 0


def _record(machine, noise: float, path: Path) -> None:
    made = scenario.record(machine, periods=2, force_noise=noise, key=jax.random.key(0))
    names = ("time", "force", "position", "velocity")
    write_table(path, {name: getattr(made, name) for name in names})
