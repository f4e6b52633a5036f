"""What a winner must pass to be selected: significance, share, size, and wider kernels."""

from collections.abc import Sequence

import numpy as np

from ..models import Model
from ..terms.effect import Effect
from .baseline import refitted
from .evidence import Evidence
from .predictions import with_predictions
from .problem import BETWEEN, LEAST_SHARE, LINEARITY, OtherRows
from .regression import Fit, fast, fit, freed
from .selection import SelectedTerm
from .significance import DRAWS, LEVEL
from .trials import Contest, Finalist, Trial

# The same of a later term as `LEAST_SHARE` is of the first.
LATER_SHARE = 0.05
# A later term must also remove this part of the base's residual, or a third of what the earlier
# terms leave: no term has quite the shape of its effect, and a tenth of its amplitude may remain.
# No other law has the shape of that remainder, so that it removes less than a third of it. Below a
# hundredth of the amplitude no force is known to follow its law. But what a law over time leaves is
# of time, too, and a wave, a step or pushes take a third of it: for those there is no such ease.
OF_BASE, LEAST_OF_BASE = 0.01, 1e-4
MOST = 1 / 3
# Sharp terms hold the very noise that they are tested against, and of a force of one moment no
# other block of the recording tells whether it was chance: none of the draws may be as good.
RAREST = 1.5 / (1 + DRAWS)


# Isolated pushes besides another effect are mostly where that effect switches, and terms on the
# force's own derivatives take what a strong effect leaves through the kernel; a load behind a gap
# is one of them, with three numbers of its own: effects with the trait `leftover`.
EASY_OF_BASE = 0.05
# Idealisations of what happens about a reversal (one spring, friction without a dip on the load):
# half of the amplitude of one is no evidence for another of them, or for pushes there.
REVERSAL_OF_BASE = 0.25
# A term that removes three quarters of the residual needs none of these: the remainder of an
# idealisation is not of one law's shape. On machines with one effect a second name took two thirds
# at most. But pushes are no law: each has a moment and a size of its own. And what a stop that
# stiffens leaves of a straight one is nearly all at its knee: a hump there is none (`local`).
NEARLY_ALL = 0.75


def accepted(
    round_: Contest, current: Fit, evidence, others: OtherRows, base: Fit,
    selected: list[SelectedTerm], given: Model | None = None,
) -> Finalist | None:  # fmt: skip
    """The best finalist that passes, beside the terms selected before; `None` if none does.

    `given`: the model whose values the base keeps, where it does.
    """
    least = _least_share(selected)
    for finalist in round_.finalists:
        effect, term = finalist.effect, finalist.trial.candidate.term
        gained = current.energy - finalist.energy
        enough = gained >= needed(finalist.trial, current, evidence, base, selected)
        if selected:
            enough &= not _again(finalist, selected)
        level = RAREST if effect.sharp or effect.momentary else LEVEL
        if not (finalist.score > 0 and finalist.p_value <= level and enough):
            continue
        derived = effect.sharp or term.swings
        if derived and not _confirmed(finalist, current, others, least, given):
            continue
        if (derived or effect.at_reversals) and of_smoothing(
            finalist, current, others.rougher(), least, given
        ):
            continue
        return finalist
    return None


def needed(
    trial: Trial, current: Fit, evidence: Evidence, base: Fit, selected: list[SelectedTerm]
) -> float:
    """The energy that a candidate must remove beside the terms selected before, N²."""
    share, force = max(_least_share(selected), trial.least), float(evidence.force @ evidence.force)
    least = max(share * current.energy, LINEARITY**2 * force)
    if trial.effect.ubiquitous:
        least = max(least, fast(current) ** 2 * len(current.residual))
    if not selected:
        return least
    before = [each.effect for each in selected]
    ours = least_gain(trial.effect, before, base.energy, current.energy, LEAST_OF_BASE)
    # Of a law that is much like the base, the base's residual holds a small part.
    found = (current.part(i) for i in range(len(current.terms) - len(selected), len(current.terms)))
    largest = min(force, max(float(part @ part) for part in found))
    return max(least, ours, LEAST_OF_BASE * largest)


def _least_share(selected: list[SelectedTerm]) -> float:
    return LATER_SHARE if selected else LEAST_SHARE


def least_gain(
    effect: Effect,
    before: Sequence[Effect],
    base: float,
    remaining: float,
    floor: float,
) -> float:
    """The energy that a term after others must remove, N².

    **Arguments:** `before`: the effects selected already; `base` and `remaining`: the energy of the
    residual of the base, and beside those effects; `floor`: the least part of the base's.
    """
    if effect.momentary and any(earlier.momentary for earlier in before):
        return OF_BASE * base
    again = any(earlier.at_reversals for earlier in before)
    most = np.inf if effect.isolated or effect.local else NEARLY_ALL * remaining
    if again and (effect.at_reversals or effect.isolated):
        return min(REVERSAL_OF_BASE * base, most)
    if effect.leftover:
        return min(EASY_OF_BASE * base, most)
    return max(floor * base, min(OF_BASE * base, MOST * remaining))


def _again(finalist: Finalist, selected: list[SelectedTerm]) -> bool:
    """Whether the effect has been selected already; of waves there may be several."""
    own = finalist.trial.candidate
    several = own.lines is not None or own.effect.several
    return not several and any(t.effect.name == own.effect.name for t in selected)


# Noise of the encoder makes, by the controller's answer, a quarter of the residual at most.
HALF = 0.5


def _confirmed(
    finalist: Finalist, current: Fit, others: OtherRows, least: float, given: Model | None = None
) -> bool:
    """Whether a term is the same through a kernel of twice the width.

    There the noise of the derivatives is 2⁵ to 2⁷ times weaker in power, the physics hardly. But a
    load may swing above that kernel's band. If it removes half of the residual, which noise of the
    encoder through the controller never did on machines without effects (a quarter at most), a
    kernel of 4/3 of the width will do.
    """
    between, wide, _ = others
    if wide is None or _alike(finalist, current, wide, 2.0, least, given):
        return True
    term = finalist.trial.candidate.term
    most = current.energy - finalist.energy >= HALF * current.energy
    loud = term.swings and most and between is not None
    return loud and _alike(finalist, current, between, BETWEEN, least, given)


# Between a force that is as large and one that is two thirds as much.
SMOOTHED = 2**0.5


def of_smoothing(
    finalist: Finalist, current: Fit, rougher: Evidence | None, least: float = LATER_SHARE,
    given: Model | None = None,
) -> bool:  # fmt: skip
    """Whether a term is not the same where the velocity is smoothed over less.

    What smoothing takes off the velocity looks like a load on a spring, and is a fifth as much
    there; near a stop within a count it looks like a friction that lags, and is two thirds as much.
    """
    return rougher is not None and not _alike(finalist, current, rougher, SMOOTHED, least, given)


def _alike(
    finalist: Finalist, current: Fit, wide: Evidence, factor: float, least: float,
    given: Model | None,
) -> bool:  # fmt: skip
    """Whether a term has the same size, within a factor, through a kernel as much wider.

    A column of noise changes by more.
    """
    less = refitted(wide, current, given, (), 4)
    less = less if given is None else freed(less, ())
    seen = with_predictions(wide, less)
    # At the β of the narrow kernel: where the wide one leaves little, it would find another.
    term, beta, basis = finalist.trial.candidate.term, finalist.betas[-1], less.basis()
    wider_fit = fit([term], seen, [beta], 0, basis)
    ratio = np.linalg.norm(wider_fit.part(0)) / max(
        float(np.linalg.norm(wider_fit.columns @ finalist.alpha)), 1e-300
    )
    positive = bool(np.all(wider_fit.alphas[0] > 0))
    enough = less.energy - wider_fit.energy >= least * less.energy
    return positive and 1 / factor < ratio < factor and enough
