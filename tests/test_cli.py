"""The command line as its users and their scripts see it."""

import json
import os
import re
import subprocess
import sys
from argparse import ArgumentTypeError
from pathlib import Path

import numpy as np
import pytest

import jaxfric
from jaxfric import models
from jaxfric.cli import commands, main
from jaxfric.cli.values import names
from jaxfric.data import io
from jaxfric.data.recording import LONG, PADDING, uniform
from jaxfric.identification import documents

ROOT = Path(__file__).parents[1]
TRUTH = {
    "inertia": 2.0,
    "coulomb+": 10.0,
    "viscous+": 40.0,
    "coulomb-": 8.0,
    "viscous-": 30.0,
}
MODEL = ("--model", "coulomb-viscous")


@pytest.fixture(autouse=True)
def _no_cache(monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")


def write_axis(path, count=2001, forwards_only=False, seed=0):
    """A log of the axis above at 1 kHz over whole periods, or forwards only between two stops."""
    rate = 2 * np.pi / 0.5
    time = np.arange(count) / 1000
    bias = 1.0 if forwards_only else 0.0
    v = 0.1 * (bias - np.cos(rate * time)) if forwards_only else 0.1 * np.sin(rate * time)
    a = 0.1 * rate * (np.sin(rate * time) if forwards_only else np.cos(rate * time))
    x = 0.1 * bias * time - 0.1 / rate * (
        np.sin(rate * time) if forwards_only else np.cos(rate * time)
    )
    forwards, backwards = np.where(v > 0, 1.0, 0.0), np.where(v < 0, 1.0, 0.0)
    force = (
        TRUTH["inertia"] * a
        + forwards * (TRUTH["coulomb+"] + TRUTH["viscous+"] * v)
        + backwards * (-TRUTH["coulomb-"] + TRUTH["viscous-"] * v)
        + 0.1 * np.random.default_rng(seed).standard_normal(count)
    )
    columns = {"time": time, "force [N]": force, "position [m]": x, "velocity [m/s]": v}
    io.write_table(path, columns)
    return str(path)


@pytest.fixture
def axis(tmp_path):
    return write_axis(tmp_path / "axis.csv")


def strict(text):
    """JSON as the standard has it: NaN and Infinity are errors."""

    def refuse(constant):
        raise AssertionError(f"{constant} in a JSON document")

    return json.loads(text, parse_constant=refuse)


def check_identification(document):
    assert document["schema"] == "jaxfric.identification/1"
    facts = document["recording"]
    assert {"file", "samples", "duration", "sample_rate"} <= set(facts)
    assert document["projection"] in ("closed_windows", "weak_form")
    assert isinstance(document["windows"], int)
    assert document["result"] in {"successful", "not_excited", "on_border", "not_converged"}
    assert models.Model.from_dict(document["model"]).parameters.keys() == TRUTH.keys()
    for name, entry in document["parameters"].items():
        assert name in TRUTH
        assert set(entry) >= {"value", "standard_error", "unit"}
        assert entry["standard_error"] is None or entry["standard_error"] >= 0


# ---- identify ----


def test_one_recording_in_full(axis, tmp_path, capsys):
    out, saved = tmp_path / "out.json", tmp_path / "model.json"
    assert main(["identify", axis, *MODEL, "--json", str(out), "--save", str(saved)]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    said = " ".join(printed.out.split())
    for piece in (axis, "2001 samples", "2 s at 1000 Hz", "force in N", "closed windows", "± 95 %"):
        assert piece in said
    assert "Columns: time, force from force [N], position from position [m], velocity" in said
    document = strict(out.read_text("utf-8"))
    check_identification(document)
    assert document["result"] == "successful"
    assert document["parameters"]["viscous+"]["unit"] == "N·s/m"
    for name, true in TRUTH.items():
        entry = document["parameters"][name]
        assert abs(entry["value"] - true) < max(4 * entry["standard_error"], 0.02 * true), name
    assert models.load(saved.read_text("utf-8")).parameters.keys() == TRUTH.keys()


def test_a_dash_prints_nothing_but_the_document(axis, capsys):
    assert main(["identify", axis, *MODEL, "--json", "-"]) == 0
    check_identification(strict(capsys.readouterr().out))


def test_it_is_said_which_column_serves_as_what(axis, tmp_path, capsys):
    table = np.loadtxt(axis, delimiter=",", skiprows=1)
    path = tmp_path / "odd.csv"
    io.write_table(path, dict(zip(("t", "\x1b[2Jm", "x", "w"), table.T, strict=True)))
    columns = ["--columns", "force=\x1b[2Jm,position=x,velocity=w", "--scale", "force=1000"]
    assert main(["identify", str(path), *MODEL, *columns]) == 0
    printed = capsys.readouterr().out
    assert "\x1b" not in printed
    assert "time from t" in printed and "position from x" in printed and "× 1000" in printed


def test_what_the_recording_cannot_see_is_null_and_said(tmp_path, capsys):
    path = write_axis(tmp_path / "forwards.csv", forwards_only=True)
    out = tmp_path / "out.json"
    assert main(["identify", path, *MODEL, "--json", str(out)]) == 0
    document = strict(out.read_text("utf-8"))
    assert document["result"] == "not_excited"
    assert document["parameters"]["coulomb-"]["standard_error"] is None
    assert document["parameters"]["coulomb+"]["standard_error"] > 0
    printed = capsys.readouterr().out
    assert "not visible" in printed
    assert "Move in both directions" in " ".join(printed.split())


def test_many_files_are_rows_and_one_bad_file_does_not_stop_the_others(axis, tmp_path, capsys):
    other, bad = write_axis(tmp_path / "other.csv", 1990, seed=1), tmp_path / "bad.csv"
    bad.write_text("time,torque\n0,1\n1,2\n")
    out = tmp_path / "out.json"
    assert main(["identify", axis, str(bad), other, *MODEL, "--json", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.err.count("\n") == 1
    assert "bad.csv" in printed.err and "--columns position=" in printed.err
    rows = [line for line in printed.out.splitlines() if line.startswith(("axis", "other"))]
    assert len(rows) == 2 and all(row.endswith("successful") for row in rows)
    documents_ = strict(out.read_text("utf-8"))
    assert [Path(d["recording"]["file"]).name for d in documents_] == ["axis.csv", "other.csv"]
    for document in documents_:
        check_identification(document)


@pytest.mark.parametrize(
    "projection", ["closed-windows", pytest.param("weak-form", marks=pytest.mark.slow)]
)
def test_padding_changes_nothing(axis, projection):
    """One compiled program for many lengths must give what a program for the one length gives."""
    recording = io.read(axis)
    prepared = jaxfric.signals.prepare(recording)
    width = jaxfric.signals.kernel_half_width(prepared)
    weak = projection == "weak-form"
    chosen = jaxfric.WeakForm(width) if weak else jaxfric.ClosedWindows()
    plain = jaxfric.identify("coulomb-viscous", prepared, projection=chosen)
    _, padded = commands.fitted(recording, "coulomb-viscous", projection)
    values = [
        np.array([[v.value, v.standard_error] for v in found.parameters.values()])
        for found in (plain, padded)
    ]
    np.testing.assert_allclose(values[1], values[0], rtol=1e-9)
    np.testing.assert_allclose(padded.filtered_force_error, plain.filtered_force_error, rtol=1e-9)


@pytest.mark.parametrize("count", [1, 255, 256, 257, 321, 1000, 1024, 1025, 24841, 2**20 + 1])
def test_padded_lengths_are_few_and_near(count):
    recording = jaxfric.Recording(np.arange(count), np.zeros(count), np.zeros(count))
    length = uniform(recording).num_samples
    assert count <= length <= max(2048, (1.25 if count > LONG else 2) * count)
    mantissa = length / 2 ** int(np.log2(length))
    assert mantissa in (PADDING if count > LONG else (1.0,))


@pytest.mark.slow
def test_the_picture(axis, tmp_path):
    pytest.importorskip("matplotlib")
    assert main(["identify", axis, *MODEL, "--plot", str(tmp_path / "friction.png")]) == 0
    assert (tmp_path / "friction.png").read_bytes().startswith(b"\x89PNG")


def test_without_matplotlib_the_extra_is_named(axis, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert main(["identify", axis, *MODEL, "--plot", str(tmp_path / "a.png")]) == 2
    assert "jaxfric[report]" in capsys.readouterr().err


# ---- predict, simulate, models ----


@pytest.fixture
def saved(tmp_path):
    model = models.from_parameters(models.coulomb_viscous(), TRUTH)
    path = tmp_path / "true.json"
    path.write_text(documents.to_json(model.to_dict()))
    return str(path)


def test_predict_writes_the_force_of_the_motion(axis, saved, tmp_path, capsys):
    out = tmp_path / "force.csv"
    assert main(["predict", saved, axis, "-o", str(out)]) == 0
    table = np.genfromtxt(out, delimiter=",", names=True)
    inside = slice(50, -50)
    difference = (table["measured_force"] - table["force"])[inside]
    assert np.median(np.abs(difference)) < 0.5  # noise of 0.1 N, and a derivative
    assert "force error" in capsys.readouterr().out


@pytest.mark.slow
def test_simulate_follows_a_set_point_or_a_force(saved, tmp_path, capsys):
    time = np.arange(1000) / 1000
    goal = tmp_path / "goal.csv"
    io.write_table(goal, {"time": time, "reference": 0.01 * np.sin(2 * np.pi * time)})
    out = tmp_path / "run.csv"
    gains = "pd:kp=7200,kd=240"
    assert main(["simulate", saved, str(goal), "-o", str(out), "--controller", gains]) == 0
    run = np.genfromtxt(out, delimiter=",", names=True)
    assert {"time", "force", "position", "velocity", "reference"} <= set(run.dtype.names)
    assert np.max(np.abs(run["position"] - run["reference"])) < 0.004
    push = tmp_path / "push.csv"
    io.write_table(push, {"time": time, "force": np.full(1000, 14.0)})
    assert main(["simulate", saved, str(push), "-o", str(out)]) == 0
    run = np.genfromtxt(out, delimiter=",", names=True)
    assert run["velocity"][-1] == pytest.approx(0.1, rel=1e-3)  # (14 − 10)/40
    assert main(["simulate", saved, str(goal), "-o", str(out)]) == 2
    assert "no force drives the axis" in capsys.readouterr().err


def test_units_that_disagree_are_refused(saved, axis, tmp_path, capsys):
    out = tmp_path / "force.csv"
    assert main(["predict", saved, axis, "-o", str(out), "--units", "force=kN"]) == 2
    assert "--scale force=1000 --units force=N" in " ".join(capsys.readouterr().err.split())
    assert main(["predict", saved, axis, "-o", str(out), "--units", "force=A"]) == 2
    assert "--scale force=FACTOR" in capsys.readouterr().err
    assert not out.exists()


def test_models_lists_every_name(capsys):
    assert main(["models"]) == 0
    printed = capsys.readouterr().out
    for name in models.NAMED:
        assert f"\n{name} " in f"\n{printed}"


# ---- misuse ----


@pytest.mark.parametrize(
    ("argv", "pieces"),
    [
        ((), ("COMMAND",)),
        (("identify",), ("FILE",)),
        (("identify", "no.csv"), ("no.csv", "no such file")),
        (("identify", "AXIS", "--model", "foo"), ("'foo'", "coulomb-viscous")),
        (("identify", "AXIS", "--columns", "force"), ("--columns", "'force'", "NAME=VALUE")),
        (("identify", "AXIS", "--columns", "force=zz"), ("'zz'", "force [N]")),
        (("identify", "AXIS", "--scale", "force=two"), ("--scale", "'two'")),
        (("identify", "AXIS", "--scale", "load=2"), ("load", "which is not read")),
        (("identify", "AXIS", "--bounds", "stribeck_velocity+=2:1"), ("--bounds", "LOW:HIGH")),
        (("identify", "AXIS", *MODEL, "--bounds", "delta=1:2"), ("--bounds", "delta")),
        (("identify", "AXIS", "--json", "no/out.json"), ("no/out.json", "folder")),
        (("identify", "AXIS", "--plot", "a.bmp"), ("a.bmp", ".png")),
        (("identify", "AXIS", "AXIS", "--save", "m.json"), ("--save", "--json")),
        (("predict", "no.json", "AXIS", "-o", "a.csv"), ("no.json",)),
        (("predict", "AXIS", "AXIS", "-o", "a.csv"), ("axis.csv", "identify --save")),
        (("simulate", "m", "AXIS", "-o", "a.csv", "--controller", "pd:kp=1"), ("lacks kd",)),
        (("simulate", "m", "AXIS", "-o", "a.csv", "--controller", "lqr:q=1"), ("'lqr'", "cascade")),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_misuse_is_one_message_and_status_2(argv, pieces, axis, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    before = sorted(os.listdir())
    try:
        status = main([axis if word == "AXIS" else word for word in argv])
    except SystemExit as stop:
        status = stop.code
    printed = capsys.readouterr()
    assert status == 2
    assert printed.out == ""
    assert printed.err.startswith("jaxfric") and printed.err.count("\n") == 1
    for piece in pieces:
        assert piece in printed.err
    assert sorted(os.listdir()) == before  # nothing half done lies about


def test_an_earlier_output_survives_a_failure(axis, tmp_path):
    out = tmp_path / "out.json"
    out.write_text("earlier")
    assert main(["identify", str(tmp_path / "no.csv"), "--json", str(out)]) == 2
    assert out.read_text() == "earlier"


def test_a_motionless_axis_leaves_no_model(tmp_path, capsys):
    path = tmp_path / "still.csv"
    still = np.zeros(2001)
    columns = {"time": np.arange(2001) / 1000, "force": still + 1, "position": still}
    io.write_table(path, columns | {"velocity": still})
    out, saved = tmp_path / "out.json", tmp_path / "model.json"
    closed = ("--projection", "closed-windows")
    assert main(["identify", str(path), *MODEL, "--json", str(out)]) == 0
    document = strict(out.read_text("utf-8"))
    assert document["result"] == "no_slip"
    # Another projection would find no slip either, and is not tried.
    assert document["projection"] == "closed_windows"
    assert "The axis never slips" in capsys.readouterr().out
    assert main(["identify", str(path), *MODEL, *closed, "--save", str(saved)]) == 2
    assert "no model to save" in capsys.readouterr().err
    assert not saved.exists()


# ---- the process ----


def run(*argv, code=None, **options):
    start = [sys.executable, "-c", code] if code else [sys.executable, "-m", "jaxfric"]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "JAXFRIC_CACHE": "off"}
    return subprocess.run(
        [*start, *argv], capture_output=True, text=True, check=False, env=environment, **options
    )


def test_help_loads_nothing_heavy():
    code = (
        "import sys\nfrom jaxfric.cli import main\n"
        "try: main(['identify', '--help'])\nexcept SystemExit as stop: assert stop.code == 0\n"
        "heavy = {'jax', 'numpy', 'equinox', 'matplotlib'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = run(code=code)
    assert done.returncode == 0, done.stderr
    assert "--projection" in done.stdout


def test_the_module_is_the_command():
    done = run("models")
    assert (done.returncode, done.stderr) == (0, "")
    assert "gaussian" in done.stdout
    done = run("identify", "no.csv")
    assert done.returncode == 2 and "Traceback" not in done.stderr


def test_a_reader_that_leaves_is_no_error():
    environment = os.environ | {"PYTHONPATH": str(ROOT), "JAXFRIC_CACHE": "off"}
    command = [sys.executable, "-m", "jaxfric", "models"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment, text=True
    ) as process:
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 0


@pytest.mark.slow
def test_demo_from_the_core_dependencies_alone(tmp_path):
    hide = "".join(
        f"sys.modules[{name!r}] = None\n"
        for name in ("matplotlib", "jinja2", "pyarrow", "h5py", "rich")
    )
    code = f"import sys\n{hide}from jaxfric.cli import main\nsys.exit(main(['demo']))\n"
    done = run(code=code, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "jaxfric[report]" in done.stdout
    folder = tmp_path / "jaxfric-demo"
    document = strict((folder / "identification.json").read_text("utf-8"))
    assert document["result"] == "successful"
    told = strict((folder / "explanation.json").read_text("utf-8"))
    assert [finding["effect"] for finding in told["findings"]] == ["cogging"]
    errors = told["fit"]["filtered_holdout_force_error"]
    assert errors["after"] < 0.2 * errors["before"]
    # Unfiltered, the derivative at the reversals is left, which knows no corner.
    plain = told["fit"]["holdout_force_error"]
    assert plain["after"] < 0.7 * plain["before"]
    assert (folder / "axis.csv").exists() and (folder / "model.json").exists()
    assert not (folder / "friction.png").exists()
    # The README shows what it says; on another processor a last digit may differ.
    shown, number = readme_text_of_demo(), r"\d+\.\d+"
    for part in shown.split("\n\n"):
        pattern = f"({number})".join(map(re.escape, re.split(number, part)))
        found = re.search(pattern, done.stdout)
        assert found, part
        said = [float(each) for each in re.findall(number, part)]
        assert [float(each) for each in found.groups()] == pytest.approx(said, rel=0.05)


def readme_text_of_demo():
    text = (ROOT / "README.md").read_text("utf-8")
    return re.search(r"```text\n(What does this model.*?)\n```", text, re.DOTALL)[1]


def test_explain_writes_what_it_says(tmp_path, capsys):
    draw = np.random.default_rng(0)
    time = np.arange(8000) / 1000.0
    x = 0.05 * np.sin(2 * np.pi * time) + 0.02 * np.sin(2 * np.pi * 2.3 * time)
    v, a = np.gradient(x, time), np.gradient(np.gradient(x, time), time)
    force = 3 * a + 10 * np.sign(v) + 40 * v + 2 * np.sin(2 * np.pi * x / 0.008)
    table = np.column_stack([time, x, force + 0.1 * draw.normal(size=time.size)])
    path = tmp_path / "axis.csv"
    np.savetxt(path, table, delimiter=",", header="time,position,force", comments="")
    out, page, model = (tmp_path / name for name in ("e.json", "e.html", "m.json"))
    options = ["--json", str(out), "--report", str(page), "--save", str(model)]
    assert main(["explain", str(path), "--baseline", "coulomb-viscous", *options]) == 0
    printed = capsys.readouterr().out
    told = strict(out.read_text("utf-8"))
    assert told["schema"] == "jaxfric.explanation/1"
    assert told["findings"][0]["effect"] == "cogging"
    assert " ".join(told["findings"][0]["sentence"].split()[:6]) in printed
    assert "<html" in page.read_text("utf-8")[:400]
    assert main(["predict", str(model), str(path), "-o", str(tmp_path / "p.csv")]) == 0
    capsys.readouterr()
    assert main(["explain", str(path), "--baseline", "nonsense"]) == 2
    assert "no model is called" in capsys.readouterr().err.lower()
    short = tmp_path / "short.csv"
    np.savetxt(short, table[:100], delimiter=",", header="time,position,force", comments="")
    assert main(["explain", str(short)]) == 2
    assert "short.csv" in capsys.readouterr().err


@pytest.mark.slow
def test_a_real_axis(data_folder, capsys):
    """EMPS (Janot, Gautier & Brunot 2019): the published direction-dependent fit."""
    pytest.importorskip("scipy")
    path = str(data_folder / "emps" / "DATA_EMPS.mat")
    reading = ("--columns", "force=vir,position=qm", "--scale", "force=35.15065")
    assert main(["identify", path, *MODEL, *reading, "--json", "-"]) == 0
    document = strict(capsys.readouterr().out)
    values = {name: entry["value"] for name, entry in document["parameters"].items()}
    assert values["inertia"] == pytest.approx(95.1, rel=0.02)
    assert values["viscous+"] == pytest.approx(166.7, rel=0.1)
    assert values["viscous-"] == pytest.approx(240.4, rel=0.1)


@pytest.mark.slow
def test_a_held_force_is_aligned_on_request(tmp_path, capsys):
    t = np.arange(2000) / 100.0
    values = {"inertia": 5.0, "coulomb+": 20.0, "viscous+": 60.0, "coulomb-": 21.0,
              "viscous-": 55.0}  # fmt: skip
    axis = models.from_parameters(models.coulomb_viscous(), values)
    clock = jaxfric.Recording(
        t, 0 * t, 0.05 * np.sin(2 * np.pi * 0.9 * t) + 0.02 * np.sin(2 * np.pi * 1.7 * t)
    )
    run = jaxfric.simulate(axis, clock, jaxfric.PD(6480.0, 252.0))
    path, model, out = (str(tmp_path / name) for name in ("log.csv", "model.json", "out.csv"))
    io.write_table(path, {n: np.asarray(getattr(run, n)) for n in ("time", "position", "force")})
    told = ["identify", path, "--model", "coulomb-viscous"]
    assert main(told) == 0
    printed = capsys.readouterr().out
    assert "after its time stamp" in printed and "--align" in printed
    assert main([*told, "--align", "--save", model]) == 0
    printed = capsys.readouterr().out
    assert "ms after its time stamp, which is taken into account" in " ".join(printed.split())
    assert "--align" not in printed
    saved = json.loads(Path(model).read_text())
    assert saved["force_delay"]["value"] == pytest.approx(0.005, rel=0.05)
    # What predict makes of the saved model is at the stamps again.
    assert main(["predict", model, path, "-o", out]) == 0
    table = np.genfromtxt(out, delimiter=",", names=True)
    moving = table["in_motion"] > 0
    left = (table["measured_force"] - table["force"])[moving]
    assert np.linalg.norm(left) < 0.01 * np.linalg.norm(table["measured_force"][moving])


def test_a_value_with_a_comma_stands_in_quotation_marks():
    said = names('position="pos, act [mm]",velocity=vel=act,force=M;x,load=')
    assert said == {"position": "pos, act [mm]", "velocity": "vel=act", "force": "M;x", "load": ""}
    with pytest.raises(ArgumentTypeError, match="quotation marks"):
        names("position=pos, act [mm]")
