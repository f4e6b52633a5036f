"""Values of the command's options, and the message of an error. Imports nothing heavy."""

import math
import os
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path
from typing import TextIO

from ..data.nearest import meant as meant
from ..data.printable import printable
from ..data.targets import replaced, same, standard

# Gains of each controller that `simulate` knows; `limit` bounds the force of any of them.
CONTROLLERS = {"pd": ("kp", "kd"), "pid": ("kp", "ki", "kd"), "cascade": ("kp", "kv")}
TABLES = (".csv", ".npz", ".parquet")
PICTURES = ("png", "pdf", "svg")


# What the options of every command read, and what they write.
READ = (
    "file", "files", "model", "compensate", "baseline", "simulation", "simulation_holdout",
    "holdout", "mujoco", "reference",
)  # fmt: skip
WRITTEN = ("out", "json", "save", "report", "plot", "c")


def say(text: str, end: str = "\n", file: TextIO | None = None) -> None:
    """Print lines for a person, in which nothing from outside steers the terminal."""
    print(printable(text, keep="\n"), end=end, file=file)


def message(error: BaseException) -> str:
    """What an error says, in one line, with the file's name where the system reports one."""
    if isinstance(error, OSError) and error.filename is not None:
        return printable(f"{os.fsdecode(error.filename)}: {error.strerror or error}")
    return printable(str(error) or type(error).__name__)


def check_outputs(arguments: Namespace) -> None:
    """Raises `ValueError` where one output would replace another, or an input."""
    given = vars(arguments)
    outputs = {f"--{name}": given[name] for name in WRITTEN if given.get(name)}
    files = [path for name in READ for path in _texts(given.get(name)) if os.path.isfile(path)]
    for number, (option, path) in enumerate(outputs.items()):
        for other, there in list(outputs.items())[:number]:
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


def names(text: str) -> dict[str, str]:
    """`a=b,c=d` as a mapping."""
    pairs = {}
    for item in filter(None, (part.strip() for part in text.split(","))):
        key, equals, value = item.partition("=")
        if not equals or not key.strip():
            raise ArgumentTypeError(f"{item!r} is not of the form NAME=VALUE")
        pairs[key.strip()] = value.strip()
    return pairs


def number(text: str) -> float:
    """A finite number."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ArgumentTypeError(f"{text!r} is not a number")
    return value


def factors(text: str) -> dict[str, float]:
    """`a=1.5,b=2` as a mapping to numbers."""
    return {name: number(value) for name, value in names(text).items()}


def bounds(text: str) -> dict[str, tuple[float, float]]:
    """`a=low:high,…` as a mapping to pairs of numbers."""
    found = {}
    for name, span in names(text).items():
        low, colon, high = span.partition(":")
        limits = (number(low), number(high)) if colon else (1.0, 0.0)
        if not limits[0] < limits[1]:
            raise ArgumentTypeError(f"{name}={span} is not of the form NAME=LOW:HIGH")
        found[name] = limits
    return found


def span(text: str) -> tuple[float, float]:
    """`low:high` as a pair of numbers, the second the larger."""
    low, colon, high = text.partition(":")
    limits = (number(low), number(high)) if colon else (1.0, 0.0)
    if not limits[0] < limits[1]:
        raise ArgumentTypeError(f"{text!r} is not of the form LOW:HIGH")
    return limits


def controller(text: str) -> tuple[str, dict[str, float]]:
    """`kind:gain=value,…` as the kind and its gains, all of them given."""
    kind, _, rest = text.partition(":")
    if kind not in CONTROLLERS:
        raise ArgumentTypeError(f"there is no {kind!r}; there are {', '.join(CONTROLLERS)}")
    gains = factors(rest)
    wanted = CONTROLLERS[kind]
    if missing := [gain for gain in wanted if gain not in gains]:
        example = ",".join(f"{gain}=…" for gain in wanted)
        raise ArgumentTypeError(f"{kind} lacks {', '.join(missing)}: {kind}:{example}")
    if unknown := sorted(set(gains) - {*wanted, "limit"}):
        raise ArgumentTypeError(f"{kind} has no {', '.join(unknown)}; it has {', '.join(wanted)}")
    return kind, gains


def output(text: str) -> str:
    """A path to write to, its folder there: said before the work instead of after it."""
    if not text:
        raise ArgumentTypeError("the name of the file is empty")
    if text == "-":
        return text
    try:
        target = replaced(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error).rstrip(".")) from None
    if target is not None and not target.parent.is_dir():
        raise ArgumentTypeError(f"{text}: there is no folder {Path(text).parent}; make it first")
    return text


def table(text: str) -> str:
    """A path to write a table to, of a kind that can be written."""
    if output(text) == "-" or replaced(text) is None or Path(text).suffix.lower() in TABLES:
        return text
    kinds = ", ".join(TABLES)
    raise ArgumentTypeError(f"{text}: tables are written as {kinds}; use that suffix")


def picture(text: str) -> str:
    """A path to draw to, of a kind that can be drawn."""
    if Path(text).suffix.lstrip(".").lower() not in PICTURES:
        kinds = ", ".join(f".{kind}" for kind in PICTURES)
        raise ArgumentTypeError(f"{text}: pictures are written as {kinds}; use that suffix")
    return output(text)


def count(text: str) -> int:
    """A whole number from one."""
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise ArgumentTypeError(f"{text!r} is not a whole number from 1")
    return value


def seconds(text: str) -> float:
    """A time span over zero, s."""
    return _over_zero(text, "a number of seconds over zero")


def positive(text: str) -> float:
    """A number over zero."""
    return _over_zero(text, "a number over zero")


def _over_zero(text: str, wanted: str) -> float:
    value = number(text)
    if value <= 0:
        raise ArgumentTypeError(f"{text!r} is not {wanted}")
    return value


def rate(text: str) -> float:
    """Samples per second, over zero."""
    value = number(text)
    if value <= 0:
        raise ArgumentTypeError(f"{text!r} is not a number of samples per second over zero")
    return value


def process(text: str) -> tuple[int, int, str]:
    """`i/n@host:port` as the number of a process, how many there are, and the address of the
    first.
    """
    place, _, address = text.partition("@")
    index, _, total = place.partition("/")
    host, _, port = address.rpartition(":")
    numbers = all(part.isdecimal() for part in (index, total, port))
    if not (numbers and host and int(index) < int(total)):
        raise ArgumentTypeError(f"{text!r} is not of the form I/N@HOST:PORT with I from 0 to N-1")
    return int(index), int(total), address


def sizes(text: str) -> tuple[float, float]:
    """`low:high`, or one number for both; shares from over 0 to 1."""
    low, _, high = text.partition(":")
    limits = number(low), number(high or low)
    if not 0 < limits[0] <= limits[1] <= 1:
        raise ArgumentTypeError(f"{text!r} is not LOW:HIGH with 0 < LOW ≤ HIGH ≤ 1")
    return limits


def reading(command: ArgumentParser) -> None:
    """Add the options that say how to read a file."""
    group = _columns(command)
    group.add_argument(
        "--period",
        type=factors,
        default={},
        metavar="position=NUMBER",
        help="the position is counted modulo this, before scaling: make it continuous",
    )
    group.add_argument(
        "--rate",
        type=rate,
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


def _columns(command: ArgumentParser):
    """The options that say which columns, in which units."""
    group = command.add_argument_group("how to read the file")
    group.add_argument(
        "--columns",
        type=names,
        default={},
        metavar="ROLE=NAME,…",
        help="for instance force=vir,position=qm",
    )
    group.add_argument(
        "--scale",
        type=factors,
        default={},
        metavar="ROLE=FACTOR,…",
        help="for instance position=0.001",
    )
    group.add_argument(
        "--units",
        type=names,
        default={},
        metavar="force=N,position=m",
        help="after scaling; they name, they do not convert",
    )
    return group


def following(command: ArgumentParser) -> None:
    """Add the options that say how to read a stream."""
    _columns(command)


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
        type=bounds,
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
        type=process,
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
        type=sizes,
        default=(0.02, 0.30),
        metavar="LOW:HIGH",
        help="of the concealed force, in parts of the Coulomb level (default: 0.02:0.3)",
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
