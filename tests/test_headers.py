"""What a header says: units behind any name, and what may be meant where a role has no column."""

import itertools

import numpy as np
import pytest

from jaxfric.data import io
from jaxfric.data.columns import assign, units, unknown_units
from jaxfric.data.roles import describe, other_unit, stated_unit
from jaxfric.online.feed import Feed

# Letters that are prefixes too, symbols of signals, and words.
NAMES = ["M", "m", "k", "u", "c", "d", "n", "P", "F", "T", "mu", "phi", "da", "drive", "axis 3"]
UNITS = {
    "force": {
        "Nm": "N·m", "mNm": "mN·m", "kNm": "kN·m", "MNm": "MN·m", "uNm": "µN·m", "N": "N",
        "mN": "mN", "kN": "kN", "MN": "MN", "daN": "daN", "mA": "mA", "lbf": "lbf", "Ncm": "N·cm",
        "N_m": "N·m", "mN_m": "mN·m", "MN_m": "MN·m", "lbf_in": "lbf·in", "in_lb": "lbf·in",
    },
    "position": {"mm": "mm", "um": "µm", "nm": "nm", "rad": "rad", "mrad": "mrad", "deg": "deg"},
    "velocity": {"mm_s": "mm/s", "rad_s": "rad/s", "rpm": "rpm", "mrad_s": "mrad/s"},
    "time": {"ms": "ms", "us": "µs"},
}  # fmt: skip
FORMS = ["{}_{}", "{} [{}]", "{} ({})", "{}[{}]", "{}({})", "{}.{}", "{} {}", "{}-{}", "{}/{}"]
HEADERS = [
    (form.format(name, unit), role, spelt)
    for role, units in UNITS.items()
    for (unit, spelt), name, form in itertools.product(units.items(), NAMES, FORMS)
    if not (form == "{}.{}" and len(unit) == 1)  # `pos.x`, `log.t`
]


def test_a_unit_is_what_follows_the_name_whatever_the_name():
    wrong = {h: stated_unit(h, role) for h, role, unit in HEADERS if stated_unit(h, role) != unit}
    assert wrong == {} and len(HEADERS) > 3000
    # What is told beside a role is the same.
    for header, role, unit in HEADERS:
        own, stated = describe(header)
        assert own != role or stated == unit, header


def test_a_name_of_one_letter_is_in_no_doubt():
    doubted = [h for h, role, _ in HEADERS if other_unit(h, role)]
    assert doubted == []


@pytest.mark.parametrize(
    ("name", "role", "unit", "other"),
    [
        ("drive_k_Nm", "force", "N·m", "kN·m"),
        ("drive_k_N_m", "force", "N·m", "kN·m"),
        ("armNm", "force", "N·m", "mN·m"),
        ("arm_m_rad", "position", "rad", "mrad"),
        ("force_m_N", "force", "N", "mN"),
        ("MNm", "force", "MN·m", "N·m"),
        ("uA", "force", "µA", "A"),
        ("TORQUE_MNM", "force", "mN·m", "MN·m"),
        ("FORCE_MN", "force", "MN", "mN"),
    ],
)
def test_a_name_that_may_be_read_as_two_units_is_told(name, role, unit, other):
    assert (stated_unit(name, role), other_unit(name, role)) == (unit, other)
    (said,) = unknown_units({role: name}, {})
    assert f"may be in {unit} or in {other}" in said and f"--units {role}={other}" in said
    assert unknown_units({role: name}, {}, {role: unit}) == []
    assert unknown_units({role: name}, {role: 2.0}) == []


@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("pos_Nm", "position", None), ("POS_NM", "position", "nm"), ("FkN", "force", None),
        ("axis_a", "force", None), ("foo_N", "force", "N"), ("kNm", "force", "kN·m"),
        ("foo (motor) [kN]", "force", "kN"), ("foo_kN (motor)", "force", "kN"),
        ("foo_kN [furlong]", "force", None),
    ],
)  # fmt: skip
def test_a_unit_keeps_its_capitals_and_stands_beside_remarks(name, role, unit):
    assert stated_unit(name, role) == unit
    assert other_unit(name, role) is None


@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("M_Nm", "force", "N·m"), ("M [mNm]", "force", "mN·m"), ("T_Nm", "force", "N·m"),
        ("M_act_Nm", "force", "N·m"), ("T [s]", "time", "s"), ("M_N", None, None),
        ("T_ms", "time", "ms"), ("phi_rad", "position", "rad"), ("epoch", "time", None),
        ("loadcell_N", "force", "N"), ("Load cell [kN]", "force", "kN"),
        ("linear_encoder_mm", "position", "mm"), ("torque.mNm", "force", "mN·m"),
        ("motor.current.mA", "force", "mA"), ("axis.A", None, None),
        ("torque (motor) [kNm]", "force", "kN·m"),
        ("loadcell_force_N", "force", "N"), ("Load cell force [kN]", "force", "kN"),
        ("iq_torque_Nm", "force", "N·m"), ("i_q_current [A]", "force", "A"),
        ("enc_pos_mm", "position", "mm"), ("elapsed_time_ms", "time", "ms"),
        ("x_force", None, None), ("current_position", None, None), ("load_force", None, None),
        ("Fz", "force", None), ("Fx [kN]", "force", "kN"), ("FY_N", "force", "N"),
        ("n [rpm]", "velocity", "rpm"), ("n_ist [1/min]", "velocity", "rpm"),
        ("n_rad_s", "velocity", "rad/s"), ("n", None, None), ("n [mm]", None, None),
        ("n [m/s]", None, None), ("n_N", None, None),
    ],
)  # fmt: skip
def test_more_headers_are_known(name, role, unit):
    assert describe(name) == (role, unit)


def test_a_torque_current_is_a_current():
    for name, unit in (("torque_current", "A"), ("iq_torque", "N·m"), ("current_torque", "N·m")):
        assert units({"force": name}, {}, {})["force"] == unit


RISING = np.arange(5) * 0.004
FLAT = np.zeros(5)


@pytest.mark.parametrize(
    ("names", "given", "option", "reason"),
    [
        ({"t": RISING, "x_mm": FLAT, "Load (lbf)": FLAT}, {}, "'force=Load (lbf)'",
         "'Load (lbf)' is the only one in a unit of force."),
        ({"t": RISING, "carriage_mm": FLAT, "following_error_mm": FLAT, "cell_kN": FLAT}, {},
         "force=cell_kN,position=carriage_mm", "'carriage_mm' is the only one"),
        ({"t": RISING, "wheel_rpm": FLAT, "f": FLAT}, {}, "velocity=wheel_rpm", "unit of velocity"),
        ({"Sample": RISING, "x": FLAT, "f": FLAT}, {}, "time=Sample", "by 0.004 a row"),
        ({"Name": RISING, "a b": FLAT, "f": FLAT}, {"position": "a b"},
         "'position=a b,time=Name'", "rises all along"),
        ({"Sample": RISING, "other": RISING, "x": FLAT, "f": FLAT}, {}, "time=NAME", "--rate"),
        ({"t": RISING, "x": FLAT, "a_kN": FLAT, "b_kN": FLAT}, {}, "force=NAME", "a_kN"),
        ({"t": RISING, "carriage_mm": FLAT, "F_cmd [kN]": FLAT}, {},
         "position=carriage_mm", "'carriage_mm' is the only one"),
        ({"t": RISING, "f": FLAT, "status_in": FLAT}, {}, "position=NAME", "status_in"),
    ],
)  # fmt: skip
def test_the_one_column_that_can_be_meant_is_proposed(names, given, option, reason):
    with pytest.raises(ValueError, match="log: no column is recognised as") as caught:
        assign(names, given, "log")
    assert f"--columns {option}." in str(caught.value) and reason in str(caught.value)


def test_the_proposal_reads_the_log(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{0.004 * i:.3f},{np.sin(i / 9):.4f},{np.cos(i / 9):.4f}" for i in range(99)]
    path.write_text("\n".join(["Sample,Displacement (in),Load (lbf)", *rows]))
    with pytest.raises(ValueError, match=r"--columns 'time=Sample,force=Load \(lbf\)'\."):
        io.read(path)
    found = io.read(path, columns={"time": "Sample", "force": "Load (lbf)"})
    assert found.unit_names == {"force": "lbf", "position": "in"}


def test_a_stream_tells_what_its_names_leave_open():
    head = "t,x_mm,drive_k_Nm"
    stream = Feed([head], {"force": "drive_k_Nm"})
    assert "may be in N·m or in kN·m" in stream.served and stream.units["force"] == "N·m"
    assert "may be" not in Feed([head], {"force": "drive_k_Nm"}, units={"force": "N·m"}).served
