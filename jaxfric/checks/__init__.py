"""What is wrong with a recording or a fit, each fault with its name, its number and the remedy."""

from .design import LINEARITY as LINEARITY, MATTERS as MATTERS, Design as Design
from .fitted import (
    LARGE as LARGE,
    LEFT as LEFT,
    Estimated as Estimated,
    fitted as fitted,
    suspects as suspects,
)
from .kinds import (
    KINDS as KINDS,
    NAMES as NAMES,
    Remark as Remark,
    none as none,
    places as places,
    remarks as remarks,
)
from .lateness import Lateness as Lateness, lateness as lateness, looks as looks
from .misfit import Misfit as Misfit, misfit as misfit
from .named import NO_STRIBECK as NO_STRIBECK, is_bump as is_bump, passive as passive
from .recorded import recorded as recorded, recorded_rows as recorded_rows
from .structure import hides as hides


def cut(share: float) -> tuple[Remark, ...]:
    """That only a share of a recording's samples is fitted, where it is below one."""
    return () if share >= 1 else remarks(places({"excerpt": share}), {})


def inspect(recording) -> tuple[Remark, ...]:
    """The remarks on a recording itself, whatever model is fitted; signals of shape `(N,)`."""
    return remarks(recorded(recording), recording.unit_names)
