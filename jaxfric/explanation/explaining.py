"""The verb: locate where a model and a recording differ, name what is missing, verify it."""

import dataclasses
import operator
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from .. import checks
from ..checks import Remark
from ..data.recording import Recording, check_same_units, require, require_force
from ..identification.identified import Identified
from ..models import NAMED, Model, named
from ..simulation.prediction import outliers, unseen
from ..simulators import AbstractSimulator, Known, same_motion
from ..terms import KNOWN, KNOWN_FORCE
from ..terms.base import AbstractTerm
from ..terms.effects import traits
from . import parameters as spelled, sanity, threads, verification
from .attributes import in_own_words
from .baseline import Baseline, Mismatch, as_given, at_values, baseline_of, mismatch
from .contest import Contest
from .doubts import contradicted
from .earlier import Earlier, changed, obeyed, rephased
from .evidence import motion_of
from .explained import Explanation
from .figures import Figures, cast
from .forward import motion_error
from .holdout import check_signals, confirmed
from .improvement import Rest, improved
from .naming import Named, search
from .problem import ALIGNED, Problem, across_reversals, problem_of, with_holdout
from .telling import facts, tell
from .timing import late, overlooked, settled


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

    - `recording`, and `holdout`, for validation only: signals of shape `(N,)`.
    - `baseline`: a model's name or a sum of terms, whose parameters are fitted; a model or an
      identification, whose values are tested first (`parameter_mismatch`); another
      simulator's force along the recorded motion (`jf.simulators.Known`, any function from a
      recording to it, `(N,)`, or a recording of the same motion), which stands as it is; or a
      recording of the same reference run through another simulator, which a sum of terms is
      fitted to; or an earlier recording of the machine, `Earlier(recording)`: what has changed.
    - `fixed`: values that are not found wrong stay as given, instead of being refitted.
    - `simulate`: run both models forward, from the recorded motion and by the recorded force, piece
      by piece, and compare the velocities (`fit["simulation_error"]`); takes some seconds more.
    - `seed`: of the bootstrap; `doing`, called with what is being done, in words.

    **Raises:** `ValueError` if a recording slips for too short a time to tell structure from
    chance.
    """
    require(recording, "explain")
    require_force(recording, "explain")
    if holdout is not None:
        require(holdout, "explain (holdout)")
        require_force(holdout, "explain (holdout)")
    known = baseline.recording if isinstance(baseline, Earlier) else baseline
    if isinstance(known, Recording):
        require(known, "explain (baseline)")
    for other in (holdout, known):
        if isinstance(other, Recording):
            check_same_units(recording, other)
    baseline = _simulator(recording, baseline, holdout)
    looked = None
    if isinstance(baseline, AbstractSimulator):
        doing("looking at signs, zeros, clocks and limits")
        baseline = looked = sanity.looked_at(recording, baseline, holdout)
        recording, holdout = looked.logs(recording, holdout)
    own = baseline.attributes() if isinstance(baseline, AbstractSimulator) else {}
    recording, baseline, holdout, fixed = _beside(recording, baseline, holdout, fixed)
    if isinstance(baseline, Earlier):
        baseline = baseline.recording
    if not isinstance(baseline, Recording):
        baseline_of(baseline)
    figures = Figures(recording, holdout, jnp.zeros(()).dtype == jnp.float64)
    ours, remarks = inspected(recording)
    theirs, more = (None, []) if holdout is None else inspected(holdout)
    # A few thousand rows: single precision would save nothing.
    with jax.enable_x64(True), threads.single():
        more = [each._replace(text=f"On the held-out recording: {each.text}") for each in more]
        held, remarks = None if theirs is None else cast(theirs), [*remarks, *more]
        remarks = remarks if looked is None else looked.remarks(remarks)
        told = _explain(
            cast(ours), cast(baseline), held, figures, remarks, fixed, simulate, seed, doing
        )
    models = {
        name: None if model is None else _as_seen(figures.own(model), recording)
        for name in ("model", "baseline", "holdout_model")
        for model in (getattr(told, name),)
    }
    values = dict(told.baseline_parameters)
    for name in unseen(values, recording):
        values[name] = values[name]._replace(value=np.float64(np.nan))
    held_out = None if holdout is None else facts(holdout)
    told = dataclasses.replace(told, **models, baseline_parameters=values, holdout=held_out)
    told = in_own_words(told, own) if own else told
    return told if looked is None else sanity.told(told, looked, figures.x64)


def _simulator(recording: Recording, baseline, holdout: Recording | None):
    """The baseline, as a simulator where it gives another program's force along this motion."""
    if isinstance(baseline, Recording) and holdout is None and same_motion(recording, baseline):
        return Known(baseline.force)
    if any(
        baseline is make for make in NAMED.values()
    ):  # the function that makes a model, not called
        return baseline()
    given_as = type | Model | Identified | AbstractTerm | AbstractSimulator
    return (
        Known(baseline) if callable(baseline) and not isinstance(baseline, given_as) else baseline
    )


def _as_seen(model: Model, recording: Recording) -> Model:
    """The model without values of a direction in which the recording does not move."""
    lacking = unseen(model.parameters, recording)
    return model.with_parameters(dict.fromkeys(lacking, np.nan)) if lacking else model


def _beside(recording: Recording, baseline, holdout: Recording | None, fixed: bool):
    """The recordings with another simulator's force where the baseline stands on one, and the
    baseline as a model of corrections to it, which stay zero unless they are found wrong.
    """
    if isinstance(baseline, AbstractSimulator):
        held = None if holdout is None else baseline.beside(holdout, held_out=True)
        recording = baseline.beside(recording)
        return recording, baseline.baseline(recording.units), held, True
    given = baseline.model if isinstance(baseline, Identified) else baseline
    term = given.term if isinstance(given, Model) else given
    if isinstance(term, AbstractTerm) and KNOWN_FORCE in term.coordinates:
        return recording, baseline, holdout, fixed
    held = None if holdout is None else _alone(holdout)
    return _alone(recording), baseline, held, fixed


def _alone(recording: Recording) -> Recording:
    """The recording without another simulator's force, which this baseline does not stand on."""
    channels = {k: v for k, v in recording.channels.items() if not k.startswith(KNOWN)}
    return dataclasses.replace(recording, channels=channels)


# What is said of lone samples in other words, as they are left out here.
SPIKES = "force_spikes"


def inspected(recording: Recording) -> tuple[Recording, list[Remark]]:
    """A recording without samples that no actuator made, and what is to be said of it.

    Every check of a recording by itself belongs here: where a remark is severe, nothing is named.
    """
    remarks = [remark for remark in checks.inspect(recording) if remark.name != SPIKES]
    spikes = outliers(recording)
    if not spikes.any():
        return recording, remarks
    mask = jnp.asarray(np.asarray(recording.mask) & ~spikes)
    return dataclasses.replace(recording, mask=mask), [*remarks, _spikes(recording, spikes)]


def _spikes(recording: Recording, lone: np.ndarray) -> Remark:
    force = np.asarray(recording.force, float)
    known = np.asarray(recording.mask) & np.isfinite(force)
    share = float(np.sum(force[lone] ** 2) / np.sum(force[known] ** 2))
    count, at = int(lone.sum()), float(np.asarray(recording.time)[np.argmax(lone)])
    unit = recording.unit_names["force"]
    which = f"one sample of the force, {force[np.argmax(lone)]:.3g} {unit} at t = {at:.6g} s, holds"
    if count > 1:
        which = f"{count} lone samples of the force, the first at t = {at:.6g} s, hold"
    return Remark(
        SPIKES,
        f"{recording.source or 'The recording'}: {which} {share:.0%} of its power, which no "
        "actuator does: left out. Look for a fault of the sensor, the bus or the file.",
        False,
    )


def _explain(
    recording,
    baseline,
    holdout,
    figures: Figures,
    remarks,
    fixed: bool,
    simulate: bool,
    seed: int,
    doing: Callable[[str], None],
) -> Explanation:
    doing("fitting the baseline")
    known = _known(baseline, seed)
    motion = motion_of(recording)
    problem = problem_of(motion, known.structure)
    if holdout is not None:
        there = motion_of(holdout)
        with_holdout(problem, there)  # says what is wrong with it before anything takes time
    if known.fit is not None:
        known = rephased(known, problem.evidence)
    remarks = [*remarks, *_contradictions(problem)]
    wrong = None
    if any(remark.severe for remark in remarks):
        found = _nothing(problem)
        if known.model is not None and fixed:
            found = _as_given(known.model, found, problem, ())
        rest = problem, found
    else:
        doing("looking for what is missing")
        problem, found, rest = _search(motion, known, problem, seed)
        doing("testing the baseline's values")
        wrong = _wrong(known, rest, recording, seed)
        if known.model is not None and (wrong is not None or fixed):
            free = () if wrong is None else tuple(wrong.moved)
            found = _as_given(known.model, found, problem, free)
            rest = rest[0], _as_given(known.model, rest[1], rest[0], free)
    first = found.base if wrong is None else at_values(known.model, problem.evidence)
    doing("predicting with the improved model")
    better = improved(first, found, rest, problem, figures)
    if holdout is not None:
        doing("validating on the held-out recording")
        check_signals(better.found, recording, holdout)
        better, problem = confirmed(better, problem, there, figures)
    doing("locating what is left")
    wrong = wrong if better.refitted else None
    explanation = tell(recording, problem, better, known, wrong, figures, remarks, seed)
    if simulate:
        doing("running both models forward")
        models = {"before": explanation.baseline, "after": explanation.model}
        errors = {when: motion_error(model, recording) for when, model in models.items()}
        explanation.fit["simulation_error"] = errors
    return explanation


def _wrong(known: Baseline, rest: Rest, recording: Recording, seed: int) -> Mismatch | None:
    """Which of the baseline's own values are wrong, where it has any."""
    if known.model is None:
        return None
    where, left = rest
    wrong = mismatch(known.model, left.last, where.evidence, seed)
    if wrong is None or known.errors is None:
        return wrong
    here = spelled.estimates(left.last, where.block, recording.unit_names)[0]
    names = [p.name for p in (*known.structure.affine, *known.structure.nonlinear)]
    return changed(wrong, known, left.last, [float(here[n].standard_error) for n in names])


def _contradictions(problem: Problem) -> list[Remark]:
    """What makes force and motion contradict each other, by the base alone."""
    units = problem.evidence.motion.unit_names
    remark = contradicted(problem, spelled.estimates(problem.base, problem.block, units)[0])
    return [] if remark is None else [remark]


def _nothing(problem: Problem) -> Named:
    """That nothing is named, nor looked for."""
    for candidates in problem.candidate_sets:
        candidates.close()
    return Named(problem.base, problem.base, [], Contest([], [], float(len(problem.base.residual))))


def _search(recording, known: Baseline, problem: Problem, seed: int) -> tuple[Problem, Named, Rest]:
    """The findings, and the problem where their remainder is examined, with the findings there.

    To first order a delay is a column; what it leaves of second order would be named too. So where
    the force acts late it is put back, and the search is done once more.
    """
    problem, found = pursue(recording, known.structure, seed, known=problem)
    lateness = None
    if any(traits(term).late for term in found.last.terms):
        # Rows across reversals hold more than a delay or a lag, of which not all may be known.
        lateness = late(recording, problem.in_slip or problem, found.start or found)
    sure = lateness is not None
    lateness = lateness or overlooked(recording, problem, found, seed)
    if lateness is None:
        return problem, found, (problem, found)
    there, behind = pursue(lateness.undone(recording), known.structure, seed, problem)
    both, behind = settled(found, behind, lateness, problem, there)
    errors = (
        verification.error(*pair)
        for pair in ((behind.last, there.evidence), (found.last, problem.evidence))
    )
    if not sure and operator.ge(*errors):
        return problem, found, (problem, found)
    return problem, both, (there, behind)


def _known(baseline, seed: int) -> Baseline:
    if isinstance(baseline, Recording):
        return obeyed(baseline, *pursue(baseline, named("gaussian"), seed), seed)
    return baseline_of(baseline)


def _as_given(model: Model, found: Named, problem: Problem, free: tuple[int, ...]) -> Named:
    """The findings beside the baseline's own values, but for those that the recording refutes."""
    base, last = (as_given(model, now, problem.evidence, free) for now in (found.base, found.last))
    return found._replace(base=base, last=last, given=model, free=free)


def pursue(
    recording, structure, seed, before=None, known: Problem | None = None
) -> tuple[Problem, Named]:
    """The problem, set up again if what was found changes how force and motion are aligned.

    **Arguments:** `before`: a problem of the same motion; `known`: the problem itself, if it
    is known.
    """
    recording = motion_of(recording)
    problem = known or problem_of(recording, structure, before=before)
    problem, found = _searched(recording, problem, seed)
    if found.taken:
        again = problem_of(recording, structure, found.last, problem)
        if abs(again.delay - problem.delay) > ALIGNED * problem.evidence.limits.interval:
            problem, found = _searched(recording, again, seed)
    return problem, found


def _searched(recording, problem: Problem, seed) -> tuple[Problem, Named]:
    """What the rows without reversals show, and then, where they say something, those across.

    The latter hold what acts at reversals tenfold, and hide the rest behind what of it no term
    has quite the shape of.
    """
    found = search(
        problem.evidence, problem.base, problem.candidate_set, problem.wide_kernels, seed
    )
    across = across_reversals(recording, problem)
    if across is None:
        return problem, found
    return across, search(
        across.evidence, across.base, across.candidate_set, across.wide_kernels, seed, found
    )
