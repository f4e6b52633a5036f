"""The explanation in summary: findings, verdict, errors, and where structure is left."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..checks import MATTERS, Remark
from ..data.recording import Recording
from ..identification.uncertainty import Estimate
from ..terms.effects import EFFECTS
from . import beyond, parameters as spelled, structure, verification
from .acceptance import LINEARITY, OF_BASE, of_smoothing
from .baseline import Baseline
from .curves import curves
from .doubts import accelerates, creeping, doubts, not_better
from .errors import brief, document, filtered_errors
from .explained import Explanation
from .farther import farther
from .figures import Figures
from .finding import Finding
from .findings import Findings
from .improvement import Improved, holdout_model
from .locate import Structure
from .mismatch import Mismatch
from .partial_residuals import moved as moved_curve, partial_residuals
from .reported import NO_POSITION, not_confirmed, reported, with_size, wrong_values
from .selection import Selection
from .sentences import CONSTANT_APART
from .trials import Finalist
from .uncertainty import estimated
from .verdict import beside_rows, halvable, halved, rough, stand_ins, verdict_of
from .wording import (
    ELSEWHERE,
    HOLDS_MORE,
    HOLDS_OTHER,
    OTHER,
    begins_anew,
    constant_apart,
)


def summarise(
    recording: Recording,
    better: Improved,
    known: Baseline,
    wrong: Mismatch | None,
    figures: Figures,
    remarks: Sequence[Remark] = (),
    seed: int = 0,
) -> Explanation:
    """The explanation of a recording from all that was found about it.

    **Arguments:** `better`: the baseline and the findings with which the model is better; `known`:
    the baseline as it was given, and `wrong`, which of its values are; `figures`: the force errors
    of models; `remarks`: what was said about the recording before.
    """
    units, problem = recording.unit_names, better.findings.problem
    selection = better.findings.selection
    before, after = structure.before_and_after(better, wrong, seed)
    effects, alone = reported(better.findings, better.first)
    refuted = not_confirmed(better)
    values = _values(better, wrong, units)
    drawn = _drawn(effects, better, wrong, known, values)
    findings = [finding for finding, _ in drawn]
    models = (
        better.findings.at_base(better.first).model(better.first),
        better.findings.model(selection.last),
    )
    filtered = filtered_errors(better.findings, better.first)
    if not any(remark.severe for remark in remarks):
        remarks = [*remarks, *_doubts(better)]
    tone = tone_left(better.findings, figures)
    errors = document(better, filtered, models[1], figures, tone)
    wrong_data = not findings and any(remark.severe for remark in remarks)
    apart = [] if wrong_data else _elsewhere(errors, effects, better.findings)
    remarks = [*remarks, *apart]
    tones, samples = [], figures.samples(models[1])
    if tone is not None:
        remarks.append(beyond.remark(tone, samples))
        tones = [tone] if beyond.matters(tone, samples) else []
    sizes = None if findings else (beyond.rms(samples.rest), figures.of_counts(models[1]))
    there, later = _that_matter(before.counts, after, better, sizes)
    new, later = (
        [s for s in some if s.coordinate not in known.structured] + tones for some in (there, later)
    )
    missing = rough(filtered, _by_effect(effects)) or beside_rows(errors) or halved(refuted)
    missing |= not findings and _halvable(better.findings, filtered)
    missing |= _values_differ(errors, effects, apart) or any(f.recurs for f in refuted)
    much = missing and not known.rough
    standing = stand_ins(alone, 1 - selection.last.energy / better.first.energy)
    # In another recording that is compared with, what has no name may be as well.
    seen = better.seen if better.spoilt is not None and known.fit is None else ()
    absent = (*better.dropped, *(finding.effect for finding in refuted))
    verdict = verdict_of(findings, new, later, much, standing, remarks, seen)
    there = sorted([*there, *tones], key=lambda each: -each.share)
    where = structure.documents(there, findings, better.first, units, known.structured)
    if verdict == "unexplained" and not where:
        where = structure.strongest(before, units, known.structured)
    shown = curves(before.counts[:6], better, models)
    return Explanation(
        verdict=verdict,
        where=where,
        findings=findings,
        not_confirmed=_listed(refuted, verdict),
        fit=errors,
        not_visible=_not_visible(selection, units, absent),
        model=models[1],
        baseline=models[0],
        baseline_name=known.name,
        baseline_parameters=values,
        recording=facts(recording),
        curves=shown | {"findings": [each for _, each in drawn]},
        warnings=[remark.to_dict() for remark in remarks],
        holdout_model=None if problem.held is None else holdout_model(better.findings),
    )


def _that_matter(
    before: list[Structure],
    after: list[Structure],
    better: Improved,
    sizes: tuple[float, float] | None,
) -> tuple[list[Structure], list[Structure]]:
    """What is a reason for a verdict of the structure that the baseline and the findings leave.

    Beside findings, of which there are no `sizes`, all of it: what they leave is theirs to explain.
    """
    if sizes is None:
        return before, after
    last = better.findings.undelayed.selection.last
    return (
        structure.that_matter(before, better.first, *sizes),
        structure.that_matter(after, last, *sizes),
    )


def _listed(refuted: Sequence[Finding], verdict: str) -> Sequence[Finding]:
    """What is told as not confirmed: of what accounts for little, beside what does, only what this
    recording knows a size of.
    """
    kept = verdict == "unexplained" or halved(refuted)
    return refuted if kept else with_size(refuted)


def tone_left(findings: Findings, figures: Figures) -> Structure | None:
    """A tone too fast for the rows that the model with the findings leaves.

    Of the amplitude of what there is without them a tenth may remain.
    """
    selection = findings.selection
    samples = figures.samples(findings.model(selection.last))
    tone = beyond.tone_beyond(samples, findings.problem.evidence)
    if tone is None or not selection.selected:
        return tone
    before = figures.samples(findings.model(selection.base))
    return tone if tone.size >= OF_BASE**0.5 * beyond.rms(before.rest) else None


def _values_differ(
    errors: Mapping[str, Any], effects: Sequence[Finding], apart: Sequence[Remark]
) -> bool:
    """Whether values are known in both recordings and differ: no one model holds for both.

    Where a load of time alone was found, another constant is the same load.
    """
    of_time = any(EFFECTS[f.effect].coordinates == ("time",) for f in effects)
    if of_time and constant_apart(errors):
        return False
    return bool(apart and errors.get("holdout_values"))


def _halvable(findings: Findings, filtered: Mapping[str, Any]) -> bool:
    """Whether a law that was not accepted halves what is left, of more than a sensor resolves: a
    part of its full scale, which is the largest force at least.
    """
    problem, selection = findings.recorded
    left = filtered["force_error"]["after"] * float(np.sqrt(np.mean(problem.evidence.force**2)))

    def made(finalist: Finalist) -> bool:
        return of_smoothing(finalist, selection.last, problem.rougher())

    return left > LINEARITY * problem.evidence.peak and halvable(selection.remaining, made)


def _drawn(
    effects: Sequence[Finding], better: Improved, wrong: Mismatch | None, known: Baseline, values
) -> list[tuple[Finding, dict[str, Any]]]:
    """All findings, wrong values of the baseline too, each with its picture; the largest first."""
    drawn = list(zip(effects, partial_residuals(better), strict=True))
    if wrong is not None:
        moved = wrong_values(values, wrong, known, better), moved_curve(better, wrong)
        drawn = [moved, *drawn]
    return sorted(drawn, key=lambda pair: -pair[0].share)


def _by_effect(findings: Sequence[Finding]) -> dict[str, float]:
    """The shares of the findings, summed by effect."""
    shares: dict[str, float] = {}
    for finding in findings:
        shares[finding.effect] = shares.get(finding.effect, 0.0) + max(finding.share, 0.0)
    return shares


def _values(better: Improved, wrong: Mismatch | None, units) -> dict[str, Estimate]:
    """The baseline's parameters in the model that is reported."""
    if wrong is not None:
        return estimated(better.findings, wrong.moved)[0]
    problem, selection = better.findings.recorded
    return spelled.estimates(selection.last, problem.block, units)[0] | dict(selection.curve)


def _doubts(better: Improved) -> list[Remark]:
    """What makes the model that is reported doubtful, and what was dropped for its errors."""
    (recorded, _), (problem, selection) = better.findings
    evidence = recorded.evidence
    values = spelled.estimates(selection.last, problem.block, evidence.motion.unit_names)[0]
    if accelerates(values):  # with what other rows say of it
        values = estimated(better.findings)[0]
    remarks = doubts(selection.last, problem, values, better.after.filtered)
    if problem.creeps:
        remarks.append(creeping(problem))
    if better.spoilt is not None and better.seen:
        named = better.shown is not None
        remark = not_better(better.dropped, better.before, better.spoilt, named)
        late = any(EFFECTS[name].late for name in better.dropped)
        if late and not evidence.located:
            remark = remark._replace(text=f"{remark.text} {NO_POSITION}")
        remarks.append(remark)
    return remarks


def _elsewhere(
    errors: Mapping[str, Any], findings: Sequence[Finding] = (), found: Findings | None = None
) -> list[Remark]:
    """That the held-out recording obeys other values of the same model, or holds something that no
    values account for and that is not here, where that matters.

    Less is told in the summary alone. What is left at one moment may be of a motion that is too
    quick there for the kernel: with what was `found` that is said.
    """
    here, held = errors["filtered_force_error"], errors["filtered_holdout_force_error"]
    refitted = errors["filtered_holdout_refitted_error"]
    if refitted is None:
        return []
    if held["after"] ** 2 - refitted**2 < MATTERS**2 or not held["after"] > ELSEWHERE * refitted:
        more = held["after"] ** 2 - here["after"] ** 2 >= MATTERS**2
        if not more or not refitted > ELSEWHERE * here["after"]:
            return []
        text = (
            f"The held-out recording is left with {held['after']:.1%} of its force, whatever the "
            f"values, and this one with {here['after']:.1%}: "
        )
        acts = "something acts there that does not act here, or not as much"
        acts = _acts_more(here, held, findings) + acts
        about = None if found is None else brief(found)
        if about is None or found is None:
            text += acts
        else:
            text += (
                f"most of that about t = {about:.4g} s. Either {acts}, or the motion is too quick "
                f"there for a filter of {found.problem.evidence.reach:.2g} s, as this log needs"
            )
        text += "." if found is None else f".{farther(found.problem)}"
        text += " Explain that one, with this one held out."
        return [Remark(HOLDS_MORE, text, False)]
    text = (
        f"The held-out recording is left with {held['after']:.0%} of its force, and with "
        f"{refitted:.0%} where the model is fitted to that one: "
    )
    if constant := constant_apart(errors):
        text += f"a constant force of {constant} more acts there. {CONSTANT_APART}"
    elif held["after"] > OTHER:
        text += (
            "it is of another axis, in other units or of another sign, or this recording does not "
            "determine the values that hold there."
        )
    elif anew := begins_anew(findings):
        text += f"other values hold there. {anew}"
    else:
        text += (
            "other values hold there. The machine has changed, or this recording does not "
            "determine them: identify on one that moves like both."
        )
    return [Remark(HOLDS_OTHER, text, False)]


def _acts_more(
    here: Mapping[str, float], held: Mapping[str, float], findings: Sequence[Finding]
) -> str:
    """That what was found makes a larger part of the held-out force than here, so that what its law
    lacks shows there, the beginning of a sentence; empty where it does not.
    """
    names = [f.effect.replace("_", " ") for f in findings if not EFFECTS[f.effect].momentary]
    if not names:
        return ""
    parts = [max(e["before"] ** 2 - e["after"] ** 2, 0.0) ** 0.5 for e in (here, held)]
    if not parts[1] > parts[0]:
        return ""
    what = " and ".join(dict.fromkeys(names))
    return (
        f"{what} takes {parts[1]:.0%} of the force there and {parts[0]:.0%} here, and what its law "
        "as found here lacks shows there, or "
    )


def _not_visible(selection: Selection, units, absent: Sequence[str]) -> list[dict[str, Any]]:
    """The smallest visible size of each effect that was neither found nor dropped."""
    sizes = verification.smallest_visible(selection.remaining, selection.last)
    return [
        {"effect": effect, "smallest_detectable": float(size), "unit": units["force"]}
        for effect, size in sorted(sizes.items(), key=lambda item: item[1])
        if effect not in selection.names and effect not in absent
    ]


def facts(recording: Recording) -> dict[str, Any]:
    """File, samples, duration, s, and rate, Hz, of a recording."""
    time, mask = np.asarray(recording.time), np.asarray(recording.mask)
    steps = np.diff(time[mask])
    steps = steps[steps > 0]
    return {
        "file": recording.source,
        "sha256": recording.sha256 or None,
        "samples": int(mask.sum()),
        "duration": float(steps.sum()),
        "sample_rate": float(1 / np.median(steps)),
    }
