"""The held-out recording judges once, when everything has been chosen without it.

Nothing is looked for again and nothing exchanged: a finding that does not bring the model nearer to
the held-out recording is told as not confirmed, and the model does without it.
"""

import numpy as np

from ..data.recording import Recording
from ..simulation.prediction import delay_of
from . import parameters as spelled, verification
from .baseline import as_given
from .evidence import Motion
from .figures import Figures
from .improvement import Improved, Rest, beside_others, force_errors, lacking
from .naming import Named
from .problem import Problem, with_holdout
from .regression import Fit
from .views import estimated


def check_signals(found: Named, recording: Recording, holdout: Recording) -> None:
    """Raise `ValueError` if a finding reads a signal that the held-out recording lacks."""
    ours, theirs = _signals(recording), _signals(holdout)
    for taken in found.taken:
        candidate = taken.trial.candidate
        for signal in sorted((candidate.term.coordinates & ours) - theirs):
            effect = candidate.effect.name.replace("_", " ")
            raise ValueError(
                f"{holdout.source or 'The held-out recording'} lacks {signal!r}, by which "
                f"{recording.source or 'the recording'} shows {effect}, so that this cannot be "
                "judged there. Add the signal, or explain without a held-out recording."
            )


def _signals(recording: Recording) -> set[str]:
    """Beside the time, the velocity and the force, which every recording has or gets."""
    placed = set() if recording.position is None else {"position"}
    return placed | set(recording.channels)


def confirmed(
    better: Improved, problem: Problem, holdout: Motion, figures: Figures
) -> tuple[Improved, Problem]:
    """What the held-out recording bears out, and the question with its rows.

    Each finding is judged beside the others, with nothing refitted there; then all of them
    together, since the model that is saved is no worse than the baseline there either. What belongs
    to a moment need not come again, and is not asked.
    """
    problem = with_holdout(problem, holdout)
    where, left = better.rest
    undone = better.found.undone
    late = undone is not None and len(better.found.taken) > len(left.taken)
    rest: Rest = (with_holdout(where, undone(holdout)) if late else problem, left)
    found, rest = _rephased(better.found, problem, rest)
    borne = [_borne_out(found, problem, rest, n) for n in range(len(found.taken))]
    borne = [
        False if b and none else b
        for b, none in zip(borne, _none_in_both(found, problem, rest), strict=True)
    ]
    taken = [t._replace(confirmed=b) for t, b in zip(found.taken, borne, strict=True)]
    found = found._replace(taken=taken)
    rest = rest[0], rest[1]._replace(taken=taken[: len(rest[1].taken)])
    claimed = found, rest
    refuted = tuple(n for n, each in enumerate(borne) if each is False)
    for number in reversed(refuted):
        found, rest = lacking(found, rest, problem, number)
    better = better._replace(found=found, rest=rest, claimed=claimed, refuted=refuted)
    better = _measured(better, problem, figures)
    lasting = tuple(n for n, each in enumerate(borne) if each is not None)
    if better.after.worse(better.before, figures.rounding) and lasting != refuted:
        for number in reversed([n for n, t in enumerate(found.taken) if t.confirmed]):
            found, rest = lacking(found, rest, problem, number)
        better = better._replace(found=found, rest=rest, refuted=lasting)
        better = _measured(better, problem, figures)
    if found.taken and better.after.worse(better.before, figures.rounding):
        better = _measured(_base_kept(better, problem), problem, figures)
    if better.after.worse(better.before, figures.rounding):
        base = found._replace(last=better.first, taken=[])
        every = tuple(range(len(taken)))
        better = better._replace(found=base, rest=(problem, base), refitted=False, refuted=every)
        better = _measured(better, problem, figures)
    return better, problem


def _base_kept(better: Improved, problem: Problem) -> Improved:
    """What belongs to a moment, beside the base at its own values.

    Of a moment the held-out recording says nothing; of the values that were refitted beside it, it
    says that they hold no better there.
    """
    model = spelled.model(better.first, problem.evidence.motion.units)

    def kept(found: Named, problem: Problem) -> Named:
        last = as_given(model, found.last, problem.evidence)
        return found._replace(last=last, given=model, free=())

    where, left = better.rest
    return better._replace(found=kept(better.found, problem), rest=(where, kept(left, where)))


def _measured(better: Improved, problem: Problem, figures: Figures) -> Improved:
    """With the errors of both models on both recordings, over the same samples."""
    units = problem.evidence.motion.units
    base = better.found._replace(last=better.first, taken=[])
    delay = delay_of(spelled.model(better.found.last, units))
    before = force_errors(base, (problem, base), problem, figures, units, delay)
    alike = not better.found.taken and not better.refitted
    after = before if alike else force_errors(better.found, better.rest, problem, figures, units)
    return better._replace(before=before, after=after)


def _rephased(found: Named, problem: Problem, rest: Rest) -> tuple[Named, Rest]:
    """The findings, each wave over position at another phase there if only so it is borne out.

    The zero of an incremental encoder is another after each homing.
    """
    where, left = rest
    start = len(left.last.terms) - len(left.taken)
    for number in range(len(left.taken)):
        wave = verification.wavelike(left.last, start + number)
        if not wave or _borne_out(found, problem, (where, left), number):
            continue
        turned, there = _turned(found, number), _turned(left, number)
        if _borne_out(turned, problem, (where, there), number):
            found, left = turned, there
    return found, (where, left)


def _turned(named: Named, number: int) -> Named:
    taken = [t._replace(rephased=t.rephased or n == number) for n, t in enumerate(named.taken)]
    return named._replace(taken=taken)


def _borne_out(found: Named, problem: Problem, rest: Rest, number: int) -> bool | None:
    """Whether the model with a finding is nearer to the held-out recording than without it.

    `None` for what no other recording can say.
    """
    if found.taken[number].trial.candidate.effect.momentary:
        return None
    less = beside_others(found, rest, problem, number)
    without, with_it = residuals(less, rest, problem, number)
    return verification.nearer(with_it, without)


def _none_in_both(found: Named, problem: Problem, rest: Rest) -> list[bool]:
    """Whether each finding's force may as well be none, by what both recordings say of it."""
    start = len(found.last.terms) - len(found.taken)
    values = estimated(found, problem, rest)[start:] if found.taken else []
    return [
        spelled.may_be_none(term, known)
        for term, known in zip(found.last.terms[start:], values, strict=True)
    ]


def residuals(less: Fit, rest: Rest, problem: Problem, number: int) -> tuple[np.ndarray, np.ndarray]:
    """What is left of the held-out recording without a finding, and with all of them, N, `(J,)`."""
    where, left = rest
    place = problem if number == len(left.taken) else where
    return verification.residuals(less, left.last, (place.held, where.held), left.rephased)
