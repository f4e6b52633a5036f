"""What was tried on bad days, one row each: one line and status 2, and nothing half written."""

import os

import pytest

from jaxfric.cli import main

from . import corpus

# A command with one bad recording, BAD; GOOD is a whole one, MODEL a whole model.
WITH_A_RECORDING = {
    "identify": "identify BAD --json out.json --save out.model",
    "best": "identify BAD --model best",
    "select": "select BAD --json out.json",
    "explain": "explain BAD --json out.json",
    "holdout": "explain GOOD --holdout BAD --json out.json",
    "simulation": "explain GOOD --simulation BAD",
    "predict": "predict MODEL BAD -o out.csv",
    "fleet": "fleet BAD --out out.csv --jobs 1",
}
# A command with one bad model.
WITH_A_MODEL = {
    "predict": "predict BAD GOOD -o out.csv",
    "simulate": "simulate BAD GOOD -o out.csv",
    "explain": "explain GOOD --baseline BAD --json out.json",
    "design": "design BAD --position 1 --velocity 1 --acceleration 9 --jerk 99 -o out.csv",
    "c": "export BAD --to c -o out.c",
    "st": "export BAD --to st -o out.st",
    "modelica": "export BAD --to modelica -o out.mo",
    "fmu": "export BAD --to fmu -o out.fmu",
    "mujoco": "export BAD --to mujoco -o out.xml",
    "urdf": "export BAD --to urdf -o out.urdf",
    "table": "export BAD --to table -o out.csv",
}
# Wrong words on the command line.
WORDS = [
    "",
    "identfy GOOD",
    "identify",
    "identify GOOD --modle gaussian",
    "identify GOOD --model os",
    "identify GOOD --model ''",
    "identify ''",
    "identify .",
    "identify /dev/null",
    "identify GOOD --bounds coulomb=1:2",
    "identify GOOD --bounds stribeck_velocity+=2:1",
    "identify GOOD --bounds stribeck_velocity+=nan:1",
    "identify GOOD --projection none",
    "identify GOOD --columns force",
    "identify GOOD --columns force=nothing",
    "identify GOOD --columns force=position",
    "identify GOOD --scale force=0",
    "identify GOOD --scale force=nan",
    "identify GOOD --scale force=1e999",
    "identify GOOD --scale time=-1",
    "identify GOOD --scale load=2",
    "identify GOOD --units mass=kg",
    "identify GOOD --period velocity=3",
    "identify GOOD --period position=0",
    "identify GOOD --period position=-1",
    "identify GOOD --rate 100",
    "identify GOOD --rate 0",
    "identify GOOD --rate -1",
    "identify GOOD --rate nan",
    "identify GOOD --json GOOD",
    "identify GOOD --json no/such/folder.json",
    "identify GOOD --json .",
    "identify GOOD --json ''",
    "identify GOOD --json same --save same",
    "identify GOOD --json - --save -",
    "identify GOOD --plot out.txt",
    "identify GOOD GOOD --save out.json",
    "explain GOOD --baseline nothing",
    "explain GOOD --baseline absent.json",
    "explain GOOD --baseline GOOD",
    "explain GOOD --holdout absent.csv",
    "explain GOOD --holdout GOOD",
    "explain GOOD --joint elbow",
    "explain GOOD --simulation-holdout GOOD",
    "explain GOOD --mujoco absent.xml",
    "explain GOOD --mujoco GOOD",
    "explain GOOD --baseline gaussian --simulation GOOD",
    "explain GOOD --report GOOD",
    "explain GOOD --report out.html --json out.html",
    "predict MODEL GOOD",
    "predict MODEL GOOD -o GOOD",
    "predict MODEL GOOD -o MODEL",
    "predict MODEL GOOD -o out.xls",
    "predict MODEL absent.csv -o out.csv",
    "predict absent.json GOOD -o out.csv",
    "simulate MODEL GOOD -o out.csv --controller pd:kp=1",
    "simulate MODEL GOOD -o out.csv --controller pd:kp=nan,kd=1",
    "simulate MODEL GOOD -o out.csv --controller lqr:q=1",
    "simulate MODEL GOOD -o GOOD",
    "export MODEL --to c --name 9x",
    "export MODEL --to fortran",
    "export MODEL --to table --speed 0:1e300",
    "export MODEL --to table --speed 1:0",
    "export MODEL --to mujoco --speed 0:1e300",
    "export MODEL --to urdf --speed 0:1e150",
    "export MODEL --to c -o MODEL",
    "effects nothing",
    "effects 'cogg\x1b[31ming'",
    "fleet absent.csv --out out.csv",
    "fleet 'absent/**/*.csv' --out out.csv",
    "fleet GOOD --out GOOD",
    "fleet GOOD --out out.xls",
    "fleet GOOD --out out.csv --axis (a+)+$",
    "fleet GOOD --out out.csv --axis (",
    "fleet GOOD --out out.csv --jobs 0",
    "fleet GOOD --out out.csv --process 2/2@here:1",
    "fleet GOOD --out out.csv --model nothing",
    "prove --cases 0",
    "prove --size 2:1",
    "prove --size 0:1",
    "prove --limit 0",
    "select absent.csv",
    "watch absent.csv --once",
    "watch GOOD --once --model nothing",
    "watch GOOD --once --keep 0",
    "watch GOOD --once --window 3 --keep 3",
    "design MODEL --position 0 --velocity 1 --acceleration 1 --jerk 1 -o out.csv",
    "design MODEL --position 1 --velocity inf --acceleration 1 --jerk 1 -o out.csv",
    "identify 'a\x1b[31m.csv'",
    "identify '=a.csv'",
    "demo --out MODEL",
]

TRIED = [
    # A simulator's force needs no motion of its own.
    *((f"{name}-{file}", line, file) for name, line in WITH_A_RECORDING.items()
      for file in corpus.RECORDINGS if (name, file) != ("simulation", "no_motion.csv")),
    *((f"{name}-{file}", line, file) for name, line in WITH_A_MODEL.items()
      for file in corpus.MODELS),
    *((line, line, None) for line in WORDS),
]  # fmt: skip


def test_five_hundred_are_tried():
    assert len({name for name, *_ in TRIED}) == len(TRIED) >= 500


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A folder with the whole corpus, each file written once."""
    folder = tmp_path_factory.mktemp("corpus")
    texts = {name: content for name, (content, _) in corpus.RECORDINGS.items()}
    texts |= {f"{name}.json": content for name, content in corpus.MODELS.items()}
    texts |= {"good.csv": corpus.GOOD, "good.json": corpus.json.dumps(corpus.model())}
    for name, content in texts.items():
        content = content() if callable(content) else content
        (folder / name).write_bytes(content.encode() if isinstance(content, str) else content)
    return folder


def words(line, files, bad):
    """The words of a command line, with the files' paths."""
    known = {"GOOD": "good.csv", "MODEL": "good.json", "BAD": bad}
    found = (word.strip("'") for word in line.split(" ") if word)
    return [str(files / known[word]) if word in known else word for word in found]


@pytest.mark.parametrize("_, line, file", TRIED, ids=[ascii(name) for name, *_ in TRIED])
def test_one_line_and_nothing_half_written(_, line, file, files, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("JAXFRIC_CACHE", "off")
    bad = f"{file}.json" if file in corpus.MODELS else file
    before = {path: path.stat().st_mtime_ns for path in files.iterdir()}
    try:
        status = main(words(line, files, bad))
    except SystemExit as stop:
        status = stop.code
    printed = capfd.readouterr()
    assert status == 2
    assert printed.err.startswith("jaxfric") and printed.err.count("\n") == 1
    assert len(printed.err) < 1500 and "\x1b" not in printed.err and printed.out == ""
    assert os.listdir() == []
    assert {path: path.stat().st_mtime_ns for path in files.iterdir()} == before
    if file:
        assert bad in printed.err
        assert corpus.RECORDINGS.get(file, ("", ""))[1] in printed.err
