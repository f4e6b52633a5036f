"""Many recordings: found, read ahead, batched, resumed, compared, and written whole."""

import argparse
import csv
import dataclasses
import json
import os
import signal
import subprocess
import sys
import time as clock
from pathlib import Path

import numpy as np
import pytest

from jaxfric import fleet
from jaxfric.cli import main
from jaxfric.cli.fleet import span
from jaxfric.cli.values import process
from jaxfric.data import io
from jaxfric.fleet import batches, comparing, files as listing, journal, tables, telling
from jaxfric.identification.identified import Result

ROOT = Path(__file__).parents[1]
MODEL = ("--model", "coulomb-viscous")


@pytest.fixture(autouse=True)
def _no_cache(monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")


def write_log(path, seed=0, count=801, coulomb=10.0):
    """An axis of 2 kg, 10 N and 40 N·s/m at 500 Hz; whole periods, a little noise."""
    rate = 2 * np.pi * 1.25
    time = np.arange(count) / 500
    v, a = 0.1 * np.sin(rate * time), 0.1 * rate * np.cos(rate * time)
    noise = 0.1 * np.random.default_rng(seed).normal(size=count)
    path.parent.mkdir(parents=True, exist_ok=True)
    io.write_table(path, {"t": time, "qd": v, "tau": 2 * a + coulomb * np.sign(v) + 40 * v + noise})


@pytest.fixture
def logs(tmp_path):
    """Three axes, four recordings each, in three formats; one file is no log."""
    for axis in "xyz":
        for run in range(4):
            suffix = ("csv", "npz", "parquet")[run % 3]
            place = tmp_path / "logs" / f"axis={axis}" / f"2024-0{run + 1}-01.{suffix}"
            write_log(place, seed=10 * ord(axis) + run, coulomb=15.0 if axis == "y" else 10.0)
    (tmp_path / "logs" / "axis=x" / "notes.csv").write_text("a,b\n1,2\n")
    return tmp_path / "logs"


def rows_of(path):
    if path.suffix == ".csv":
        with path.open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    import pyarrow.parquet

    return pyarrow.parquet.read_table(path).to_pylist()


def run(*arguments):
    return main(["fleet", *map(str, arguments), *MODEL, "--jobs", "1"])


# ---- the whole way ----


@pytest.mark.slow
def test_a_fleet_becomes_a_table_a_picture_and_words(logs, tmp_path, capsys):
    out, picture = tmp_path / "fits.parquet", tmp_path / "fits.png"
    assert run(logs / "**" / "*.*", "--out", out, "--plot", picture) == 0
    text, errors = capsys.readouterr()
    assert not errors  # progress is for terminals
    rows = rows_of(out)
    assert len(rows) == 13
    assert [row["file"] for row in rows] == sorted(row["file"] for row in rows)
    good = [row for row in rows if row["result"] == "successful"]
    assert len(good) == 12
    for row in good:
        coulomb = 15.0 if row["axis"] == "y" else 10.0
        assert abs(row["coulomb+"] - coulomb) < 0.2
        assert 0 < row["coulomb+_standard_error"] < 0.2
        assert row["coulomb+_unit"] == "N"
        assert row["projection"] == "closed_windows" and row["windows"] == 1
        assert row["samples"] == 801
    (bad,) = [row for row in rows if row["result"] == "failed"]
    assert "notes.csv" in bad["reason"] and bad["coulomb+"] is None
    assert "12 successful, 1 failed" in text and bad["reason"] in text
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert not journal.folder(out).exists()


@pytest.mark.slow
def test_a_row_is_what_identify_says_of_the_file(tmp_path, capsys):
    """A shorter and a longer log in one fleet, and one that starts and ends at other speeds."""
    folder = tmp_path / "few"
    write_log(folder / "long.npz")
    write_log(folder / "short.npz", count=790)
    whole = io.read(folder / "long.npz")
    # One way only, ever faster: closed windows would use less than half of it.
    time = np.asarray(whole.time)
    speed = 0.01 + 0.2 * time**2
    force = 10.0 + 0.8 * time + 40 * speed + 0.1 * np.random.default_rng(0).normal(size=time.size)
    io.write_table(folder / "open.npz", {"t": time, "v": speed, "f": force})
    out, single = tmp_path / "fits.csv", tmp_path / "single.json"
    assert run(folder, "--out", out) == 0
    rows = rows_of(out)
    assert len(rows) == 3
    for row in rows:
        assert main(["identify", row["file"], *MODEL, "--json", str(single)]) == 0
        document = json.loads(single.read_text())
        assert row["result"] == document["result"]
        assert row["projection"] == document["projection"]
        for name, entry in document["parameters"].items():
            for key, suffix in (("value", ""), ("standard_error", "_standard_error")):
                cell = row[name + suffix]
                assert (cell == "") == (entry[key] is None)
                if cell and entry["standard_error"] is not None:
                    # The order of sums differs, some rounding times the columns' condition.
                    np.testing.assert_allclose(float(cell), entry[key], rtol=1e-9, err_msg=name)
    assert {row["projection"] for row in rows} == {"closed_windows", "weak_form"}


# ---- interruptions ----


class Died(BaseException):
    pass


@pytest.mark.slow
def test_an_interrupted_run_goes_on_without_losing_or_repeating_rows(logs, tmp_path, monkeypatch):
    monkeypatch.setattr(batches, "ROWS", 4)
    out, solved = tmp_path / "fits.csv", []
    real = batches.devices.solve

    def solve(setup, faults, over):
        if len(solved) == 2:
            raise Died
        solved.append(setup.recording.time.shape)
        return real(setup, faults, over)

    monkeypatch.setattr(batches.devices, "solve", solve)
    with pytest.raises(Died):
        run(logs, "--out", out)
    assert not out.exists()
    kept = journal.folder(out) / "rows-0.jsonl"
    lines = kept.read_bytes().splitlines()
    assert len(lines) == 1 + 8 + 1  # head, two batches of four, and the file that is no log
    kept.write_bytes(kept.read_bytes() + b'{"file": "half a li')  # killed while it wrote
    changed = json.loads(lines[-1])["file"]
    write_log(Path(changed), seed=99, count=801, coulomb=12.0)
    solved.clear()
    assert run(logs, "--out", out) == 0
    assert len(solved) == 2  # four that were left, and the one that has changed
    rows = rows_of(out)
    assert len({row["file"] for row in rows}) == len(rows) == 13
    assert sum(row["result"] == "successful" for row in rows) == 12
    (again,) = [row for row in rows if row["file"] == changed]
    assert abs(float(again["coulomb+"]) - 12.0) < 0.2
    assert not journal.folder(out).exists()


@pytest.mark.slow
def test_a_killed_process_leaves_rows_to_go_on_from(tmp_path):
    folder, out = tmp_path / "logs", tmp_path / "fits.csv"
    for i in range(48):  # two lengths: the second program is being compiled when the kill comes
        write_log(folder / f"run{i}.npz", seed=i, count=801 if i < 40 else 2001)
    command = [sys.executable, "-m", "jaxfric", "fleet", str(folder), "--out", str(out)]
    command += ["--jobs", "1", *MODEL]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "JAXFRIC_CACHE": "off"}
    kept = journal.folder(out) / "rows-0.jsonl"
    first = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE)
    while first.poll() is None:
        if kept.exists() and kept.read_bytes().count(b"\n") > 1:
            break
        clock.sleep(0.02)
    first.send_signal(signal.SIGKILL)
    first.wait()
    first.stderr.close()
    before = kept.read_bytes()
    count = before.count(b"\n") - 1
    assert 0 < count < 48 and not out.exists()
    second = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert second.returncode == 0, second.stderr
    rows = rows_of(out)
    assert len({row["file"] for row in rows}) == len(rows) == 48
    assert all(row["result"] == "successful" for row in rows)
    by_file = {row["file"]: row for row in rows}
    for line in map(json.loads, before.splitlines()[1 : 1 + count]):  # the last may be half a line
        kept_value = line["row"]["parameters"]["coulomb+"]["value"]
        assert float(by_file[line["file"]]["coulomb+"]) == kept_value


@pytest.mark.slow
def test_two_processes_share_a_fleet(tmp_path):
    import socket

    folder, out = tmp_path / "logs", tmp_path / "fits.csv"
    for i in range(6):
        write_log(folder / f"run{i}.npz", seed=i, coulomb=10.0 + i)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "JAXFRIC_CACHE": "off"}
    command = [sys.executable, "-m", "jaxfric", "fleet", str(folder), "--out", str(out)]
    # What is left of another model is in the way of neither.
    for part in range(2):
        with journal.Journal(out, {"model": "lorentzian"}, part):
            pass
    command += ["--jobs", "1", *MODEL, "--restart", "--process"]
    both = [
        subprocess.Popen([*command, f"{i}/2@127.0.0.1:{port}"], env=environment) for i in range(2)
    ]
    try:
        assert [each.wait(timeout=240) for each in both] == [0, 0]
    finally:
        for each in both:
            each.kill()
    rows = rows_of(out)
    np.testing.assert_allclose(
        [float(row["coulomb+"]) for row in rows], 10.0 + np.arange(6), atol=0.2
    )


def a_file(name="a.csv", axis="", size=1, changed=1, group=""):
    return listing.File(name, {}, axis, group, size, changed)


def test_rows_of_other_options_are_not_taken_over(tmp_path):
    out = tmp_path / "fits.csv"
    with journal.Journal(out, {"model": "gaussian"}) as kept:
        kept.add([(a_file(), {"result": "successful", "parameters": {}})])
    with pytest.raises(ValueError, match="model gaussian, not lorentzian.*--restart"):
        journal.Journal(out, {"model": "lorentzian"}).__enter__()
    journal.forget(out)
    with journal.Journal(out, {"model": "lorentzian"}) as kept:
        assert not kept.rows([a_file()])


def test_a_second_run_for_the_same_output_is_refused(tmp_path):
    pytest.importorskip("fcntl")
    with journal.Journal(tmp_path / "fits.csv", {}):
        with pytest.raises(ValueError, match="another run"):
            journal.Journal(tmp_path / "fits.csv", {}).__enter__()
        with pytest.raises(ValueError, match="another run"):
            journal.forget(tmp_path / "fits.csv")


def test_beginning_anew_each_process_removes_its_own_rows(tmp_path):
    out = tmp_path / "fits.csv"
    for part in range(3):
        with journal.Journal(out, {}, part):
            pass

    def left():
        return [path.stem for path in sorted(journal.folder(out).glob("*"))]

    journal.forget(out, 1, 2)
    assert left() == ["rows-0", "rows-2"]
    journal.forget(out, 0, 2)
    assert left() == []


def test_rows_of_changed_files_are_made_anew(tmp_path):
    with journal.Journal(tmp_path / "fits.csv", {}) as kept:
        kept.add([(a_file(), {"result": "successful", "parameters": {}})])
        assert set(kept.rows([a_file()])) == {"a.csv"}
        assert not kept.rows([a_file(size=2)])
        assert not kept.rows([a_file(changed=2)])
        assert not kept.rows([a_file("b.csv")])


# ---- bad input ----


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nothing/**/*.csv", "--out", "a.csv"), "nothing/**/*.csv: no file matches"),
        (("logs", "--out", "a.csv", "--model", "gausian"), "No model is called 'gausian'"),
        (("logs", "--out", "none/a.csv"), "there is no folder none"),
        (("logs", "--out", "a.txt"), ".parquet or .csv"),
        (("logs", "--out", "logs"), "written as"),
        (("logs", "--out", "a.csv", "--axis", "("), "no regular expression"),
        (("logs", "--out", "a.csv", "--group", "zzz"), "neither a key"),
        (("logs", "--out", "a.csv", "--columns", "force=zz"), "none of 1 files"),
    ],
)
def test_bad_input_is_one_message_and_no_output(tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.chdir(tmp_path)
    write_log(tmp_path / "logs" / "a.csv")
    assert main(["fleet", *arguments]) == 2
    out, errors = capsys.readouterr()
    assert message in errors and not out
    assert len(errors.splitlines()) == 1
    assert os.listdir(tmp_path) == ["logs"]


@pytest.mark.parametrize("text", ["", "1/2", "2/2@host:1", "0/2@host", "a/2@host:1", "0/2@:1"])
def test_a_process_is_named_by_number_and_address(text):
    assert process("1/2@host:80") == (1, 2, "host:80")
    with pytest.raises(argparse.ArgumentTypeError):
        process(text)


# ---- files ----


def test_files_are_found_in_natural_order_with_axis_and_date(tmp_path):
    for name in ("run10", "run2", "run1"):
        write_log(tmp_path / "machine=7" / "axis=a%20b" / "date=2024-03-01" / f"{name}.npz")
    found = fleet.find([str(tmp_path), str(tmp_path / "**" / "run2.npz")])
    assert [Path(f.path).stem for f in found] == ["run1", "run2", "run10"]
    assert found[0].axis == "machine=7/axis=a b"
    assert found[0].keys == {"machine": "7", "axis": "a b", "date": "2024-03-01"}
    by_key = fleet.find([str(tmp_path)], axis="axis", group=r"machine=(\d)")
    assert (by_key[0].axis, by_key[0].group) == ("a b", "7")


@pytest.mark.parametrize(
    ("name", "days"),
    [
        ("2024-03-01.csv", 19783.0),
        ("log_20240301-1200.csv", 19783.5),
        ("2024-03-01T06:00:00.csv", 19783.25),
        ("2024-02-31.csv", None),
        ("run20240301123.csv", None),
        ("axis3.csv", None),
    ],
)
def test_dates_in_names(name, days):
    assert a_file(name).date == days


# ---- comparing ----


def rows_like(values, error=0.1, axes=1):
    """Rows with one parameter, and their files, in turn of some axes."""
    many = [a_file(f"{i}.csv", f"axis{i % axes}") for i in range(len(values))]
    parameters = [{"coulomb+": {"value": v, "standard_error": error, "unit": "N"}} for v in values]
    rows = {
        f.path: {"result": "successful", "filtered_force_error": 0.02, "parameters": p}
        for f, p in zip(many, parameters, strict=True)
    }
    return many, rows


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e3])
def test_outliers_are_told_in_any_unit(unit):
    values = unit * np.random.default_rng(1).normal(10, 0.5, 60)
    values[7] = 15 * unit
    found = fleet.compare(*rows_like(values, 0.1 * unit, axes=60))
    assert [one.path for one in found.outliers] == ["7.csv"]
    assert found.outliers[0].chance < 0.01
    (usual, error) = found.usual
    assert abs(usual.median / unit - 10) < 0.3 and 0.3 < usual.deviation / unit < 0.8
    assert error.name == "filtered_force_error" and error.recordings == 60


def test_a_value_that_is_hardly_known_is_no_outlier():
    many, rows = rows_like(np.append(np.random.default_rng(1).normal(10, 0.5, 40), 15))
    rows[many[-1].path]["parameters"]["coulomb+"]["standard_error"] = 5.0
    assert not fleet.compare(many, rows).outliers


def test_few_recordings_and_equal_ones_have_no_outliers():
    assert not fleet.compare(*rows_like([10.0, 10.0, 99.0])).outliers
    assert not fleet.compare(*rows_like([10.0] * 20)).outliers


def test_false_alarms_are_as_rare_as_promised():
    rng, alarms = np.random.default_rng(0), np.zeros(2)
    for _ in range(100):
        found = fleet.compare(*rows_like(rng.normal(10, 1, 40), axes=5))
        drifts = [drift.chance < comparing.LEVEL for drift in found.drifts]
        alarms += [bool(found.outliers), any(drifts)]
    # 5 of 100 by design; 12 or more come about once in 200 runs.
    assert np.all(alarms < 12), alarms


def test_a_drift_of_one_axis_among_many_is_told():
    rng = np.random.default_rng(2)
    values = rng.normal(10, 0.1, (12, 5))
    values[:, 3] += 0.2 * np.arange(12)
    many, rows = rows_like(values.ravel(), axes=5)
    found = fleet.compare(many, rows)
    told = [drift for drift in found.drifts if drift.chance < comparing.LEVEL]
    assert [drift.axis for drift in told] == ["axis3"]
    drift = told[0]
    assert drift.per == "recording"
    assert abs(drift.line[1] - 0.2) < 4 * drift.slope_error < 0.1


def test_a_dated_drift_is_per_day():
    dates = [f"2024-01-{day:02d}.csv" for day in (1, 4, 5, 11, 20)]
    many, rows = rows_like([10.0 + 0.5 * d for d in (0, 3, 4, 10, 19)])
    many = [f._replace(path=date) for f, date in zip(many, dates, strict=True)]
    rows = dict(zip(dates, rows.values(), strict=True))
    drift = next(d for d in fleet.compare(many, rows).drifts if d.name == "coulomb+")
    assert drift.per == "day"
    np.testing.assert_allclose(drift.line, (10.0, 0.5), rtol=1e-9)
    assert drift.chance < 1e-6


def test_a_slope_is_that_of_weighted_least_squares():
    rng = np.random.default_rng(3)
    x, y = np.arange(8.0), rng.normal(size=8)
    (level, rise), error = comparing.slope(x, y, np.zeros(8))
    design = np.stack([np.ones(8), x], 1)
    solution, rest, *_ = np.linalg.lstsq(design, y)
    expected = np.sqrt(rest[0] / 6 * np.linalg.inv(design.T @ design)[1, 1])
    np.testing.assert_allclose((level, rise, error), (*solution, expected), rtol=1e-9)


def test_chances_against_tables():
    # Student's t at 97.5 % with 2, 8 and 30 degrees of freedom.
    for degrees, t in ((2, 4.302653), (8, 2.306004), (30, 2.042272)):
        np.testing.assert_allclose(comparing.two_sided(np.array([t, -t]), degrees), 0.05, rtol=1e-5)
    raised = comparing.corrected(np.array([0.01, 0.5, 0.02]))
    np.testing.assert_allclose(raised, [0.03, 0.5, 0.04])


# ---- tables, progress ----


def test_the_columns_have_the_same_types_even_where_they_are_empty(tmp_path):
    import pyarrow.parquet

    many = [a_file("a.csv"), a_file("b.csv")]
    entry = {"coulomb+": {"value": 1.0, "standard_error": None, "unit": "N"}}
    rows = {
        "a.csv": {"result": "not_excited", "parameters": entry},
        "b.csv": {"result": "failed", "reason": 'why, "so"', "parameters": {}},
    }
    for name in ("a.parquet", "a.csv"):
        fleet.write(tmp_path / name, tables.columns(many, rows, "gaussian"))
    schema = pyarrow.parquet.read_schema(tmp_path / "a.parquet")
    kinds = {name: str(schema.field(name).type) for name in schema.names}
    assert kinds["coulomb+"] == kinds["coulomb+_standard_error"] == "double"
    assert kinds["filtered_force_error"] == "double" and kinds["windows"] == "int64"
    assert kinds["reason"] == kinds["axis"] == kinds["coulomb+_unit"] == "string"
    assert rows_of(tmp_path / "a.csv")[1]["reason"] == 'why, "so"'


def test_durations():
    assert [span(x) for x in (0.4, 59.4, 60, 5400)] == ["0 s", "59 s", "1 min", "1 h 30 min"]


def test_lengths_of_one_bucket_share_a_batch(tmp_path):
    """Different lengths, one program; what waits is bounded."""
    from jaxfric.fleet import reading

    for i, count in enumerate((801, 850, 890)):
        write_log(tmp_path / f"{i}.npz", count=count)
    found = list(reading.ahead(fleet.find([str(tmp_path)]), {}, threads=2, most=2))
    assert len({item.kind for item in found}) == 1
    assert [item.facts["samples"] for item in found] == [801, 850, 890]
    assert dataclasses.is_dataclass(found[0].recording)


def a_row(result="successful", error=0.02, warnings="", reason="", value=1.0):
    entry = {"value": value, "standard_error": 0.1, "unit": "N"}
    row = {"result": result, "filtered_force_error": error, "warnings": warnings}
    return row | {"reason": reason, "parameters": {"coulomb+": entry}}


def test_rows_that_describe_no_axis_are_not_compared():
    given = {"a": a_row(), "b": a_row(error=0.56, value=-57.0), "d": a_row(result="contradictory")}
    given["c"] = a_row(warnings="negative_parameter, force_late", value=-3.0)
    files = [fleet.File(path, {}, "", "", 0, 0) for path in given]
    found = fleet.compare(files, given)
    assert [(one.name, one.recordings, one.median) for one in found.usual][0] == ("coulomb+", 1, 1)
    said = telling.summary(files, given, found)
    assert (
        "Not compared, for their force error is over 25% or their friction negative: b, c" in said
    )


def test_a_result_is_told_with_what_each_file_contradicts_itself_in():
    words = Result[Result.contradictory]
    given = {name: a_row("contradictory", reason=f"{words} So by {name}.") for name in "abcd"}
    given |= {name: a_row(warnings="force_late") for name in "efghi"} | {"j": a_row(warnings="x")}
    files = [fleet.File(path, {}, "", "", 0, 0) for path in given]
    told = telling.troubles(files, given).splitlines()
    assert told[:5] == [
        f"contradictory: {words}",
        *(f"  {name}: So by {name}." for name in "abc"),
        "  and 1 more",
    ]
    assert "warning force_late: 5 recordings: e, f, g and 2 more" in told
    assert "warning x: 1 recording: j" in told


def test_too_few_recordings_of_an_axis_for_a_drift_are_told():
    many, rows = rows_like([10.0, 12.0, 14.0] * 4, axes=4)
    found = fleet.compare(many, rows)
    assert found.most == 3 and not found.drifts
    assert telling._drifts(found) == [
        "", "Drift: no axis has more than 3 sound recordings, and it takes 4."
    ]  # fmt: skip
    once = fleet.compare(*rows_like([10.0, 10.0, 99.0], axes=3))
    assert once.most == 1 and not telling._drifts(once)
