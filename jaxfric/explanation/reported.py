"""Findings as they are reported: parameters with their errors, shares, sentences."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..identification.uncertainty import Estimate
from ..terms.effect import ANY, Effect, Extent
from ..terms.effects import EFFECTS
from ..terms.effects.parameter_mismatch import MISMATCH, PARAMETER_MISMATCH
from ..units import spell
from . import parameters as spelled, rivals, verification
from .acceptance import OF_BASE
from .baseline import Baseline
from .common_factor import FACTOR, factor_of
from .dates import dated, spanning
from .evidence import Evidence
from .finding import Finding, Moved
from .findings import Findings
from .improvement import Errors, Improved
from .mismatch import Mismatch
from .quantities import nil, quantity, rise
from .regression import Fit
from .selection import SelectedTerm
from .sentences import changed_sentence, factor_sentence, mismatch_sentence, sentence, spoken
from .slow_changes import slow, together
from .uncertainty import estimated
from .verdict import overlapping

# What cannot be told from a force that acts late.
NO_POSITION = (
    "No position is recorded: a filter on the recorded velocity looks like a delay or a lag, and "
    "recording the position tells."
)
ELSEWHERE = " The held-out recording does not go where it acts, and cannot confirm it."
FAINT = (
    " On the held-out recording it is but {0:.2%} of the force (root mean square), too little to "
    "confirm it."
)
REST = (
    " Its size is not known together with its shape, and it is little beside the other findings: "
    "it may be what those have not quite the shape of."
)
REPHASED = (
    " On the held-out recording it has the same period and amplitude at another phase: the "
    "position's zero has moved, as after another homing."
)


def reported(findings: Findings, first: Fit) -> tuple[list[Finding], list[float]]:
    """The findings, and the share of each beside all the others."""
    selection, evidence = findings.selection, findings.problem.evidence
    estimates = estimated(findings)
    values = estimates[selection.term_index(0) :]
    extent = _extent(evidence, estimates[0])
    every = [_shares(findings, first, number) for number in range(len(values))]
    shares = [
        _shares(_without(findings, twins), first, number) if twins else every[number]
        for number, twins in enumerate(_twins(findings, n) for n in range(len(values)))
    ]
    removed = 1 - selection.last.energy / first.energy
    together = removed if overlapping([share for share, _ in shares], removed) else None
    result: list[Finding] = []
    for number, (selected, parameters) in enumerate(zip(selection.selected, values, strict=True)):
        effect, (share, held) = selected.effect, shares[number]
        term = selection.last.terms[selection.term_index(number)]
        small = len(values) > 1 and share < OF_BASE
        rest = small and spelled.may_be_none(term, parameters, as_told=True)
        if effect.moment:
            parameters = dated(parameters, effect.moment, evidence)
            parameters = spanning(parameters, findings, number)
        parameters = parameters | _dates(effect, findings, number)
        parameters = parameters | _derived(effect, parameters, extent, evidence)
        names = _rivals(findings, number, together)
        alike = *names, *map(spoken, selected.instead)
        text = sentence(effect.name, parameters, share, alike, extent, together)
        text += _overtone(effect, parameters, result)
        text += _told_with(findings, number, extent)
        if rest:
            text += REST
        if selected.rephased:
            text += REPHASED
        unheard = selected.confirmed is None and not effect.momentary
        if findings.problem.held is not None and unheard:
            text += unconfirmed(_part_there(findings, number))
        if effect.late and not evidence.located:
            text += f" {NO_POSITION}"
        result.append(
            Finding(
                effect.name, effect.equation, text, names, effect.separate_by, parameters,
                share, held, selected.p_value, confirmed=selected.confirmed,
                instead=_instead(selected),
            )
        )  # fmt: skip
    return result, [share for share, _ in every]


def _rivals(findings: Findings, number: int, together: float | None) -> tuple[str, ...]:
    """What a finding cannot be told from: not what stands beside it, unless they overlap."""
    problem, selection = findings.examined_in(number)
    own = selection.selected[number]
    told = rivals.beside(problem, selection, number) if together is None and own.near else ()
    return tuple(name for name in own.rivals if name not in told)


def _instead(selected: SelectedTerm) -> dict[str, tuple[str, ...]]:
    """To the parameter that changed, others that may have changed instead."""
    own = selected.trial.candidate.term.affine[0].name
    return {own: selected.instead} if selected.instead else {}


def not_confirmed(better: Improved) -> list[Finding]:
    """What this recording shows and the held-out one does not confirm, and what its rows show with
    which the model is worse sample by sample.
    """
    shown = [] if better.shown is None else _beside_rows(better)
    if not better.refuted:
        return shown
    every, _ = reported(better.claimed, better.first)
    return shown + [
        every[n]._replace(
            confirmed=False,
            recurs=_recurs(every[n], better),
            sentence=every[n].sentence
            + (_LEANING if n in better.leaning else _reason(every[n], better)),
        )
        for n in better.refuted
    ]


# Of a change at a moment, which no other recording can bear out.
_LEANING = " Without what the held-out recording refutes it may as well be none: it is left out."


def with_size(refuted: Sequence[Finding]) -> list[Finding]:
    """Those of which this recording knows a size, not only that there may be one."""
    return [finding for finding in refuted if not _of_no_size(finding)]


def _of_no_size(finding: Finding) -> bool:
    """Whether the intervals of all that its force is proportional to hold zero."""
    terms = EFFECTS[finding.effect].shapes(ANY)
    affine = {parameter.name for term in terms for parameter in term.affine}
    sizes = [
        estimate
        for name, estimate in finding.parameters.items()
        if name in affine or name.startswith("amplitude")
    ]
    return bool(sizes) and all(nil(e) or not math.isfinite(float(e.standard_error)) for e in sizes)


def _beside_rows(better: Improved) -> list[Finding]:
    """What the rows show and was dropped: the held-out recording has no say."""
    every, _ = reported(better.shown, better.first)
    why = " Sample by sample the model with it is worse: it is not in the model."
    return [
        finding._replace(sentence=f"{finding.sentence}{why}")
        for finding in every
        if finding.effect in better.dropped
    ]


def _recurs(finding: Finding, better: Improved) -> bool:
    """Whether the held-out recording shows it too, though the model with it is worse."""
    return bool(better.worse is not None and finding.confirmed)


def _reason(finding: Finding, better: Improved) -> str:
    """Why a finding is not confirmed, the end of its sentence."""
    if finding.confirmed is None:  # as the sentence has said
        return " The model is no better there with it, so it is left out."
    if not _recurs(finding, better):
        return " The held-out recording does not bear it out: it is not in the model."
    name, change = _risen(*better.worse)
    error = "filtered force error" if name.startswith("filtered") else "force error"
    where = "there" if name.endswith("held") else "on this recording"
    return (
        f" The held-out recording shows it too, but the model with it is worse {where}: it takes "
        f"the {error} from {change}. It is not in the model."
    )


def _risen(before: Errors, after: Errors) -> tuple[str, str]:
    """The name of the figure that is worse by the largest factor, and how it rose."""

    def factor(name: str) -> float:
        times = getattr(after, name) / max(getattr(before, name), 1e-300)
        return times if times == times else np.inf

    name = max(after.worse(before, 0.0), key=factor)
    return name, rise(getattr(before, name), getattr(after, name))


def wrong_values(values, wrong: Mismatch, known: Baseline, better: Improved) -> Finding:
    """The finding that values of the baseline are wrong; `values`, its parameters as refitted."""
    base, held = better.findings.selection.base, better.findings.problem.held
    names = [p.name for p in (*base.terms[0].affine, *base.terms[0].nonlinear)]
    errors = np.zeros(len(names)) if known.errors is None else known.errors
    moved = {}
    for i, before in wrong.moved.items():
        current = values[names[i]]
        if i not in wrong.within:
            moved[names[i]] = Moved(before, current, float(errors[i]))
    first = better.first
    held_share = None if held is None else verification.share(first, base, first, held)
    other = None if known.fit is None else known.name.removeprefix("recording ")
    if wrong.factor is not None:
        factor = factor_of(known, better.findings.undelayed)
        told = factor_sentence(factor, wrong.share, other, wrong.friction, wrong.rivals)
        # Each value is that many times what it was, as well known as the factor is.
        moved = {FACTOR: Moved(1.0, factor)} | {
            name: m._replace(estimate=factor._replace(
                value=m.before * factor.value,
                standard_error=abs(m.before) * factor.standard_error,
                unit=m.unit,
            ))
            for name, m in moved.items()
        }  # fmt: skip
    elif other is not None:
        told = changed_sentence(moved, wrong.share, other, wrong.rivals)
    else:
        unit = better.findings.problem.evidence.motion.unit_names["force"]
        told = mismatch_sentence(moved, wrong.share, wrong.rivals, unit)
    separate_by = " ".join(dict.fromkeys(EFFECTS[rival].separate_by for rival in wrong.rivals))
    instead = {names[i]: tuple(names[j] for j in others) for i, others in wrong.instead.items()}
    return Finding(
        MISMATCH, PARAMETER_MISMATCH.equation, told, wrong.rivals, separate_by, moved,
        wrong.share, held_share, wrong.p_value, instead=instead,
    )  # fmt: skip


def _overtone(effect: Effect, parameters: dict[str, Estimate], before: list[Finding]) -> str:
    """That a wave is a harmonic of an earlier finding of the same effect, by the errors of both
    periods, in words.
    """
    for earlier in before:
        for name in effect.periods if earlier.effect == effect.name else ():
            first, own = earlier.parameters[name], parameters[name]
            ratio = float(first.value) / float(own.value)
            error = math.hypot(*(float(p.half_width() / p.value) for p in (first, own)))
            if round(ratio) > 1 and abs(ratio / round(ratio) - 1) <= error < 0.5 / ratio:
                whole = quantity(Estimate(np.float64(first.value), np.float64(0.0), first.unit))
                part = f"1/{round(ratio)} of the period of {whole}"
                return f" That is {part}: a harmonic of the same cause."
    return ""


def _part_there(findings: Findings, number: int) -> float:
    """The part of the held-out recording's force that is a finding's, root mean square."""
    problem, selection = findings.examined_in(number)
    return verification.part(selection.last, problem.held, selection.term_index(number))


def unconfirmed(part: float) -> str:
    """Why the held-out recording cannot confirm a finding that has a `part` of the force there."""
    return ELSEWHERE if f"{part:.2%}" == "0.00%" else FAINT.format(part)


def _told_with(findings: Findings, number: int, extent: Extent) -> str:
    """That the values along the stroke are those of several findings together, in words."""
    _, selection = findings.examined_in(number)
    current, index = selection.last, selection.term_index(number)
    stroke = extent.low, extent.high
    if not slow(current.terms[index], current.betas[index], stroke):
        return ""
    first = selection.term_index(0)
    others = [
        selection.selected[n - first].effect.name.replace("_", " ")
        for n in together(current, index, stroke)
        if n != index
    ]
    return f" These values along the stroke are with {' and '.join(others)}." if others else ""


def _twins(findings: Findings, number: int) -> list[int]:
    """Later findings of the same effect, the last one first.

    Two stops that stand for one which stiffens are each nearly all of it without the other. So the
    earlier one is compared without the later, and their shares add up to that of the effect.
    """
    names = [selected.effect.name for selected in findings.selection.selected]
    return [n for n in reversed(range(number + 1, len(names))) if names[n] == names[number]]


def _dates(effect: Effect, findings: Findings, number: int) -> dict[str, Estimate]:
    """The times that a term holds as given numbers: anywhere between two rows."""
    problem, selection = findings.examined_in(number)
    term = selection.last.terms[selection.term_index(number)]
    error = problem.evidence.reach / problem.evidence.half / np.sqrt(12)
    return {
        name: Estimate(np.float64(at), np.float64(error), "s")
        for name, at in effect.dates(term).items()
    }


def _without(findings: Findings, numbers: list[int]) -> Findings:
    """The findings compared without some, of which the last comes first."""
    undelayed = findings.undelayed
    for number in numbers:
        undelayed = undelayed.without(number)
    return findings._replace(undelayed=undelayed)


def _extent(evidence: Evidence, base: Mapping[str, Estimate]) -> Extent:
    """The range of the position, the usual force and the largest, and the inertia by the `base`'s
    parameters.
    """
    limits = evidence.limits
    force = float(np.sqrt(np.mean(evidence.force**2)))
    inertia = float(base["inertia"].value) if "inertia" in base else float("nan")
    return Extent(float(limits.low), float(limits.high), force, inertia, float(limits.peak))


def _derived(
    effect: Effect, parameters: Mapping[str, Estimate], extent: Extent, evidence: Evidence
) -> dict[str, Estimate]:
    """Values that follow from the parameters, as well known as these."""
    values = {name: float(estimate.value) for name, estimate in parameters.items()}
    units = evidence.motion.unit_names
    found = {}
    for name, how in effect.derived(values, extent).items():
        own = parameters[how.of]
        found[name] = own._replace(
            value=how.factor * own.value,
            standard_error=abs(how.factor) * own.standard_error,
            unit=spell(how.dimension, units),
        )
    return found


def _shares(findings: Findings, first: Fit, number: int) -> tuple[float, float | None]:
    """The part of the mismatch that a finding alone accounts for, here and held out.

    `None` for what no other recording can say.
    """
    base = findings.examined_in(number).selection.base
    less, last = findings.fit_without(number), findings.undelayed.selection.last
    # No more than the base leaves, which refitting in a few steps may miss.
    share = float((min(less.energy, base.energy) - last.energy) / first.energy)
    held = findings.problem.held
    if held is None or findings.selection.selected[number].effect.momentary:
        return share, None
    without, with_it = findings.holdout_residuals(less, number)
    power = np.sum(verification.residual(first, held) ** 2)
    return share, float((np.sum(without**2) - np.sum(with_it**2)) / power)
