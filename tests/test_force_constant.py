"""A force constant that varies along the stroke is named, and told as large as it is."""

import numpy as np
import pytest

import jaxfric as jf
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
@pytest.mark.parametrize("seed", [11, 12])
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
