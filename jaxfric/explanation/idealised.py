"""What models idealise, as friction that jumps at zero speed: a part of the baseline where it makes
no more of the force than the noise does.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from ..checks import Remark
from ..terms.effect import Effect
from .baseline import Baseline
from .explained import Explanation
from .figures import Figures
from .improvement import Improved, force_errors
from .sentences import told


class Idealised(NamedTuple):
    """A baseline with what it idealised: the effects, their parameters, and the force error without
    and with these terms.
    """

    baseline: Baseline
    effects: tuple[Effect, ...]
    names: tuple[tuple[str, ...], ...]
    before: float
    after: float


def idealised(known: Baseline, better: Improved, figures: Figures) -> Idealised | None:
    """The baseline with those findings that it only idealises; `None` where there are none.

    A sum of terms whose values are fitted has what every such sum leaves out, where noise makes as
    much of the force or more. Of values as given nothing is put right without being told.
    """
    findings, last = better.findings, better.findings.selection.last
    if known.model is not None or known.fit is not None or better.refitted:
        return None
    selected = findings.selection.selected
    numbers = [n for n, each in enumerate(selected) if each.effect.idealised]
    if not numbers:
        return None
    less = findings
    for number in reversed(numbers):
        less = less.without(number)
    before, after = force_errors(less, figures).here, better.after.here
    noise = figures.floor(findings.model(last), 2 * findings.problem.evidence.reach)
    if not before**2 - after**2 <= noise**2:
        return None
    terms = [(last.terms[i], last.betas[i]) for i in map(findings.selection.term_index, numbers)]
    structure, start = known.structure, [last.betas[0]]
    for term, beta in terms:
        structure, start = structure + term, [*start, beta]
    names = tuple(tuple(p.name for p in (*t.affine, *t.nonlinear)) for t, _ in terms)
    baseline = known._replace(structure=structure, start=np.concatenate(start))
    effects = tuple(selected[n].effect for n in numbers)
    return Idealised(baseline, effects, names, before, after)


def with_idealised(found: Explanation, own: Idealised) -> Explanation:
    """An explanation beside that baseline, with a remark on each of its effects."""
    errors = (
        f"without it the force error is {100 * own.before:.3g} instead of {100 * own.after:.3g} %"
    )
    remarks = []
    for effect, names in zip(own.effects, own.names, strict=True):
        values = {name: found.baseline_parameters[name] for name in names}
        text = (
            f"{told(effect, values)}. That makes no more of the force than the noise does "
            f"({errors}), and is a part of the baseline."
        )
        remarks.append(Remark(effect.name, text, False).to_dict())
    return dataclasses.replace(found, warnings=[*found.warnings, *remarks])
