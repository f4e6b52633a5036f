"""Units written beside numbers."""

import pytest

from jaxfric import units
from jaxfric.units import Dimension, is_rotary, spell

ROTARY = {"force": "N·m", "position": "rad"}
SERVO = {"force": "A", "position": "rev"}


@pytest.mark.parametrize(
    ("dimension", "linear", "rotary", "servo"),
    [
        (units.DIMENSIONLESS, "1", "1", "1"),
        (units.FORCE, "N", "N·m", "A"),
        (units.POSITION, "m", "rad", "rev"),
        (units.TIME, "s", "s", "s"),
        (units.VELOCITY, "m/s", "rad/s", "rev/s"),
        (units.FREQUENCY, "1/s", "1/s", "1/s"),
        (units.STIFFNESS, "N/m", "N·m/rad", "A/rev"),
        (units.DAMPING, "N·s/m", "N·m·s/rad", "A·s/rev"),
        (units.INERTIA, "kg", "kg·m²", "A·s²/rev"),
        (Dimension(force=1, position=-2, time=2), "N·s²/m²", "N·m·s²/rad²", "A·s²/rev²"),
        (Dimension(force=-1, position=-1), "1/(N·m)", "1/(N·m·rad)", "1/(A·rev)"),
        (Dimension(force=2, time=-4), "N²/s⁴", "(N·m)²/s⁴", "A²/s⁴"),
    ],
)
def test_every_dimension_in_linear_rotary_and_drive_units(dimension, linear, rotary, servo):
    assert spell(dimension) == linear
    assert spell(dimension, ROTARY) == rotary
    assert spell(dimension, SERVO) == servo


def test_units_that_are_not_given_are_si():
    assert spell(units.VELOCITY, {"force": "V"}) == "m/s"


def test_mass_is_kilogram_only_where_the_names_allow_it():
    assert spell(units.INERTIA, {"force": "kN"}) == "kN·s²/m"
    assert spell(units.INERTIA, {"force": "N·m", "position": "deg"}) == "N·m·s²/deg"


@pytest.mark.parametrize(
    ("names", "rotary"),
    [
        ({"force": "N", "position": "m"}, False),
        ({"force": "A", "position": "rad"}, True),
        ({"force": "Nm", "position": "counts"}, True),
        ({"force": "V", "position": "mm"}, False),
    ],
)
def test_rotary_axes_are_told_by_their_units(names, rotary):
    assert is_rotary(names) is rotary
