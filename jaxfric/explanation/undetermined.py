"""What a recording does not determine of the baseline that is fitted to it.

Where an axis turns within a kernel the rows begin above the speeds of a narrow Stribeck bump, and
any height of it fits them. Another recording that is slow for longer has then a friction that
nobody measured: what is not needed is none.
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np

from ..identification.uncertainty import Estimate
from ..models import Model
from ..terms.base import changed_columns
from . import parameters as spelled
from .acceptance import LINEARITY, OF_BASE
from .baseline import as_given
from .evidence import Evidence
from .figures import Figures
from .findings import Findings, Solution, alone
from .holdout import measured
from .improvement import Improved
from .regression import Fit
from .uncertainty import by_rows


def without_undetermined(better: Improved, figures: Figures) -> Improved:
    """With none of the base's laws whose size may be none and which nothing needs.

    The rows do not, within the price of its numbers (Schwarz 1978), nor the samples, within what a
    sensor resolves; and neither within a tenth in amplitude of what the findings take there, whose
    laws have not quite the shapes of their forces. The fit of the baseline alone is without those
    that nothing there determines.
    """
    findings, first = better.findings, better.first
    if findings.selection.given is not None or better.refitted:
        return better
    problem, last = findings.problem, findings.undelayed.selection.last
    size = max(findings.selection.remaining.size, 2)
    beside = list(by_rows(findings)[0].here.values())
    units = problem.evidence.motion.unit_names
    by_itself = list(spelled.estimates(first, problem.block, units)[0].values())
    gone, less, left = tuple[int, ...](), better, last.energy
    for shape, own in enumerate(changed_columns(last.terms[0])):
        law = (*own, len(last.alphas[0]) + shape)
        price = np.expm1(len(law) * np.log(size) / size)
        if all(_may_be_none(beside[i]) for i in own):
            simpler = _without(less, law)
            energy = simpler.findings.undelayed.selection.last.energy
            if energy - left < max(price * left, OF_BASE * (better.first.energy - left)):
                less, left = simpler, energy
        if all(_may_be_none(by_itself[i]) for i in own):
            simplest, _, _ = _fixed(first, problem.evidence, (*gone, *law))
            if simplest.energy < (1 + price) * first.energy:
                first, gone = simplest, (*gone, *law)
    if less is better and not gone:
        return better
    found = _in_both(less.findings, lambda each: _with_base(each, gone))
    less = measured(less._replace(first=first, findings=found), figures)
    taken = better.before.here**2 - better.after.here**2
    as_well = less.after.here**2 - better.after.here**2 < max(LINEARITY**2, OF_BASE * taken)
    return less if as_well else better


def _may_be_none(estimate: Estimate) -> bool:
    low, high = spelled.tested(estimate).interval()
    return bool(low <= 0 <= high)


def _without(better: Improved, law: tuple[int, ...]) -> Improved:
    """With none of a law of the base, by the numbers of its parameters."""
    gone = (*better.findings.selection.undetermined, *law)

    def of(solution: Solution) -> Solution:
        problem, selection = solution
        last, model, free = _fixed(selection.last, problem.evidence, gone)
        selection = selection._replace(last=last, given=model, free=free, undetermined=gone)
        return Solution(problem, selection)

    return better._replace(findings=_in_both(better.findings, of))


def _in_both(findings: Findings, changed: Callable[[Solution], Solution]) -> Findings:
    """The findings with both solutions changed, which are one where the force does not act late."""
    recorded, undelayed = findings
    found = changed(recorded)
    return alone(found) if undelayed is recorded else Findings(found, changed(undelayed))


def _with_base(solution: Solution, gone: tuple[int, ...]) -> Solution:
    """With a fit of the base alone that has no force of the affine parameters of those numbers."""
    problem, selection = solution
    if not gone:
        return solution
    base, _, _ = _fixed(selection.base, problem.evidence, gone)
    return Solution(problem, selection._replace(base=base))


def _fixed(
    current: Fit, evidence: Evidence, gone: tuple[int, ...]
) -> tuple[Fit, Model, tuple[int, ...]]:
    """A fit whose base has no force of the affine parameters of those numbers; the base so, and the
    numbers of its other parameters.
    """
    size = len(current.alphas[0])
    alpha = np.where(np.isin(np.arange(size), gone), 0.0, current.alphas[0])
    free = tuple(i for i in range(size + len(current.betas[0])) if i not in gone)
    model = Model(spelled.whole(current.only([0])), jnp.asarray(alpha), evidence.motion.units)
    return as_given(model, current, evidence, free), model, free
