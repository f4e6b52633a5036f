"""A hard limit of force in a log of commands, by a baseline that is fitted to it.

The motion knows nothing of what the command asks for beyond the limit, so that no term of a model
can say it. The limit is found, the command is cut off there, and all else is looked for in what
arrived.
"""

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from ...identification.uncertainty import Estimate
from ...models import Model
from ...terms.effects.force_limit import FORCE_LIMIT
from .. import parameters as spelled, verification
from ..baseline import at_values
from ..evidence import FEWEST_ROWS, Evidence, gather
from ..explained import Explanation
from ..figures import Figures
from ..finding import Finding
from ..motion import Motion
from ..nodes import NODES
from ..predictions import with_predictions
from ..problem import Problem, with_holdout
from ..quantities import quantity
from ..regression import Fit, fit
from ..significance import FEWEST
from . import limits
from .preceding import p_value, with_preceding

# A cut that takes less than a fifth of the mismatch is none: further fits are saved.
SUSPECT = 0.8
# Of the mean-square mismatch beyond the level, what there may be below, a third in amplitude: what
# arrives obeys the baseline. Cogging in a slow motion is as much below friction's level as above.
BELOW = 0.1
# A machine that is at its limit for most of the time does not do what it is told: the lower part of
# the commands arrives, and the baseline is fitted to it first. Fitted to all of them it would err
# by the excess, too, and could hide it. Where the axis mostly moves at constant speed, that part
# holds friction alone and no inertia: then a quarter as many samples are left out, and so on.
ARRIVES, ROUNDS = 1 - limits.MOST, 3
# Where an eighth of the rows or fewer are beyond a limit, the fit to all of them may move half of
# what it leaves to as many rows below: those beyond then have seven times the power of the others,
# and four times where noise is as large as what is left of those. With less, three fits are spared.
ERRS = 4.0
# A node where the limit is reached holds samples below it too: levels a little higher are tried.
NEAR = tuple(np.linspace(0.99, 1.05, 13))


class Bounded(NamedTuple):
    """A limit of force, N; the part of the mean-square residual that goes with it; the baseline
    beside what arrives; and that of the log as it is, with what it leaves of the force through the
    kernel, on the held-out recording too.
    """

    limit: Estimate
    share: float
    beside: Model
    baseline: Model
    filtered: float
    filtered_held: float | None


def bounded(
    motion: Motion, problem: Problem, given: Model | None, held: Motion | None = None
) -> Bounded | None:
    """The limit of a log of commands, if there is one.

    `given`: the baseline, where it has values; `held`: the held-out recording.

    At the nodes: the force that the motion needs is compared with the command there.
    """
    rows, base = problem.evidence, problem.base
    moving = np.abs(np.asarray(rows.motion.velocity)) > rows.limits.slowest
    moving &= np.arange(len(moving)) < rows.nodes
    command = np.asarray(rows.motion.force, float)[moving]
    speed = np.asarray(rows.motion.velocity, float)[moving]
    size, side = np.abs(command), np.sign(command)
    unit = motion.recording.unit_names["force"]
    limit = None
    for number, begin in enumerate(_levels(size)):
        if number and not _errs_beyond(rows, base, begin):
            continue
        needed = _of_arriving(rows, base, moving, side, size, begin)
        limit = None if needed is None else limits.limit_of(command, side * needed, speed, unit)
        if limit is not None:
            break
    if limit is None:
        return None
    fits = {near: _cut_off(motion, problem, near * float(limit.value)) for near in NEAR}
    near = min(fits, key=lambda each: fits[each].energy)
    limit, current = limit._replace(value=near * limit.value), fits[near]
    if not current.energy < limits.LEAVES_IN_ALL * base.energy:
        return None
    first = base if given is None else at_values(given, rows)
    beside, baseline = (
        spelled.model(each, motion.recording.units, problem.delay) for each in (current, first)
    )
    share = 1 - current.energy / base.energy
    there = None if held is None else with_holdout(problem, held).held
    filtered = [None if each is None else verification.error(first, each) for each in (rows, there)]
    return Bounded(limit, share, beside, baseline, *filtered)


def by_samples(bound: Bounded, commanded: Figures, arrived: Figures, reach: float) -> bool:
    """Whether the limit halves what noise does not make of the error by samples as well, in power.

    Rows hold what slips for a kernel. An axis that creeps against a hard stop does not give way at
    one force: at the samples beside it another force stops it each time. `reach` of the kernel, s.
    """
    noise = arrived.floor(bound.beside, 2 * reach) ** 2
    before = commanded.here(bound.baseline) ** 2 - noise
    return arrived.here(bound.beside) ** 2 - noise < limits.LEAVES_IN_ALL * before


def _levels(size: np.ndarray) -> list[float]:
    """Levels of the command to begin with, N: half of the samples are beyond, an eighth, ..."""
    beyond = ARRIVES ** np.arange(1, 1 + max(1, math.log(FEWEST / len(size), ARRIVES)), 2)
    return list(dict.fromkeys(np.quantile(size, 1 - beyond).tolist()))


def _errs_beyond(rows: Evidence, base: Fit, level: float) -> bool:
    """Whether the baseline errs clearly more in rows whose commands are beyond a level."""
    arrives = np.isin(rows.rows, _below(rows, level).rows)
    power = base.residual**2
    some = 0 < np.count_nonzero(arrives) < len(power)
    return bool(some and power[~arrives].mean() > ERRS * power[arrives].mean())


def _of_arriving(
    rows: Evidence, base: Fit, moving: np.ndarray, side: np.ndarray, size: np.ndarray, level: float
) -> np.ndarray | None:
    """What the motion needs in the command's direction, N, by rows whose commands all arrive, where
    it is one value beyond a level. `level` to begin with.
    """
    for _ in range(ROUNDS):
        below = _below(rows, level)
        if len(below.rows) < FEWEST_ROWS:
            return None
        needed = side * _needed(rows, fit(base.terms, below, base.betas))[moving]
        last = level
        level, left = limits.cut(size, needed)
        if left > SUSPECT:
            return None
        if level == last:
            break
    return needed if _one_level(size, needed, level) else None


def _one_level(size: np.ndarray, needed: np.ndarray, level: float) -> bool:
    """Whether commands below a level arrive, and what is needed beyond it is one value."""
    beyond = size > level
    apart = (size - needed) ** 2
    arrives = np.mean(apart[~beyond]) <= BELOW * np.mean(apart[beyond])
    return bool(arrives and limits.one_value(needed, beyond))


def _cut_off(motion: Motion, problem: Problem, level: float) -> Fit:
    """The baseline fitted to the command cut off at a level, N."""
    arrived = motion.forced(np.clip(np.asarray(motion.recording.force), -level, level))
    rows = gather(arrived, problem.evidence.width, problem.delay)
    return fit(problem.base.terms, rows, problem.base.betas)


def _below(evidence: Evidence, level: float) -> Evidence:
    """The rows that hold no command beyond a level, N."""
    size = np.abs(np.asarray(evidence.motion.force, float))
    around = np.lib.stride_tricks.sliding_window_view(np.pad(size, NODES), 2 * NODES + 1)
    keep = around.max(axis=1)[evidence.centre] <= level
    return evidence.only(keep)


def _needed(evidence: Evidence, current: Fit) -> np.ndarray:
    seen = with_predictions(evidence, current)
    return np.asarray(seen.motion.channels["predicted_force"], float)


def with_limit(found: Explanation, bound: Bounded, commanded: Figures) -> Explanation:
    """An explanation of what arrived, with the limit as its first finding.

    `commanded`: the figures of the log as it is.
    """
    text = (
        f"The actuator gives no more than {quantity(bound.limit)}: beyond it the command asks for "
        f"what does not arrive. {bound.share:.0%} of the unexplained force goes with it. All else "
        "is said, and the errors after are taken, of the command cut off there."
    )
    limit = Finding(
        FORCE_LIMIT.name, FORCE_LIMIT.equation, text, (), "", {FORCE_LIMIT.name: bound.limit},
        bound.share, None, p_value(bound.limit),
    )  # fmt: skip
    before = {
        "force_error": commanded.here(bound.baseline), "filtered_force_error": bound.filtered,
    }  # fmt: skip
    if bound.filtered_held is not None:
        before["holdout_force_error"] = commanded.held(bound.baseline)
        before["filtered_holdout_force_error"] = bound.filtered_held
    found = with_preceding(found, [limit], 1 - bound.share, before)
    held = found.holdout_model
    return dataclasses.replace(
        found,
        model=found.model.with_force_limit(float(bound.limit.value)),
        holdout_model=held and held.with_force_limit(float(bound.limit.value)),
    )
