"""The verb: locate where a model and a recording differ, name what is missing, verify it."""

import dataclasses
from collections.abc import Callable, Hashable, Iterator

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
from .baseline import Baseline, as_given, at_values, baseline_of, mismatch
from .contest import Contest, contest
from .doubts import contradicted
from .earlier import Earlier, changed, obeyed, rephased
from .explained import Explanation
from .figures import Figures, cast
from .forward import motion_error
from .improvement import improved
from .naming import LATER_SHARE, LEAST_OF_BASE, LINEARITY, MOST, OF_BASE, Named, marks, search
from .predictions import with_predictions
from .question import ALIGNED, Question, ask, opened
from .regression import Fit
from .telling import facts, tell
from .timing import late, overlooked, settled
from .views import weightless


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

    - `recording`, and `holdout`, which is only judged on: signals of shape `(N,)`.
    - `baseline`: a model's name or a sum of terms, whose parameters are fitted; a model or an
      identification, whose values are questioned first (`parameter_mismatch`); another
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
    asked = ask(recording, holdout, known.structure)
    if known.fit is not None:
        known = rephased(known, asked.evidence)
    remarks = [*remarks, *_contradictions(asked)]
    wrong = None
    if any(remark.severe for remark in remarks):
        found = _nothing(asked)
        if known.model is not None and fixed:
            found = _as_given(known.model, found, asked, ())
        rest = asked, found
    else:
        doing("looking for what is missing, and whether it holds")
        asked, found, rest = _found(recording, holdout, known, asked, seed)
        doing("judging the values")
        there, left = rest
        if known.model is not None:
            wrong = mismatch(known.model, left.last, there.evidence, seed)
        if wrong is not None and known.errors is not None:
            here = spelled.estimates(left.last, there.block, recording.unit_names)[0]
            names = [p.name for p in (*known.structure.affine, *known.structure.nonlinear)]
            wrong = changed(wrong, known, left.last, [float(here[n].standard_error) for n in names])
        if known.model is not None and (wrong is not None or fixed):
            free = () if wrong is None else tuple(wrong.moved)
            found = _as_given(known.model, found, asked, free)
            rest = there, _as_given(known.model, left, there, free)
    first = found.base if wrong is None else at_values(known.model, asked.evidence)
    doing("predicting with the improved model")
    better = improved(first, found, rest, asked, figures)
    doing("locating what is left")
    wrong = wrong if better.refitted else None
    explanation = tell(recording, asked, better, known, wrong, figures, remarks, seed)
    if simulate:
        doing("running both models forward")
        models = {"before": explanation.baseline, "after": explanation.model}
        errors = {when: motion_error(model, recording) for when, model in models.items()}
        explanation.fit["simulation_error"] = errors
    return explanation


def _contradictions(asked: Question) -> list[Remark]:
    """What makes force and motion contradict each other, by the base alone."""
    units = asked.evidence.motion.unit_names
    remark = contradicted(asked, spelled.estimates(asked.base, asked.block, units)[0])
    return [] if remark is None else [remark]


def _nothing(asked: Question) -> Named:
    """That nothing is named, nor looked for."""
    for field in asked.fields:
        field.close()
    return Named(asked.base, asked.base, [], Contest([], [], float(len(asked.base.residual))))


def _found(
    recording, holdout, known: Baseline, asked: Question, seed: int
) -> tuple[Question, Named, tuple[Question, Named]]:
    """The findings, and the question where what they leave is judged, with the findings there."""
    asked, found = _proved(recording, holdout, known.structure, seed, known=asked)
    found, rest = _with_the_force_put_back(recording, holdout, known.structure, asked, found, seed)
    return asked, found, rest


def _with_the_force_put_back(
    recording, holdout, structure, asked: Question, found: Named, seed
) -> tuple[Named, tuple[Question, Named]]:
    """The findings, and the question where what they leave is judged, with the findings there.

    To first order a delay is a column; what it leaves of second order would be named too. So where
    the force acts late it is put back, and the search is done once more.
    """
    lateness = None
    if any(traits(term).late for term in found.last.terms):
        # Rows across reversals hold more than a delay or a lag, of which not all may be known.
        lateness = late(recording, asked.within or asked, found.start or found)
    sure = lateness is not None
    lateness = lateness or overlooked(recording, asked, found, seed)
    if lateness is None:
        return found, (asked, found)
    later = None if holdout is None else lateness.undone(holdout)
    there, behind = _proved(lateness.undone(recording), later, structure, seed, asked)
    both, behind = settled(found, behind, lateness, asked, there)
    if not sure and later is not None:
        if _error(behind, there) >= _error(found, asked):
            return found, (asked, found)
    return both, (there, behind)


def _known(baseline, seed: int) -> Baseline:
    if isinstance(baseline, Recording):
        return obeyed(baseline, *pursue(baseline, None, named("gaussian"), seed), seed)
    return baseline_of(baseline)


def _as_given(model: Model, found: Named, asked: Question, free: tuple[int, ...]) -> Named:
    """The findings beside the baseline's own values, but for those that the recording refutes."""
    base, last = (as_given(model, now, asked.evidence, free) for now in (found.base, found.last))
    return found._replace(base=base, last=last, given=model, free=free)


def _proved(
    recording, holdout, structure, seed, before=None, known: Question | None = None
) -> tuple[Question, Named]:
    """The question and the findings that hold on the held-out recording.

    Where one did not, it may hold beside others that hardly show here; or another may account for
    the same here and hold there, another form of its law, which is looked for first, or another
    effect. `before`: a question about the same motion; `known`: the question itself, if it has
    been put.
    """
    asked, first = pursue(recording, holdout, structure, seed, before, known)
    _check_signals(first, recording, holdout)
    found = _verified(first, asked, seed)
    ways: list[tuple[frozenset[Hashable], float | None, float]]
    ways = [(gone, None, 1.0) for gone in _refuted(first, found, asked)]
    if ways and asked.held is not None:
        ways.insert(0, (frozenset(), LATER_SHARE, HALVED))
    for gone, part, enough in ways:
        again = _sought(asked, seed, gone, first.start, part)
        _check_signals(again, recording, holdout)
        again = _verified(again, asked, seed)
        better = _error(again, asked) < enough * _error(found, asked)
        if again.names > found.names and better:
            return asked, again
    return asked, found


# Another motion excites another effect: what is a trifle here may be most of the held-out mismatch,
# and hide there that another finding holds. So where one is refuted, less is asked of later terms,
# if with all that then hold there the held-out error is half as large.
HALVED = 0.5


def _refuted(first: Named, found: Named, asked: Question) -> Iterator[frozenset[Hashable]]:
    """Marks of what did not hold of the first: its forms, where others are; its effects."""
    names = first.names - found.names
    gone = [t.trial.candidate for t in first.taken if t.trial.candidate.effect.name in names]
    forms = frozenset[Hashable]().union(*map(marks, gone)) - names
    others = [c for c in asked.field.candidates if c.effect.name in names and not marks(c) & forms]
    if others:
        yield forms
    if names:
        yield names


def _check_signals(found: Named, recording, holdout) -> None:
    """Raise `ValueError` if a finding reads a signal that the held-out recording lacks."""
    if holdout is None:
        return
    ours, theirs = _signals(recording), _signals(holdout)
    for taken in found.taken:
        candidate = taken.trial.candidate
        lacking = (candidate.term.coordinates & ours) - theirs
        for signal in sorted(lacking):
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


def pursue(
    recording, holdout, structure, seed, before=None, known: Question | None = None
) -> tuple[Question, Named]:
    """The question, put again if what was found changes how force and motion are aligned."""
    asked = known or ask(recording, holdout, structure, before=before)
    asked, found = _searched(recording, holdout, asked, seed)
    if found.taken:
        again = ask(recording, holdout, structure, found.last, asked)
        if abs(again.delay - asked.delay) > ALIGNED * asked.evidence.limits.interval:
            asked, found = _searched(recording, holdout, again, seed)
    return asked, found


def _searched(recording, holdout, asked: Question, seed) -> tuple[Question, Named]:
    """What the rows without reversals show, and then, where they say something, those across.

    The latter hold what acts at reversals tenfold, and hide the rest behind what of it no term
    has quite the shape of.
    """
    found = _sought(asked, seed)
    across = opened(recording, holdout, asked)
    return (asked, found) if across is None else (across, _sought(across, seed, start=found))


def _sought(
    asked: Question, seed, refuted: frozenset[Hashable] = frozenset(), start=None, part=None
) -> Named:
    judged = asked.held is not None
    return search(
        asked.evidence, asked.base, asked.field, asked.wider, seed, refuted, start, judged, part
    )


def _verified(found: Named, asked: Question, seed) -> Named:
    """Without terms that do not hold: on the held-out recording, or by their own size."""
    held = found if asked.held is None else _helpful(found, asked)
    evidence = with_predictions(asked.evidence, held.last)
    sized = held
    while (idle := next(weightless(sized, asked), None)) is not None:
        sized = _lacking(sized, evidence, idle)
    if len(sized.taken) < len(found.taken):
        sized = sized._replace(left=contest(evidence, sized.last, asked.field, seed))
    return sized


def _helpful(found: Named, asked: Question) -> Named:
    """Without terms that do not help on the held-out recording, each beside the others.

    Each is judged without that recording's events, by which it may be far off; all of them together
    are to be nearer to it than the baseline as it is.
    """
    evidence = with_predictions(asked.evidence, found.last)
    for number in reversed(_lasting(found)):
        less = verification.lacking(found, evidence, number)
        place = len(found.last.terms) - len(found.taken) + number
        if _holds(less, found, asked, found.rephased):
            continue
        again = found.rephased | {place}
        if verification.wavelike(found.last, place) and _holds(less, found, asked, again):
            taken = [
                t._replace(rephased=t.rephased or i == number) for i, t in enumerate(found.taken)
            ]
            found = found._replace(taken=taken)
            continue
        found = _lacking(found, evidence, number)
    before = verification.error(found.base, asked.held)
    while _lasting(found) and _error(found, asked) > before:
        fewer = [_lacking(found, evidence, number) for number in _lasting(found)]
        found = min(fewer, key=lambda each: _error(each, asked))
    return found


def _lasting(found: Named) -> list[int]:
    """Numbers of the findings that another recording has to show too."""
    return [i for i, t in enumerate(found.taken) if not t.trial.candidate.effect.momentary]


def _lacking(found: Named, evidence, number: int) -> Named:
    less = verification.lacking(found, evidence, number)
    return found._replace(last=less, taken=[t for i, t in enumerate(found.taken) if i != number])


def _error(found: Named, asked: Question) -> float:
    """On the held-out recording, or without one on its own."""
    judge = asked.evidence if asked.held is None else asked.held
    return verification.error(found.last, judge, found.rephased)


# On the held-out recording a later term has to take the least part of the baseline's mismatch that
# it may take here, since another motion excites another effect more; or a quarter of what the
# others leave there, with nothing refitted: what another law leaves does not repeat so well. That
# is asked of what takes neither 1 % of the baseline's mismatch nor half of the rest here.
GOOD_PART = 0.25


def _holds(less: Fit, found: Named, asked: Question, rephased: frozenset[int]) -> bool:
    """Whether what `less` lacks helps on the held-out recording; beside others, by how much."""
    if not verification.helps(less, found.last, asked.held, rephased):
        return False
    gained, force = less.energy - found.last.energy, asked.evidence.force
    faint = gained < LINEARITY**2 * float(force @ force)
    if len(found.taken) == 1 and not faint:
        return True

    def part(first: Fit) -> float:
        return verification.share(less, found.last, first, asked.held, rephased)

    weak = faint or gained < min(OF_BASE * found.base.energy, MOST * less.energy)
    return (part(found.base) >= LEAST_OF_BASE and not weak) or part(less) >= GOOD_PART
