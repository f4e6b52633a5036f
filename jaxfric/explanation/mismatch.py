"""Which of a baseline's own values are wrong on a recording, and what else would do as well."""

from typing import NamedTuple

import numpy as np

from ..models import Model
from . import parameters as spelled
from .acceptance import LEAST_OF_BASE, LEAST_SHARE, LINEARITY, MOST, OF_BASE
from .baseline import as_given, at_values
from .evidence import Evidence
from .fewest import MOST_WRONG, SURE, fewest
from .least_squares import orthonormal, solve
from .predictions import with_predictions
from .problem import PERSISTS
from .regression import Fit, fit, freed
from .significance import LEVEL, BlockBootstrap, blocks


class Mismatch(NamedTuple):
    """Parameters whose values are wrong, and what that costs.

    `moved`: number of each parameter among affine and nonlinear ones, with its value before;
    `share`: part of the baseline's mean-square residual that the right values remove, beside the
    terms found; `p_value`; `energy`: of the residual before, N²; `rivals`: effects that take as
    much with no more numbers, with none of these values wrong; `within`: numbers of those that move
    with the others, by no more than is uncertain; `instead`: to each that moved, what would do as
    well; `factor`: that of all affine values, where it says what moved by one number, but for those
    that were `unknown` before, and whether one of `friction` alone does as well.
    """

    moved: dict[int, float]
    share: float
    p_value: float
    energy: float
    within: frozenset[int] = frozenset()
    instead: dict[int, tuple[int, ...]] = {}  # noqa: RUF012 - a NamedTuple's default, never changed
    rivals: tuple[str, ...] = ()
    factor: float | None = None
    unknown: tuple[int, ...] = ()
    friction: bool = False

    @property
    def numbers(self) -> int:
        """How many numbers are other ones."""
        return len(self.moved) if self.factor is None else 1


def mismatch(
    model: Model, refitted: Fit, evidence: Evidence, wide: Evidence | None = None, seed: int = 0,
    recorded: int = 1,
) -> Mismatch | None:  # fmt: skip
    """Which of a model's values are wrong on a recording; `None` if none is.

    `refitted`: with all values free, beside the terms found: values and missing physics are tested
    together. The refitted parameters differ from the given ones (all of them together at 1 %) and
    take enough of the residual, and of the baseline's: below a hundredth of its amplitude no term
    is known to follow its law, and beside laws, which have not quite the shape of their effect, as
    much is needed as of a later term. Of those the fewest are moved that leave no more than all of
    them do, but for what no sensor of force resolves. `wide`: rows through a kernel of twice the
    width, which have to show them too; `recorded`: in how many recordings, 2 where the values are
    of an earlier one, each by its own sensor of force.
    """
    given, first = as_given(model, refitted, evidence), at_values(model, evidence).energy
    residual, own, beside = apart(model, refitted, evidence)
    gained = given.energy - refitted.energy
    least = max(LEAST_SHARE * given.energy, LEAST_OF_BASE * first)
    if len(refitted.terms) > 1:
        least = max(least, min(OF_BASE * first, MOST * given.energy))
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    raw = (own / np.maximum(np.abs(own).max(axis=0), 1e-300)).T[None]
    empty = given._replace(columns=beside, slopes=np.zeros((len(own), 0)))
    scan = BlockBootstrap(empty, block, seed)(raw.astype(np.float32))
    p_value = float((1 + np.sum(scan.drawn >= scan.gain[0])) / (1 + len(scan.drawn)))
    if not gained > least or p_value > LEVEL:
        return None
    before = [*given.alphas[0], *given.betas[0]]
    enough = recorded * LINEARITY**2 * float(evidence.force @ evidence.force)
    free = fewest(own, residual, block, enough)
    if free and wide is not None and len(free) <= MOST_WRONG:
        free = _lasting(model, refitted, wide, free, solve(own[:, free], residual))
    if not free:
        return None
    free = _different(model, refitted, evidence, block, free)
    instead = _instead(own, residual, block, free, enough)
    if vague := [i for i, others in instead.items() if len(others) > VAGUE * own.shape[1]]:
        free = [i for i in free if i not in vague] or free
        instead = _instead(own, residual, block, free, enough)
    moved = {i: before[i] for i in sorted(free)}
    return Mismatch(moved, float(gained / first), p_value, given.energy, instead=instead)


def apart(
    model: Model, refitted: Fit, evidence: Evidence
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The residual at the values as given, and the parameters' columns and derivatives, both apart
    from those of all other terms, whose orthonormal basis is the last.

    The other terms have the shapes that they have beside the refitted values: the derivatives are
    of that place. Beside values that are wrong they would take other shapes, to make up for these.
    """
    given = as_given(model, refitted, evidence, iterations=0)
    count, counts = len(given.alphas[0]), len(given.betas[0])
    affine, slopes = refitted.columns, refitted.slopes
    own = np.concatenate([affine[:, :count], slopes[:, :counts]], axis=1)
    beside = orthonormal(np.concatenate([affine[:, count:], slopes[:, counts:]], axis=1))
    residual = given.residual - beside @ (beside.T @ given.residual)
    return residual, own - beside @ (beside.T @ own), beside


def _lasting(
    model: Model, refitted: Fit, wide: Evidence, free: list[int], shifts: np.ndarray
) -> list[int]:
    """The wrong values that rows through a kernel of twice the width show as well, and not much
    smaller: the noise of the acceleration, which shifts an inertia, is much weaker there.
    """
    there = fit(refitted.terms, with_predictions(wide, refitted), refitted.betas, 0)
    residual, own, _ = apart(model, there, wide)
    again = solve(own[:, free], residual)
    return [i for i, one, two in zip(free, shifts, again, strict=True)
            if two * np.sign(one) >= PERSISTS * abs(one)]  # fmt: skip


# What half of all parameters would do as well says nothing of any of them.
VAGUE = 0.5


def _different(
    model: Model, refitted: Fit, evidence: Evidence, block: np.ndarray, free: list[int]
) -> list[int]:
    """The wrong values without those that, fitted with the rest, are what they were.

    What a law of the missing physics takes of a value is known once both are fitted together.
    """
    names = [p.name for p in (*model.term.affine, *model.term.nonlinear)]
    units = dict(model.units)
    while 1 < len(free) <= MOST_WRONG:
        current = as_given(model, refitted, evidence, tuple(free))
        values = spelled.estimates(freed(current, free), block, units)[0]
        before = [*model.alpha, *model.term.beta()]
        away = {
            i: abs(float(values[names[i]].value) - float(before[i]))
            / float(spelled.tested(values[names[i]]).half_width())
            for i in free
        }
        least = min(away, key=lambda i: away[i])
        if away[least] > 1:
            break
        free = [i for i in free if i != least]
    return free


def _instead(
    own: np.ndarray, residual: np.ndarray, block: np.ndarray, free: list[int], enough: float
) -> dict[int, tuple[int, ...]]:
    """Columns that would do as well instead of one of those that are free."""
    found: dict[int, tuple[int, ...]] = {}
    size = np.linalg.norm(own, axis=0)
    others = [j for j in range(own.shape[1]) if j not in free and size[j] > 0]
    noise = residual - own[:, free] @ solve(own[:, free], residual)
    if len(free) > MOST_WRONG:
        return found
    for i in free:
        rest = orthonormal(own[:, [j for j in free if j != i]])
        alike = []
        for j in others:
            basis = orthonormal(own[:, [j]], rest)
            basis = np.concatenate([rest, basis], axis=1)
            lone = own[:, i] - basis @ (basis.T @ own[:, i])
            lone = lone / max(float(np.linalg.norm(lone)), 1e-300)
            part = float(lone @ residual)
            spread = np.bincount(block, lone * noise, int(block[-1]) + 1)
            if abs(part) <= SURE * float(np.linalg.norm(spread)) or part**2 < enough:
                alike.append(j)
        if alike:
            found[i] = tuple(alike)
    return found
