"""What is wrong with a recording or a fit, each fault with its name, its number and the remedy."""

from .fitted import (
    LEFT as LEFT,
    MATTERS as MATTERS,
    Design as Design,
    Estimated as Estimated,
    Lateness as Lateness,
    fitted as fitted,
    lateness as lateness,
)
from .kinds import (
    KINDS as KINDS,
    NAMES as NAMES,
    Remark as Remark,
    none as none,
    places as places,
    remarks as remarks,
)
from .lone import LONE as LONE, lone as lone
from .recorded import recorded as recorded
from .structure import hides as hides


def cut(share: float) -> tuple[Remark, ...]:
    """That only a share of a recording's samples is fitted, where it is below one."""
    return () if share >= 1 else remarks(places({"excerpt": share}), {})


def inspect(recording) -> tuple[Remark, ...]:
    """The remarks on a recording itself, whatever model is fitted; signals of shape `(N,)`."""
    return remarks(recorded(recording), recording.unit_names)
