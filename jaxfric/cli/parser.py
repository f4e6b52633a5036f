"""The parser of the command: a parser for each of its commands, and what they have in common."""

import argparse
import gc
import re
from collections.abc import Callable
from importlib import import_module

from ..data.nearest import meant
from ..data.printable import printable
from .completion import SHELLS, Completion
from .examples import EXAMPLES


class _Parser(argparse.ArgumentParser):
    """A parser whose complaint is one line, as every other message of the command."""

    def error(self, message: str):
        said = f"{self.prog}: {printable(message)}.{self._meant(message)}"
        self.exit(2, f"{said} (see {self.prog} --help)\n")

    def _meant(self, message: str) -> str:
        """What the user may have meant by an option or a choice that there is not."""
        if choice := re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)", message):
            return meant(choice[1], re.findall(r"[\w.-]+", choice[2]))
        if unknown := re.search(r"unrecognized arguments: (?:.* )?(--[\w-]+)", message):
            known = [*self._option_string_actions]
            for action in self._actions:
                if isinstance(action, argparse._SubParsersAction) and action.choices:
                    for command in action.choices.values():
                        known += command._option_string_actions
            return meant(unknown[1], known)
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
        function = getattr(import_module(f".{module}", __package__), name)
        # What was imported stays: from here on the collector need not look at it.
        gc.freeze()
        gc.enable()
        return function(arguments)

    return run


def parser() -> tuple[argparse.ArgumentParser, argparse._SubParsersAction]:
    """The parser, and the commands that are added to it."""
    whole = _Parser(
        prog="jaxfric",
        description="Friction of drive axes, identified without mass and without acceleration, and "
        "what a model leaves out of a recording.",
        epilog="JAXFRIC_CACHE: folder for compiled programs, or off.",
    )
    whole.add_argument("--version", action=_Version, nargs=0, help="print the version")
    whole.add_argument(
        "--print-completion",
        action=Completion,
        choices=SHELLS,
        metavar="SHELL",
        help="print what makes bash, zsh or tcsh complete commands, options and names "
        '(extra: completion); in ~/.bashrc: eval "$(jaxfric --print-completion bash)"',
    )
    commands = whole.add_subparsers(dest="command", required=True, metavar="COMMAND")
    return whole, commands


def add(commands, name: str, run: str, text: str) -> argparse.ArgumentParser:
    """A command of that name, which runs the function `module.name` of this package."""
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
