"""Reading logs: formats, roles, units, clean-up; writing whole or not at all."""

import os
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from jaxfric.data import io
from jaxfric.data.columns import assign, units
from jaxfric.data.roles import describe
from jaxfric.data.tables import load

DATA = Path(os.environ.get("JAXFRIC_DATA", Path(__file__).parents[2] / "shared" / "data"))
needs_data = pytest.mark.skipif(
    not DATA.is_dir(), reason="the recordings folder (JAXFRIC_DATA) is absent"
)


def log(n=200, rate=1000.0):
    t = np.arange(n) / rate
    return {"time": t, "position": np.sin(7 * t), "force": np.cos(7 * t) + 0.5}


def save(path, columns):
    """A log in the format of the suffix, written without the code under test."""
    columns = {name: np.asarray(column) for name, column in columns.items()}
    if path.suffix == ".npz":
        np.savez(path, **columns)
    elif path.suffix == ".mat":
        pytest.importorskip("scipy.io").savemat(path, columns)
    elif path.suffix == ".h5mat":
        path = path.with_suffix(".mat")
        with pytest.importorskip("h5py").File(path, "w", userblock_size=512) as file:
            for name, column in columns.items():
                file[name] = column[None, :]
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file".ljust(512))
    elif path.suffix == ".parquet":
        pa = pytest.importorskip("pyarrow")
        pytest.importorskip("pyarrow.parquet").write_table(pa.table(columns), path)
    else:
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        lines = [",".join(columns), *(",".join(map(str, row)) for row in rows)]
        path.write_text("\n".join(lines) + "\n")
    return path


# ---- formats ----


def frame(columns, index=None, name=None):
    """A data frame: columns by name, and an index of its rows."""
    rows = len(next(iter(columns.values())))
    values = np.arange(rows) if index is None else index
    index = type("Index", (), {"name": name, "__array__": lambda *_, **__: values})()
    return type("Frame", (dict,), {"columns": list(columns), "index": index})(columns)


def test_columns_in_memory_are_read_as_a_file_of_them(tmp_path):
    """A cell that is no number, and stamps that scatter, are put in order."""
    ticks, columns = trembling(1e-7)
    off = columns(ticks)
    off["tau"][90] = np.nan
    from_file, told = io.read_with_notes(save(tmp_path / "log.npz", off))
    assert len(told) == 2
    for memory in (off, frame(off)):
        recording, notes = io.read_with_notes(memory, served=True)
        assert notes[1:] == told and "time from t" in notes[0]
        assert recording.source == "(table in memory)" and not recording.sha256
        for name in ("time", "position", "force", "mask"):
            np.testing.assert_array_equal(getattr(recording, name), getattr(from_file, name))


def test_an_index_of_moments_is_the_clock():
    whole = log()
    stamps = np.datetime64("2026-03-01T12:00", "ns") + np.rint(1e9 * whole.pop("time")).astype(int)
    recording = io.read(frame(whole, stamps))
    assert np.ptp(recording.time) == pytest.approx(0.199)
    named = io.read(frame(whole, 1e-3 * np.arange(200), name="seconds"))
    assert np.ptp(named.time) == pytest.approx(0.199)


@pytest.mark.parametrize("what", [3, [1.0, 2.0], {}, {"t": 3.0}])
def test_what_is_no_table_is_refused(what):
    with pytest.raises(ValueError, match="in memory.*holds no columns. Give the path of a log"):
        io.read(what)


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".mat", ".h5mat", ".parquet"])
@settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_every_format_gives_back_every_number(tmp_path, suffix, data):
    n = data.draw(st.integers(16, 40))
    steps = data.draw(hnp.arrays(float, n, elements=st.floats(1e-3, 3e-3)))
    values = hnp.arrays(float, n, elements=st.floats(-1e12, 1e12))
    columns = {"time": np.cumsum(steps), "velocity": data.draw(values), "torque": data.draw(values)}
    recording, notes = io.read_with_notes(save(tmp_path / f"log{suffix}", columns))
    assert notes == []
    np.testing.assert_array_equal(recording.time, columns["time"])
    np.testing.assert_array_equal(recording.velocity, columns["velocity"])
    np.testing.assert_array_equal(recording.force, columns["torque"])
    assert recording.position is None
    assert bool(recording.mask.all()) and recording.num_segments == 1


@pytest.mark.parametrize("suffix", [".csv", ".npz", ".parquet"])
def test_written_tables_read_back_exactly(tmp_path, suffix):
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    io.write_table(tmp_path / f"out{suffix}", log())
    recording = io.read(tmp_path / f"out{suffix}")
    for name, column in log().items():
        np.testing.assert_array_equal(getattr(recording, name), column)


CSV_SPELLINGS = {
    "semicolon and decimal comma": "t [s];x [mm];f [N]\n{rows}",
    "tabs": "t\tx\tf\n{rows}",
    "blanks": "t x f\n{rows}",
    "savetxt header": "# t,x,f\n{rows}",
    "comments before": "# rig 7\n# spring\nt,x,f\n{rows}",
    "byte order mark": "\ufefft,x,f\n{rows}",
    "trailing delimiter": "t,x,f\n{rows}",
    "quotes": '"t","x","f"\n{rows}',
    "blank lines at the end": "t,x,f\n{rows}\n\n\n",
    "cut off": "t,x,f\n{rows}\n0.9,1",
}


@pytest.mark.parametrize("kind", CSV_SPELLINGS)
def test_csv_spellings(tmp_path, kind):
    text = CSV_SPELLINGS[kind]
    header = text.split("{")[0].strip().splitlines()[-1]
    delimiter = next((d for d in ";\t," if d in header), " ")
    columns = log(20)
    cells = [[repr(float(cell)) for cell in row] for row in zip(*columns.values(), strict=True)]
    lines = [delimiter.join(row) for row in cells]
    if kind.startswith("semicolon"):
        lines = [line.replace(".", ",") for line in lines]
    if kind == "trailing delimiter":
        lines = [line + "," for line in lines]
    path = tmp_path / "log.csv"
    path.write_text(text.format(rows="\n".join(lines)), encoding="utf-8")
    recording, notes = io.read_with_notes(path)
    np.testing.assert_array_equal(recording.time, columns["time"])
    np.testing.assert_array_equal(recording.position, columns["position"])
    np.testing.assert_array_equal(recording.force, columns["force"])
    assert len(notes) == (kind == "cut off")


ROWS = "".join(f"{i};{i % 7},5;{i % 3}\n" for i in range(40))


@pytest.mark.parametrize(
    "head, names, notes",
    [
        ("t;x;f\nms;mm;N\n", ["t [ms]", "x [mm]", "f [N]"], []),
        ("t;x;f\n[s];;[A]\n", ["t [s]", "x", "f [A]"], []),
        ("Name;Scope\nFile;a.svdx\n\nt;x;f\n", ["t", "x", "f"], ["2 lines above"]),
        ("Scope YT, 3 channels\nt;x;f\ns;mm;N\n", ["t [s]", "x [mm]", "f [N]"], ["1 line above"]),
        (";x;\n", ["column1", "x", "column3"], []),
        ("# a comment\nt;x;f\n", ["t", "x", "f"], []),
    ],
)
def test_heads_of_tables(tmp_path, head, names, notes):
    (tmp_path / "log.csv").write_text(head + ROWS)
    table = load(tmp_path / "log.csv")
    assert list(table.columns) == names
    assert table.columns[names[1]][:2].tolist() == [0.5, 1.5]
    assert table.first_row == head.count("\n") + 1
    assert [note[: len(want)] for note, want in zip(table.notes, notes, strict=True)] == notes


ABOVE = {
    "nothing": [],
    "a line": ["Export, version 3,2, of the drive"],
    "filled": ["Protokoll", "Datum:{d}14.03.2024{d}", "Prüfer:{d}Möller, K.{d}"],
}


HEADS = [(above, True, units) for above in ABOVE for units in (False, True)]


@pytest.mark.parametrize("above, named, units", [("nothing", False, False), *HEADS])
@pytest.mark.parametrize(
    "delimiter, decimal",
    [
        (";", ","),
        (";", "."),
        ("\t", ","),
        ("\t", "."),
        ("|", ","),
        (",", "."),
        (" ", ","),
        (" ", "."),
    ],
)
def test_the_delimiter_is_the_one_that_leaves_numbers(
    tmp_path, above, named, units, delimiter, decimal
):
    names = ["t", "x", "v", "f", "temp"]
    values = np.round(np.random.default_rng(3).normal(size=(30, 5)), 3)
    values[:, 0], values[3, 4] = np.arange(30) / 1000, 24
    rows = [delimiter.join(f"{x:.3f}".replace(".", decimal) for x in row) for row in values]
    head = [line.format(d=delimiter) for line in ABOVE[above]]
    head += [delimiter.join(names)] * named
    head += [delimiter.join(["s", "mm", "mm/s", "N", "°C"])] * units
    (tmp_path / "log.csv").write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    table = load(tmp_path / "log.csv")
    assert len(table.columns) == 5
    np.testing.assert_array_equal(np.transpose(list(table.columns.values())), values)
    if named:
        assert [name.split(" [")[0] for name in table.columns] == names
        assert all(name.endswith("]") for name in table.columns) == units
    assert len(table.notes) == (above != "nothing")


def test_a_text_among_the_numbers_is_no_head(tmp_path):
    (tmp_path / "log.csv").write_text("t;x;f\n0;off;1\n" + ROWS)
    assert list(load(tmp_path / "log.csv").columns) == ["t", "x", "f"]


def test_arrow_and_plain_csv_agree(tmp_path, monkeypatch):
    pytest.importorskip("pyarrow")
    columns = log(50) | {"mode": ["a", "b"] * 25, "temp": [20.0] * 49 + [""]}
    path = save(tmp_path / "log.csv", columns)
    plain = io.read(path)
    monkeypatch.setattr("jaxfric.data.delimited._SMALL_CSV", 0)
    arrow = io.read(path)
    for name in ("time", "position", "force"):
        np.testing.assert_array_equal(getattr(arrow, name), getattr(plain, name))
    np.testing.assert_array_equal(arrow.channels["temperature"], plain.channels["temperature"])


def test_csv_needs_no_optional_library_and_is_quick(tmp_path, monkeypatch):
    for library in ("pyarrow", "scipy", "h5py"):
        monkeypatch.setitem(sys.modules, library, None)
    path = save(tmp_path / "log.csv", log(25_000))
    io.read(path)  # jax compiles its conversions on the first call
    best = min(_seconds(lambda: io.load(path)) for _ in range(5))
    # 0.03 s on two slow shared cores; the bound is ours, with room for a busy machine.
    assert best < 0.1


def _seconds(call):
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


@pytest.mark.parametrize("suffix, library", [(".parquet", "pyarrow"), (".mat", "scipy")])
def test_missing_library_says_what_to_install(tmp_path, monkeypatch, suffix, library):
    for module in [name for name in sys.modules if name.split(".")[0] == library]:
        monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setitem(sys.modules, library, None)
    path = tmp_path / f"log{suffix}"
    path.write_bytes(b"x" * 600)
    with pytest.raises(ValueError, match=r'pip install "jaxfric\[io\]"'):
        io.read(path)


def test_matlab_structures_matrices_and_scalars(tmp_path):
    matlab = pytest.importorskip("scipy.io")
    columns = log(30)
    two = np.stack([columns["force"], columns["force"] + 1], axis=1)
    content = {"log": {"time": columns["time"][:, None], "q": columns["position"]}, "tau": two}
    matlab.savemat(tmp_path / "log.mat", content | {"gain": 3.0, "note": "spring"})
    recording = io.read(tmp_path / "log.mat", columns={"force": "tau:2"})
    np.testing.assert_array_equal(recording.force, columns["force"] + 1)
    np.testing.assert_array_equal(recording.position, columns["position"])


# ---- roles and units ----


@pytest.mark.parametrize(
    "name, role, unit",
    [
        ("time [s]", "time", "s"), ("Time_ms", "time", "ms"), ("TimeStamp", "time", None),
        ("t(µs)", "time", "µs"), ("q", "position", None), ("pos_mm", "position", "mm"),
        ("position_counts", "position", "counts"), ("motorPosition", "position", None),
        ("actual_position [rad]", "position", "rad"), ("qd", "velocity", None),
        ("velocity_rad_s", "velocity", "rad/s"), ("Speed (mm/s)", "velocity", "mm/s"),
        ("speed_rpm", "velocity", "rpm"), ("TORQUE_Nm", "force", "N·m"), ("i_q", "force", None),
        ("pos_nm", "position", "nm"), ("measured_current_A", "force", "A"), ("vir", "force", None),
        ("qg", "reference", None), ("desired_position", "reference", None),
        ("position_setpoint_mm", "reference", "mm"), ("log.tau", "force", None),
        ("desired_current", None, None), ("current_setpoint", None, None),
        ("reference_velocity", None, None), ("target_torque", None, None), ("q_d", None, None),
        ("gear_temperature", None, None), ("mode", None, None), ("x_a", None, None),
        ("motor temperature", "temperature", None), ("seg", "segment", None),
        ("altitude (deg)", "position", "deg"), ("z [m]", "position", "m"), ("stamp", "time", None),
        ("height_mm", "position", "mm"), ("cylinder force [kN]", "force", "kN"),
        ("actuator_force_N", "force", "N"),
        ("neighbour_velocity", "neighbour_velocity", None),
        ("neighborVelocity [rad/s]", "neighbour_velocity", "rad/s"),
    ],
)  # fmt: skip
def test_names(name, role, unit):
    assert describe(name) == (role, unit)


@pytest.mark.parametrize(
    "name, role, unit",
    [
        ("PX[cnt]", "position", "counts"), ("VX[cnt/sec]", "velocity", "counts/s"),
        ("px", None, None), ("Active Current [A]", "force", "A"),
        ("pos_estimate", "position", None), ("vel_estimate", "velocity", None),
        ("PL.FB (deg)", "position", "deg"), ("VL.FB (rpm)", "velocity", "rpm"),
        ("IL.FB (Arms)", "force", "A"), ("IL.CMD (Arms)", None, None),
        ("r0063[0]", "velocity", None), ("DO1.r63 Actual speed [rpm]", "velocity", "rpm"),
        ("DO1.r62[0] Speed setpoint", None, None), ("r0080 Drehmomentistwert [Nm]", "force", "N·m"),
        ("r0482[0] Geberlageistwert", "position", "counts"), ("r80", None, None),
        ("6064h", "position", None), ("0x606C:00", "velocity", None), ("6064", None, None),
        ("6077h", "force", "‰"), ("6077h torque actual value", "force", "‰"),
        ("6077h [Nm]", "force", "N·m"), ("0x6077 [0.1%]", "force", "‰"),
        ("S-0-0051 Lageistwert [mm]", "position", "mm"), ("S-0-0084", "force", None),
        ("Axis 1.ActVelo [mm/s]", "velocity", "mm/s"), ("Position actual value", "position", None),
        ("%time", "time", None), ("field.position0", "position", None),
        ("field.effort0", "force", None), ("/joint_states/elbow/effort", "force", None),
        ("/joint_states/header/stamp", "time", None), ("s actual [mm]", None, None),
    ],
)  # fmt: skip
def test_names_of_makers(name, role, unit):
    assert describe(name) == (role, unit)


def test_parts_of_a_rated_torque_are_no_newton_metres():
    assert units({"force": "6077h", "position": "6064h"}, {}, {}) == {"force": "‰"}


def test_a_measured_signal_goes_before_its_estimate():
    assert assign(["t", "q", "tau", "tau_est"], None, "log")["force"] == "tau"
    assert assign(["t", "q", "tau_est"], None, "log")["force"] == "tau_est"


@pytest.mark.parametrize(
    "name", ["Torque Reference[%]", "cmd_force", "F_cmd [kN]", "F_soll_N", "torque_cmd_Nm"]
)
def test_a_commanded_force_is_read_where_none_is_measured_and_told(tmp_path, name):
    names = ["Time[ms]", "Feedback Speed[min-1]", name]
    assert assign(names, None, "log")["force"] == name
    assert assign([*names, "tau"], None, "log")["force"] == "tau"
    path = save(
        tmp_path / "log.csv", {"t": log()["time"], "x": log()["position"], name: np.ones(200)}
    )
    (said,) = io.read_with_notes(path)[1]
    assert said.startswith(f"No force is measured: {name!r}, the commanded one")
    assert io.read_with_notes(path, columns={"force": name})[1] == []


@pytest.mark.parametrize("others", [["force_cmd", "tau_cmd"], ["F_cmd [kN]", "cell_kN"]])
def test_a_commanded_force_beside_another_is_not_guessed(others):
    with pytest.raises(ValueError, match="no column is recognised as force"):
        assign(["t", "x", *others], None, "log")


def test_a_force_of_one_direction_is_the_force_where_it_is_the_only_one():
    assert assign(["t", "z", "Fz"], None, "log")["force"] == "Fz"
    assert assign(["t", "z", "Fz", "F"], None, "log")["force"] == "F"
    with pytest.raises(ValueError, match="3 columns could be the force: Fx, Fy, Fz"):
        assign(["t", "z", "Fx", "Fy", "Fz"], None, "log")


def test_counts_are_the_position_beside_those_of_a_revolution(tmp_path):
    whole = log()
    counts = np.rint(1000 * whole["position"])
    named = {"time": whole["time"], "counts": counts, "I [mA]": whole["force"]}
    path = save(tmp_path / "log.csv", named)
    with pytest.raises(ValueError, match="--columns position=counts"):
        io.read(path)
    recording = io.read(path, counts_per_rev=1000)
    np.testing.assert_allclose(recording.position, 2 * np.pi / 1000 * counts)
    assert recording.unit_names["position"] == "rad"


@pytest.mark.parametrize(
    "other", [{"ticks": np.arange(200)[::-1]}, {"counts": np.arange(200)}], ids=["two", "of rows"]
)
def test_counts_that_may_be_another_thing_are_not_guessed(tmp_path, other):
    whole = log()
    named = {"time": whole["time"], "counts": np.rint(whole["position"]), "f": whole["force"]}
    path = save(tmp_path / "log.csv", named | other)
    with pytest.raises(ValueError, match="no column is recognised as position"):
        io.read(path, counts_per_rev=1000)


STAMPS = {
    "T": (lambda text: text, ","),
    "blank": (lambda text: text.replace("T", " "), ","),
    "comma": (lambda text: text.replace(".", ","), ";"),
    "quoted": (lambda text: f'"{text.replace(".", ",")}"', ","),
    "Z": (lambda text: f"{text}Z", ","),
    "zone": (lambda text: f"{text}+01:00", "\t"),
    "apart": (lambda text: f"{text.replace('T', ' ')} -0530", ","),
}


def dated(stamp, delimiter=",", repeated=None):
    """Lines of a log over midnight, every 5 ms, with a row in which a header is `repeated`."""
    whole, start = log(), np.datetime64("2026-03-04T23:59:59.500", "ms")
    head = delimiter.join(["Timestamp", "Position [mm]", "Force [N]"])
    lines = [
        delimiter.join([stamp(str(start + np.timedelta64(5 * i, "ms"))), f"{x:.4f}", f"{f:.4f}"])
        for i, (x, f) in enumerate(zip(whole["position"], whole["force"], strict=True))
    ]
    if repeated:
        lines.insert(repeated, head)
    return "\n".join([head, *lines, ""])


@pytest.mark.parametrize("form", STAMPS)
@pytest.mark.parametrize("above", ["", "Drive: M 7\nFirmware: 3\n"])
def test_dates_of_iso_8601_are_the_clock(tmp_path, form, above):
    path = tmp_path / "log.csv"
    path.write_text(above + dated(*STAMPS[form]))
    np.testing.assert_allclose(io.read(path).time, 0.005 * np.arange(200), atol=1e-9)


def test_a_change_of_the_zone_is_no_jump():
    instants = np.datetime64("2026-03-29T00:59:59.500", "ms") + 5 * np.arange(200)
    summer = np.arange(200) >= 100
    local = instants + 3_600_000 * (1 + summer)
    stamps = [f"{each}+0{1 + later}:00" for each, later in zip(local, summer, strict=True)]
    recording = io.read(log() | {"time": np.array(stamps, object)})
    np.testing.assert_allclose(recording.time, 0.005 * np.arange(200), atol=1e-9)


def test_what_is_no_date_among_dates_is_told_where_it_stands(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(dated(lambda text: text).replace("T23:59:59.600", "T23.59"))
    with pytest.raises(ValueError, match=r"row 22, column 'Timestamp'.* is not a date as the"):
        io.read(path)


@pytest.mark.parametrize("stamp", [lambda text: text, lambda text: text[17:].replace("00.", "60.")])
def test_a_header_that_comes_again_is_told_as_two_recordings(tmp_path, stamp):
    path = tmp_path / "log.csv"
    path.write_text(dated(stamp, repeated=150))
    with pytest.raises(ValueError, match="row 152 is a header again: .*two recordings.* Split it"):
        io.read(path)


def test_a_table_of_predicted_forces_is_no_recording():
    names = ["time", "force", "measured_force", "in_motion"]
    with pytest.raises(ValueError, match="log: jaxfric predict wrote this table"):
        assign(names, None, "log")


def test_columns_that_are_not_used_are_told(tmp_path):
    path = save(tmp_path / "log.csv", log() | {"s actual": log()["force"]})
    assert io.read_with_notes(path, served=True)[1][0].endswith("Not used: s actual.")
    more = log() | {f"channel {i}": log()["force"] for i in range(20)}
    said = io.read_with_notes(save(tmp_path / "more.csv", more), served=True)[1][0]
    assert said.endswith("channel 11 and 8 more.")


def test_what_is_wanted_is_never_the_force():
    names = ["time", "position", "current", "desired_current", "reference_position"]
    chosen = assign(names, None, "log")
    assert chosen["force"] == "current" and chosen["reference"] == "reference_position"


def test_ambiguous_names_are_an_error_that_lists_them(tmp_path):
    path = save(tmp_path / "log.csv", log() | {"torque": log()["force"]})
    with pytest.raises(ValueError, match=r"force: force, torque.*--columns force=") as caught:
        io.read(path)
    assert "log.csv" in str(caught.value)
    assert io.read(path, columns={"force": "torque"}).num_samples == 200


def test_given_columns_win_and_extra_roles_become_channels(tmp_path):
    path = save(tmp_path / "log.csv", log() | {"strain": np.ones(200), "oil": np.arange(200.0)})
    columns = {"force": "strain", "oil_level": "oil"}
    recording = io.read(path, columns=columns)
    np.testing.assert_array_equal(recording.force, 1.0)
    np.testing.assert_array_equal(recording.channels["oil_level"], np.arange(200.0))
    assert "oil" not in io.read(path).channels


def test_an_empty_name_leaves_a_role_out(tmp_path):
    path = save(tmp_path / "log.csv", log() | {"velocity": np.full(200, np.nan)})
    with pytest.raises(ValueError, match="velocity column holds no number.*velocity="):
        io.read(path)
    assert io.read(path, columns={"velocity": ""}).velocity is None


def test_unknown_column_lists_what_is_there(tmp_path):
    with pytest.raises(ValueError, match="'strain' for the force.*time, position, force"):
        io.read(save(tmp_path / "log.csv", log()), columns={"force": "strain"})


@pytest.mark.parametrize("gone", ["time", "position", "force"])
def test_missing_roles(tmp_path, gone):
    columns = {name: column for name, column in log().items() if name != gone}
    with pytest.raises(ValueError, match=f"{gone}.*--columns {gone}=NAME"):
        io.read(save(tmp_path / "log.csv", columns | {"other": np.ones(200)}))


def test_scale_multiplies_and_units_follow(tmp_path):
    columns = log()
    named = {"t": columns["time"], "pos_mm": columns["position"], "torque": columns["force"]}
    path = save(tmp_path / "log.csv", named)
    recording = io.read(path)
    assert recording.unit_names == {"force": "N·m", "position": "mm"}
    np.testing.assert_array_equal(recording.position, columns["position"])
    recording = io.read(path, scale={"position": 0.001, "force": 2.0}, units={"force": "kN"})
    assert recording.unit_names == {"force": "kN", "position": "m"}
    np.testing.assert_allclose(recording.position, 0.001 * columns["position"], rtol=1e-15)
    np.testing.assert_allclose(recording.force, 2 * columns["force"], rtol=1e-15)


@pytest.mark.parametrize("factor", [0.0, np.nan, np.inf])
def test_useless_scales_are_refused(tmp_path, factor):
    with pytest.raises(ValueError, match="scale of force"):
        io.read(save(tmp_path / "log.csv", log()), scale={"force": factor})
    with pytest.raises(ValueError, match="scale names 'load'"):
        io.read(tmp_path / "log.csv", scale={"load": 1.0})


def test_milliseconds_in_a_name_are_taken_as_such(tmp_path):
    columns = log()
    named = {"time_ms": 1000 * columns["time"], "x": columns["position"], "f": columns["force"]}
    path = save(tmp_path / "log.csv", named)
    recording, (said,) = io.read_with_notes(path, served=True)
    assert "time from time_ms × 0.001" in said
    np.testing.assert_allclose(recording.time, columns["time"])
    np.testing.assert_allclose(io.read(path, scale={"time": 1.0}).time, 1000 * columns["time"])


@pytest.mark.parametrize("unit", ["35.15*N", "35.15 N", "35.15·N"])
def test_a_factor_in_a_unit_is_told_to_be_a_scale(tmp_path, unit):
    path = save(tmp_path / "log.csv", log())
    with pytest.raises(ValueError, match=r"--scale force=35\.15 --units force=N "):
        io.read(path, units={"force": unit})
    assert io.read(path, units={"force": "1"}).unit_names["force"] == "1"


def test_time_stamps_since_1970_are_what_they_are_beside_a_unit(tmp_path):
    columns = log()
    stamps = 1_700_000_000_000 + np.rint(1000 * columns["time"]).astype(int)
    named = {"time_ms": stamps, "x": columns["position"], "f": columns["force"]}
    time = io.read(save(tmp_path / "log.csv", named)).time
    np.testing.assert_allclose(time, columns["time"] - columns["time"][0], atol=1e-9)


@pytest.mark.parametrize(
    ("position", "velocity", "times", "unit"),
    [
        ("x_rad", "v_deg_s", np.pi / 180, "rad"),
        ("x [deg]", "speed [rpm]", 6.0, "deg"),
        ("x [rev]", "speed [1/min]", 1 / 60, "rev"),
        ("x [m]", "speed [mm/s]", 1e-3, "m"),
        ("x", "speed [mm/min]", 1 / 60, "mm"),
        (None, "speed [rpm]", np.pi / 30, "rad"),
        (None, "speed [mm/min]", 1 / 60, "mm"),
        ("x [mm]", "v [mm/s]", 1.0, "mm"),
    ],
)
def test_velocity_is_the_position_s_unit_per_second(tmp_path, position, velocity, times, unit):
    columns = log()
    named = {"t": columns["time"], velocity: columns["position"], "f": columns["force"]}
    if position:
        named[position] = columns["force"]
    recording = io.read(save(tmp_path / "log.csv", named))
    np.testing.assert_allclose(recording.velocity, times * columns["position"], rtol=1e-12)
    assert dict(recording.units)["position"] == unit
    own = io.read(tmp_path / "log.csv", scale={"velocity": 2.0})
    np.testing.assert_allclose(own.velocity, 2 * columns["position"], rtol=1e-12)


@pytest.mark.parametrize(
    ("named", "times"),
    [
        ({"reference_m": "reference"}, 1000.0),
        ({"reference_mm": "reference"}, 1.0),
        ({"neighbour_velocity_m_s": "neighbour_velocity"}, 1000.0),
        ({"neighbour_velocity [mm/min]": "neighbour_velocity"}, 1 / 60),
        ({"neighbour_velocity_rad_s": "neighbour_velocity"}, 1.0),
        ({"neighbour_velocity [foo]": "neighbour_velocity"}, 1.0),
    ],
)
def test_a_neighbour_and_a_reference_are_in_the_position_s_unit(tmp_path, named, times):
    columns = log()
    ((column, role),) = named.items()
    table = {"t": columns["time"], "x [mm]": columns["position"], "f": columns["force"]}
    recording, notes = io.read_with_notes(
        save(tmp_path / "log.csv", table | {column: columns["position"]}), served=True
    )
    np.testing.assert_allclose(recording.channels[role], times * columns["position"], rtol=1e-12)
    assert (f"× {times:g}" in notes[0]) == (times != 1)
    assert ("[foo]" in "".join(notes[1:])) == ("foo" in column)


@pytest.mark.parametrize(
    ("position", "velocity", "remedy"),
    [("x", "speed [rpm]", "--units position=rad.*--scale velocity=0.1047"),
     ("x [mm]", "speed [rpm]", "rpm, but the position is in mm.*--scale velocity=")],
)  # fmt: skip
def test_a_speed_that_no_name_relates_asks_for_its_factor(tmp_path, position, velocity, remedy):
    columns = log()
    named = {"t": columns["time"], position: columns["position"], velocity: columns["position"]}
    path = save(tmp_path / "log.csv", named | {"f": columns["force"]})
    with pytest.raises(ValueError, match=remedy):
        io.read(path)


# ---- clean-up ----


def test_a_clean_log_is_left_alone(tmp_path):
    jitter = np.random.default_rng(1).uniform(0.0, 0.9e-3, 200)
    t = log()["time"] + jitter  # and that is when the samples were taken
    columns = {"time": t, "position": np.sin(7 * t), "force": np.cos(7 * t)}
    recording, notes = io.read_with_notes(save(tmp_path / "log.csv", columns))
    assert notes == [] and recording.num_segments == 1
    np.testing.assert_array_equal(recording.time, columns["time"])


def test_segments_by_column_restart_and_gap(tmp_path):
    columns = log(300)
    restart = np.concatenate([columns["time"][:100]] * 3)
    labels = np.repeat(["up", "down", "up"], 100)
    for extra in ({"segment": labels}, {"run": np.repeat([4, 2, 9], 100)}, {}):
        recording, notes = io.read_with_notes(
            save(tmp_path / "log.csv", columns | {"time": restart} | extra)
        )
        np.testing.assert_array_equal(recording.segment, np.repeat([0, 1, 2], 100))
        assert recording.num_segments == 3
        assert len(notes) == (not extra)
    gap = columns["time"] + np.repeat([0.0, 0.1, 5.0], 100)
    recording, notes = io.read_with_notes(save(tmp_path / "log.csv", columns | {"time": gap}))
    np.testing.assert_array_equal(recording.segment, np.repeat([0, 1, 2], 100))
    assert "2 samples after a gap" in notes[0] and "row 102" in notes[0]


def test_a_slow_segment_has_no_gaps_of_a_fast_one(tmp_path):
    columns = log(150)
    step = np.repeat([0.001, 0.1], [100, 50])
    columns |= {"time": np.cumsum(step), "segment": np.repeat([0, 1], [100, 50])}
    assert io.read(save(tmp_path / "log.npz", columns)).num_segments == 2


def test_stamps_repeated_backward_and_stray_are_left_out(tmp_path):
    columns = log()
    columns["time"][50] = columns["time"][49]
    columns["time"][80] = columns["time"][79] - 0.0005
    columns["time"][120] = 99.0
    columns["time"][150] = np.nan
    recording, notes = io.read_with_notes(save(tmp_path / "log.csv", columns))
    kept = np.delete(np.arange(200), [50, 80, 120, 150])
    np.testing.assert_array_equal(recording.time, columns["time"][kept])
    np.testing.assert_array_equal(recording.force, columns["force"][kept])
    assert recording.num_segments == 1
    assert "row 152" in notes[0] and "row 122" in notes[1] and "row 52" in notes[2]


def trembling(quantum, rate=1000.0, n=4000, share=0.03, drift=2e-3):
    """A steady motion, and stamps that scatter about a clock that drifts by two steps."""
    draw = np.random.default_rng(4)
    ticks = np.arange(n) / rate
    stamps = ticks + share / rate * draw.normal(size=n) + drift * np.sin(2 * ticks)

    def columns(at):
        position = 0.05 * np.sin(7 * at) + 0.02 * np.sin(19 * at)
        position = quantum * np.round(position / quantum)
        return {"t": stamps, "q": position, "tau": np.cos(7 * at)}

    return ticks, columns


@pytest.mark.parametrize("quantum", [1e-7, 1e-6])
def test_stamps_that_scatter_about_a_steady_clock_are_put_on_it(tmp_path, quantum):
    ticks, columns = trembling(quantum)
    even = columns(ticks + 2e-3 * np.sin(2 * ticks))
    recording, notes = io.read_with_notes(save(tmp_path / "log.csv", even))
    assert len(notes) == 1 and "scatter by 3.0% of a step" in notes[0]
    off = np.asarray(recording.time) - ticks - 2e-3 * np.sin(2 * ticks)
    assert np.std(off[40:-40]) < 0.25 * 0.03e-3  # the drift is the clock's own
    moving = {"t": even["t"], "qd": np.gradient(even["q"], 1e-3), "tau": even["tau"]}
    _, notes = io.read_with_notes(save(tmp_path / "log.csv", moving))
    assert not notes or "velocity is smoother" in notes[0]


@pytest.mark.parametrize("quantum", [1e-7, 1e-6, 1e-3])
def test_stamps_that_are_right_or_make_no_difference_are_left_alone(tmp_path, quantum):
    """Samples taken where the stamps say, and an encoder too coarse to tell."""
    _, columns = trembling(quantum)
    late = columns(columns(0.0)["t"])
    recording, notes = io.read_with_notes(save(tmp_path / "log.csv", late))
    assert not notes
    np.testing.assert_array_equal(np.asarray(recording.time), late["t"])


def test_invalid_samples_are_masked_and_finite(tmp_path):
    columns = log() | {"temperature": np.where(np.arange(200) % 10 == 0, 20.0, np.nan)}
    columns["force"][[3, 4]] = [np.nan, np.inf]
    columns["position"][-1] = -np.inf
    recording, notes = io.read_with_notes(save(tmp_path / "log.csv", columns))
    np.testing.assert_array_equal(np.flatnonzero(~np.asarray(recording.mask)), [3, 4, 199])
    for signal in (recording.force, recording.position, recording.channels["temperature"]):
        assert np.isfinite(signal).all()
    low, high = sorted(columns["force"][[2, 5]])
    assert low <= float(recording.force[3]) <= high
    assert len(notes) == 3 and "2 samples without a finite force" in " ".join(notes)


def rotation(turn, quantum, centred, n=4000):
    t = np.arange(n) / 1000
    turns = 1.7 * np.sin(2 * t) + 0.9 * t
    true = np.round(turns * turn / quantum) * quantum
    wrapped = np.mod(true + centred * turn / 2, turn) - centred * turn / 2
    return t, true, wrapped


@pytest.mark.parametrize("centred", [False, True])
@pytest.mark.parametrize(
    "turn, quantum",
    [(8192, 1), (4000, 1), (10000, 1), (2 * np.pi, 2 * np.pi / 8192), (360.0, 1e-3), (1e6, 1.0)],
)
def test_a_wrapped_position_becomes_continuous(tmp_path, turn, quantum, centred):
    t, true, wrapped = rotation(turn, quantum, centred)
    columns = {"time": t, "position": wrapped, "force": np.ones_like(t), "reference": wrapped}
    recording, notes = io.read_with_notes(save(tmp_path / "log.npz", columns))
    assert "wraps modulo" in notes[0]
    moved = np.asarray(recording.position - recording.position[0])
    np.testing.assert_allclose(moved, true - true[0], atol=1e-6 * turn)
    np.testing.assert_allclose(recording.channels["reference"], recording.position)


def test_motion_and_glitches_are_not_taken_for_wraps(tmp_path):
    t = np.arange(2000) / 1000
    smooth = 300 * np.sin(5 * t) + 500
    spikes, steps, coarse = smooth.copy(), np.sign(np.sin(20 * t)), np.sin(2 * np.pi * 300 * t)
    spikes[[400, 900, 1300]] = [4000, 0, 7000]
    for position, warned in ((smooth, 0), (spikes, 1), (steps, 1), (coarse, 0)):
        columns = {"time": t, "position": position, "force": np.ones_like(t)}
        recording, notes = io.read_with_notes(save(tmp_path / "log.npz", columns))
        known = np.asarray(recording.mask)
        assert np.flatnonzero(~known).tolist() == ([400, 900, 1300] if position is spikes else [])
        np.testing.assert_array_equal(np.asarray(recording.position)[known], position[known])
        assert len(notes) == warned


# ---- bad input ----


def test_text_in_a_number_column_is_located(tmp_path):
    columns = log() | {"force": ["1.5"] * 7 + ["E-STOP"] + ["2"] * 192}
    with pytest.raises(ValueError, match=r"log\.csv: row 9, column 'force': 'E-STOP'"):
        io.read(save(tmp_path / "log.csv", columns))


BAD = {
    "empty": ("", "empty"),
    "header only": ("t,x,f\n", "no samples below its first line, 't, x, f'"),
    "a word": ("hello", "no samples below its first line, 'hello'.* numbers for each sample"),
    "comments only": ("# nothing\n", "no samples"),
    "ragged": ("t,x,f\n0,1,2\n1,2\n" + "2,3,4\n" * 20, "row 3 has 2 fields"),
    "no header": ("0,1,2\n1,2,3\n" * 20, "column1, column2, column3"),
    "few": ("t,x,f\n0,1,2\n1,2,3\n", "2 samples .* at least 16"),
    "constant time": ("t,x,f\n" + "1,2,3\n" * 30, "does not change"),
    "time runs back": (
        "t,x,f\n" + "".join(f"{-i},2,3\n" for i in range(30)),
        "runs backwards",
    ),
    "all NaN": ("t,x,f\n" + "".join(f"{i},nan,3\n" for i in range(30)), "no number at all"),
    "few valid": (
        "t,x,f\n" + "".join(f"{i},{i if i < 9 else ''},3\n" for i in range(30)),
        "9 valid samples",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_files(tmp_path, case):
    text, message = BAD[case]
    (tmp_path / "log.csv").write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        io.read(tmp_path / "log.csv")
    assert "log.csv" in str(caught.value)


@pytest.mark.parametrize("suffix", [".parquet", ".mat", ".npz"])
def test_damaged_files(tmp_path, suffix):
    (tmp_path / f"log{suffix}").write_bytes(b"PK\x03\x04 this is no such file " * 40)
    with pytest.raises(ValueError, match=f"log{suffix}: this is no readable"):
        io.read(tmp_path / f"log{suffix}")


def test_absent_file_unknown_format_and_unequal_columns(tmp_path):
    with pytest.raises(ValueError, match="no such file"):
        io.read(tmp_path / "log.csv")
    (tmp_path / "log.xlsx").write_text("a")
    with pytest.raises(ValueError, match="'xlsx' is not known"):
        io.read(tmp_path / "log.xlsx")
    np.savez(tmp_path / "log.npz", t=np.arange(30.0), x=np.arange(31.0), f=np.arange(30.0))
    with pytest.raises(ValueError, match="differ in length: .*x .position. 31"):
        io.read(tmp_path / "log.npz")


# ---- writing ----


def test_a_folder_is_told_as_such(tmp_path):
    with pytest.raises(ValueError, match=r"is a folder; name a file in it, .*jaxfric fleet"):
        io.read(tmp_path)
    with pytest.raises(ValueError, match="there is no such file"):
        io.read(tmp_path / "nothing")


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = tmp_path / "out.csv"
    io.write_text(path, "old µ")
    with pytest.raises(ValueError, match="columns of one length"):
        io.write_table(path, {"a": np.ones(3), "b": np.ones(4)})
    with pytest.raises(UnicodeEncodeError):
        io.write_text(path, "\ud800")
    assert path.read_text(encoding="utf-8") == "old µ"
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.csv"]
    with pytest.raises(ValueError, match="folder"):
        io.write_text(tmp_path / "absent" / "out.json", "{}")
    with pytest.raises(ValueError, match="use that suffix"):
        io.write_table(tmp_path / "out.xls", {"a": np.ones(3)})


# ---- real recordings ----


@needs_data
def test_emps():
    pytest.importorskip("scipy.io")
    recording, notes = io.read_with_notes(DATA / "emps" / "DATA_EMPS.mat", scale={"force": 35.15})
    assert notes == [] and recording.num_samples == 24841 and recording.velocity is None
    assert recording.unit_names == {"force": "N", "position": "m"}
    assert list(recording.channels) == ["reference"]
    assert float(abs(recording.channels["reference"] - recording.position).max()) < 2e-3


@needs_data
@pytest.mark.parametrize("name, segments", [("spinup_uncompensated", 50), ("slow_compensated", 1)])
def test_odrive(name, segments):
    recording, notes = io.read_with_notes(DATA / "odrive" / f"{name}.csv")
    assert notes == [] and recording.num_segments == segments
    assert recording.unit_names == {"force": "A", "position": "counts"}


@needs_data
def test_delta_servo_and_ur10e():
    recording, notes = io.read_with_notes(DATA / "delta_servo" / "Jm_1.csv")
    assert notes == [] and recording.unit_names == {"force": "N·m", "position": "rad"}
    assert list(recording.channels) == ["reference"] and recording.velocity is not None
    recording, notes = io.read_with_notes(DATA / "ur10e" / "joint_1.csv")
    assert notes == [] and recording.channels == {} and recording.num_segments == 1


@pytest.mark.parametrize(
    "head, options, said",
    [
        (
            "time,position,current",
            {},
            "No unit is named: position as m (else --units position=UNIT)",
        ),
        ("time,position,force", {}, "force as N and position as m"),
        ("time,velocity,force [N]", {}, "position as m"),
        ("time,position [mm],force [N]", {}, None),
        ("time,position,torque", {}, None),
        ("time,position,current", {"units": {"position": "rad"}}, None),
    ],
)
def test_a_unit_that_nothing_names_is_said(tmp_path, head, options, said):
    path = tmp_path / "log.csv"
    rows = "\n".join(f"{0.01 * i},{np.sin(i)},{np.cos(i)}" for i in range(20))
    path.write_text(f"{head}\n{rows}\n")
    _, notes = io.read_with_notes(path, served=True, **options)
    assert said in notes[0] if said else "No unit is named" not in notes[0]


# ---- what is no log of one axis ----


def two_axes(path, alike, count=400):
    """Rows of two axes in turn, each with its own force, and its own motion if not `alike`."""
    rows = []
    for i in range(count):
        places = (np.sin(i / 30), np.sin(i / 30) if alike else 0.1 + 0.5 * np.cos(i / 20))
        forces = (10 * np.cos(i / 30), 25 + i % 3)
        rows += [f"{i / 1000:.3f},{x:.6f},{f:.3f}" for x, f in zip(places, forces, strict=True)]
    path.write_text("\n".join(["time,position,force", *rows]))
    return path


@pytest.mark.parametrize(("alike", "role"), [(False, "position"), (True, "force")])
def test_two_logs_row_by_row_are_told(tmp_path, alike, role):
    with pytest.raises(ValueError, match=f"2 samples in turn .* the {role} jumps to and fro"):
        io.read(two_axes(tmp_path / "log.csv", alike))


def test_stamps_that_are_rounded_are_no_two_logs(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{i // 2 / 1000:.3f},{np.sin(i / 60):.6f},{i % 7}" for i in range(800)]
    path.write_text("\n".join(["time,position,force", *rows]))
    assert "rounded" in io.read_with_notes(path)[1][0]


def test_a_clock_that_runs_backwards_is_told(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{(100 - i) / 100},{np.sin(i / 9)},{i % 7}" for i in range(100)]
    path.write_text("\n".join(["time,position,force", *rows]))
    with pytest.raises(ValueError, match="time runs backwards at 99 of 99 steps. Turn the order"):
        io.read(path)


def test_a_file_that_is_no_text_is_told(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(bytes([0x5F, 0x82, 0xC2, 10, 0x23, 0x04, 0x45, 10]) * 20)
    with pytest.raises(ValueError, match="this is no text: byte 6 is a control character"):
        io.read(path)
