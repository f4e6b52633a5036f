"""A force constant that varies along the stroke is named, and told as large as it is."""

from typing import NamedTuple

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.explanation import search
from jaxfric.explanation.findings import Findings, Solution
from jaxfric.terms.effects import EFFECTS
from jaxfric.validation import concealed

NAME = "position_dependent_force_constant"


def relative(machine, position):
    """The force constant of a machine at places, by that in the middle of its stroke."""
    truth, ends = machine.truth[NAME], (position.min(), position.max())
    places = np.array([ends[0], np.mean(ends), ends[1]])
    constant = 1 - truth["fall"] * ((places - truth["fall_from"]) / truth["fall_distance"]) ** 2
    return constant[[0, 2]] / constant[1]


def test_a_concealed_one_takes_its_part_of_the_command():
    """The command times the force constant is what the machine without it needs."""
    machine = concealed.draw(11, (NAME,), 0.2)
    assert 0 < machine.truth[NAME]["fall"] <= 0.5
    run, truth = concealed.record(machine), machine.truth[NAME]
    x = np.asarray(run.true[0].position)
    lost = truth["fall"] * ((x - truth["fall_from"]) / truth["fall_distance"]) ** 2
    command, hidden = np.asarray(run.true[0].force), run.hidden[NAME]
    speed = np.abs(run.true[0].velocity)
    moving = speed > 0.1 * np.quantile(speed, 0.98)
    scale = np.sqrt(np.mean(hidden[moving] ** 2))
    assert np.sqrt(np.mean((hidden - lost * command)[moving] ** 2)) < 0.02 * scale


@pytest.mark.slow
@pytest.mark.parametrize("seed", [12])
def test_it_is_named_and_its_ends_are_in_their_intervals(seed):
    machine = concealed.draw(seed, (NAME,), 0.2)
    run = concealed.record(machine)
    found = jf.explain(run.recording, machine.baseline, run.holdout)
    assert [finding.effect for finding in found.findings] == [NAME]
    assert found.verdict == "explained" and found.findings[0].confirmed
    wanted = relative(machine, np.asarray(run.recording.position))
    for end, constant in zip(("low", "high"), wanted, strict=True):
        estimate = found.findings[0].parameters[f"command_at_{end}_end"]
        low, high = estimate.interval()
        assert low < 1 / constant - 1 < high
        assert high - low < 0.1
    assert "than in the middle" in found.findings[0].sentence
    errors = found.fit["holdout_force_error"]
    assert errors["after"] < 0.7 * errors["before"]


class Term(NamedTuple):
    """A selected term, as far as it is read here."""

    name: str
    rivals: tuple[str, ...] = ()

    @property
    def effect(self):
        return EFFECTS[self.name]


class Contest(NamedTuple):
    size: float = 500.0


class Selection(NamedTuple):
    selected: list
    remaining: Contest = Contest()

    @property
    def names(self):
        return frozenset(each.name for each in self.selected)


def findings(*selected):
    solution = Solution(None, Selection(list(selected)))
    return Findings(solution, solution)


@pytest.mark.parametrize(
    ("scores", "names", "rivals"),
    [
        ({1: 300.0, 2: 200.0}, (NAME,), [()]),
        ({1: 200.0, 2: 300.0}, ("spring", "cogging"), [("end_stop",), ()]),
        ({1: 300.0, 2: 298.0}, (NAME,), [("cogging", "spring")]),
        ({1: 298.0, 2: 300.0}, ("spring", "cogging"), [("end_stop", NAME), (NAME,)]),
    ],
)
def test_it_competes_as_a_whole_with_what_may_stand_in_its_place(
    monkeypatch, scores, names, rivals
):
    one = findings(Term(NAME))
    two = findings(Term("spring", ("end_stop", NAME)), Term("cogging"))
    monkeypatch.setattr(search, "_score", lambda each, size: scores[len(each.selection.selected)])
    better = search._of_two(one, two).selection.selected
    assert tuple(each.name for each in better) == names
    assert [each.rivals for each in better] == rivals
