"""After is never worse than before but by chance: findings go until the saved model is no worse."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from ..models import Model
from ..simulation.errors import delay_of
from ..terms.effects.parameter_mismatch import MISMATCH
from . import parameters as spelled, verification
from .acceptance import HALF
from .dates import anytime
from .figures import Figures
from .findings import Findings
from .problem import LEAST_SHARE
from .regression import Fit
from .uncertainty import estimated

# A figure that is larger by less than a hundredth of itself, and not more than by chance, is not
# worse: Student's t of 15 degrees of freedom is below 2.13 in 97.5 % of the cases.
UNSEEN, CHANCE = 0.01, 2.13


class Errors(NamedTuple):
    """Force errors of one model, by `predict` and through the kernel; `None` without a held-out
    recording. `parts`: what the first two leave of the parts of their recordings, N², by name.
    """

    here: float
    held: float | None
    filtered: float
    filtered_held: float | None
    parts: Mapping[str, np.ndarray] = MappingProxyType({})

    def worse(self, before: "Errors", rounding: float) -> list[str]:
        """Which of the figures are worse than before, by more than rounding and chance."""
        found = []
        for name in ("here", "held", "filtered", "filtered_held"):
            ours, was = getattr(self, name), getattr(before, name)
            if ours is None or was is None or ours <= was * (1 + rounding):
                continue
            parts = [each.parts[name] for each in (self, before) if name in each.parts]
            # What is not a number is no better than what is.
            if not ours <= was * (1 + UNSEEN) or len(parts) < 2 or not _by_chance(*parts):
                found.append(name)
        return found


def _by_chance(ours, before) -> bool:
    """Whether parts of a record disagree on which of two models leaves more, `(B,)` N² each."""
    more = ours - before
    return bool(np.sum(more) <= CHANCE * np.sqrt(np.sum((more - more.mean()) ** 2)))


class Improved(NamedTuple):
    """What is reported: the baseline, the findings that remain, and both models' errors.

    - `first`: the fit of the baseline; `refitted`: whether its values are others than those given.
    - `dropped`: effects whose findings were dropped, as the model with them is worse; `shown`: the
      findings with those; `spoilt`: the errors of that model; `seen`: those that noise is not.
    - `claimed`: the findings that the recording shows, of which the held-out recording does not
      confirm those of the numbers `refuted`; `worse`: the errors before and with them, where what
      each of them removes there is confirmed, but the model with them is worse; `leaning`: those
      of the refuted that may be none without the others.
    """

    first: Fit
    findings: Findings
    refitted: bool
    before: Errors
    after: Errors
    dropped: tuple[str, ...] = ()
    spoilt: Errors | None = None
    seen: tuple[str, ...] = ()
    shown: Findings | None = None
    claimed: Findings | None = None
    refuted: tuple[int, ...] = ()
    worse: tuple[Errors, Errors] | None = None
    leaning: tuple[int, ...] = ()


def improved(first: Fit, findings: Findings, figures: Figures) -> Improved:
    """The findings, without those that make the saved model worse than the baseline `first`.

    By either figure, over the same samples. Of those without which it is not, the one goes that the
    rows miss least; where there is none, the one without which the force error is least.
    """
    if findings.selection.given is not None:
        # Beside values as given, what only refitted values had called for removes nothing.
        while (less := _without_idle(findings)) is not None:
            findings = less
    claimed, base = findings, findings.at_base(first)
    refitted = first is not findings.selection.base
    spoilt = None

    def compared(some: Findings) -> tuple[Errors, Errors]:
        before = errors_of_base(base, some, figures)
        alike = not (some.selection.selected or refitted)
        return before, before if alike else force_errors(some, figures)

    def worse(before: Errors, after: Errors) -> bool:
        return bool(after.worse(before, figures.rounding))

    while True:
        before, after = compared(findings)
        selected = findings.selection.selected
        if not worse(before, after):
            less = None if spoilt is None else _without_idle(findings)
            if less is None:
                break
            findings = less
            continue
        spoilt = spoilt or after
        if not selected:
            findings, refitted = base, False
            continue
        fewer = [findings.without(n) for n in range(len(selected))]
        enough = [some for some in fewer if not worse(*compared(some))]
        if enough:
            findings = min(enough, key=lambda some: some.undelayed.selection.last.energy)
        else:
            findings = min(fewer, key=lambda some: _here(some, figures))
    dropped = _dropped(claimed, findings)
    shown = claimed if dropped else None
    if spoilt is not None and not dropped:
        dropped = (MISMATCH,)
    seen = tuple(name for name in dropped if not _as_noise(name, claimed))
    return Improved(first, findings, refitted, before, after, dropped, spoilt, seen, shown)


def _as_noise(name: str, found: Findings) -> bool:
    """Whether an effect may be the encoder's noise by the controller's answer: of a load that
    swings faster than a wide kernel resolves. That noise makes a quarter of a residual at most.
    """
    selected = found.undelayed.selection.selected
    own = [n for n, each in enumerate(selected) if each.effect.name == name]
    most = found.undelayed.selection.last.energy / (1 - HALF)
    return bool(own) and all(
        selected[n].trial.candidate.term.swings
        and found.without(n).undelayed.selection.last.energy < most
        for n in own
    )


def _dropped(before: Findings, after: Findings) -> tuple[str, ...]:
    """Effects of which there are fewer findings than before."""
    names, others = (
        [selected.effect.name for selected in some.selection.selected] for some in (before, after)
    )
    return tuple(dict.fromkeys(n for n in names if names.count(n) > others.count(n)))


def without_unsure(findings: Findings) -> Findings:
    """Without what is [`unsure`][]."""
    while numbers := unsure(findings):
        findings = findings.without(numbers[-1])
    return findings


def unsure(findings: Findings) -> list[int]:
    """Numbers of the changes at a moment whose size may as well be none once the moment is
    uncertain, or that may have been at any moment, and of pushes all of which may be none.

    What a change is told by is the value before and after: an interval that holds both says
    nothing. No other recording can bear out what happens once, so that it is tested by the
    intervals that are told, which are wider where one acts in few blocks.
    """
    selected = findings.selection.selected
    dated = [n for n, s in enumerate(selected) if s.effect.moment or s.effect.isolated]
    if not dated:
        return []
    values = estimated(findings)[findings.selection.term_index(0) :]
    terms = findings.selection.last.terms[findings.selection.term_index(0) :]
    return [
        n
        for n in dated
        if spelled.may_be_none(terms[n], values[n], as_told=True) or anytime(findings, n)
    ]


def _without_idle(findings: Findings) -> Findings | None:
    """Without a finding that by itself removes too little; `None` where there is none."""
    energy = findings.undelayed.selection.last.energy
    for number in range(len(findings.selection.selected)):
        less = findings.without(number)
        if 1 - energy / less.undelayed.selection.last.energy < LEAST_SHARE:
            return less
    return None


def holdout_model(findings: Findings) -> Model:
    """The model as it stands on the held-out recording.

    That is the saved one, but for waves at their phase there and without effects of a moment that
    does not return.
    """
    problem, selection = findings.undelayed
    there = verification.carried(selection.last, problem.held, selection.rephased)
    return findings.model(findings.with_late(there))


def _here(findings: Findings, figures: Figures) -> float:
    error = figures.here(findings.model(findings.selection.last))
    return error if np.isfinite(error) else np.inf


def force_errors(findings: Findings, figures: Figures, delay: float | None = None) -> Errors:
    """The force errors of a model, on the held-out recording too where there are rows of it.

    `delay`: that of the model whose samples the figures are to be taken over, if another's.
    """
    problem, selection = findings.undelayed
    filtered = verification.error(selection.last, problem.evidence)
    model = findings.model(findings.selection.last)
    here, parts = figures.here(model, delay), {"here": figures.parts(model, "here", delay)}
    if findings.problem.held is None:
        return Errors(here, None, filtered, None, parts)
    model = holdout_model(findings)
    held, parts["held"] = figures.held(model, delay), figures.parts(model, "held", delay)
    filtered_held = verification.error(selection.last, problem.held, selection.rephased)
    return Errors(here, held, filtered, filtered_held, parts)


def errors_of_base(base: Findings, findings: Findings, figures: Figures) -> Errors:
    """The force errors of the baseline, over the samples of the model with the findings."""
    return force_errors(base, figures, delay_of(findings.model(findings.selection.last)))
