"""Options that several commands share, and a check of what they read and write."""

import math
import os
from argparse import ArgumentParser, Namespace

from ..data.targets import replaced, same, standard
from . import values
from .values import count, factors, names, number, output, picture, positive, seconds

# What the options of every command read, and what they write.
READ = (
    "file", "files", "model", "compensate", "baseline", "simulation", "simulation_holdout",
    "holdout", "mujoco", "reference",
)  # fmt: skip
WRITTEN = ("out", "json", "save", "report", "plot", "c")


def check_outputs(arguments: Namespace) -> None:
    """Raises `ValueError` where one output would replace another, or an input."""
    given = vars(arguments)
    outputs = {f"--{name}": given[name] for name in WRITTEN if given.get(name)}
    files = [path for name in READ for path in _texts(given.get(name)) if os.path.isfile(path)]
    for index, (option, path) in enumerate(outputs.items()):
        for other, there in list(outputs.items())[:index]:
            if same(path, there) and _kept(path):
                raise ValueError(f"{other} and {option} are both {path}; give each its own.")
        if any(same(path, there) for there in files):
            raise ValueError(f"{path}: is read, and {option} would replace it; write elsewhere.")


def _texts(value: object) -> list[str]:
    values = value if isinstance(value, list) else [value]
    return [text for text in values if isinstance(text, str)]


def _kept(path: str) -> bool:
    """Whether what is written there stays: standard output and files, not the null device."""
    return standard(path) or replaced(path) is not None


def recordings(command: ArgumentParser) -> None:
    """Add the files of a command that takes one or many."""
    command.add_argument("files", nargs="+", metavar="FILE", help="CSV, Parquet, .mat or .npz")


def document(command: ArgumentParser, what: str, it: str = "it") -> None:
    """Add where JSON is written to, and what it holds."""
    command.add_argument("--json", type=output, metavar="OUT", help=f"write {what}; - prints {it}")


def table(command: ArgumentParser) -> None:
    """Add where a table is written to."""
    command.add_argument("-o", "--out", type=values.table, required=True, metavar="OUT.csv")


def reading(command: ArgumentParser) -> None:
    """Add the options that say how to read a file."""
    group = columns(command)
    group.add_argument(
        "--period",
        type=factors,
        default={},
        metavar="position=NUMBER",
        help="the position is counted modulo this, before scaling: make it continuous",
    )
    group.add_argument(
        "--rate",
        type=values.rate,
        metavar="HZ",
        help="samples per second of a file without a time column",
    )
    group.add_argument(
        "--counts-per-rev",
        type=positive,
        metavar="N",
        help="encoder counts of a revolution: a position in counts becomes rad, or the rev or deg "
        "that --units position= names",
    )
    group.add_argument(
        "--no-repair",
        action="store_false",
        dest="repair",
        help="leave clock, samples and position as they are (not finite samples are masked)",
    )


def columns(command: ArgumentParser):
    """Add the options that say which columns, in which units; returns their group."""
    group = command.add_argument_group("how to read the file")
    group.add_argument(
        "--columns",
        type=names,
        default={},
        metavar="ROLE=NAME,…",
        help="for instance force=vir,position=qm; a name with a comma in quotation marks; "
        "neighbour_velocity=v2 for an axis beside it (not needed for joints of a robot)",
    )
    group.add_argument(
        "--scale",
        type=factors,
        default={},
        metavar="ROLE=FACTOR,…",
        help="for instance position=0.001; of one joint of a robot elbow_position=0.0174533",
    )
    group.add_argument(
        "--units",
        type=names,
        default={},
        metavar="force=N,position=m",
        help="after scaling; they name, they do not convert",
    )
    return group


def watching(command: ArgumentParser) -> None:
    """Add the options of following a stream."""
    command.add_argument(
        "--model",
        default="coulomb-viscous",
        metavar="NAME",
        help="a name that jaxfric models lists (default: coulomb-viscous)",
    )
    forget = command.add_mutually_exclusive_group()
    forget.add_argument(
        "--keep",
        type=seconds,
        default=math.inf,
        metavar="SECONDS",
        help="slip time of a direction after which a stroke weighs 1/e (default: nothing fades)",
    )
    forget.add_argument(
        "--window", type=count, default=0, metavar="N", help="only the last N strokes each way"
    )
    command.add_argument(
        "--every",
        type=seconds,
        default=10.0,
        metavar="SECONDS",
        help="of the stream's clock, between two lines of parameters (default: 10)",
    )
    command.add_argument(
        "--false-alarms",
        type=number,
        default=1e-4,
        metavar="RATE",
        help="of the change detection, a stroke of a direction (default: 0.0001)",
    )
    command.add_argument(
        "--c",
        type=output,
        metavar="OUT.c",
        help="instead: write the update as C99 for a drive, for the speeds of the stream's start",
    )
    command.add_argument("--once", action="store_true", help="stop at the end of the file")
    command.add_argument(
        "--json", action="store_true", dest="json_lines", help="one JSON document a line"
    )


def designing(command: ArgumentParser) -> None:
    """Add the limits of a motion, in the model's units."""
    for name, unit in (
        ("position", "m"), ("velocity", "m/s"), ("acceleration", "m/s²"), ("jerk", "m/s³"),
    ):  # fmt: skip
        command.add_argument(
            f"--{name}", type=positive, required=True, metavar="LIMIT", help=f"to each side, {unit}"
        )
    for name, value in (("duration", 10.0), ("interval", 0.002)):
        command.add_argument(
            f"--{name}", type=seconds, default=value, metavar="SECONDS", help=f"default: {value:g}"
        )
    command.add_argument(
        "--centre", type=number, default=0.0, metavar="X", help="middle of the stroke (default: 0)"
    )
    command.add_argument(
        "--noise", type=positive, metavar="FORCE", help="of a sample of force (default: 2 %% of it)"
    )


def identifying(command: ArgumentParser) -> None:
    """Add the options that say how to identify."""
    command.add_argument(
        "--projection",
        choices=("auto", "closed-windows", "weak-form"),
        default="auto",
        help="without mass and acceleration, or with inertia fitted too (default: auto)",
    )
    command.add_argument(
        "--bounds",
        type=values.bounds,
        default={},
        metavar="NAME=LOW:HIGH,…",
        help="of nonlinear parameters, for instance stribeck_velocity+=0.001:0.1",
    )


def gathering(command: ArgumentParser) -> None:
    """Add the options of a fleet: which recordings, where to, on what."""
    command.add_argument(
        "patterns",
        nargs="+",
        metavar="PATTERN",
        help="'logs/**/*.parquet' (quoted), files, or folders",
    )
    command.add_argument(
        "--model", default="gaussian", metavar="NAME", help="as jaxfric models lists them"
    )
    command.add_argument(
        "--out", required=True, metavar="FITS.parquet", help="one row a recording; or .csv"
    )
    command.add_argument(
        "--plot", type=picture, metavar="OUT.png", help="draw the fleet (extra: report)"
    )
    command.add_argument(
        "--axis",
        metavar="KEY_OR_REGEX",
        help="which axis a path is of, for drift (default: folders named key=value)",
    )
    command.add_argument(
        "--group", metavar="KEY_OR_REGEX", help="outliers within groups (default: the whole fleet)"
    )
    command.add_argument("--jobs", type=count, metavar="K", help="cores to use (default: all)")
    command.add_argument(
        "--restart", action="store_true", help="forget the rows of an interrupted run"
    )
    command.add_argument(
        "--process",
        type=values.process,
        metavar="I/N@HOST:PORT",
        help="the I-th, from 0, of N such commands on machines that share the folders; "
        "process 0 is reached at HOST:PORT",
    )


def proving(command: ArgumentParser) -> None:
    """Add the options of a proof: which machines, on what, where to."""
    command.add_argument(
        "--cases", type=count, default=240, metavar="N", help="machines (default: 240)"
    )
    command.add_argument(
        "--seed", type=count, default=1, metavar="S", help="of the machines (default: 1)"
    )
    command.add_argument(
        "--jobs", type=count, default=1, metavar="K", help="processes (default: 1)"
    )
    command.add_argument(
        "--size",
        type=values.sizes,
        default=(0.02, 0.30),
        metavar="LOW:HIGH",
        help="of the concealed force, in parts of the Coulomb level (default: 0.02:0.3)",
    )
    command.add_argument(
        "--definitions",
        choices=("all", "development", "scored"),
        help="conceal each effect by several definitions of its physics: all, those that are "
        "developed on, or those that are only scored (default: the usual one)",
    )
    command.add_argument(
        "--limit",
        type=seconds,
        default=600.0,
        metavar="SECONDS",
        help="a case without answer is given up, and counts as missed, after so many (default: "
        "600, a hundred times what one takes)",
    )
    text = "answers and report; answers that are there stay"
    command.add_argument("--out", default="jaxfric-proof", metavar="FOLDER", help=text)
