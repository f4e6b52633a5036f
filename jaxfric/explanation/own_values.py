"""The baseline's own values: which are wrong beside the findings, and the model with both."""

from collections.abc import Callable

from ..data.excerpt import MOST
from . import parameters as spelled
from .baseline import Baseline, at_values
from .common_factor import put_right, with_factor
from .earlier import changed, without_unchanged
from .findings import Findings
from .holdout import measured
from .improvement import Improved, improved, without_unsure
from .inputs import Inputs
from .mismatch import Mismatch, mismatch
from .parsimony import instead
from .search import at_given
from .uncertainty import estimated


def judged(
    known: Baseline, findings: Findings, inputs: Inputs, doing: Callable[[str], None], seed: int
) -> tuple[Mismatch | None, Improved]:
    """The baseline's wrong values beside the findings, and which of both make the model better."""
    doing("testing the baseline's values")
    findings = without_unchanged(known, findings)
    wrong = _wrong(known, findings, seed)
    searched_for = findings.selection.remaining.trials and not findings.selection.selected
    if wrong is not None and searched_for:
        one, rivals = instead(known.model, findings, wrong, seed)
        wrong = wrong._replace(rivals=rivals)
        if one is not None and _wrong(known, one, seed) is None:
            findings, wrong = one, None
    wrong = _sure(known, findings, wrong, inputs)
    doing("predicting with the improved model")
    return wrong, improved_model(known, findings, wrong, inputs)


def _sure(
    known: Baseline, findings: Findings, wrong: Mismatch | None, inputs: Inputs
) -> Mismatch | None:
    """The wrong values without those whose told interval holds the value as given.

    A simulator's own are told apart later, since those of one body are needed together; and what
    has changed since an earlier recording is tested by the errors of both.
    """
    model = known.model
    if model is None or known.errors is not None or inputs.attributes:
        return wrong
    if wrong is not None and wrong.factor is not None:  # whose own interval leaves out one
        return wrong
    names = [p.name for p in (*model.term.affine, *model.term.nonlinear)]
    while wrong is not None and wrong.moved:
        free = tuple(wrong.moved)
        values = estimated(at_given(model, findings, free), free)[0]
        away = {
            i: abs(float(values[names[i]].value) - before) / float(values[names[i]].half_width())
            for i, before in wrong.moved.items()
        }
        least = min(away, key=lambda i: away[i])
        if away[least] > 1:
            return wrong
        moved = {i: before for i, before in wrong.moved.items() if i != least}
        instead = {i: others for i, others in wrong.instead.items() if i != least}
        wrong = wrong._replace(moved=moved, instead=instead)
    return None


def known_there(
    known: Baseline, wrong: Mismatch | None, better: Improved, inputs: Inputs
) -> tuple[Mismatch | None, Improved]:
    """The wrong values that are told apart from those given beside the held-out recording, too."""
    less = _sure(known, better.findings, wrong, inputs) if better.refitted else wrong
    if wrong is None or known.model is None or less == wrong:
        return wrong, better
    free = () if less is None else tuple(less.moved)
    given = without_unsure(at_given(known.model, better.findings, free))
    fewer = better._replace(findings=given, refitted=less is not None)
    fewer = measured(fewer, inputs.figures)
    if fewer.after.worse(fewer.before, inputs.figures.rounding):
        return wrong, better
    return less, fewer


def _wrong(known: Baseline, findings: Findings, seed: int) -> Mismatch | None:
    """Which of the baseline's own values are wrong, where it has any."""
    if known.model is None:
        return None
    problem, selection = findings.undelayed
    recorded = 1 if known.errors is None else 2
    wrong = mismatch(known.model, selection.last, problem.evidence, problem.wide, seed, recorded)
    wrong = None if wrong is None else with_factor(known, findings.undelayed, wrong)
    if wrong is None or wrong.factor is not None or known.errors is None:
        return wrong
    units = problem.evidence.motion.unit_names
    here = spelled.estimates(selection.last, problem.block, units)[0]
    names = [p.name for p in (*known.structure.affine, *known.structure.nonlinear)]
    return changed(wrong, known, selection.last, [float(here[n].standard_error) for n in names])


def improved_model(
    known: Baseline, findings: Findings, wrong: Mismatch | None, inputs: Inputs
) -> Improved:
    """The findings beside the baseline's values as given or refitted, where the model is better."""
    fixed = inputs.fixed and not findings.selection.trusted
    if known.model is not None and (wrong is not None or fixed):
        model, free = put_right(known.model, wrong)
        findings = at_given(model, findings, free)
    first = findings.selection.base
    if wrong is not None:
        first = at_values(known.model, findings.problem.evidence)
    if inputs.recording.num_samples > MOST:  # whose predictions need the memory
        for problem in (findings.problem, findings.undelayed.problem):
            problem.forget()
    return improved(first, without_unsure(findings), inputs.figures)
