"""What was found, told: findings with their parameters and sentences, the verdict, the errors."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..checks import MATTERS, Remark
from ..data.recording import Recording
from ..identification.uncertainty import Estimate
from ..terms.effect import Extent
from ..terms.effects import EFFECTS
from ..terms.effects.parameter_mismatch import MISMATCH, PARAMETER_MISMATCH
from . import parameters as spelled, verification
from .baseline import Baseline, Mismatch, freed
from .bins import unit
from .curves import curves
from .doubts import NOT_BETTER, accelerates, doubts, not_better
from .errors import document, filtered_errors
from .evidence import Evidence
from .explained import ELSEWHERE, Explanation, Finding, Moved
from .figures import Figures
from .holdout import residuals
from .improvement import Improved, beside_others, elsewhere
from .locate import NOISY, Place, locate, repeated
from .naming import LATER_SHARE, LEAST_SHARE, LINEARITY, Named
from .partial_residuals import moved as moved_curve, partial_residuals
from .predictions import with_predictions
from .problem import Problem
from .regression import Fit, fast, fit
from .sentences import changed_sentence, mismatch_sentence, sentence
from .significance import LEVEL
from .views import estimated


def tell(
    recording: Recording,
    problem: Problem,
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
    units, evidence = recording.unit_names, problem.evidence
    first, found, rest = better.first, better.found, better.rest
    before, after = _places(problem, better, wrong, seed)
    findings, alone = _findings(found, problem, rest, first)
    refuted = _refuted(better, problem)
    shown = partial_residuals(problem, better)
    standing = _stand_ins(alone, 1 - found.last.energy / first.energy)
    shares: dict[str, float] = {}
    for finding in findings:
        shares[finding.effect] = shares.get(finding.effect, 0.0) + max(finding.share, 0.0)
    values = spelled.estimates(
        found.last if wrong is None else freed(found.last, wrong.moved), problem.block, units
    )[0]
    if wrong is not None:
        findings = [_moved(values, wrong, known, found, first, problem), *findings]
        shown = [moved_curve(problem, better, wrong), *shown]
    models = tuple(spelled.model(now, recording.units) for now in (first, found.last))
    drawn = curves(
        before[:6], first, found.last, evidence, problem.held, units, models, found.rephased
    )
    told = sorted(zip(findings, shown, strict=True), key=lambda pair: -pair[0].share)
    findings, drawn["findings"] = [each for each, _ in told], [picture for _, picture in told]
    filtered = filtered_errors(problem, first, *rest)
    if not any(remark.severe for remark in remarks):
        remarks = [*remarks, *_doubts(problem, better, units)]
    much = rough(filtered, shares) and not known.rough
    new, later = ([p for p in some if p.coordinate not in known.left] for some in (before, after))
    verdict = _verdict(findings, new, later, much, standing)
    errors = document(problem, better, filtered, models[1], figures)
    remarks = [*remarks, *_elsewhere(errors)]
    return Explanation(
        verdict=_doubted(verdict, remarks, known.fit is not None),
        where=_everywhere([_where(place, units, known.left) for place in before], findings, first),
        findings=findings,
        not_confirmed=refuted,
        fit=errors,
        not_visible=_not_visible(found, units, (*better.gone, *(f.effect for f in refuted))),
        model=models[1],
        baseline=models[0],
        baseline_name=known.name,
        baseline_parameters=values,
        recording=facts(recording),
        curves=drawn,
        warnings=[remark.to_dict() for remark in remarks],
        holdout_model=None if problem.held is None else elsewhere(found, rest, recording.units),
    )


def _places(problem: Problem, better: Improved, wrong: Mismatch | None, seed: int):
    """Where the baseline's residual has structure, and where that of the findings has."""
    first, evidence = better.first, problem.evidence
    force = float(np.sqrt(np.mean(evidence.force**2)))
    before = shown_places(
        locate(with_predictions(evidence, first), first, seed), LEAST_SHARE, force
    )
    before = _through_wide(before, first, problem.wide, seed)
    before = _lasting(before, first, problem)
    if not better.found.taken and wrong is None:
        return before, []
    where, left = better.rest
    seen = with_predictions(where.evidence, left.last)
    after = shown_places(locate(seen, left.last, seed), LATER_SHARE, force)
    after = _through_wide(after, left.last, where.wide, seed)
    return before, _lasting(after, left.last, where)


def _doubts(problem: Problem, better: Improved, units) -> list[Remark]:
    """What makes the model that is reported doubtful, and what was not reported for its errors."""
    where, left = better.rest
    values = spelled.estimates(left.last, where.block, units)[0]
    if accelerates(values):  # with what other views say of it
        values = estimated(better.found, problem, better.rest)[0]
    remarks = doubts(left.last, where, values, better.after.filtered)
    if better.spoilt is not None:
        remark = not_better(better.gone, better.before, better.spoilt)
        late = any(EFFECTS[name].late for name in better.gone)
        if late and problem.evidence.motion.position is None:
            remark = remark._replace(text=f"{remark.text} {NO_POSITION}")
        remarks.append(remark)
    return remarks


def _elsewhere(errors: Mapping[str, Any]) -> list[Remark]:
    """That the held-out recording obeys other values of the same model, where that matters.

    Less is told in the summary alone.
    """
    held, refitted = (
        errors["filtered_holdout_force_error"],
        errors["filtered_holdout_refitted_error"],
    )
    if refitted is None or not held["after"] > ELSEWHERE * refitted:
        return []
    if held["after"] ** 2 - refitted**2 < MATTERS**2:
        return []
    text = (
        f"The held-out recording is left with {held['after']:.0%} of its force, and with "
        f"{refitted:.0%} where the model is fitted to it: it is of another axis, in other units or "
        "of another sign, or this recording does not determine the values that hold there."
    )
    return [Remark("holdout_differs", text, False)]


def _doubted(verdict: str, remarks: Sequence[Remark], compared: bool) -> str:
    """A verdict that says no more than the remarks allow.

    `compared`: with another recording, in which what has no name may be as well.
    """
    names = {remark.name for remark in remarks}
    doubtful = any(remark.severe for remark in remarks)
    if verdict == "explained" and doubtful:
        return "partly_explained"
    return (
        "unexplained"
        if verdict == "consistent" and (doubtful or (NOT_BETTER in names and not compared))
        else verdict
    )


def _moved(
    values, wrong: Mismatch, known: Baseline, found: Named, first: Fit, problem: Problem
) -> Finding:
    names = [p.name for p in (*found.base.terms[0].affine, *found.base.terms[0].nonlinear)]
    errors = np.zeros(len(names)) if known.errors is None else known.errors
    moved = {}
    for i, before in wrong.moved.items():
        now = values[names[i]]
        if i not in wrong.within:
            moved[names[i]] = Moved(
                before, now.value, now.standard_error, now.unit, float(errors[i])
            )
    held = None
    if problem.held is not None:
        held = verification.share(first, found.base, first, problem.held)
    text = mismatch_sentence(moved, wrong.share)
    if known.fit is not None:
        text = changed_sentence(moved, wrong.share, known.name.removeprefix("recording "))
    instead = {names[i]: tuple(names[j] for j in others) for i, others in wrong.instead.items()}
    return Finding(
        MISMATCH, PARAMETER_MISMATCH.equation, text, (), "", moved,
        wrong.share, held, wrong.p_value, instead=instead,
    )  # fmt: skip


def shown_places(places: list[Place], least: float, force: float) -> list[Place]:
    """The places that are believed: by chance, by share, and beyond the force's linearity."""
    floor = LINEARITY * force
    return [p for p in places if p.p_value <= LEVEL and p.share >= least and p.size >= floor]


def _through_wide(places: list[Place], now: Fit, wide: Evidence | None, seed) -> list[Place]:
    """Without what a kernel of twice the width does not show of the coordinates that hold noise.

    They hold the acceleration, whose noise is in the residual too, by the loop's answer to the
    encoder: a curve over them that follows that noise alone, and in power is 2⁵ to 2⁷ times weaker
    there. Not asked is what is larger than all that differs from row to row, but the force's rate,
    which holds the acceleration's derivative.
    """
    noise = fast(now)

    def doubted(place: Place) -> bool:
        rate = place.coordinate == "force_rate"
        return rate or (place.coordinate in NOISY and place.size <= noise)

    if wide is None or not any(map(doubted, places)):
        return places
    again = fit(now.terms, with_predictions(wide, now), now.betas, 4)
    there = locate(with_predictions(wide, again), again, seed)
    sure = {p.coordinate for p in there if p.p_value <= LEVEL and p.share >= LEAST_SHARE}
    return [p for p in places if p.coordinate in sure or not doubted(p)]


def _lasting(places: list[Place], now: Fit, problem: Problem) -> list[Place]:
    """The places that the held-out recording shows too, and no slow part of the noise.

    Every axis has a load that wanders: one that is slow beside the kernel but no larger than what
    differs from row to row is the same noise.
    """
    places = [p for p in places if p.coordinate != "time" or p.size > fast(now)]
    if problem.held is None:
        return places
    return repeated(places, now, with_predictions(problem.held, now))


# Slow hidden loads of healthy machines make a residual up to about twice as large as its own fast
# part; of four times its size, sixteen times the power, something is missing, wherever.
ROUGH = 4.0
# Where the findings leave half of the mismatch's size, a quarter of its power, less will do: more
# than half as much again as that noise in power. So it will where they leave more than the
# geometric mean of mismatch and noise.
HALF_ROUGH, HALF = 1.25, 0.5


def rough(fit: dict[str, Any], shares: Mapping[str, float]) -> bool:
    """Whether what is left is far from the noise that neighbouring rows show, or much of it all.

    What is named (`shares` by effect) has to explain the held-out recording as well: to within four
    times the noise, and its larger part. Effects of time alone need not recur: held-out error is
    allowed in proportion to what they explain here. Where nothing is named, any base that has to
    extrapolate may miss that recording by more.
    """
    here, held = fit["force_error"], fit["holdout_force_error"]

    def above(view, size: float) -> bool:
        return view["after"] > max(size * fit["noise_floor"], LINEARITY)

    def left(view) -> float:
        return (view["after"] / max(view["before"], 1e-300)) ** 2

    much, far = [here], False
    if held is not None:
        momentary = [share for name, share in shares.items() if EFFECTS[name].momentary]
        excused = HALF_ROUGH**2 * (left(here) + sum(momentary)) if momentary else 0.0
        much += [held] if left(held) > excused else []
        if not momentary:
            far = above(held, ROUGH)
    # The findings go from the mismatch to the noise, and less than half the way (in decades).
    halfway = np.sqrt(here["before"] * fit["noise_floor"])
    many = any(left(view) > HALF**2 and above(view, HALF_ROUGH) for view in much)
    many |= here["after"] > max(halfway, LINEARITY)
    return bool(above(here, ROUGH) or (shares and (many or far)))


# Of two effects that are there each has a part of its own; of three or more that share a quarter of
# what they account for, none can claim it: they stand in for one that the library does not have.
STAND_INS = 3
CLAIMED = 0.75


def _stand_ins(alone: list[float], removed: float) -> bool:
    """Whether many findings share what they remove of the mismatch, instead of adding up to it.

    `alone`: what each removes beside all the others.
    """
    claimed = sum(max(share, 0.0) for share in alone)
    return len(alone) >= STAND_INS and claimed < CLAIMED * removed


def _verdict(findings: list[Finding], before, after, rough: bool, standing: bool) -> str:
    if findings:
        return "partly_explained" if after or rough or standing else "explained"
    return "unexplained" if before or rough else "consistent"


# What cannot be told from a force that acts late.
NO_POSITION = (
    "No position is recorded: a filter on the recorded velocity looks like a delay or a lag, and "
    "recording the position tells."
)


def _findings(
    found: Named, problem: Problem, rest, first: Fit
) -> tuple[list[Finding], list[float]]:
    """The findings, and the share of each beside all the others."""
    start = len(found.last.terms) - len(found.taken)
    values = estimated(found, problem, rest)[start:]
    findings, alone = [], []
    for number, (taken, parameters) in enumerate(zip(found.taken, values, strict=True)):
        effect = taken.trial.candidate.effect
        if effect.moment:
            parameters = _dated(parameters, effect.moment, problem.evidence)
        share, held = _shares(found, problem, rest, first, number)
        alone.append(share)
        if twins := _twins(found, number):
            share, held = _shares(found, problem, _without(rest, twins), first, number)
        rivals = taken.rivals
        text = sentence(effect.name, parameters, share, rivals, _extent(problem.evidence))
        if taken.rephased:
            text += (
                " On the held-out recording it has the same period and amplitude at another "
                "phase: the position's zero has moved, as after another homing."
            )
        if effect.late and problem.evidence.motion.position is None:
            text += f" {NO_POSITION}"
        findings.append(
            Finding(
                effect.name,
                effect.equation,
                text,
                rivals,
                effect.separate_by,
                parameters,
                share,
                held,
                taken.p_value,
                confirmed=taken.confirmed,
            )
        )
    return findings, alone


def _refuted(better: Improved, problem: Problem) -> list[Finding]:
    """What this recording shows and the held-out one does not bear out."""
    if not better.refuted:
        return []
    every, _ = _findings(better.claimed[0], problem, better.claimed[1], better.first)
    text = " The held-out recording does not bear it out: it is not in the model."
    return [
        every[n]._replace(confirmed=False, sentence=every[n].sentence + text)
        for n in better.refuted
    ]


def _twins(found: Named, number: int) -> list[int]:
    """Later findings of the same effect, the last one first.

    Two stops that stand for one which stiffens are each nearly all of it without the other. So the
    earlier one is judged before the later, and their shares add up to that of the effect.
    """
    names = [taken.trial.candidate.effect.name for taken in found.taken]
    return [n for n in reversed(range(number + 1, len(names))) if names[n] == names[number]]


def _without(rest: tuple[Problem, Named], numbers: list[int]) -> tuple[Problem, Named]:
    """What is judged, without some findings, of which the last comes first."""
    where, left = rest
    evidence = with_predictions(where.evidence, left.last)
    for number in numbers:
        less = verification.lacking(left, evidence, number)
        left = left._replace(last=less, taken=left.taken[:number] + left.taken[number + 1 :])
    return where, left


def _extent(evidence: Evidence) -> Extent:
    """The range of the position and the usual force."""
    limits = evidence.limits
    force = float(np.sqrt(np.mean(evidence.force**2)))
    return Extent(float(limits.low), float(limits.high), force)


def _shares(
    found: Named, problem: Problem, rest, first: Fit, number: int
) -> tuple[float, float | None]:
    """The part of the mismatch that a finding alone accounts for, here and held out.

    `None` for what no other recording can say. Of a force that acts late all that undoing it takes
    away is its own; the others are judged with the force put back.
    """
    left = rest[1]
    base = found.base if number == len(left.taken) else left.base
    less = beside_others(found, rest, problem, number)
    # No more than the base leaves, which refitting in a few steps may miss.
    share = float((min(less.energy, base.energy) - left.last.energy) / first.energy)
    if problem.held is None or found.taken[number].trial.candidate.effect.momentary:
        return share, None
    without, with_it = residuals(less, rest, problem, number)
    power = np.sum(verification.residual(first, problem.held) ** 2)
    return share, float((np.sum(without**2) - np.sum(with_it**2)) / power)


def _dated(parameters: dict[str, Estimate], moment: str, evidence: Evidence) -> dict[str, Estimate]:
    """A step lies somewhere between two rows, each blurred by the kernel; at rest they are far
    apart. The error of a time that may be anywhere in that width, s.
    """
    own = parameters[moment]
    times = np.asarray(evidence.motion.time)[evidence.centre]
    after = int(np.clip(np.searchsorted(times, own.value), 1, len(times) - 1))
    width = times[after] - times[after - 1] + evidence.reach
    error = np.hypot(own.standard_error, width / np.sqrt(12))
    return parameters | {moment: own._replace(standard_error=np.float64(error))}


def _everywhere(places: list[dict], findings: list[Finding], first: Fit) -> list[dict[str, Any]]:
    """The places, and where findings act that no free curve shows: at a few rows, say."""
    for finding in findings:
        own = [name.removesuffix("_lines") for name in EFFECTS[finding.effect].coordinates]
        if not own or any(place["coordinate"] in own for place in places):
            continue
        power = max(finding.share, 0.0) * first.energy / len(first.residual)
        place = {
            "coordinate": own[0],
            "share": finding.share,
            "size": float(np.sqrt(power)),
            "p_value": finding.p_value,
            "detail": f"where {finding.effect.replace('_', ' ')} acts",
        }
        places = [*places, place]
    return places


def _where(
    place: Place, units: Mapping[str, str], shared: frozenset[str] = frozenset()
) -> dict[str, Any]:
    detail, its = "", unit(place.coordinate, units)
    if place.coordinate == "position_lines":
        detail = f"period {1 / place.peak:.4g} {its}"
    elif place.coordinate == "time_lines":
        detail = f"{place.peak:.4g} Hz"
    elif place.coordinate == "force_rate":
        late = float(place.curve[1][0])
        detail = f"the force acts {abs(late):.2g} s {'late' if late > 0 else 'early'}"
    elif len(place.curve[0]):
        at, height = place.curve
        peak = int(np.argmax(np.abs(height)))
        detail = f"strongest at {at[peak]:.3g} {its}".rstrip()
    if place.coordinate in shared:
        detail += ", as in the other recording"
    return {
        "coordinate": place.coordinate.removesuffix("_lines"),
        "share": place.share,
        "size": place.size,
        "p_value": place.p_value,
        "detail": detail,
    }


def _not_visible(found: Named, units, gone: Sequence[str]) -> list[dict[str, Any]]:
    sizes = verification.smallest_visible(found.left, found.last)
    return [
        {"effect": effect, "smallest_detectable": float(size), "unit": units["force"]}
        for effect, size in sorted(sizes.items(), key=lambda item: item[1])
        if effect not in found.names and effect not in gone
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
