"""The verb: locate where a model and a recording differ, name what is missing, verify it."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..identified import Identified
from ..models import Model, named
from ..recording import Recording
from ..terms.base import AbstractTerm
from . import verification
from .baseline import Baseline, at_values, baseline_of, mismatch, simulated
from .candidates import OF_THE_MOMENT
from .contest import contest
from .explained import Explanation
from .forward import motion_error
from .naming import LEAST_OF_BASE, Named, search
from .predictions import with_predictions
from .question import ALIGNED, Question, ask
from .regression import Fit
from .telling import tell
from .timing import late, overlooked, settled


def explain(
    recording: Recording,
    baseline: str | AbstractTerm | Model | Identified | Recording = "gaussian",
    holdout: Recording | None = None,
    *,
    fixed: bool = False,
    simulate: bool = False,
    seed: int = 0,
) -> Explanation:
    """What a model leaves out of a recording: where, what, how much, and what could not be seen.

    **Arguments:**

    - `recording`, and `holdout`, which is only judged on: signals of shape `(N,)`.
    - `baseline`: a model's name or a sum of terms, whose parameters are fitted; a model or an
      identification, whose values are questioned first (`parameter_mismatch`); or a recording
      of another simulator, of the same reference or the same motion.
    - `fixed`: values that are not found wrong stay as given, instead of being refitted.
    - `simulate`: run both models forward, from the recorded motion and by the recorded force, piece
      by piece, and compare the velocities (`fit["simulation_error"]`); takes some seconds more.
    - `seed`: of the bootstrap.

    **Raises:** `ValueError` if a recording slips for too short a time to tell structure from
    chance.
    """
    with jax.enable_x64(True):  # a few thousand rows: single precision would save nothing
        ours, theirs = _double(recording), None if holdout is None else _double(holdout)
        told = _explain(ours, _double(baseline), theirs, fixed, simulate, seed)
    own = recording.time.dtype
    models = {name: _double(getattr(told, name), own) for name in ("model", "baseline")}
    return dataclasses.replace(told, **models)


def _double(tree, dtype=float):
    """Every floating-point array in double (or another) precision; anything else as it is."""

    def cast(leaf):
        inexact = eqx.is_array(leaf) and jnp.issubdtype(leaf.dtype, jnp.floating)
        return jnp.asarray(np.asarray(leaf), dtype) if inexact else leaf

    return tree if isinstance(tree, str) else jax.tree.map(cast, tree)


def _explain(recording, baseline, holdout, fixed: bool, simulate: bool, seed: int) -> Explanation:
    known = _known(baseline, seed)
    asked, found = _proved(recording, holdout, known.structure, seed)
    found, rest = _with_the_force_put_back(recording, holdout, known.structure, asked, found, seed)
    wrong = None
    if known.model is not None:
        wrong = mismatch(known.model, asked.base, asked.evidence, seed)
        if wrong is None and fixed:
            asked, found = rest = _as_given(known, asked, seed)
    explanation = tell(recording, asked, found, rest, known, wrong, seed)
    if simulate:
        models = {"before": explanation.baseline, "after": explanation.model}
        errors = {when: motion_error(model, recording) for when, model in models.items()}
        explanation.fit["simulation_error"] = errors
    return explanation


def _with_the_force_put_back(
    recording, holdout, structure, asked: Question, found: Named, seed
) -> tuple[Named, tuple[Question, Named]]:
    """The findings, and the question where what they leave is judged, with the findings there.

    To first order a delay is a column; what it leaves of second order would be named too. So where
    the force acts late it is put back, and the search is done once more.
    """
    lateness = late(recording, asked, found)
    sure = lateness is not None
    lateness = lateness or overlooked(recording, asked, found, seed)
    if lateness is None:
        return found, (asked, found)
    later = None if holdout is None else lateness.undone(holdout)
    there, behind = _proved(lateness.undone(recording), later, structure, seed, asked)
    both, behind = settled(found, behind, lateness, asked, there)
    if not sure and later is not None:
        errors = (
            verification.error(behind.last, there.held),
            verification.error(found.last, asked.held, found.rephased),
        )
        if errors[0] >= errors[1]:
            return found, (asked, found)
    return both, (there, behind)


def _known(baseline, seed: int) -> Baseline:
    if isinstance(baseline, Recording):
        _, found = pursue(baseline, None, named("gaussian"), seed)
        return simulated(baseline, found)
    return baseline_of(baseline)


def _as_given(known: Baseline, asked: Question, seed) -> tuple[Question, Named]:
    """The search with the baseline's own values, which nothing on the recording contradicts."""
    base = at_values(known.model, asked.evidence)
    asked = asked._replace(base=base)
    return asked, search(asked.evidence, base, asked.field, asked.wider, seed)


def _proved(recording, holdout, structure, seed, before=None) -> tuple[Question, Named]:
    """The question and the findings that hold on the held-out recording.

    Where one did not, another may account for the same here and hold there: it is looked for, once.
    `before`: a question about the same motion.
    """
    asked, first = pursue(recording, holdout, structure, seed, before)
    _check_signals(first, recording, holdout)
    found = _verified(first, asked, seed)
    refuted = _names(first) - _names(found)
    if not refuted:
        return asked, found
    again = search(asked.evidence, asked.base, asked.field, asked.wider, seed, refuted)
    _check_signals(again, recording, holdout)
    again = _verified(again, asked, seed)
    errors = [verification.error(each.last, asked.held, each.rephased) for each in (found, again)]
    return asked, again if _names(again) > _names(found) and errors[1] < errors[0] else found


def _check_signals(found: Named, recording, holdout) -> None:
    """Raise `ValueError` if a finding reads a signal that the held-out recording lacks."""
    if holdout is None:
        return
    for taken in found.taken:
        candidate = taken.trial.candidate
        lacking = (candidate.term.coordinates & set(recording.channels)) - set(holdout.channels)
        for signal in sorted(lacking):
            effect = candidate.effect.name.replace("_", " ")
            raise ValueError(
                f"{holdout.source or 'The held-out recording'} lacks {signal!r}, by which "
                f"{recording.source or 'the recording'} shows {effect}, so that this cannot be "
                "judged there. Add the signal, or explain without a held-out recording."
            )


def _names(found: Named) -> frozenset[str]:
    return frozenset(taken.trial.candidate.effect.name for taken in found.taken)


def pursue(recording, holdout, structure, seed, before=None) -> tuple[Question, Named]:
    """The question, put again if what was found changes how force and motion are aligned."""
    asked = ask(recording, holdout, structure, before=before)
    found = search(asked.evidence, asked.base, asked.field, asked.wider, seed)
    if found.taken:
        again = ask(recording, holdout, structure, found.last, asked)
        if abs(again.delay - asked.delay) > ALIGNED * asked.evidence.limits.interval:
            asked = again
            found = search(asked.evidence, asked.base, asked.field, asked.wider, seed)
    return asked, found


def _verified(found: Named, asked: Question, seed) -> Named:
    """Without terms that do not help on the held-out recording."""
    if asked.held is None:
        return found
    evidence = with_predictions(asked.evidence, found.last)
    for number in reversed(range(len(found.taken))):
        if found.taken[number].trial.candidate.effect.name in OF_THE_MOMENT:
            continue
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
        taken = [t for i, t in enumerate(found.taken) if i != number]
        left = contest(evidence, less, asked.field, seed)
        found = found._replace(last=less, taken=taken, left=left)
    return found


# On the held-out recording a later term has to take the least part of the baseline's mismatch that
# it may take here, since another motion excites another effect more; or a quarter of what the
# others leave there, with nothing refitted: what another law leaves does not repeat so well.
GOOD_PART = 0.25


def _holds(less: Fit, found: Named, asked: Question, rephased: frozenset[int]) -> bool:
    """Whether what `less` lacks helps on the held-out recording; beside others, by how much."""
    if not verification.helps(less, found.last, asked.held, rephased):
        return False
    if len(found.taken) == 1:
        return True

    def part(first: Fit) -> float:
        return verification.share(less, found.last, first, asked.held, rephased)

    return part(found.base) >= LEAST_OF_BASE or part(less) >= GOOD_PART
