"""Machines with a load behind a gap, and one with a soft limit, drawn by `prove`, explained."""

import pytest

from jaxfric import explain
from jaxfric.validation import concealed


def explained(seed, effect, definition):
    machine = concealed.draw(seed, (effect,), (0.1, 0.3), {effect: definition})
    run = concealed.record(machine)
    return machine, explain(run.recording, machine.baseline, run.holdout)


@pytest.mark.slow
def test_a_load_with_more_friction_one_way_strikes_when_it_does():
    """A load heavier than its motor, with 12 % less friction forwards: without that in the law half
    of what is missing stayed, and a dead band and a delay were named beside the gap.
    """
    machine, found = explained(392557739, "backlash", "free_load")
    truth = machine.truth["backlash"]
    assert [each.effect for each in found.findings] == ["backlash"]
    gap = found.findings[0]
    assert gap.confirmed and gap.share > 0.95
    # By 12 % in dry friction and 25 % in viscous friction, of which the law knows one for both.
    own, names = machine.physics, ("coulomb", "viscous")
    sides = ((own[f"{name}+"], own[f"{name}-"]) for name in names)
    dry, viscous = ((ahead - back) / (ahead + back) for ahead, back in sides)
    assert viscous < float(gap.parameters["load_asymmetry"].value) < dry
    low, high = gap.parameters["half_gap"].interval()
    assert low <= truth["half_gap"] <= high and high - low < 0.1 * truth["half_gap"]
    assert float(gap.parameters["backlash_force"].value) == pytest.approx(
        truth["backlash_force"], rel=0.1
    )
    errors = found.fit["holdout_force_error"]
    assert errors["after"] < 0.6 * errors["before"]


@pytest.mark.slow
def test_what_a_wider_kernel_hardly_sees_it_does_not_refute():
    """A knee that only a few moments reach: a wider kernel tells 0.07 ± 0.26 of 0.33."""
    machine, found = explained(205195862, "actuator_saturation", "knee")
    truth = machine.truth["actuator_saturation"]
    assert [each.effect for each in found.findings] == ["actuator_saturation"]
    knee, share = (found.findings[0].parameters[name] for name in ("knee", "saturation"))
    assert float(knee.value) == pytest.approx(truth["knee"], rel=0.05)
    assert float(share.value) == pytest.approx(truth["saturation"], rel=0.05)
    assert found.verdict == "explained"
