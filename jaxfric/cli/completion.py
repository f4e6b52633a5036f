"""Completion in a shell: the script that `jaxfric --print-completion SHELL` prints, by shtab."""

from argparse import Action, ArgumentParser, Namespace, _SubParsersAction
from collections.abc import Iterator

from . import options

SHELLS = ("bash", "zsh", "tcsh")


class Completion(Action):
    """Prints the script and ends; shtab and the names of models are imported only here."""

    def __call__(self, parser, namespace: Namespace, values, option_string=None):
        try:
            import shtab
        except ImportError:
            message = 'completion needs shtab: pip install "jaxfric[completion]"'
            parser.error(message)
        _prepare(parser, shtab.FILE)
        print(shtab.complete(parser, shell=values))
        parser.exit()


def _prepare(parser: ArgumentParser, files) -> None:
    """Say of each argument what stands for it: files, or the names that there are."""
    from ..models import names
    from ..terms.effects import EFFECTS

    known = {"model": names(), "name": tuple(EFFECTS)}
    for command, action in _actions(parser):
        if command == "identify" and action.dest == "model":
            action.choices = (*names(), "best")
        elif command in ("fleet", "watch", "effects") and action.dest in known:
            action.choices = known[action.dest]
        elif action.dest in (*options.READ, *options.WRITTEN, "patterns"):
            action.complete = files  # type: ignore[attr-defined]


def _actions(parser: ArgumentParser) -> Iterator[tuple[str, Action]]:
    """Each argument with the command that it belongs to."""
    for outer in parser._actions:
        if isinstance(outer, _SubParsersAction):
            for name, command in outer.choices.items():
                yield from ((name, action) for action in command._actions)
