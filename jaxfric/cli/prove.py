"""`jaxfric prove`: the concealed-effect benchmark."""

from argparse import Namespace
from pathlib import Path

from ..data.io import write_text
from ..validation import proof
from . import _configure
from .commands import working
from .messages import say


def run(arguments: Namespace) -> int:
    """Do what is left of the cases, score all, print the short table, write the report."""
    folder, size = Path(arguments.out), arguments.size
    options = (arguments.cases, arguments.seed, size, arguments.jobs, _configure, arguments.limit)
    with working(f"proving in {folder}") as doing:
        cases = proof.run(folder, *options, doing, arguments.definitions or "")
    scores = proof.scores(folder, cases)
    proof.conclude(folder, proof.results(scores))
    try:
        pictures, missing = proof.draw(scores, folder), ""
    except ValueError as error:
        pictures, missing = [], f"; no pictures: {error}"
    command = (
        f"jaxfric prove --cases {arguments.cases} --seed {arguments.seed} "
        f"--size {size[0]:g}:{size[1]:g}"
    )
    if arguments.definitions:
        command += f" --definitions {arguments.definitions}"
    write_text(folder / "report.md", proof.report(scores, command, pictures))
    say(proof.short(scores))
    written = ", ".join(["proof.json", "report.md", *pictures, "sealed/", "answers/"])
    say(f"\nWritten to {folder}: {written}{missing}")
    return 0
