"""What an export gives: the text, and what its form costs."""

from typing import NamedTuple

from ..models import Model


class ForceError(NamedTuple):
    """How far the force of the target's form lies from the model's.

    - `rms`: root mean square over the ranges, in `unit`; every speed and place counts alike.
    - `relative`: `rms` over the root mean square of the model's own force there.
    - `worst`: the largest difference, in `unit`.
    - `unit`: of the force.
    """

    rms: float
    relative: float
    worst: float
    unit: str


def exact(model: Model) -> ForceError:
    """No cost: the form holds all that it takes of a model in full."""
    return ForceError(0.0, 0.0, 0.0, dict(model.units)["force"])


class Exported(NamedTuple):
    """A model handed over.

    - `text`: the content of the file.
    - `force_error`: what the target's form costs; zero where it holds the model in full.
    - `left_out`: the terms that the target lacks, with their share in the error.
    - `remarks`: what the reader of the file should know.
    - `speed`: the range (lowest, highest) of the speed that the error is counted over, or `None`
      where the form is exact at every speed.
    - `data`: the content of the file where that is no text: the archive of an FMU.
    """

    text: str
    force_error: ForceError
    left_out: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    speed: tuple[float, float] | None = None
    data: bytes | None = None

    @property
    def content(self) -> bytes:
        """The content of the file."""
        return self.text.encode() if self.data is None else self.data
