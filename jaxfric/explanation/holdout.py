"""Validation on the held-out recording, once, when everything has been chosen without it.

Nothing is searched again and nothing exchanged: a finding that does not bring the model nearer to
the held-out recording is reported as not confirmed, and the model does without it.
"""

import numpy as np

from ..data.recording import Recording
from ..terms.base import AbstractTerm
from . import parameters as spelled, verification
from .acceptance import HALF, LINEARITY
from .baseline import as_given
from .figures import Figures
from .findings import Findings, Solution
from .improvement import Improved, errors_of_base, force_errors, unsure
from .motion import Motion
from .problem import with_holdout
from .selection import Selection
from .slow_changes import slow, stroke_of
from .uncertainty import Estimates, by_rows


def check_signals(selection: Selection, recording: Recording, holdout: Recording) -> None:
    """Raise `ValueError` if a finding reads a signal that the held-out recording lacks."""
    ours, theirs = _signals(recording), _signals(holdout)
    for selected in selection.selected:
        candidate = selected.trial.candidate
        for signal in sorted((candidate.term.coordinates & ours) - theirs):
            effect = candidate.effect.name.replace("_", " ")
            raise ValueError(
                f"{holdout.source or 'The held-out recording'} lacks {signal!r}, by which "
                f"{recording.source or 'the recording'} shows {effect}, so that this cannot be "
                "judged there. Add the signal, or explain without a held-out recording."
            )


def _signals(recording: Recording) -> set[str]:
    """Beside the time, the velocity and the force, which every recording has or gets."""
    position = set() if recording.position is None else {"position"}
    return position | set(recording.channels)


def confirmed(better: Improved, holdout: Motion, figures: Figures) -> Improved:
    """What the held-out recording confirms, with its rows in the problems.

    Each finding is compared with the model without it, nothing refitted there; then all of them
    together, since the saved model must be no worse than the baseline there either. Effects of a
    moment need not recur, and what does not act there cannot: these are not tested.
    """
    findings = _rephased(_with_rows(better.findings, holdout))
    nil = _nil(findings)
    borne = [_borne_out(findings, number) for number in range(len(nil))]
    borne = [each and not none for each, none in zip(borne, nil, strict=True)]
    findings = findings.with_selected([
        selected._replace(confirmed=each)
        for selected, each in zip(findings.selection.selected, borne, strict=True)
    ])  # fmt: skip
    better = better._replace(claimed=findings)
    better = _refuting(better, findings, [n for n, each in enumerate(borne) if each is False])
    better = measured(_without_leaning(better), figures)
    tested = {n for n, each in enumerate(borne) if each is not None}
    if better.after.worse(better.before, figures.rounding) and not tested <= {*better.refuted}:
        borne_out = better.findings.selection.selected
        others = [n for n, selected in enumerate(borne_out) if selected.confirmed]
        worse = better.before, better.after
        gone = tuple(sorted(tested | {*better.refuted}))
        better = _refuting(better, better.findings, others)._replace(refuted=gone, worse=worse)
        better = measured(better, figures)
    if better.findings.selection.selected and better.after.worse(better.before, figures.rounding):
        better = measured(_without_leaning(_without_nil(_at_base_values(better))), figures)
    if better.after.worse(better.before, figures.rounding):
        base, every = findings.at_base(better.first), tuple(range(len(borne)))
        better = better._replace(findings=base, refitted=False, refuted=every)
        better = measured(better, figures)
    return better


def _with_rows(findings: Findings, holdout: Motion) -> Findings:
    """The findings with the held-out recording's rows, its force put back where it acts late."""
    (problem, selection), (_, others) = findings
    recorded = Solution(with_holdout(problem, holdout), selection)
    if selection.undone is None or len(selection.selected) == len(others.selected):
        return Findings(recorded, Solution(recorded.problem, others))
    undone = with_holdout(findings.undelayed.problem, selection.undone(holdout))
    return Findings(recorded, Solution(undone, others))


def _refuting(better: Improved, findings: Findings, refuted) -> Improved:
    """The findings without those of some numbers."""
    for number in reversed(refuted):
        findings = findings.without(number)
    return better._replace(findings=findings, refuted=tuple(refuted))


def _at_base_values(better: Improved) -> Improved:
    """Effects of a moment, beside the base at its own values.

    Of a moment the held-out recording says nothing; of the values that were refitted beside it, it
    says that they hold no better there.
    """
    recorded, undelayed = better.findings
    model = spelled.model(better.first, recorded.problem.evidence.motion.units)

    def given(solution: Solution) -> Solution:
        problem, selection = solution
        last = as_given(model, selection.last, problem.evidence)
        return Solution(problem, selection._replace(last=last, given=model, free=()))

    findings = Findings(given(recorded), given(undelayed))
    return better._replace(findings=findings, refitted=False)


def _without_nil(better: Improved) -> Improved:
    """Without findings whose force may as well be none once the base has its own values."""
    return _also(better, [n for n, none in enumerate(_nil(better.findings)) if none])


def _without_leaning(better: Improved) -> Improved:
    """Without changes at a moment that may be none, or that chance makes, once what was refuted is
    gone: beside that they were sure.
    """
    refuted = better.refuted
    while refuted and (gone := unsure(better.findings) or _by_chance(better.findings)):
        better = _also(better, gone[-1:])
    more = [n for n in better.refuted if n not in refuted]
    return better._replace(leaning=(*better.leaning, *more))


def _by_chance(findings: Findings) -> list[int]:
    """Numbers of the changes at a moment that take no more of what is left without them than the
    draws did of what they were found in; pushes are not tested by draws.
    """
    left, numbers = findings.undelayed.selection.last.energy, list[int]()
    for number, selected in enumerate(findings.selection.selected):
        if selected.effect.momentary and selected.trial.threshold < np.inf:
            without = findings.without(number).undelayed.selection.last.energy
            if not 1 - left / without > selected.trial.threshold:
                numbers.append(number)
    return numbers


def _also(better: Improved, gone: list[int]) -> Improved:
    """Without further findings, of these numbers among those that remain."""
    numbers = [n for n in range(len(better.claimed.selection.selected)) if n not in better.refuted]
    refuted = (*better.refuted, *(numbers[n] for n in gone))
    return _refuting(better, better.findings, gone)._replace(refuted=tuple(sorted(refuted)))


def measured(better: Improved, figures: Figures) -> Improved:
    """With the errors of both models on both recordings, over the same samples."""
    findings = better.findings
    before = errors_of_base(findings.at_base(better.first), findings, figures)
    alike = not findings.selection.selected and not better.refitted
    after = before if alike else force_errors(findings, figures)
    return better._replace(before=before, after=after)


def _rephased(findings: Findings) -> Findings:
    """The findings, each wave over position at another phase there if only so it is confirmed.

    The zero of an incremental encoder is another after each homing. What does not repeat within the
    stroke has no phase: any slow change is near to a part of some wave.
    """
    problem, selection = findings.undelayed
    stroke = stroke_of(problem.evidence.limits)
    for number in range(len(selection.selected)):
        index, last = selection.term_index(number), selection.last
        wave = verification.wavelike(last, index) and not slow(
            last.terms[index], last.betas[index], stroke
        )
        if not wave or _borne_out(findings, number):
            continue
        turned = findings.with_selected([
            selected._replace(rephased=selected.rephased or n == number)
            for n, selected in enumerate(findings.selection.selected)
        ])  # fmt: skip
        if _borne_out(turned, number):
            findings = turned
    return findings


def _borne_out(findings: Findings, number: int, part: float = 1.0) -> bool | None:
    """Whether the model with a finding is nearer to the held-out recording than without it, and
    leaves no more than a part of the energy.

    `None` for what no other recording can say.
    """
    if findings.selection.selected[number].effect.momentary or not _acts_there(findings, number):
        return None
    less = findings.fit_without(number)
    without, with_it = findings.holdout_residuals(less, number)
    return verification.nearer(with_it, without, part)


def _acts_there(findings: Findings, number: int) -> bool:
    """Whether a finding has a force on the held-out recording that a sensor could tell from none.

    An end stop has none in a motion that does not reach it, a limit none where less is asked for.
    """
    problem, selection = findings.examined_in(number)
    return (
        verification.part(selection.last, problem.held, selection.term_index(number)) >= LINEARITY
    )


def _nil(findings: Findings) -> list[bool]:
    """Whether each finding's force may as well be none by what either recording says of it, or a
    kernel of twice the width.

    Values that make up for each other, as the frequency of a light ring for how late the force is,
    may each be none by its own interval; what halves what is left of another recording, with
    nothing refitted, is not. But what other rows contradict is none whatever it does there.
    """
    selection = findings.selection
    start = selection.term_index(0)
    values = by_rows(findings, shaped=True)[start:] if selection.selected else []

    def none(number: int, term: AbstractTerm, own: Estimates) -> bool:
        if spelled.may_be_none(term, own.here):
            return not _borne_out(findings, number, HALF)
        return any(spelled.may_be_none(term, own.here, other) for other in (own.wide, own.there))

    pairs = zip(selection.last.terms[start:], values, strict=True)
    return [none(number, *each) for number, each in enumerate(pairs)]
