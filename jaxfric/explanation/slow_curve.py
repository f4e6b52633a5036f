"""The baseline's friction curve at speeds that no row holds: by samples, once all else is known.

A row is a kernel wholly inside slip. Where the axis turns within one, the rows begin above the
speeds of a narrow Stribeck bump, and any height of it, or none, fits them. The samples hold it:
what all other terms make is taken off the force, and over closed strokes acceleration is orthogonal
to what is left, a function of the velocity (Kim, Kim & Ha 2004, Lemma 1).
"""

from typing import NamedTuple

import jax
import numpy as np

from ..data.recording import Recording
from ..identification.uncertainty import Estimate
from ..terms.base import Sum, summands
from ..terms.sample import Scales
from . import parameters as spelled
from .baseline import Baseline
from .evaluation import PAIR, evaluate
from .evidence import Evidence
from .figures import PARTS, Figures, InSlip
from .findings import Findings, Solution, alone
from .improvement import CHANCE, Improved, force_errors
from .least_squares import solve
from .predictions import with_predictions
from .regression import Fit, fit

# Speeds in steps of a sixth: a tenth of a bump's own width, over which it bends by half a percent.
SPEEDS = 48


class Bins(NamedTuple):
    """Samples of one direction and about one speed in one part of a record, as rows.

    `motion`: their mean velocity, `(K,)`; `weight`: roots of their numbers; `target`: their mean
    force times that; `part` of the record; the rest as of `Evidence`.
    """

    motion: Recording
    weight: np.ndarray
    target: np.ndarray
    part: np.ndarray
    limits: Scales
    peak: float
    both_ways: bool

    @classmethod
    def of(cls, velocity, force, part, limits: Scales, peak: float) -> "Bins":
        """Of samples in slip, `(C,)` each; of all bins, so that one program serves all records."""
        ends = np.geomspace(limits.slowest, np.max(np.abs(velocity)) * (1 + 1e-9), SPEEDS + 1)
        number = np.clip(np.searchsorted(ends, np.abs(velocity), "right") - 1, 0, SPEEDS - 1)
        number = (2 * number + (velocity > 0)) * PARTS + part
        size = 2 * SPEEDS * PARTS
        count = np.bincount(number, minlength=size)
        many = np.maximum(count, 1)
        means = [np.bincount(number, each, size) / many for each in (velocity, force)]
        speed = np.where(count > 0, means[0], limits.slowest)
        none = np.zeros(size)
        motion = Recording(none, none, none, speed)
        weight = np.sqrt(count)
        both = bool(velocity.min() < 0 < velocity.max())
        parts = np.tile(np.arange(PARTS), 2 * SPEEDS)
        return cls(motion, weight, weight * means[1], parts, limits, peak, both)

    def columns(self, term, betas: np.ndarray) -> np.ndarray:
        """Rows of a term's columns at many β, `(G, d)` to `(G, K, p)`."""
        found = []
        for start in range(0, len(betas), PAIR):
            some = betas[start : start + PAIR]
            full = np.concatenate([some, np.repeat(some[-1:], PAIR - len(some), axis=0)])
            found.append(np.asarray(evaluate(term, full, self.motion)[0])[: len(some)])
        return np.concatenate(found).transpose(0, 2, 1) * self.weight[:, None]

    def sorted_by_part(self) -> "Bins":
        """With the bins of each part together."""
        order = np.argsort(self.part, kind="stable")
        motion = jax.tree.map(lambda values: values[order], self.motion)
        weight, target, part = (x[order] for x in (self.weight, self.target, self.part))
        return self._replace(motion=motion, weight=weight, target=target, part=part)


def at_slow_speeds(known: Baseline, better: Improved, figures: Figures) -> Improved:
    """With the friction curve of the samples, where it leaves less of them, for sure.

    Of a baseline that is fitted, and not beside effects that act where friction changes its sign,
    or where the force is late there: of those the curve would take a part.
    """
    findings, selection = better.findings, better.findings.selection
    effects = [each.effect for each in selection.selected]
    if known.model is not None or known.fit is not None or better.refitted:
        return better
    if selection.given is not None:
        return better
    if findings.problem.reversals or any(e.at_reversals or e.late for e in effects):
        return better
    places = _friction(selection.last)
    samples = figures.in_slip(findings.model(selection.last))
    if places is None or samples is None:
        return better
    evidence = findings.problem.evidence
    found, rough = _identified(selection.last, places, samples, evidence)
    if found is None:
        return better
    last = _with_friction(selection.last, places, found, findings)
    values, others = (
        spelled.estimates(each, _EVERY, evidence.motion.unit_names)[0] for each in (found, rough)
    )
    values = {name: _as_known(own, others[name]) for name, own in values.items()}
    less = _instead(better, last, values)
    after = force_errors(less.findings, figures)
    if after.here >= better.after.here:
        return better
    before = better.before if effects else after
    return less._replace(before=before, after=after)


# The part of each bin once they are sorted by parts.
_EVERY = np.repeat(np.arange(PARTS), 2 * SPEEDS)


class _Places(NamedTuple):
    """Friction in the baseline: its terms, and where its parameters stand in α and β."""

    term: Sum
    affine: list[int]
    nonlinear: list[int]


def _friction(last: Fit) -> _Places | None:
    """The baseline's terms that are functions of the velocity; `None` without a curve in them."""
    terms, affine, nonlinear, at = [], list[int](), list[int](), [0, 0]
    for part in summands(last.terms[0]):
        counts = len(part.affine), len(part.nonlinear)
        if part.coordinates == {"velocity"}:
            terms.append(part)
            affine += range(at[0], at[0] + counts[0])
            nonlinear += range(at[1], at[1] + counts[1])
        at = [start + count for start, count in zip(at, counts, strict=True)]
    return _Places(Sum(tuple(terms)), affine, nonlinear) if nonlinear else None


def _as_known(own: Estimate, rough: Estimate) -> Estimate:
    """A value that depends on how the acceleration is taken is known no better than that.

    Where friction changes its sign the acceleration jumps, and a smoothed one errs by the speed's
    own sign; the difference of neighbouring velocities is rough, and misses the moment by a sample.
    """
    error = np.hypot(own.standard_error, own.value - rough.value)
    return own._replace(standard_error=np.float64(error))


def _identified(
    last: Fit, places: _Places, samples: InSlip, evidence: Evidence
) -> tuple[Fit, Fit] | tuple[None, None]:
    """Friction fitted to the samples without what all else makes, and the same by the other
    acceleration; `None` where that is no better.
    """
    velocity, left, rough, part = samples
    beta, alpha = last.betas[0][places.nonlinear], last.alphas[0][places.affine]
    bins, other = (
        Bins.of(velocity, each, part, evidence.limits, evidence.peak).sorted_by_part()
        for each in (left, rough)
    )
    own = bins.columns(places.term, beta[None])[0] @ alpha
    bins = bins._replace(target=bins.target + own)
    fits = [fit([places.term], bins, [start]) for start in (beta, None)]
    best = min(fits, key=lambda each: each.energy)
    change = (bins.target - own) ** 2 - best.residual**2
    gained = np.bincount(bins.part, change, PARTS)
    sure = np.sum(gained) > CHANCE * np.sqrt(np.sum((gained - gained.mean()) ** 2))
    # More than the price of its parameters (Schwarz 1978), in the noise of a bin.
    count, many = len(alpha) + len(beta), int(np.count_nonzero(bins.weight))
    price = count * np.log(many) * best.energy / max(many - count, 1)
    if not sure or np.sum(gained) <= price:
        return None, None
    return best, fit([places.term], other._replace(target=other.target + own), best.betas)


def _with_friction(last: Fit, places: _Places, found: Fit, findings: Findings) -> Fit:
    """The model with that friction, its other affine parameters fitted beside it."""
    beta, alpha = last.betas[0].copy(), np.concatenate(last.alphas)
    beta[places.nonlinear], alpha[places.affine] = found.betas[0], found.alphas[0]
    evidence = with_predictions(findings.problem.evidence, last)
    there = fit(last.terms, evidence, [beta, *last.betas[1:]], 0)
    others = [i for i in range(len(alpha)) if i not in places.affine]
    own = there.columns[:, places.affine] @ alpha[places.affine]
    alpha[others] = solve(there.columns[:, others], evidence.target - own)
    residual = evidence.target - there.columns @ alpha
    ends = np.cumsum([len(each) for each in last.alphas])[:-1]
    return there._replace(
        alphas=tuple(np.split(alpha, ends)), residual=residual, energy=float(residual @ residual)
    )


def _instead(better: Improved, last: Fit, values: dict[str, Estimate]) -> Improved:
    """With another fit of the same terms, whose friction has these values."""
    problem, selection = better.findings.recorded
    selection = selection._replace(last=last, curve=values)
    if selection.selected:
        return better._replace(findings=alone(Solution(problem, selection)))
    findings = alone(Solution(problem, selection._replace(base=last)))
    return better._replace(findings=findings, first=last)
