"""The arguments of every command."""

import argparse

from . import options, values
from .parser import add, parser


def whole() -> argparse.ArgumentParser:
    """The parser with all commands."""
    made, commands = parser()
    for each in (
        _add_demo, _add_identify, _add_explain, _add_predict, _add_simulate, _add_export,
        _add_models, _add_effects, _add_fleet, _add_prove, _add_design, _add_select, _add_watch,
        _add_presliding,
    ):  # fmt: skip
        each(commands)
    return made


def _add_demo(commands) -> None:
    command = add(
        commands,
        "demo",
        "demo.run",
        "a machine with something concealed: recorded, identified, explained",
    )
    command.add_argument(
        "--out", default="jaxfric-demo", metavar="FOLDER", help="what it writes goes here"
    )


def _add_identify(commands) -> None:
    command = add(commands, "identify", "commands.identify", "friction of one or many recordings")
    options.recordings(command)
    command.add_argument(
        "--model",
        default="gaussian",
        metavar="NAME",
        help="a name that jaxfric models lists, or best: held-out data choose (default: gaussian)",
    )
    options.identifying(command)
    command.add_argument(
        "--align",
        action="store_true",
        help="find by how much the force acts after its time stamp, and take it into account",
    )
    options.document(command, "the identification")
    command.add_argument(
        "--save", type=values.output, metavar="MODEL.json", help="write the identified model"
    )
    command.add_argument(
        "--plot", type=values.picture, metavar="OUT.png", help="draw it (extra: report)"
    )
    options.reading(command)


def _add_explain(commands) -> None:
    command = add(commands, "explain", "explain.run", "what a model leaves out of a recording")
    command.add_argument("file", metavar="FILE", help="CSV, Parquet, .mat, .npz, or a bag")
    _add_baseline(command)
    command.add_argument("--holdout", metavar="FILE", help="a recording for validation only")
    command.add_argument(
        "--other-scale",
        type=values.factors,
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
        type=values.count,
        metavar="N",
        help="of the motor whose angle the position is: periods are told per pole pair too",
    )
    command.add_argument(
        "--simulate", action="store_true", help="run the models forward too, before and after"
    )
    options.document(command, "the explanation")
    command.add_argument(
        "--report", type=values.output, metavar="OUT.html", help="write a page (extra: report)"
    )
    command.add_argument(
        "--save",
        type=values.output,
        metavar="MODEL",
        help="write the improved model (.json); with --mujoco the simulator's own file, put right "
        "(.xml), and what it has no attribute for as Python beside it",
    )
    options.reading(command)


def _add_baseline(command) -> None:
    """What `explain` compares with."""
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
        "which stands as it is (time and force will do, with the log's time stamps); or its run of "
        "the same reference, which a model is fitted to",
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
        "where names do not speak for themselves; NAME_command=COLUMN where the log holds what the "
        "joint's actuator was told (MuJoCo's ctrl)",
    )
    command.add_argument(
        "--simulation-holdout",
        metavar="FILE",
        help="your simulator's force along the motion of --holdout",
    )


def _add_predict(commands) -> None:
    command = add(commands, "predict", "commands.predict", "the force that a recorded motion needs")
    command.add_argument("model", metavar="MODEL.json")
    command.add_argument("file", metavar="FILE", help="the recording")
    options.table(command)
    options.reading(command)


def _add_simulate(commands) -> None:
    command = add(commands, "simulate", "simulate.run", "run a model forward, with stick and slip")
    command.add_argument("model", metavar="MODEL.json")
    command.add_argument("file", metavar="REFERENCE.csv", help="set-point, or force, over time")
    options.table(command)
    command.add_argument(
        "--controller",
        type=values.controller,
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
    options.document(command, "that benefit")
    options.reading(command)


def _add_export(commands) -> None:
    command = add(commands, "export", "export.run", "hand a model over to another program")
    command.add_argument("model", metavar="MODEL.json")
    command.add_argument(
        "--to",
        required=True,
        choices=("c", "st", "modelica", "fmu", "mujoco", "urdf", "table"),
        help="target",
    )
    command.add_argument(
        "-o", "--out", type=values.output, default="-", metavar="OUT", help="default: printed"
    )
    command.add_argument("--name", default="axis", help="of functions, block or joint")
    command.add_argument(
        "--speed",
        type=values.span,
        metavar="LOW:HIGH",
        help="range that mujoco, urdf and table are fitted to and judged over "
        "(default: from rest to where friction has doubled or its bump is over)",
    )
    command.add_argument(
        "--position",
        type=values.span,
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
    add(commands, "models", "commands.models", "the friction models, with their equations")


def _add_effects(commands) -> None:
    command = add(commands, "effects", "effects.run", "the physics that a model can leave out")
    command.add_argument("name", nargs="?", metavar="NAME", help="one of them, with parameters")
    command.add_argument(
        "--json",
        type=values.output,
        nargs="?",
        const="-",
        metavar="OUT",
        help="as JSON, printed or written",
    )


def _add_fleet(commands) -> None:
    command = add(commands, "fleet", "fleet.run", "many recordings, streamed, resumable")
    options.gathering(command)
    options.identifying(command)
    options.reading(command)


def _add_prove(commands) -> None:
    options.proving(add(commands, "prove", "prove.run", "the concealed-effect benchmark"))


def _add_design(commands) -> None:
    command = add(commands, "design", "design.run", "the motion to record next")
    command.add_argument(
        "model", metavar="MODEL.json", help="a model; or an explanation, whose rivals to separate"
    )
    options.designing(command)
    options.table(command)
    options.document(command, "the prediction")


def _add_select(commands) -> None:
    command = add(
        commands, "select", "commands.selection", "which friction model a recording supports"
    )
    options.recordings(command)
    options.document(command, "the standings", "them")
    options.reading(command)


def _add_watch(commands) -> None:
    command = add(commands, "watch", "watch.run", "parameters and changes as data arrive")
    command.add_argument("file", metavar="FILE", help="a CSV that grows, or - for standard input")
    options.watching(command)
    options.columns(command)


def _add_presliding(commands) -> None:
    command = add(
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
    options.document(command, "what was found")
    command.add_argument(
        "--save", type=values.output, metavar="MODEL.json", help="write the model with bristles"
    )
    options.reading(command)
