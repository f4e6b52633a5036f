"""Physical constraints: a load within the machine's inertia and friction, forces beyond zero."""

from collections.abc import Iterator, Sequence

from ..identification.uncertainty import Estimate
from ..terms.base import AbstractTerm, leaves
from ..terms.effect import PASSED
from ..terms.effects import traits
from ..terms.friction import AbstractBump
from ..terms.sample import Burden
from . import parameters as spelled
from .acceptance import OF_BASE
from .burdens import IDEALISED, Machine, machine
from .evidence import Evidence
from .predictions import with_predictions
from .regression import Fit, at_shapes, fit
from .significance import blocks, evenly
from .trials import Contest, Finalist

# Where the rows determine an inertia badly and prefer somewhat more than the machine has, a load
# with all of it is tried; a hundredth less, not to be refused by rounding.
TRIES, LIGHTER = 3, 1.01


def constrained(round_: Contest, current: Fit, evidence: Evidence) -> Contest:
    """The finalists within the constraints, the best first: as they are, or the nearest."""
    found = []
    for finalist in round_.finalists:
        for _ in range(TRIES):
            if physical(finalist, current, evidence):
                found.append(finalist)
                break
            lighter = _lighter(finalist, current, evidence, round_.size)
            if lighter is None:
                break
            finalist = lighter
    return round_._replace(finalists=sorted(found, key=lambda each: -each.score))


def _lighter(finalist: Finalist, current: Fit, evidence: Evidence, size: float) -> Finalist | None:
    """A load with no more inertia than the machine has, its friction fitted again.

    `None` where the rows determine the inertia, and where the friction is too much.
    """
    trial = finalist.trial
    burden = trial.candidate.term.burden(finalist.betas[-1], finalist.alpha)
    if burden is None or burden.lighter is None:
        return None
    own, most = _beside(finalist, current, evidence)
    too_much = own.friction > IDEALISED * most.friction
    if too_much or not 0 < most.inertia < own.inertia:
        return None
    beta = burden.lighter(LIGHTER * own.inertia / most.inertia)
    there = fit([trial.candidate.term], evidence, [beta], 0, current.basis())
    gain = 1 - there.energy / current.energy
    return finalist._replace(
        score=trial.score(gain, size),
        p_value=finalist.p_value if gain > trial.threshold else 1.0,
        energy=there.energy,
        betas=(*finalist.betas[:-1], there.betas[0]),
        alpha=there.alphas[0],
    )


def physical(finalist: Finalist, current: Fit, evidence: Evidence) -> bool:
    """Whether a candidate beside the rest of the model keeps the constraints.

    A load on a spring or behind a gap has a part of the inertia and of the friction, and does not
    rest while the motor moves by a tenth of the stroke: that would be a spring to the ground. It
    swings where the kernel passes a force: a resonance above shows by its tail alone, the second
    derivative of the acceleration, and what smooths a position or a force makes that too.
    Friction that follows speed late follows a Stribeck curve that shows in steady slip too.
    """
    burden = finalist.trial.candidate.term.burden(finalist.betas[-1], finalist.alpha)
    if burden is None:
        return True
    bumps = any(isinstance(leaf, AbstractBump) for t in current.terms for leaf in leaves(t))
    if burden.curved and not bumps:
        return False
    if burden.resonance * evidence.reach > PASSED:
        return False
    if burden.give and burden.give > 0.1 * (evidence.limits.high - evidence.limits.low):
        return False
    own, most = _beside(finalist, current, evidence)
    return own.inertia <= most.inertia and own.friction <= IDEALISED * most.friction


def nil(current: Fit, count: int, evidence: Evidence, wide: Evidence | None) -> Iterator[int]:
    """Numbers of the last `count` terms all of whose forces may as well be none, the last first.

    At the shapes that they have, and through a kernel of twice the width too, `wide`. There is none
    of an effect, either, whose distance or time may be zero.
    """
    start = len(current.terms) - count
    units = evidence.motion.unit_names
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    free = spelled.estimates(current, block, units)
    shaped = at_shapes(current)
    own = spelled.estimates(shaped, block, units)
    there: Sequence[dict[str, Estimate] | None] = [None] * len(own)
    if wide is not None:
        rows = evenly(len(wide.rows), int(block[-1]) + 1)
        again = fit(current.terms, with_predictions(wide, current), current.betas, 0)
        there = spelled.estimates(at_shapes(again), rows, units)
    for number in reversed(range(start, len(current.terms))):
        term = current.terms[number]
        gone = [spelled.tested(free[number][name]).interval() for name in traits(term).vanishes]
        none = any(low <= 0 for low, _ in gone)
        if none or spelled.may_be_none(term, own[number], there[number]):
            yield number - start


def told_parts(current: Fit, count: int, evidence: Evidence) -> Iterator[tuple[int, AbstractTerm]]:
    """Of the last `count` terms those made of forces by themselves, isolated pushes, without the
    forces that are under a tenth of the largest and whose told interval holds zero: their numbers,
    and what is left.

    A large push bends the base by a part of itself, which then stands out elsewhere.
    """
    start = len(current.terms) - count
    if not any(traits(term).parts for term in current.terms[start:]):
        return
    block = blocks(evidence.elapsed[evidence.centre], evidence.reach)
    own = spelled.estimates(current, block, evidence.motion.unit_names)
    for number, term in enumerate(current.terms[start:]):
        some = traits(term).parts
        if some is None:
            continue
        values = [own[start + number][parameter.name] for parameter in term.affine]
        least = OF_BASE**0.5 * max(abs(float(each.value)) for each in values)
        ends = [each.interval() for each in values]
        sure = [
            n
            for n, (each, (low, high)) in enumerate(zip(values, ends, strict=True))
            if low * high > 0 or abs(float(each.value)) >= least
        ]
        if len(sure) < len(values):
            yield number, some(term, sure)


def _beside(finalist: Finalist, current: Fit, evidence: Evidence) -> tuple[Burden, Machine]:
    """What a term has of inertia and friction, beside all the others, and what the machine has."""
    term = finalist.trial.candidate.term
    both = fit((*current.terms, term), evidence, finalist.betas, 0)
    own = term.burden(both.betas[-1], both.alphas[-1])
    return own, machine(both.terms[:-1], both.alphas[:-1])
