"""A rival that is found as well, and is the force that competed, has been told from a finding."""

import types

import numpy as np
import pytest

from jaxfric.explanation import reported, rivals
from jaxfric.terms.effects import EFFECTS

TIME = np.linspace(0.0, 1.0, 500)
STEP = np.where(TIME > 0.5, 1.0, 0.0)
WAVE, OTHER = np.sin(20 * TIME), np.sin(55 * TIME)
ONE = np.ones((500, 1)) / np.sqrt(500)


def competed(name, force):
    """A finalist whose term is its force."""
    trial = types.SimpleNamespace(candidate=types.SimpleNamespace(term=force))
    betas, effect = (np.zeros(0),), EFFECTS[name]
    return types.SimpleNamespace(trial=trial, betas=betas, effect=effect, alpha=np.ones(1))


def selection(near, *beside, rivals=("cogging",)):
    """A step of friction, with what came as near, and waves beside it."""
    own = types.SimpleNamespace(effect=EFFECTS["friction_step"], rivals=rivals, near=near)
    names = [types.SimpleNamespace(effect=EFFECTS["cogging"], rivals=(), near=()) for _ in beside]
    terms = [np.zeros(500), STEP, *beside]
    last = types.SimpleNamespace(
        terms=terms, betas=[np.zeros(0)] * len(terms), alphas=[np.ones(1)] * len(terms)
    )
    base = types.SimpleNamespace(basis=lambda: ONE)
    return types.SimpleNamespace(
        selected=[own, *names], last=last, base=base, term_index=lambda number: number + 1
    )


@pytest.fixture
def problem(monkeypatch):
    monkeypatch.setattr(rivals, "with_predictions", lambda evidence, last: evidence)
    evidence = types.SimpleNamespace(columns=lambda term, betas: term[None, :, None])
    return types.SimpleNamespace(evidence=evidence)


CASES = [
    # what came as near, what is beside it, and whether it has been told from that
    ([WAVE], [1.2 * WAVE + 3.0], True),
    ([WAVE], [OTHER, -WAVE + 0.1 * OTHER], True),
    ([WAVE], [OTHER], False),
    ([WAVE, OTHER], [WAVE], False),
    ([WAVE, OTHER], [OTHER, WAVE], True),
    ([WAVE], [], False),
    ([], [WAVE], False),
]


@pytest.mark.parametrize(("near", "beside", "told"), CASES)
def test_a_rival_beside_a_finding_with_the_force_that_competed_is_none(problem, near, beside, told):
    found = selection([competed("cogging", force) for force in near], *beside)
    assert rivals.beside(problem, found, 0) == ({"cogging"} if told else set())


@pytest.mark.parametrize(("together", "left"), [(None, ("spring",)), (0.9, ("cogging", "spring"))])
def test_findings_that_overlap_stay_in_doubt(problem, together, left):
    found = selection([competed("cogging", WAVE)], WAVE, rivals=("cogging", "spring"))
    findings = types.SimpleNamespace(examined_in=lambda number: (problem, found))
    assert reported._rivals(findings, 0, together) == left
