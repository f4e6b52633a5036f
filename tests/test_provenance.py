"""What a result was made from and by; and that the same input gives the same output."""

import hashlib
import json
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest

import jaxfric as jf
from jaxfric.cli import main
from jaxfric.data.provenance import LIBRARIES, sha256, versions

from .test_cli import write_axis

ROOT = Path(__file__).parents[1]
MODEL = ("--model", "coulomb-viscous")


@pytest.fixture(autouse=True)
def _no_cache(monkeypatch):
    monkeypatch.setenv("JAXFRIC_CACHE", "off")


@pytest.fixture
def axis(tmp_path):
    return write_axis(tmp_path / "axis.csv")


def hashed(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def test_an_identification_says_what_it_is_of(axis, tmp_path):
    out, model = tmp_path / "fit.json", tmp_path / "model.json"
    assert main(["identify", axis, *MODEL, "--json", str(out), "--save", str(model)]) == 0
    told, saved = (json.loads(path.read_text("utf-8")) for path in (out, model))
    assert told["schema"] == "jaxfric.identification/1"
    assert told["recording"]["sha256"] == hashed(axis)
    assert told["versions"]["numpy"] == version("numpy") and set(told["versions"]) == {*LIBRARIES}
    assert saved["made_from"] == [{"file": axis, "sha256": hashed(axis)}]
    assert saved["versions"] == told["versions"]
    jf.models.load(model.read_text("utf-8"))


def test_a_recording_of_no_file_has_no_hash(axis):
    read = jf.read(axis)
    assert read.sha256 == hashed(axis)
    made = jf.Recording(time=np.asarray(read.time), force=read.force, velocity=read.velocity)
    assert made.sha256 == ""
    assert jf.stack([read, read]).sha256 == ""
    assert sha256("/dev/null") == "" and sha256("") == ""


@pytest.mark.slow
def test_every_document_says_what_it_was_made_from(axis, tmp_path, capsys):
    model, out = tmp_path / "model.json", tmp_path / "out.json"
    assert main(["identify", str(axis), *MODEL, "--save", str(model)]) == 0
    limits = "--position 0.1 --velocity 0.1 --acceleration 1 --jerk 20".split()
    motion = str(tmp_path / "motion.csv")
    lines = {
        "jaxfric.design/1": (model, ["design", str(model), *limits, "-o", motion]),
        "jaxfric.selection/1": (axis, ["select", str(axis)]),
        "jaxfric.benefit/1": (
            model,
            ["simulate", str(model), motion, "--compensate", "-o", str(tmp_path / "run.csv")],
        ),
    }
    for schema, (file, line) in lines.items():
        assert main([*line, "--json", str(out)]) == 0, capsys.readouterr().err
        document = json.loads(out.read_text())
        assert document["schema"] == schema and set(document["versions"]) == set(LIBRARIES)
        assert document["made_from"][0] == {"file": str(file), "sha256": sha256(file)}


def test_the_effects_say_by_which_version(capsys):
    assert main(["effects", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["versions"] == versions()


def test_the_same_identification_byte_for_byte(axis, tmp_path):
    outs = [tmp_path / f"{i}.json" for i in range(2)]
    for out in outs:
        assert main(["identify", axis, *MODEL, "--json", str(out)]) == 0
    first, second = (out.read_bytes() for out in outs)
    assert first == second


@pytest.mark.slow
def test_the_same_explanation_byte_for_byte(tmp_path):
    """In two processes with other hashes of strings: document, model, page, what is printed."""
    files = [write_axis(tmp_path / f"{name}.csv", 8001, seed=i) for i, name in enumerate("ab")]
    told = []
    for seed in ("1", "2"):
        folder = tmp_path / seed
        folder.mkdir()
        outs = {"--json": "e.json", "--save": "m.json", "--report": "p.html"}
        options = [f"{option}={name}" for option, name in outs.items()]
        command = [sys.executable, "-m", "jaxfric", "explain", files[0], "--holdout", files[1]]
        environment = os.environ | {
            "PYTHONHASHSEED": seed,
            "SOURCE_DATE_EPOCH": "1700000000",
            "PYTHONPATH": str(ROOT),
        }
        done = subprocess.run(
            [*command, "--baseline", "coulomb-viscous", *options],
            cwd=folder,
            env=environment,
            capture_output=True,
            check=True,
        )
        told.append([done.stdout, *((folder / name).read_bytes() for name in outs.values())])
    assert told[0] == told[1]
    document = json.loads(told[0][1])
    assert document["recording"]["sha256"] == hashed(files[0])
    assert document["holdout"]["sha256"] == hashed(files[1])
    page = told[0][3].decode()
    assert hashed(files[0]) in page and hashed(files[1]) in page and "2023-11-14" in page
