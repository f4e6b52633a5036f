"""Which of several candidates that fit alike is selected, and which cannot be told from it."""

from collections.abc import Sequence

import numpy as np

from .regression import Fit
from .significance import LEVEL
from .trials import RIVAL, Contest, Finalist

# No idealisation of a reversal, or of what makes a force late, is right to the last tenth of its
# score. A law of three nonlinear parameters finds that tenth in any of them: then the law with
# fewer is selected.
NO_EVIDENCE = 0.9


def simplest(best: Finalist, round_: Contest) -> Finalist:
    """The best, or an idealisation of the same with fewer parameters that does nearly as well."""

    def enough(other: Finalist) -> bool:
        effect = other.effect
        known = effect.at_reversals and not effect.sharp and other.p_value <= LEVEL
        fewer = len(other.betas[-1]) < len(best.betas[-1])
        return known and fewer and other.score >= NO_EVIDENCE * best.score

    if not best.effect.at_reversals:
        return best
    return next((other for other in round_.finalists if enough(other)), best)


# Effects whose force is the same but for 5 % cannot be told apart: between them only noise decides,
# which is never quite as assumed. But one that leaves more than twice as much as the other, four
# times its energy, has been told from it: what it leaves is no noise.
ALIKE, TOLD = 0.95, 4.0


def with_rivals(
    best: Finalist, round_: Contest, current: Fit, evidence, besides: Sequence[Finalist] = ()
) -> tuple[Finalist, tuple[str, ...], tuple[str, ...]]:
    """The best, the effects that cannot be told from it, and of its own effect the parameters.

    `besides`: finalists that cannot be selected, though they may fit as well.

    Of a line in position and one in time, which are the same at constant speed, the one in position
    is selected: a machine has more pitches than clocks.
    """
    basis, force = current.basis(), _force(best, evidence)
    force = force - basis @ (basis.T @ force)
    alike = []
    for other in [*round_.finalists, *besides]:
        if other.effect.name == best.effect.name and not _of_another(other, best):
            continue
        theirs = _force(other, evidence)
        theirs = theirs - basis @ (basis.T @ theirs)
        size = np.linalg.norm(force) * np.linalg.norm(theirs)
        same = size > 0 and abs(force @ theirs) > ALIKE * size
        same = same and other.energy <= TOLD * best.energy
        # The remainder of a term that is but the first order of its effect is no evidence, neither
        # against significant effects that it is known to be confused with nor against itself.
        effect, rival = best.effect, other.effect
        rough = effect.first_order or rival.first_order
        excused = rough and rival.name in effect.confusable_with
        half = current.energy - other.energy >= 0.5 * (current.energy - best.energy)
        significant = other.p_value <= LEVEL and half
        if same or other.score > best.score - RIVAL or (excused and significant):
            alike.append((other, same))
    own = best.effect.name
    names = [f.effect.name for f, _ in alike if f.effect.name != own]
    instead = [_parameter(f) for f, _ in alike if f.effect.name == own]
    twin = [f for f, same in alike if same and _line(f, "position") and _selectable(f, round_)]
    if _line(best, "time") and twin and twin[0].p_value <= LEVEL:
        best = twin[0]
        names = [own, *(name for name in names if name != best.effect.name)]
    return best, tuple(dict.fromkeys(names)), tuple(dict.fromkeys(instead))


def _selectable(finalist: Finalist, round_: Contest) -> bool:
    return any(each is finalist for each in round_.finalists)


def _parameter(finalist: Finalist) -> str:
    """What its force is proportional to."""
    return finalist.trial.candidate.term.affine[0].name


def _of_another(other: Finalist, best: Finalist) -> bool:
    """Whether two terms of one effect are of different parameters of the baseline."""
    return best.effect.by_parameter and _parameter(other) != _parameter(best)


def _line(finalist: Finalist, coordinate: str) -> bool:
    """Whether it is a wave over a coordinate alone."""
    lines = finalist.trial.candidate.lines
    return lines is not None and lines.coordinate == coordinate and not lines.factor


def _force(finalist: Finalist, evidence) -> np.ndarray:
    columns = evidence.columns(finalist.trial.candidate.term, finalist.betas[-1][None])[0]
    return columns @ finalist.alpha
