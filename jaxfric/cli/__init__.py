"""The command `jaxfric`: the only place that parses arguments, prints, and switches on float64.

Nothing heavy is imported before a command runs, so that `jaxfric --help` answers at once.
"""

import argparse
import gc
import os
import re
import shlex
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from io import TextIOWrapper

from . import options
from .completion import SHELLS, Completion
from .examples import EXAMPLES


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; returns the exit status: 0 done, 2 bad input or usage."""
    given = sys.argv[1:] if argv is None else list(argv)
    arguments = _parser().parse_args(given)
    arguments.typed = shlex.join(["jaxfric", *given])
    name = f"jaxfric {arguments.command}"
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # what its encoding lacks is no reason to fail
            stream.reconfigure(errors="backslashreplace")
    try:
        options.check_outputs(arguments)
        gc.disable()  # importing makes much and throws nothing away: a tenth of its time
        _configure()
        status = arguments.run(arguments)
        sys.stdout.flush()
        return status
    except BrokenPipeError:  # the reader, `head` for one, has seen enough
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 - Python flushes it at exit
        return 0
    except (ValueError, OSError) as error:
        print(f"{name}: {options.message(error)}", file=sys.stderr)
        return 2
    except MemoryError:
        print(f"{name}: out of memory; split the file or identify fewer samples.", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        return 130


def _configure() -> None:
    """float64, and jax's cache of compiled programs in the user's cache folder."""
    # Explaining multiplies many small matrices, where several threads wait more than they work.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    import jax

    from ..programs import use_cache

    jax.config.update("jax_enable_x64", True)
    use_cache()
    # A folder that cannot be written, an entry of a process that was killed: the program is
    # compiled anew, and the user need not hear of it.
    warnings.filterwarnings("ignore", "Error (reading|writing) persistent compilation cache")


class _Parser(argparse.ArgumentParser):
    """A parser whose complaint is one line, as every other message of the command."""

    def error(self, message: str):
        said = f"{self.prog}: {options.printable(message)}.{self._meant(message)}"
        self.exit(2, f"{said} (see {self.prog} --help)\n")

    def _meant(self, message: str) -> str:
        """What the user may have meant by an option or a choice that there is not."""
        if choice := re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message):
            return options.meant(choice[1], re.findall(r"[\w.-]+", choice[2]))
        if unknown := re.search(r"unrecognized arguments: (?:.* )?(--[\w-]+)", message):
            known = [*self._option_string_actions]
            for action in self._actions:
                if isinstance(action, argparse._SubParsersAction) and action.choices:
                    for command in action.choices.values():
                        known += command._option_string_actions
            return options.meant(unknown[1], known)
        return ""


class _Version(argparse.Action):
    """Prints the version, which takes time to look up and so is looked up only when asked for."""

    def __call__(self, parser, namespace, values, option_string=None):
        from importlib.metadata import PackageNotFoundError, version

        try:
            print(f"jaxfric {version('jaxfric')}")
        except PackageNotFoundError:
            print("jaxfric, not installed: run from its source")
        parser.exit()


def _lazily(place: str) -> Callable[[argparse.Namespace], int]:
    """A function of this package, `module.name`, imported when it is called."""
    module, _, name = place.partition(".")

    def run(arguments):
        function = getattr(import_module(f".{module}", __name__), name)
        # What was imported stays: from here on the collector need not look at it.
        gc.freeze()
        gc.enable()
        return function(arguments)

    return run


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="jaxfric",
        description="Friction of drive axes, identified without mass and without acceleration, and "
        "what a model leaves out of a recording.",
        epilog="JAXFRIC_CACHE: folder for compiled programs, or off.",
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="print the version")
    parser.add_argument(
        "--print-completion",
        action=Completion,
        choices=SHELLS,
        metavar="SHELL",
        help="print what makes bash, zsh or tcsh complete commands, options and names "
        '(extra: completion); in ~/.bashrc: eval "$(jaxfric --print-completion bash)"',
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for add in (
        _add_demo,
        _add_identify,
        _add_explain,
        _add_predict,
        _add_simulate,
        _add_export,
        _add_models,
        _add_effects,
        _add_fleet,
        _add_prove,
        _add_design,
        _add_select,
        _add_watch,
        _add_presliding,
    ):
        add(commands)
    return parser


def _add(commands, name: str, run: str, text: str) -> argparse.ArgumentParser:
    command = commands.add_parser(
        name,
        help=text,
        description=text,
        allow_abbrev=False,
        epilog=EXAMPLES[name],
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.set_defaults(run=_lazily(run))
    return command


def _add_demo(commands) -> None:
    command = _add(
        commands,
        "demo",
        "demo.run",
        "a machine with something concealed: recorded, identified, explained",
    )
    command.add_argument(
        "--out", default="jaxfric-demo", metavar="FOLDER", help="what it writes goes here"
    )


def _add_identify(commands) -> None:
    command = _add(commands, "identify", "commands.identify", "friction of one or many recordings")
    command.add_argument("files", nargs="+", metavar="FILE", help="CSV, Parquet, .mat or .npz")
    command.add_argument(
        "--model",
        default="gaussian",
        metavar="NAME",
        help="a name that jaxfric models lists, or best: held-out data choose (default: gaussian)",
    )
    options.identifying(command)
    command.add_argument(
        "--json", type=options.output, metavar="OUT", help="write the identification; - prints it"
    )
    command.add_argument(
        "--save", type=options.output, metavar="MODEL.json", help="write the identified model"
    )
    command.add_argument(
        "--plot", type=options.picture, metavar="OUT.png", help="draw it (extra: report)"
    )
    options.reading(command)


def _add_explain(commands) -> None:
    command = _add(commands, "explain", "explain.run", "what a model leaves out of a recording")
    command.add_argument("file", metavar="FILE", help="CSV, Parquet, .mat, .npz, or a bag")
    base = command.add_mutually_exclusive_group()
    base.add_argument(
        "--baseline",
        metavar="NAME_OR_FILE",
        help="a name that jaxfric models lists; a saved model, MODEL.json; or an earlier recording "
        "of this machine: what changed (default: gaussian; with --columns known_force=NAME your "
        "simulator's force, as it is)",
    )
    base.add_argument(
        "--simulation",
        metavar="FILE",
        help="instead: your own simulator's force along the recorded motion, sample by sample, "
        "which stands as it is; or its run of the same reference, which a model is fitted to",
    )
    base.add_argument(
        "--mujoco",
        "--urdf",
        metavar="MODEL.xml",
        help="instead: a MuJoCo model or a URDF, whose force along the recorded motion is "
        "computed, for all its joints that the log has (extra: mujoco)",
    )
    command.add_argument(
        "--joint",
        metavar="NAME",
        help="one joint of the model of --mujoco; --columns NAME_position=COLUMN,NAME_force=COLUMN "
        "where names do not speak for themselves",
    )
    command.add_argument(
        "--simulation-holdout",
        metavar="FILE",
        help="your simulator's force along the motion of --holdout",
    )
    command.add_argument("--holdout", metavar="FILE", help="a recording that is only judged on")
    command.add_argument(
        "--other-scale",
        type=options.factors,
        default={},
        metavar="ROLE=FACTOR,…",
        help="as --scale, for the file of --holdout or --simulation where its units differ",
    )
    command.add_argument(
        "--fixed",
        action="store_true",
        help="keep a saved model's parameters, unless they are found wrong, instead of refitting",
    )
    command.add_argument(
        "--pole-pairs",
        type=options.count,
        metavar="N",
        help="of the motor whose angle the position is: periods are told per pole pair too",
    )
    command.add_argument(
        "--simulate", action="store_true", help="run the models forward too, before and after"
    )
    command.add_argument(
        "--json", type=options.output, metavar="OUT", help="write the explanation; - prints it"
    )
    command.add_argument(
        "--report", type=options.output, metavar="OUT.html", help="write a page (extra: report)"
    )
    command.add_argument(
        "--save",
        type=options.output,
        metavar="MODEL",
        help="write the improved model (.json); with --mujoco the simulator's own file, put right "
        "(.xml), and what it has no attribute for as Python beside it",
    )
    options.reading(command)


def _add_predict(commands) -> None:
    command = _add(
        commands, "predict", "commands.predict", "the force that a recorded motion needs"
    )
    command.add_argument("model", metavar="MODEL.json")
    command.add_argument("file", metavar="FILE", help="the recording")
    command.add_argument("-o", "--out", type=options.table, required=True, metavar="OUT.csv")
    options.reading(command)


def _add_simulate(commands) -> None:
    command = _add(commands, "simulate", "simulate.run", "run a model forward, with stick and slip")
    command.add_argument("model", metavar="MODEL.json")
    command.add_argument("file", metavar="REFERENCE.csv", help="set-point, or force, over time")
    command.add_argument("-o", "--out", type=options.table, required=True, metavar="OUT.csv")
    command.add_argument(
        "--controller",
        type=options.controller,
        metavar="KIND:GAIN=VALUE,…",
        help="pd:kp=,kd= | pid:kp=,ki=,kd= | cascade:kp=,kv= (each also limit=); "
        "without one the force column drives",
    )
    command.add_argument(
        "--compensate",
        nargs="?",
        const="",
        metavar="DRIVE.json",
        help="add feed-forward by the model that the drive has (default: by the machine's own), "
        "and say how much tracking error and controller force that removes",
    )
    command.add_argument(
        "--json", type=options.output, metavar="OUT", help="write that benefit; - prints it"
    )
    options.reading(command)


def _add_export(commands) -> None:
    command = _add(commands, "export", "export.run", "hand a model over to another program")
    command.add_argument("model", metavar="MODEL.json")
    command.add_argument(
        "--to",
        required=True,
        choices=("c", "st", "modelica", "fmu", "mujoco", "urdf", "table"),
        help="target",
    )
    command.add_argument(
        "-o", "--out", type=options.output, default="-", metavar="OUT", help="default: printed"
    )
    command.add_argument("--name", default="axis", help="of functions, block or joint")
    command.add_argument(
        "--speed",
        type=options.span,
        metavar="LOW:HIGH",
        help="range that mujoco, urdf and table are fitted to and judged over "
        "(default: from rest to where friction has doubled or its bump is over)",
    )
    command.add_argument(
        "--position",
        type=options.span,
        metavar="LOW:HIGH",
        help="likewise (default: a period of every wave)",
    )
    command.add_argument(
        "--reference",
        metavar="FILE",
        help="a set-point over time (column reference or position): say how much tracking error "
        "and controller force feed-forward by the model would remove along it",
    )
    options.reading(command)


def _add_models(commands) -> None:
    _add(commands, "models", "commands.models", "the friction models, with their equations")


def _add_effects(commands) -> None:
    command = _add(commands, "effects", "effects.run", "the physics that a model can leave out")
    command.add_argument("name", nargs="?", metavar="NAME", help="one of them, with parameters")
    command.add_argument(
        "--json",
        type=options.output,
        nargs="?",
        const="-",
        metavar="OUT",
        help="as JSON, printed or written",
    )


def _add_fleet(commands) -> None:
    command = _add(commands, "fleet", "fleet.run", "many recordings, streamed, resumable")
    options.gathering(command)
    options.identifying(command)
    options.reading(command)


def _add_prove(commands) -> None:
    options.proving(_add(commands, "prove", "prove.run", "the concealed-effect benchmark"))


def _add_design(commands) -> None:
    command = _add(commands, "design", "design.run", "the motion to record next")
    command.add_argument(
        "model", metavar="MODEL.json", help="a model; or an explanation, whose rivals to separate"
    )
    options.designing(command)
    command.add_argument("-o", "--out", type=options.table, required=True, metavar="OUT.csv")
    command.add_argument(
        "--json", type=options.output, metavar="OUT", help="write the prediction; - prints it"
    )


def _add_select(commands) -> None:
    command = _add(
        commands, "select", "commands.selection", "which friction model a recording supports"
    )
    command.add_argument("files", nargs="+", metavar="FILE", help="CSV, Parquet, .mat or .npz")
    command.add_argument(
        "--json", type=options.output, metavar="OUT", help="write the standings; - prints them"
    )
    options.reading(command)


def _add_watch(commands) -> None:
    command = _add(commands, "watch", "watch.run", "parameters and changes as data arrive")
    command.add_argument("file", metavar="FILE", help="a CSV that grows, or - for standard input")
    options.watching(command)
    options.following(command)


def _add_presliding(commands) -> None:
    command = _add(
        commands, "presliding", "presliding.run", "bristles (Dahl, LuGre) in place of a jump"
    )
    command.add_argument("file", metavar="FILE", help="a recording with a position")
    command.add_argument(
        "--model",
        default="coulomb-viscous",
        metavar="NAME_OR_FILE",
        help="the friction that they bend, and all else: a name that jaxfric models lists, or a "
        "saved model, whose parameters are refitted (default: coulomb-viscous)",
    )
    command.add_argument(
        "--json", type=options.output, metavar="OUT", help="write what was found; - prints it"
    )
    command.add_argument(
        "--save", type=options.output, metavar="MODEL.json", help="write the model with bristles"
    )
    options.reading(command)
