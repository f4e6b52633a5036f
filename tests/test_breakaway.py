"""Break-away levels that a model states: saved, held to in simulation, exported."""

import json

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.models import Model

RATE = 1000.0


def axis(levels=None):
    """Coulomb and viscous friction, with break-away levels or without."""
    values = {"inertia": 5.0, "coulomb+": 20.0, "viscous+": 60.0, "coulomb-": 18.0,
              "viscous-": 80.0}  # fmt: skip
    model = jf.models.from_parameters(jf.models.coulomb_viscous(), values)
    return model if levels is None else model.with_breakaway(*levels)


@pytest.mark.slow
def test_simulation_holds_up_to_the_levels_and_slips_below_them():
    """Eq. (4): a ramp of force through 20 N, where slip begins, and 25 N, where the axis breaks."""
    t = np.arange(3001) / RATE
    ramp = jf.Recording(t, 10.0 * t, position=np.zeros(t.size))
    for model, least, most in ((axis(), 19.9, 20.2), (axis((-27.0, 25.0)), 24.9, 25.2)):
        run = jf.simulate(model, ramp, initial=(0.0, 0.0))
        moving = np.flatnonzero(np.asarray(run.velocity) > 0)
        assert least < float(ramp.force[moving[0]]) < most
    after = np.asarray(run.velocity)[moving[0] + 50]
    # 5 N more than slip friction over 5 kg, for 49 ms.
    assert after == pytest.approx(0.045, rel=0.2)


def test_a_level_below_the_slip_curve_changes_nothing():
    t = np.arange(3001) / RATE
    ramp = jf.Recording(t, 10.0 * t, position=np.zeros(t.size))
    one, two = (jf.simulate(m, ramp, initial=(0.0, 0.0)) for m in (axis(), axis((-5.0, 5.0))))
    np.testing.assert_array_equal(one.velocity, two.velocity)


def test_exports_hold_the_levels_or_say_that_they_do_not():
    from jaxfric.export import export

    model = axis((-27.0, 25.0))
    written = {target: export(model, target) for target in ("c", "st", "modelica", "table")}
    assert "axis_stick(double applied)" in written["c"].text and "25.0" in written["c"].text
    assert "breakaway_plus" in written["modelica"].text
    assert "breakaway [N]" in written["table"].text.splitlines()[0]
    assert any("Not written" in remark for remark in written["st"].remarks)
    for target in ("mujoco", "urdf"):
        assert any("breakaway+: 25" in line for line in export(model, target).left_out)
    assert "stick" not in export(axis(), "c").text


def test_levels_are_saved_and_refused_where_they_would_drive_the_axis():
    model = Model.from_dict(json.loads(json.dumps(axis((-27.0, 25.0)).to_dict())))
    np.testing.assert_array_equal(model.breakaway, [-27.0, 25.0])
    assert model.with_parameters({"inertia": 4.0}).breakaway is not None
    with pytest.raises(ValueError, match="backwards below zero"):
        axis((1.0, 2.0))
