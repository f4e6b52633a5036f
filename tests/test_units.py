"""Units written beside numbers."""

import re

import pytest

from jaxfric import units
from jaxfric.data import io
from jaxfric.data.columns import unknown_units
from jaxfric.data.recording import Recording, check_same_units
from jaxfric.data.roles import describe, stated_unit
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
        (units.FREQUENCY, "Hz", "Hz", "Hz"),
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


@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("speed [U/min]", "velocity", "rpm"),
        ("speed [Umdr/min]", "velocity", "rpm"),
        ("v [r/min]", "velocity", "rpm"),
        ("omega [min^-1]", "velocity", "rpm"),
        ("speed_u_min", "velocity", "rpm"),
        ("velocity [Grad/s]", "velocity", "deg/s"),
        ("velocity [rad·s^-1]", "velocity", "rad/s"),
        ("velocity [mm/min]", "velocity", "mm/min"),
        ("time [milliseconds]", "time", "ms"),
        ("t [msec]", "time", "ms"),
        ("t [millis]", "time", "ms"),
        ("time [Mikrosekunden]", "time", "µs"),
        ("time_hours", "time", "h"),
        ("position [Umdrehungen]", "position", "rev"),
        ("position [inch]", "position", "in"),
        ("position_in", None, None),
        ("torque [Newtonmeter]", "force", "N·m"),
        ("torque [lbf·in]", "force", "lbf·in"),
        ("current [Arms]", "force", "A"),
        ("speed [1/s]", "velocity", None),
        ("force_kN", "force", "kN"),
        ("forcekN", "force", "kN"),
        ("torque_mNm", "force", "mN·m"),
        ("torque_uNm", "force", "µN·m"),
        ("Torque_kNm", "force", "kN·m"),
        ("torque_MNm", "force", "MN·m"),
        ("force_mN", "force", "mN"),
        ("current_mA", "force", "mA"),
        ("motorTorqueNm", "force", "N·m"),
        ("torque_mN_m", "force", "mN·m"),
        ("torque_lbf_in", "force", "lbf·in"),
        ("angle_arcmin", "position", "arcmin"),
        ("vel_mm_sec", "velocity", "mm/s"),
    ],
)
def test_units_are_read_in_the_spellings_of_loggers(name, role, unit):
    assert describe(name) == (role, unit)


def test_a_column_given_by_the_user_states_its_unit_as_well():
    assert stated_unit("Drehzahl [U/min]", "velocity") == "rpm"
    assert stated_unit("drehzahl_rpm", "velocity") == "rpm"
    assert stated_unit("axis_a", "force") is None
    assert stated_unit("tau1_uNm", "force") == "µN·m"
    assert stated_unit("axis_in_lb", "force") == "lbf·in"
    assert stated_unit("axis_mm_filtered", "position") == "mm"
    assert stated_unit("w_rad_s", "velocity") == "rad/s"
    assert stated_unit("kN", "force") == "kN"


def test_a_unit_that_the_user_names_is_spelt_as_one_that_a_column_states(tmp_path):
    rows = "".join(f"{i / 100},{i % 7},{i % 3}\n" for i in range(40))
    (tmp_path / "log.csv").write_text(f"t,axis_deg,axis_uNm\n{rows}")
    roles = {"position": "axis_deg", "force": "axis_uNm"}
    stated = io.read(tmp_path / "log.csv", columns=roles).unit_names
    assert stated == {"force": "µN·m", "position": "deg"}
    given = io.read(tmp_path / "log.csv", columns=roles, units={"force": "uNm"}).unit_names
    assert given == stated
    named = io.read(tmp_path / "log.csv", columns=roles, units={"force": "ticks"}).unit_names
    assert named["force"] == "ticks"


@pytest.mark.parametrize(
    ("column", "text"),
    [
        ("position [furlong]", r"unit \[furlong\] of column 'position \[furlong\]' is not known"),
        ("position [N]", r"\[N\] .* is no unit of position; .* --scale position=FACTOR"),
        ("velocity [1/s]", r"\[1/s\] .* taken as the unit of the position per second"),
    ],
)
def test_a_unit_that_is_not_known_is_told(column, text):
    role = column.split()[0]
    (sentence,) = unknown_units({role: column}, {})
    assert re.search(text, sentence)
    assert unknown_units({role: column}, {role: 2.0}) == []


@pytest.mark.parametrize("column", ["q[0]", "torque (filtered)", "position [actual]", "x (axis 3)"])
def test_a_bracket_that_is_no_unit_passes(column):
    role = describe(column)[0]
    assert unknown_units({role: column}, {}) == []


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("t [msec],x,f", "time from t [msec] × 0.001"),
        ("time_h,x,f", "time from time_h × 3600"),
        ("t,speed [U/min],f", "velocity from speed [U/min] × 0.10472"),
        ("t,speed [mm/min],f", "velocity from speed [mm/min] × 0.0166667"),
        ("t,speed_krpm,torque_mNm", "velocity from speed_krpm × 104.72"),
        ("t,speed_kmh,f", "velocity from speed_kmh × 0.000277778"),
    ],
)
def test_units_that_are_not_per_second_are_converted_and_said(tmp_path, header, said):
    rows = "".join(f"{i / 100},{i % 7},{i % 3}\n" for i in range(40))
    (tmp_path / "log.csv").write_text(f"{header}\n{rows}")
    assert said in io.read_with_notes(tmp_path / "log.csv", served=True)[1][0]


MIXED = {
    "point beside comma": ("0.01\t12,345\t1", "row 7: '12,345' beside '0.00' in row 2"),
    "both in a cell": ("0.01\t1,234.5\t1", "row 7: '1,234.5' beside '0.00' in row 2"),
    "German thousands": ("0\t1.234,5\t1", "row 7: '1.234,5' beside"),
    "two groups": ("0.01\t1,234,567\t1", "row 7: '1,234,567'"),
}


@pytest.mark.parametrize("kind", MIXED)
@pytest.mark.parametrize("delimiter", ["\t", ";", " "])
def test_a_comma_beside_a_point_is_not_guessed(tmp_path, kind, delimiter):
    row, message = MIXED[kind]
    rows = [f"{i / 100:.2f}\t{i}\t{i % 3}" for i in range(40)]
    rows[5] = row
    text = "\n".join(["t\tx\tf", *rows]).replace("\t", delimiter)
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(ValueError, match=re.escape(message)) as caught:
        io.read(tmp_path / "log.csv")
    assert "one decimal sign" in str(caught.value)


def test_decimal_commas_alone_are_read_and_possible_thousands_told(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{i}\t{i % 5}\t{i % 3}" for i in range(40)]
    rows[20] = "20,5\t1\t12.03.2024"  # the first comma comes late; a date is no number
    path.write_text("\n".join(["t [s]\tx\tf", *(row.replace("12.03.2024", "1") for row in rows)]))
    recording, notes = io.read_with_notes(path)
    assert recording.time[20] == 20.5 and notes == []
    counts = [f"{i}\t{12 + i},{345 + i}\t{i % 3}" for i in range(40)]
    path.write_text("\n".join(["t [s]\tx\tf", *counts]))
    recording, notes = io.read_with_notes(path)
    assert recording.position[0] == 12.345
    assert "'12,345' in row 2" in notes[0] and "thousands" in notes[0]


@pytest.mark.parametrize(
    ("unit", "other", "remedy"),
    [
        ("m", "mm", "--scale position=0.001"),
        ("mm", "m", "--scale position=1000"),
        ("rad", "deg", "--scale position=0.0174532"),
        ("mm", "rad", "--scale position=FACTOR"),
    ],
)
def test_two_recordings_of_one_comparison_state_the_same_units(unit, other, remedy):
    ours, theirs = (
        Recording(range(3), range(3), range(3), units={"position": u}) for u in (unit, other)
    )
    with pytest.raises(ValueError, match=f"is in {other}, but in {unit}.*{remedy}"):
        check_same_units(ours, theirs)
    check_same_units(ours, ours)


def test_newton_and_metre_give_way_where_they_may_be_no_statement():
    stated = Recording(range(3), range(3), range(3), units={"force": "A", "position": "rad"})
    check_same_units(stated, Recording(range(3), range(3), range(3)))
    check_same_units(Recording(range(3), range(3), range(3)), stated)
