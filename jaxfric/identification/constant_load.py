"""A constant load that friction of each direction has taken up, as of a vertical axis."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..checks import Remark
from ..models import NAMED, name_of
from .uncertainty import COSINES, student_quantile

# The dry friction of guides, seals and gears differs with the direction, by half at most. From a
# third of it on, one direction twice as much as the other, a load is as likely.
SHARE = 1 / 3
NAME = "constant_load"


class Load(NamedTuple):
    """Half the difference of the directions' Coulomb friction, and half their sum, N."""

    load: float
    friction: float


def load(names: tuple[str, ...], alpha: np.ndarray, half: np.ndarray) -> Load | None:
    """The load that would account for what the directions' Coulomb friction differs by.

    `None` where the difference is small or not certain, or both together would drive the axis:
    that no load does.

    **Arguments:** `names` of the affine parameters, their values `alpha` and half intervals, N,
    `(p,)`.
    """
    if not {"coulomb+", "coulomb-"} <= set(names):
        return None
    forward, backward = names.index("coulomb+"), names.index("coulomb-")
    width = 0.5 * float(np.hypot(half[forward], half[backward]))
    mean, apart = (0.5 * float(alpha[forward] + s * alpha[backward]) for s in (1, -1))
    if not (np.isfinite(width) and mean > -width):
        return None
    return Load(apart, mean) if abs(apart) - width > SHARE * (mean + width) else None


def remark(found: Any) -> Remark | None:
    """The sentence about the load of one `Identified`; `None` where there is none."""
    model, unit = found.model, dict(found.model.units)["force"]
    names = found.names[: len(model.term.affine)]
    spread = np.sqrt(np.diagonal(np.asarray(found.covariance)))[: len(names)]
    alpha = np.asarray(model.alpha)
    there = load(names, alpha, student_quantile(0.975, COSINES) * spread)
    if there is None:
        return None
    forward, backward = (alpha[names.index(f"coulomb{sign}")] for sign in "+-")
    name = name_of(model.term)
    other = f"--model symmetric-{name} has" if name in NAMED else "Tied directions + Offset() have"
    values = f"{forward:.4g} and {backward:.4g} {unit}"
    split = f"{there.load:.4g} {unit} beside a friction of {there.friction:.4g} {unit} both ways"
    return Remark(
        NAME,
        f"coulomb+ and coulomb- are {values}: a constant load, as of a weight ({split}), or "
        f"friction that differs by direction. {other} the load as offset.",
        False,
    )


def twice(hidden: Sequence[str]) -> str:
    """Why a load is not determined beside friction of each direction, where it is that alone."""
    if set(hidden) != {"offset", "coulomb+", "coulomb-"}:
        return ""
    return (
        "No motion tells offset from coulomb+ and coulomb-, half of whose difference is such a "
        "force: leave Offset() out, or tie the directions (symmetric-gaussian has an offset)."
    )
