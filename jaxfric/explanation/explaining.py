"""The verb: locate where a model and a recording differ, name what is missing, verify it."""

import dataclasses
from collections.abc import Callable, Hashable

import jax
import numpy as np

from ..checks import Remark
from ..data.recording import Recording
from ..identification.identified import Identified
from ..models import Model, named
from ..simulators import AbstractSimulator
from ..terms.base import AbstractTerm
from . import beyond, parameters as spelled, sanity, threads, zero
from .attributes import in_own_words
from .baseline import Baseline, baseline_of
from .doubts import contradicted
from .earlier import Earlier, obeyed, rephased
from .explained import Explanation
from .findings import Findings
from .forward import motion_error
from .holdout import check_signals, confirmed
from .idealised import idealised, with_idealised
from .improvement import Errors, Improved
from .inputs import Inputs, prepare
from .mismatch import Mismatch
from .motion import Motion, motion_of
from .own_values import improved_model, judged, known_there
from .problem import Problem, problem_of, with_holdout
from .rivals import NO_EVIDENCE
from .search import nothing, obeying, searched
from .slow_curve import at_slow_speeds
from .summary import facts, summarise, tone_left
from .undetermined import without_undetermined


def explain(
    recording: Recording,
    baseline: str
    | AbstractTerm
    | Model
    | Identified
    | Recording
    | Earlier
    | AbstractSimulator = "gaussian",
    holdout: Recording | None = None,
    *,
    fixed: bool = False,
    simulate: bool = False,
    seed: int = 0,
    doing: Callable[[str], None] = lambda stage: None,
) -> Explanation:
    """What a model leaves out of a recording: where, what, how much, and what could not be seen.

    **Arguments:**

    - `recording`, and `holdout`, for validation only: signals of shape `(N,)`. Of velocity alone
      the position is its integral; where the held-out one begins, it is fitted there.
    - `baseline`: a model's name or a sum of terms, whose parameters are fitted; a model or an
      identification, whose values are tested first (`parameter_mismatch`); another simulator's
      force along the recorded motion (`jf.simulators.Known`, any function from a recording to it,
      `(N,)`, or a recording of the same motion), which stands as it is; or a recording of the same
      reference run through another simulator, which a sum of terms is fitted to; or an earlier
      recording of the machine, `Earlier(recording)`: what has changed.
    - `fixed`: values that are not found wrong stay as given, instead of being refitted.
    - `simulate`: run both models forward, from the recorded motion and by the recorded force, piece
      by piece, and compare the velocities (`fit["simulation_error"]`); takes some seconds more.
    - `seed`: of the bootstrap; `doing`, called with what is being done, in words.

    **Raises:** `ValueError` if a recording slips for too short a time for a test of significance.
    """
    inputs = prepare(recording, baseline, holdout, fixed, doing)
    # A few thousand rows: single precision would save nothing.
    with jax.enable_x64(True), threads.single():
        found = _explain(inputs, simulate, seed, doing)
    return _finished(found, inputs)


def _finished(found: Explanation, inputs: Inputs) -> Explanation:
    """The explanation in the caller's precision, and in the words of the simulator, if any."""
    checked, figures = inputs.checked, inputs.figures
    models = {
        name: None if model is None else figures.as_seen(model)
        for name in ("model", "baseline", "holdout_model")
        for model in (getattr(found, name),)
    }
    values = dict(found.baseline_parameters)
    for name in figures.unseen(values):
        values[name] = values[name]._replace(value=np.float64(np.nan))
    holdout = None if inputs.holdout is None else facts(inputs.holdout)
    found = dataclasses.replace(
        found, **models, recording=facts(inputs.recording), baseline_parameters=values,
        holdout=holdout,
    )  # fmt: skip
    found = in_own_words(found, inputs.attributes) if inputs.attributes else found
    return found if checked is None else sanity.with_checks(found, checked, figures.x64)


def _explain(
    inputs: Inputs, simulate: bool, seed: int, doing: Callable[[str], None]
) -> Explanation:
    """Rows, baseline, search, verification, summary: each step takes the result of the last."""
    recording, holdout, baseline = inputs.in_double_precision()
    doing("fitting the baseline")
    known = _known(baseline, seed)
    motion, held = motion_of(recording), None if holdout is None else motion_of(holdout)
    problem = problem_of(motion, known.structure, start=known.start)
    seen = None if inputs.checked or inputs.free else sanity.stopped(motion, problem, held)
    if seen is not None and seen.stops:
        problem.close()
        found = _explain(inputs.without(seen.without), simulate, seed, doing)
        return sanity.with_stops(found, seen, inputs.figures)
    bound = None
    if inputs.checked is None and not inputs.arrived:
        bound = sanity.bounded(motion, problem, known.model, held)
    cut_off = None if bound is None else inputs.cut_off(bound.limit)
    reach = problem.evidence.reach
    if cut_off and sanity.by_samples(bound, inputs.figures, cut_off.figures, reach):
        problem.close()
        found = _explain(cut_off, simulate, seed, doing)
        found = sanity.with_limit(found, bound, inputs.figures)
        there = found.fit["holdout_force_error"]
        if there is None or not there["after"] > there["before"]:
            return found
        # The other recording knows of no limit.
        problem = problem_of(motion, known.structure, start=known.start)
    if held is not None:
        with_holdout(problem, held)  # says what is wrong with it before anything takes time
    if known.fit is not None:
        known = rephased(known, problem.evidence)
    apart = None if inputs.checked else sanity.drifting(motion, problem)
    remarks = [*inputs.remarks, *_contradictions(problem), *([apart] if apart else [])]
    if any(remark.severe for remark in remarks):
        wrong, better = _unjudged(known, nothing(problem), inputs, doing, seed)
    else:
        wrong, better = _with_tone(known, motion, problem, inputs, seed, doing)
    small = idealised(known, better, inputs.figures)
    if small is not None:
        problem.close()
        found = _explain(inputs._replace(baseline=small.baseline), simulate, seed, doing)
        return with_idealised(found, small)
    better = without_undetermined(better, inputs.figures)
    wrong, better, more = _held_out(known, wrong, better, inputs, held, doing)
    remarks += more
    better = at_slow_speeds(known, better, inputs.figures)
    doing("locating what is left")
    wrong = wrong if better.refitted else None
    explanation = summarise(recording, better, known, wrong, inputs.figures, remarks, seed)
    if simulate:
        doing("running both models forward")
        models = {"before": explanation.baseline, "after": explanation.model}
        errors = {when: motion_error(model, recording) for when, model in models.items()}
        explanation.fit["simulation_error"] = errors
    return sanity.without_visible(explanation) if seen is not None and seen.leans else explanation


def _held_out(
    known: Baseline, wrong: Mismatch | None, better: Improved, inputs: Inputs, held: Motion | None,
    doing: Callable[[str], None],
) -> tuple[Mismatch | None, Improved, list[Remark]]:  # fmt: skip
    """What the held-out recording says of wrong values and findings, and what was said about it."""
    if held is None or inputs.sound_holdout is None:
        return wrong, better, zero.integrated(better.findings, None)
    doing("validating on the held-out recording")
    check_signals(better.findings.selection, inputs.sound, inputs.sound_holdout)
    place = zero.zero_of(better.findings, held)
    if place:
        held = zero.beginning_at(held, place)
        inputs.figures.held_from(place)
    remarks = zero.integrated(better.findings, place)
    better = confirmed(better, held, inputs.figures)
    return *known_there(known, wrong, better, inputs), remarks


def _known(baseline, seed: int) -> Baseline:
    """The baseline: for a recording, what it obeys."""
    if isinstance(baseline, Recording):
        return obeyed(baseline, obeying(motion_of(baseline), named("gaussian"), seed), seed)
    return baseline_of(baseline)


def _contradictions(problem: Problem) -> list[Remark]:
    """What makes force and motion contradict each other, by the base alone."""
    units = problem.evidence.motion.unit_names
    remark = contradicted(problem, spelled.estimates(problem.base, problem.block, units)[0])
    return [] if remark is None else [remark]


def _with_tone(
    known: Baseline, motion: Motion, problem: Problem, inputs: Inputs, seed: int,
    doing: Callable[[str], None],
) -> tuple[Mismatch | None, Improved]:  # fmt: skip
    """What is missing, through a narrower kernel where a tone is left that this one does not pass.

    Through that the noise is larger: it counts if it shows the tone and all that this one shows.
    """
    found = wrong, better = _found(known, motion, problem, inputs, seed, doing)
    tone = tone_left(better.findings, inputs.figures)
    width = None if tone is None else beyond.half_width(tone, problem.evidence)
    if width is None:
        return found
    problem.forget()
    narrow = problem_of(motion, problem.structure, half_width=width, start=problem.start)
    again = _found(known, motion, narrow, inputs, seed, doing)
    names = set(better.findings.selection.names)
    same = names <= set(again[1].findings.selection.names)
    return again if same and again[1].after.here < better.after.here else found


def _found(
    known: Baseline, motion: Motion, problem: Problem, inputs: Inputs, seed: int,
    doing: Callable[[str], None],
) -> tuple[Mismatch | None, Improved]:  # fmt: skip
    """What is missing and which values are wrong, by laws that do not make the model worse.

    A law may fit the rows and go astray beside them, where another of its effect does not. What is
    found instead and fits the rows less has the wrong name.
    """
    refused, rounds = frozenset[Hashable](), list[tuple[Mismatch | None, Improved]]()
    while True:
        doing("looking for what is missing")
        findings = searched(motion, problem, seed, refused)
        wrong, better = judged(known, findings, inputs, doing, seed)
        rounds.append((wrong, better))
        gone = findings.selection.forms - better.findings.selection.forms
        if not better.dropped or gone <= refused:  # a late force is looked for in another way
            break
        refused |= gone
    first = rounds[0][1]
    if len(rounds) > 1:
        if _stands_in(better, first):
            return rounds[0]
        better = _with_dropped(better, [each for _, each in rounds])
    return wrong, better._replace(shown=None)


def _stands_in(better: Improved, first: Improved) -> bool:
    """Whether what was found instead of effects that were dropped has less than nine tenths of the
    evidence for them: by the logarithms of what both leave of the rows.
    """
    if not first.seen or set(first.dropped) & set(better.findings.selection.names):
        return False
    if not better.findings.selection.selected or first.spoilt is None or first.shown is None:
        return False

    def evidence(errors: Errors) -> float:
        return float(np.log(first.before.filtered / max(errors.filtered, 1e-300)))

    return evidence(better.after) < NO_EVIDENCE * evidence(first.spoilt)


def _with_dropped(better: Improved, rounds: list[Improved]) -> Improved:
    """With the effects that any round dropped and that no other law of theirs stands for."""
    names = dict.fromkeys(name for each in rounds for name in each.dropped)
    dropped = tuple(name for name in names if name not in better.findings.selection.names)
    seen = tuple(name for name in dropped if any(name in each.seen for each in rounds))
    spoilt = rounds[0].spoilt if dropped else None
    return better._replace(dropped=dropped, spoilt=spoilt, seen=seen)


def _unjudged(
    known: Baseline, none: Findings, inputs: Inputs, doing: Callable[[str], None], seed: int
) -> tuple[Mismatch | None, Improved]:
    """Nothing found. Of a simulator no value is tested either: beside what is certain to be wrong
    with its log each would only make up for that.
    """
    if inputs.attributes:
        return None, improved_model(known, none, None, inputs)
    return judged(known, none, inputs, doing, seed)
