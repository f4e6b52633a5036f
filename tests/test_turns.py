"""A position in encoder counts becomes an angle where the counts of a revolution are stated."""

import json

import numpy as np
import pytest

from jaxfric import read
from jaxfric.cli import main
from jaxfric.explanation.quantities import per_pole_pair, turns
from jaxfric.identification.identified import Estimate

TIME = np.arange(2001) / 1000
ANGLE = 2.0 * np.sin(10 * TIME)  # rad
SPEED = 20.0 * np.cos(10 * TIME)
FORCE = 0.3 * np.sign(SPEED) + 0.01 * SPEED - 0.002 * 10 * 20 * np.sin(10 * TIME)
COUNTS = 8192 / (2 * np.pi)


def log(path, head, *columns):
    np.savetxt(path, np.c_[TIME, *columns], delimiter=",", header=head, comments="")
    return str(path)


@pytest.fixture
def encoder(tmp_path):
    head = "time,torque [Nm],position [counts],velocity"
    return log(tmp_path / "e.csv", head, FORCE, ANGLE * COUNTS, SPEED * COUNTS)


@pytest.mark.parametrize("unit, turn", [("rad", 2 * np.pi), ("deg", 360.0), ("rev", 1.0)])
def test_counts_become_the_angle_that_is_asked_for(encoder, unit, turn):
    units = {} if unit == "rad" else {"position": unit}
    found = read(encoder, counts_per_rev=8192, units=units)
    assert found.unit_names == {"force": "N·m", "position": unit}
    np.testing.assert_allclose(found.position, ANGLE * turn / (2 * np.pi), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(found.velocity, SPEED * turn / (2 * np.pi), rtol=1e-6, atol=1e-9)


def test_a_velocity_in_the_right_unit_stays(tmp_path):
    head = "time,torque [Nm],position [counts],velocity [rad/s]"
    path = log(tmp_path / "a.csv", head, FORCE, ANGLE * COUNTS, SPEED)
    np.testing.assert_allclose(read(path, counts_per_rev=8192).velocity, SPEED, atol=1e-9)


@pytest.mark.parametrize(
    "more, fault",
    [
        ({"counts_per_rev": 0}, "over zero"),
        ({"counts_per_rev": float("nan")}, "over zero"),
        ({"counts_per_rev": 8192, "units": {"position": "mm"}}, "which mm is not"),
        ({"counts_per_rev": 8192, "scale": {"position": 2.0}}, "give one of them"),
    ],
)
def test_what_contradicts_the_counts_is_refused(encoder, more, fault):
    with pytest.raises(ValueError, match=f"e.csv: .*{fault}"):
        read(encoder, **more)


def test_a_position_in_another_unit_is_refused(tmp_path):
    path = log(tmp_path / "a.csv", "time,torque,position [mm]", FORCE, ANGLE)
    with pytest.raises(ValueError, match="is in mm, not in counts.*--columns position=NAME"):
        read(path, counts_per_rev=8192)


def test_the_command_identifies_in_radians(encoder, tmp_path, monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    out = tmp_path / "out.json"
    arguments = ["identify", encoder, "--model", "coulomb-viscous", "--counts-per-rev", "8192"]
    assert main([*arguments, "--json", str(out)]) == 0
    found = json.loads(out.read_text())["parameters"]
    assert found["viscous+"]["unit"] == "N·m·s/rad"
    assert found["viscous+"]["value"] == pytest.approx(0.01, rel=0.02)


def test_a_period_of_counts_is_told_per_revolution():
    period = 8192 / 7 / COUNTS
    assert turns(Estimate(period, period * 1e-4, "rad")) == " (7 times per revolution)"
    assert turns(Estimate(1 / 7, 1e-5, "rev")) == " (7 times per revolution)"


def test_periods_are_told_per_pole_pair():
    def told(period, error=0.0, unit="rev", pairs=7):
        return per_pole_pair(Estimate(period, error, unit), pairs)

    assert told(1 / 42) == " That is 6 times per pole pair."
    assert told(360 / 7.001, 0.1, "deg") == " That is once per pole pair."
    assert told(1 / 5, 1e-5) == (
        " That is 0.714 times per pole pair, so not of the electrical period."
    )
    assert told(0.0025, unit="m") == "" and told(2.0) == "" and told(float("nan")) == ""
