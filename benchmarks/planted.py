"""Known effects planted in real recordings, and what `explain` calls them.

    python benchmarks/planted.py --out planted --seed 1

plants in the recordings of `recordings.py`, found in the folder that JAXFRIC_DATA names or in
`../shared/data` beside the project; or in one of your own:

    python benchmarks/planted.py axis.csv --holdout other.csv --baseline gaussian --out planted

Scores, report and pictures are those of `jaxfric prove`; interrupted, it goes on where it was.
"""

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import comparing
import planting
import recordings

from jaxfric.cli import _configure, options, values
from jaxfric.data.io import write_text
from jaxfric.validation import proof
from jaxfric.validation.proof.writing import rates, table

METHOD = """\
To the recorded force of a real machine the force of one effect is added, computed from the recorded
position, velocity and time by the functions that also conceal it in drawn machines: the recording
of a machine with that physics, at the same motion. Only effects that are such a force are planted:
not presliding, lag, backlash, compliance, delays and faults of the actuator, which would have moved
otherwise; no asymmetry, which every one of these machines has; nothing of another axis. Half of the
force, in power, acts where the axis moves: at rest, friction answers any force. The baseline is
fitted, each direction of motion with its own parameters.

- *Size*: root mean square of the planted force over the recording, in parts of the Coulomb level
  that `identify` finds in it.
- A real machine has findings of its own, with nothing planted: they are in the table above. Every
  answer is judged by its difference to that one. A finding that was there before (the same effect,
  and the same place where it has one, within 2 % or two standard errors; of a stop, the same end)
  is not counted, nor is one that is declared confusable with an own one that is not named again,
  unless it is the planted one or, at half of the growth, declared confusable with it;
  what else is new and was not planted is false. What was planted where the machine has the same of
  its own counts as found if that has grown by half of what the baseline's residual has, in power.
  So does a place that has structure of its own.
- *Before* is the held-out error freed of what the machine's own findings remove, in squares; the
  *oracle* has the planted force taken away and its own findings kept.
- The rest is as in the report of `jaxfric prove`."""

AGAIN = """\
The same command plants the same forces; the truth of each case is in `sealed/`, what `explain`
said, the machine's own findings included, in `answers/`."""


def main() -> None:
    """Do what is left, and write report and pictures to the folder."""
    arguments = parse()
    _configure()
    folder, logs = Path(arguments.out), chosen(arguments)
    sizes = [float(size) for size in arguments.sizes.split(",")]
    cases = planting.run(
        folder, logs, sizes, arguments.each, arguments.seed, arguments.jobs, _configure,
        arguments.limit,
    )  # fmt: skip
    scores = comparing.scores(folder, cases)
    command = (
        f"python benchmarks/planted.py --seed {arguments.seed} --each {arguments.each} "
        f"--sizes {arguments.sizes}"
    )
    more = [
        "## By recording and size",
        by_recording(scores, cases),
        "## The recordings as they are",
        table(("", "verdict", "findings", "force error before, after"),
              comparing.described(folder, cases)),
    ]  # fmt: skip
    text = proof.report(
        scores, command, proof.draw(scores, folder), title="Planted effects", method=METHOD,
        again=AGAIN, more=more,
    )  # fmt: skip
    write_text(folder / "report.md", text)
    print(proof.short(scores))
    print(f"\n{more[1]}\n\n{more[3]}\n\nWritten to {folder}: report.md")


def by_recording(scores, cases) -> str:
    """The power table, for each recording and size that was asked for."""
    groups: dict[str, list] = {}
    asked = {case.name: case.size[0] for case in cases}
    for score in scores:
        name = f"{score.name.rpartition('-')[0]}, {asked[score.name]:.0%}"
        groups.setdefault(name, []).append(score)
    rows = [(name, str(len(some)), *rates(some)) for name, some in groups.items()]
    return table(("", "cases", "exactly", "first", "among", "within the class", "place"), rows)


def chosen(arguments) -> list[planting.Log]:
    """The recording of the command line, or those of the folder that are there."""
    if arguments.file:
        reading = {"columns": arguments.columns, "scale": arguments.scale, "units": arguments.units}
        file = Path(arguments.file)
        return [planting.Log(file.stem, str(file), arguments.holdout, arguments.baseline, reading)]
    logs = recordings.logs()
    if not logs:
        sys.exit("No recordings: name a file, or let JAXFRIC_DATA name the folder with them.")
    return logs


def parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", nargs="?", help="a recording of your own")
    parser.add_argument("--holdout", help="a second one, only judged on")
    parser.add_argument("--baseline", default="coulomb-viscous")
    parser.add_argument("--sizes", default="0.05,0.1,0.2", help="in parts of the Coulomb level")
    parser.add_argument("--each", type=values.count, default=10, help="cases a size, recording")
    parser.add_argument("--seed", type=values.count, default=1)
    parser.add_argument("--jobs", type=values.count, default=1)
    parser.add_argument("--limit", type=values.seconds, default=600.0)
    parser.add_argument("--out", default="planted")
    options.reading(parser)
    return parser.parse_args()


if __name__ == "__main__":
    main()
