"""What the command prints for a person, and the message of an error. Imports nothing heavy."""

import os
from typing import TextIO

from ..data.printable import printable


def say(text: str, end: str = "\n", file: TextIO | None = None) -> None:
    """Print lines for a person, in which nothing from outside steers the terminal."""
    print(printable(text, keep="\n"), end=end, file=file)


def message(error: BaseException) -> str:
    """What an error says, in one line, with the file's name where the system reports one."""
    if isinstance(error, OSError) and error.filename is not None:
        return printable(f"{os.fsdecode(error.filename)}: {error.strerror or error}")
    return printable(str(error) or type(error).__name__)
