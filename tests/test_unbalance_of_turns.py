"""An unbalance of an axis that turns more than once and a half: its period is a revolution."""

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.explanation.candidates import candidates
from jaxfric.explanation.evidence import gather
from jaxfric.explanation.motion import motion_of

UNITS = {"position": "rad", "force": "N·m"}


def log(turns: float, units=UNITS) -> jf.Recording:
    """An axis that turns to and fro, with a weight of 0.4 N·m at an angle."""
    time = np.arange(8000) / 400
    rate, way = 2 * np.pi * 0.23, 2 * np.pi * turns
    position = 0.42 * way * np.sin(rate * time) + 0.08 * way * np.sin(2.6 * rate * time)
    velocity = np.gradient(position, time)
    force = 0.05 * np.gradient(velocity, time) + np.sign(velocity) + 0.1 * velocity
    force += 0.4 * np.sin(position + 0.3) + np.random.default_rng(1).normal(0, 0.02, time.size)
    return jf.Recording(time=time, force=force, position=position, velocity=velocity, units=units)


@pytest.mark.slow
@pytest.mark.parametrize("turns", [0.5, 2.06, 5.7])
def test_an_unbalance_is_named_however_often_the_axis_turns(turns):
    found = jf.explain(log(turns))
    assert found.verdict == "explained"
    assert [each.effect for each in found.findings] == ["gravity_unbalance"]
    amplitude = found.findings[0].parameters["amplitude"]
    assert float(amplitude.value) == pytest.approx(0.4, rel=0.01)
    assert "once per revolution" in found.findings[0].sentence


def test_a_revolution_is_tried_where_it_is_told_and_on_angles_alone():
    """A sine of more than eight strokes is a parabola."""

    def tried(recording):
        every = candidates(gather(motion_of(recording)), jf.models.gaussian())
        return any(isinstance(each.term, jf.terms.Gravity) for each in every)

    assert tried(log(2.06)) and tried(log(0.2)) and not tried(log(0.1))
    assert not tried(log(2.06, {"position": "m", "force": "N"}))
