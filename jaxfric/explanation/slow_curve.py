"""The baseline's friction curve at speeds that no row holds: by samples, once all else is known.

A row is a kernel wholly inside slip. Where the axis turns within one, the rows begin above the
speeds of a narrow Stribeck bump, and any height of it, or none, fits them. The samples hold it:
what all other terms make is taken off the force, and over closed strokes acceleration is orthogonal
to what is left, a function of the velocity (Kim, Kim & Ha 2004, Lemma 1).
"""

from typing import NamedTuple

import numpy as np

from ..data.recording import Recording
from ..identification.uncertainty import Estimate
from ..terms.base import Sum, summands
from ..terms.sample import Scales
from . import parameters as spelled
from .baseline import Baseline
from .evaluation import in_batches
from .figures import PARTS, Figures, InSlip
from .findings import Findings, Solution, alone
from .improvement import CHANCE, Improved, force_errors
from .least_squares import solve
from .predictions import with_predictions
from .regression import Fit, fit

# Steps of a tenth of the speed, over which a bump bends by less than a thousandth of its height.
SPEEDS = 48
# The part of the record of each bin.
_PARTS = np.repeat(np.arange(PARTS), 2 * SPEEDS)


class Bins(NamedTuple):
    """Samples of one direction and about one speed in one part of a record, as rows for
    [`fit`][jaxfric.explanation.regression.fit].

    `motion`: their mean velocity, m/s, `(K,)`, part by part; `weight`: roots of their numbers;
    `target`: their mean force, N, times that; the rest as of `Evidence`.
    """

    motion: Recording
    weight: np.ndarray
    target: np.ndarray
    limits: Scales
    peak: float
    both_ways: bool

    @classmethod
    def of(cls, samples: InSlip, limits: Scales, peak: float) -> "Bins":
        """All bins, those without samples too, so that one program serves all records."""
        velocity, force, part = samples
        ends = np.geomspace(limits.slowest, np.max(np.abs(velocity)) * (1 + 1e-9), SPEEDS + 1)
        speed = np.clip(np.searchsorted(ends, np.abs(velocity), "right") - 1, 0, SPEEDS - 1)
        number = (2 * part + (velocity > 0)) * SPEEDS + speed
        count = np.bincount(number, minlength=len(_PARTS))
        means = [
            np.bincount(number, values, len(_PARTS)) / np.maximum(count, 1)
            for values in (velocity, force)
        ]
        none, weight = np.zeros(len(_PARTS)), np.sqrt(count)
        motion = Recording(none, none, none, np.where(count > 0, means[0], limits.slowest))
        both_ways = bool(velocity.min() < 0 < velocity.max())
        return cls(motion, weight, weight * means[1], limits, peak, both_ways)

    def columns(self, term, betas: np.ndarray) -> np.ndarray:
        """Rows of a term's columns at many β, `(G, d)` to `(G, K, p)`."""
        plain = [columns for columns, _ in in_batches(term, betas, self.motion)]
        return np.concatenate(plain).transpose(0, 2, 1) * self.weight[:, None]


def at_slow_speeds(known: Baseline, better: Improved, figures: Figures) -> Improved:
    """With the friction curve of the samples, where it leaves less of them, for sure.

    Of a baseline that is fitted, and not beside effects that act where friction changes its sign,
    or where the force is late there: of those the curve would take a part.
    """
    findings, selection = better.findings, better.findings.selection
    effects = [each.effect for each in selection.selected]
    given = known.model is not None or known.fit is not None or not selection.fitted
    if given or better.refitted or findings.problem.reversals:
        return better
    places = _friction(selection.last)
    if places is None or any(effect.at_reversals or effect.late for effect in effects):
        return better
    found = _identified(findings, places, figures)
    if found is None:
        return better
    curve, values = found
    less = _instead(better, _with_friction(selection.last, places, curve, findings), values)
    after = force_errors(less.findings, figures)
    if after.here >= better.after.here:
        return better
    return less._replace(before=better.before if effects else after, after=after)


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
    findings: Findings, places: _Places, figures: Figures
) -> tuple[Fit, dict[str, Estimate]] | None:
    """Friction fitted to the samples without what all else makes, and its parameters; `None` where
    that is no better than the friction that there is.
    """
    last, evidence = findings.selection.last, findings.problem.evidence
    model = findings.model(last)
    samples = figures.in_slip(model)
    if samples is None:
        return None
    found = fitted(last, places, Bins.of(samples, evidence.limits, evidence.peak))
    other = None if found is None else figures.in_slip(model, differences=True)
    if found is None or other is None:
        return None
    bins = _with_own(last, places, Bins.of(other, evidence.limits, evidence.peak))
    values, others = (
        spelled.estimates(each, _PARTS, evidence.motion.unit_names)[0]
        for each in (found, fit(found.terms, bins, found.betas))
    )
    return found, {name: _as_known(own, others[name]) for name, own in values.items()}


def _with_own(last: Fit, places: _Places, bins: Bins) -> Bins:
    """Bins of what a model leaves with its own friction added again."""
    beta, alpha = last.betas[0][places.nonlinear], last.alphas[0][places.affine]
    return bins._replace(target=bins.target + bins.columns(places.term, beta[None])[0] @ alpha)


def fitted(last: Fit, places: _Places, left: Bins) -> Fit | None:
    """Friction fitted to what a model leaves, for sure less than with its own; else `None`."""
    bins, beta = _with_own(last, places, left), last.betas[0][places.nonlinear]
    best = min((fit([places.term], bins, [b]) for b in (beta, None)), key=lambda each: each.energy)
    gained = np.bincount(_PARTS, left.target**2 - best.residual**2, PARTS)
    sure = np.sum(gained) > CHANCE * np.sqrt(np.sum((gained - gained.mean()) ** 2))
    # More than the price of its parameters (Schwarz 1978), in the noise of a bin.
    count, many = best.jacobian.shape[1], int(np.count_nonzero(bins.weight))
    price = count * np.log(many) * best.energy / max(many - count, 1)
    return best if sure and np.sum(gained) > price else None


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
    selection = selection._replace(last=last, curve=values, given=None, free=(), undetermined=())
    if selection.selected:
        return better._replace(findings=alone(Solution(problem, selection)))
    findings = alone(Solution(problem, selection._replace(base=last)))
    return better._replace(findings=findings, first=last)
