"""Damaged files, odd names, wrong arguments, special targets: one line that helps, or a result."""

import io
import json
import os
import threading
from argparse import ArgumentTypeError, Namespace
from pathlib import Path

import equinox as eqx
import numpy as np
import pytest

import jaxfric as jf
from jaxfric import fleet, models, terms
from jaxfric.cli import commands, main, options, values
from jaxfric.data.io import read_with_notes, write_table, write_text
from jaxfric.data.printable import printable
from jaxfric.explanation import holdout
from jaxfric.fleet import expressions, journal, reading, tables
from jaxfric.identification import documents
from jaxfric.identification.documents import to_json
from jaxfric.identification.identified import Identified, Result, result_names
from jaxfric.validation.proof import planning, running, scoring

TIME = np.arange(40) * 0.001
FORCE = np.where(np.cos(100 * TIME) > 0, 3.0, -3.0)
POSITION = np.sin(100 * TIME)
SIGNALS = {"time": TIME, "force": FORCE, "position": POSITION}
ROWS = "".join(f"{t},{f},{x}\n" for t, f, x in zip(TIME, FORCE, POSITION, strict=True))
HEAD = "time,force,position\n"


def npy():
    content = io.BytesIO()
    np.save(content, TIME)
    return content.getvalue()


def parquet(names):
    pa, pq = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    content = io.BytesIO()
    columns = [pa.array(SIGNALS.get(name, POSITION)) for name in names]
    pq.write_table(pa.Table.from_arrays(columns, names=list(names)), content)
    return content.getvalue()


def mat(path, more=lambda file: None):
    """A file of MATLAB 7.3: HDF5 behind a block of 512 bytes."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, signal in SIGNALS.items():
            file[name] = signal[None]
        more(file)


def cyclic(file):
    file.create_group("group")["loop"] = file["/"]


def dangling(file):
    file["nothing"] = __import__("h5py").SoftLink("/nowhere")


def external(file):
    file["elsewhere"] = __import__("h5py").ExternalLink("other.mat", "/time")


# ---- reading ----

# Content of a file, and what the message says.
UNREADABLE = {
    "header.csv": ("time,force," + "x" * 10_000_000 + "\n" + ROWS, "row 1 has 10000011 characters"),
    "open.csv": (HEAD + '0,1,"2\n' + ROWS * 100, "row 2: a quotation mark is opened"),
    "late.csv": (HEAD + ROWS + '1,2,"3', "row 42: a quotation mark is opened"),
    "pair.csv": (HEAD + ROWS + '1,2,"3\n' + ROWS + '2,2,3"\n', "row 42: a quotation mark"),
    "text.csv": (
        HEAD + "0,1," + "y" * 1000 + "\n" + ROWS,
        r"row 2, column 'position': 'y{80}…' is",
    ),
    "many.csv": (
        ",".join(f"c{i}" for i in range(500)) + "\n" + "1," * 499 + "1\n",
        "c39 and 460 more",
    ),
    "twice.parquet": (
        lambda: parquet(("time", "force", "position", "position")),
        "2 columns could",
    ),
    "array.npz": (npy, "one array without a name"),
}


def written(folder, name, content):
    path = folder / name
    content = content() if callable(content) else content
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("name", UNREADABLE)
def test_an_unreadable_file_is_named_with_its_fault(tmp_path, name):
    content, fault = UNREADABLE[name]
    path = written(tmp_path, name, content)
    with pytest.raises(ValueError, match=fault) as caught:
        read_with_notes(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ") and len(message) < 1000 and "\n" not in message


def test_a_quotation_mark_that_pyarrow_would_not_mind_loses_no_rows(tmp_path):
    rows = "".join(f"{i / 1000},1,{i % 7}\n" for i in range(400_000))
    path = written(tmp_path, "large.csv", HEAD + rows + '400,1,"2\n' + rows)
    with pytest.raises(ValueError, match="row 400002: a quotation mark"):
        read_with_notes(path)


def test_another_column_of_a_file_with_repeated_names_is_read(tmp_path):
    path = written(tmp_path, "a.parquet", lambda: parquet(("time", "force", "position", "x", "x")))
    recording, _ = read_with_notes(path, columns={"position": "x (2)"})
    np.testing.assert_allclose(recording.position, POSITION)


@pytest.mark.parametrize(
    "more, note", [(cyclic, "group.loop"), (dangling, "/nowhere"), (external, "other.mat")]
)
def test_links_of_matlab_files_are_left_out(tmp_path, more, note):
    mat(tmp_path / "a.mat", more)
    recording, notes = read_with_notes(tmp_path / "a.mat")
    np.testing.assert_allclose(recording.force, FORCE)
    assert note in notes[0]


@pytest.mark.parametrize("kind", ["mat", "parquet", "npz"])
def test_flipped_bytes_are_a_message_or_a_recording(tmp_path, kind):
    path = tmp_path / f"a.{kind}"
    if kind == "mat":
        mat(path)
    elif kind == "npz":
        np.savez(path, **SIGNALS)
    else:
        path.write_bytes(parquet(SIGNALS))
    whole = path.read_bytes()
    for seed in range(30):
        rng, content = np.random.default_rng(seed), bytearray(whole)
        for place in rng.integers(512 if kind == "mat" else 0, len(content), 40):
            content[place] ^= 255
        path.write_bytes(content)
        try:
            read_with_notes(path)
        except ValueError as error:
            assert str(error).startswith(f"{path}: ") and "\n" not in str(error)


def test_whole_numbers_in_the_first_row_do_not_decide_the_decimal_sign(tmp_path):
    rows = ROWS.replace(",", ";").replace(".", ",")
    path = written(tmp_path, "a.csv", "0;0;3\n" + rows[rows.index("\n") + 1 :])
    names = dict(zip(SIGNALS, ("column1", "column2", "column3"), strict=True))
    recording, _ = read_with_notes(path, columns=names)
    np.testing.assert_allclose(recording.time, TIME, atol=1e-12)


def test_a_folder_is_no_recording(tmp_path):
    (tmp_path / "a.csv").mkdir()
    with pytest.raises(ValueError, match="is a folder"):
        read_with_notes(tmp_path / "a.csv")


# ---- names ----

ODD = "a\x1b[31m\u202eb\n\udce9.csv"


def test_no_name_steers_a_terminal(tmp_path, capsys):
    assert printable(ODD) == r"a\x1b[31m\u202eb\n\xe9.csv"
    assert printable("µ·² é") == "µ·² é"
    assert main(["identify", str(tmp_path / ODD)]) == 2
    assert capsys.readouterr().err.endswith(
        r"a\x1b[31m\u202eb\n\xe9.csv: there is no such file." + "\n"
    )
    with pytest.raises(SystemExit):
        main(["identify", "a.csv", "--json", str(tmp_path / "\x1b[31m" / "out.json")])
    assert "\x1b" not in capsys.readouterr().err


def test_a_name_that_is_no_utf8_is_read_and_written(tmp_path):
    path = written(tmp_path, "\udce9.csv", HEAD + ROWS)
    recording, _ = read_with_notes(path)
    assert recording.source == str(tmp_path / r"\xe9.csv")
    text = to_json({"file": ODD})
    assert json.loads(text.encode("utf-8")) == {"file": ODD} and "\x1b" not in text


# ---- writing ----


def test_a_pipe_and_the_null_device_stay_what_they_are(tmp_path):
    write_text(os.devnull, "gone")
    write_table("/dev/null", {"a": np.ones(3)})
    assert not Path("/dev/null").is_file()
    os.mkfifo(tmp_path / "pipe")
    got = []
    reader = threading.Thread(target=lambda: got.append((tmp_path / "pipe").read_text()))
    reader.start()
    write_text(tmp_path / "pipe", "through")
    reader.join()
    assert got == ["through"] and (tmp_path / "pipe").is_fifo()


def test_what_a_link_leads_to_is_written(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "folder" / "real")
    for text in ("new", "newer"):
        write_text(tmp_path / "link", text)
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "folder" / "real").read_text() == text


@pytest.mark.parametrize("name, fault", [("", "is a folder"), ("loop", "symbolic links")])
def test_what_cannot_be_replaced_is_refused_before_the_work(tmp_path, name, fault):
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(ArgumentTypeError, match=fault):
        values.output(str(tmp_path / name))
    with pytest.raises(ValueError, match=fault):
        write_text(tmp_path / name, "x")


@pytest.mark.skipif(not Path("/dev/zero").is_char_device(), reason="no such device here")
def test_a_device_is_refused():
    with pytest.raises(ValueError, match="is a device; name a file"):
        write_text("/dev/zero", "x")


def test_no_output_replaces_another_or_an_input(tmp_path):
    log, model, link, new = (str(tmp_path / n) for n in ("a.csv", "m.json", "link", "new"))
    for path in (log, model):
        Path(path).write_text("")
    Path(link).symlink_to(log)
    wrong = [
        ({"file": log, "model": model, "out": log}, "is read, and --out"),
        ({"file": log, "model": model, "out": model}, "is read, and --out"),
        ({"files": ["b.csv", log], "json": link}, "is read, and --json"),
        ({"file": log, "holdout": model, "save": model}, "is read, and --save"),
        ({"file": log, "json": new, "save": new}, "--json and --save are both"),
        ({"file": log, "save": new, "report": str(tmp_path / "." / "new")}, "--save and --report"),
        ({"file": log, "json": "-", "save": "/dev/stdout"}, "--json and --save"),
    ]
    for arguments, fault in wrong:
        with pytest.raises(ValueError, match=fault):
            options.check_outputs(Namespace(**arguments))
    for arguments in (
        {"file": log, "json": "-", "save": new},
        {"file": log, "json": "/dev/null", "save": "/dev/null"},
        {"files": [log], "model": "gaussian", "json": new, "save": None},
    ):
        options.check_outputs(Namespace(**arguments))


def test_a_table_of_unknown_kind_is_refused_before_the_work(tmp_path):
    assert values.table("-") == "-"
    assert values.table("/dev/null") == "/dev/null"
    with pytest.raises(ArgumentTypeError, match=r"\.csv, \.npz, \.parquet"):
        values.table(str(tmp_path / "a.xls"))


# ---- fleets and proofs ----


def a_file(path):
    return fleet.File(str(path), {}, "", "", 1, 1)


@pytest.mark.parametrize("name", [*UNREADABLE, "cut.mat", "absent.csv"])
def test_a_bad_file_is_a_row_with_its_reason(tmp_path, name):
    if name == "cut.mat":
        mat(tmp_path / name)
        os.truncate(tmp_path / name, 3000)
    elif name in UNREADABLE:
        written(tmp_path, name, UNREADABLE[name][0])
    found = reading._ready(a_file(tmp_path / name), {})
    assert isinstance(found, reading.Failure) and found.reason.startswith(str(tmp_path / name))


def test_what_no_one_thought_of_is_a_row_too(tmp_path, monkeypatch):
    def fall(*_, **__):
        raise ZeroDivisionError("so")

    monkeypatch.setattr(reading, "read_with_notes", fall)
    assert reading._ready(a_file("a.csv"), {}).reason == "a.csv: ZeroDivisionError: so"


def test_a_link_that_leads_round_counts_a_recording_once(tmp_path, monkeypatch):
    (tmp_path / "logs" / "inner").mkdir(parents=True)
    (tmp_path / "logs" / "inner" / "a.csv").touch()
    (tmp_path / "logs" / "inner" / "up").symlink_to("..")
    (tmp_path / "logs" / "all").symlink_to("inner")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "b.csv").touch()
    (tmp_path / "logs" / "other").symlink_to(tmp_path / "other")
    expected = ["logs/inner/a.csv", "logs/other/b.csv"]
    monkeypatch.chdir(tmp_path)
    for patterns in (["logs"], ["logs/**/*.csv"], ["**/*.csv", "./logs/inner/a.csv"], ["logs/**"]):
        names = [file.path for file in fleet.find(patterns)]
        assert {os.path.realpath(n) for n in names} == {os.path.realpath(n) for n in expected}
        assert len(names) == 2
    assert [f.path for f in fleet.find(["logs/**/*.csv"])] == expected


@pytest.mark.parametrize("text", ["(a+)+$", "(a|aa)*$", "(a?){30}", "(?=(a*)*)b", "(", "a*" * 9])
def test_an_expression_that_may_never_end_is_refused(tmp_path, text):
    (tmp_path / ("a" * 60 + "!.csv")).touch()
    with pytest.raises(ValueError, match="--axis"):
        fleet.find([str(tmp_path)], axis=text)


@pytest.mark.parametrize("text", [r"(\w+)/[^/]+$", "(?:m1|m2)", "(a++)+", ".*_(x|y).*", "(ab)+"])
def test_usual_expressions_are_taken(text):
    assert expressions.expression(text, "--axis").pattern == text


def test_a_row_of_numpy_has_its_diagnosis():
    number = result_names().index("no_slip")
    alone = eqx.tree_at(lambda r: r._value, Result.no_slip, np.int32(number))
    nothing = dict.fromkeys(
        ("model", "covariance", "windows", "covered", "filtered_force_error", "cost")
    )
    found = Identified(result=alone, weak=np.True_, open_ends=None, **nothing)
    assert found.diagnosis.startswith("The axis never slips")


ODD_ROW = {"result": "failed", "reason": "=why", "parameters": {}}


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_an_odd_name_is_in_the_table(tmp_path, suffix):
    out = tmp_path / f"fits{suffix}"
    files = [a_file("=cmd|'x'!A1.csv"), a_file("\udce9.csv")]
    with journal.Journal(out, {}) as kept:
        kept.add([(file, ODD_ROW) for file in files])
    rows = kept.rows(files)
    tables.write(out, tables.columns(files, rows, "gaussian"))
    assert tables.is_one(str(out))
    if suffix == ".csv":
        lines = out.read_text().splitlines()
        assert lines[1].startswith("./=cmd|") and "'=why" in lines[1]
        assert lines[2].startswith("\\xe9.csv,")
    written(tmp_path, "log.csv", HEAD + ROWS)
    assert not tables.is_one(str(tmp_path / "log.csv"))


@pytest.mark.parametrize("number, line", [(1, "[]"), (2, "[1]"), (2, '{"file": 1}'), (2, "{nope")])
def test_a_damaged_journal_is_named(tmp_path, number, line):
    out = tmp_path / "fits.csv"
    with journal.Journal(out, {}) as kept:
        kept.add([(a_file("a.csv"), ODD_ROW)])
    path = tmp_path / "fits.csv.partial" / "rows-0.jsonl"
    lines = path.read_text().splitlines()
    lines[number - 1] = line
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(ValueError, match=f"rows-0.jsonl: line {number} .*--restart"):
        with journal.Journal(out, {}) as kept:
            kept.rows([a_file("a.csv")])
    (path.parent / "rows-x.jsonl").touch()
    journal.forget(out)
    assert not path.exists()


@pytest.mark.parametrize("text", ["[]", "{", "3", "[" * 100_000, '{"seed": 1}'])
def test_another_proof_is_named(tmp_path, text):
    (tmp_path / "proof.json").write_text(text)
    with pytest.raises(ValueError, match=r"proof\.json: .*(remove it|another --out)"):
        running.claim(tmp_path, {"seed": 2, "size": [0.1, 0.2]})


@pytest.mark.parametrize("text", ["[]", "{", "{}", '{"seconds": 1, "error": null}'])
def test_an_answer_of_another_kind_is_named(tmp_path, text):
    case = planning.plan(1, 1, (0.1, 0.2))[0]
    for part in ("answers", "sealed"):
        (tmp_path / part).mkdir()
        (tmp_path / part / f"{case.name}.json").write_text(text)
    with pytest.raises(ValueError, match=f"{case.name}.json: .* remove it"):
        scoring.scores(tmp_path, [case])


# ---- arguments in Python ----


def a_log(count=40):
    return jf.Recording(time=TIME[:count], force=FORCE[:count], position=POSITION[:count])


def a_model(**values):
    names = ("inertia", "coulomb+", "viscous+", "coulomb-", "viscous-")
    known = dict.fromkeys(names, 1.0) | values
    return models.from_parameters(models.coulomb_viscous(), known)


BATCH = jf.stack([a_log(), a_log()])
VERBS = {
    "identify": lambda log: jf.identify("gaussian", log),
    "select": jf.select,
    "explain": jf.explain,
    "explain .baseline.": lambda log: jf.explain(a_log(), log),
    "explain .holdout.": lambda log: jf.explain(a_log(), "gaussian", log),
    "predict": lambda log: jf.predict(a_model(), log),
    "simulate": lambda log: jf.simulate(a_model(), log),
}
NO_LOGS = {
    "a_path": (Path("a.csv"), "path or name 'a.csv'"),
    "a_dict": ({"time": TIME}, "a dict"),
    "none": (None, "None"),
    "an_array": (TIME, "a ndarray"),
    "empty": (a_log(0), "samples or more; the recording has 0"),
    "one_sample": (a_log(1), "samples or more; the recording has 1"),
    "batch": (BATCH, "not a batch of 2"),
}


@pytest.mark.parametrize("kind", NO_LOGS)
@pytest.mark.parametrize("verb", VERBS)
def test_what_is_no_recording_is_named_with_the_remedy(verb, kind):
    given, fault = NO_LOGS[kind]
    if (verb, kind) in (("identify", "batch"), ("explain .holdout.", "none")):
        return  # these are right
    name = verb
    if verb == "explain .baseline." and not isinstance(given, jf.Recording):
        name = "baseline is"
    with pytest.raises(ValueError, match=f"{name}.*{fault}"):
        VERBS[verb](given)


NO_MODELS = {
    "a_path": ("model.json", "'model.json'"),
    "a_dict": ({}, "a dict"),
    "none": (None, "None"),
    "a_class": (terms.Coulomb, "the class Coulomb"),
    "a_function": (models.gaussian, "a function"),
}


@pytest.mark.parametrize("kind", NO_MODELS)
@pytest.mark.parametrize("verb", ["identify", "explain", "predict", "simulate", "export"])
def test_what_is_no_model_is_named_with_the_remedy(verb, kind):
    given, fault = NO_MODELS[kind]
    if (verb, kind) == ("explain", "a_function"):
        return  # a model's own, or another simulator's force
    with pytest.raises(ValueError, match=fault):
        if verb == "explain":
            jf.explain(a_log(), given)
        elif verb == "export":
            jf.export.export(given, "c")
        else:
            getattr(jf, verb)(given, a_log())


@pytest.mark.parametrize(
    "wrong, fault",
    [
        ({"grid": 1}, "grid is 1; give"),
        ({"grid": "fine"}, "grid is 'fine'"),
        ({"bounds": [1, 2]}, "bounds is a list"),
        ({"bounds": {"stribeck_velocity": 3}}, "bounds of stribeck_velocity are 3"),
        ({"bounds": {"stribeck_velocity+": (2, 1)}}, "low first"),
        ({"bounds": {"stribek": (1, 2)}}, "'stribek', which the model does not search"),
        ({"projection": "weak"}, "projection is the path or name 'weak'"),
    ],
)
def test_wrong_options_of_identify_are_named(wrong, fault):
    with pytest.raises(ValueError, match=fault):
        jf.identify("gaussian", a_log(), **wrong)


@pytest.mark.parametrize("verb", ["select", "explain", "explain .holdout."])
def test_a_force_of_zero_is_named(verb):
    nothing = jf.Recording(time=TIME, force=0 * FORCE, position=POSITION, source="a.csv")
    with pytest.raises(ValueError, match=f"{verb}: the force of a.csv is zero"):
        VERBS[verb](nothing)


def test_other_wrong_arguments_are_named():
    with pytest.raises(ValueError, match="controller is the path or name 'pd'"):
        jf.simulate(a_model(), a_log(), "pd")
    with pytest.raises(ValueError, match="needs time, an array"):
        jf.Recording(time=None, force=FORCE, position=POSITION)
    with pytest.raises(ValueError, match="an array of numbers, not the path or name .time."):
        jf.Recording(time="time", force=FORCE, position=POSITION)
    with pytest.raises(ValueError, match="a list of at least one"):
        jf.stack(a_log())
    with pytest.raises(ValueError, match="baseline has no value for coulomb-"):
        jf.explain(a_log(), a_model(**{"coulomb-": np.nan}))


# ---- models ----


def a_document():
    return a_model().to_dict()


def changed(*place, value):
    """The document with another value at a place."""
    document = a_document()
    inner = document
    for key in place[:-1]:
        inner = inner[key]
    inner[place[-1]] = value
    return json.dumps(document)


def deep(levels):
    term = {"type": "Coulomb"}
    for _ in range(levels):
        term = {"type": "Sum", "terms": [term]}
    return term


VALUE = ("parameters", "coulomb+", "value")
TABLE = {"type": "Table", "coordinate": "position", "knots": [0.0, 1.0]}
BAD_MODELS = {
    "huge number": (changed(*VALUE, value=10**400), "coulomb. .* must be a number"),
    "overflow": (changed(*VALUE, value=0).replace('"value": 0', '"value": 1e999'), "a number"),
    "digits": ("1" * 5000, "no JSON"),
    "deep text": ("[" * 100_000, "no JSON"),
    "deep term": (changed("term", value=deep(300)), "nested deeper"),
    "a number for a type": (changed("term", "type", value=5), "names a term 5"),
    "a number for a term": (changed("term", "terms", 1, "positive", value=5), "5 stands where"),
    "a huge one": (changed("term", "terms", 0, value=10**300), "0{70,79}… stands where a term"),
    "a number for a unit": (changed("units", "force", value=3), "names of the force"),
    "an odd unit": (changed("units", "force", value="N\n*/"), "names of the force"),
    "another quantity": (changed("units", value={"mass": "kg"}), "names of the force"),
    "a number for a coordinate": (
        changed("term", "terms", 0, value=TABLE | {"coordinate": 3}),
        "Table.coordinate .* is 3: a name",
    ),
    "no knots": (changed("term", "terms", 0, value=TABLE | {"knots": "x"}), "a finite number"),
    "no number of waves": (
        changed("term", "terms", 0, value={"type": "Cogging", "harmonics": 10**9}),
        "Cogging.harmonics .* a whole number up to",
    ),
}


@pytest.mark.parametrize("name", BAD_MODELS)
def test_a_bad_model_is_refused_in_one_line(name):
    text, fault = BAD_MODELS[name]
    with pytest.raises(ValueError, match=fault) as caught:
        models.load(text)
    assert len(str(caught.value)) < 500 and "\n" not in str(caught.value)


def test_a_sum_in_a_sum_is_the_same_model(tmp_path):
    flat = a_model()
    nested = models.from_parameters(
        terms.Sum((terms.Sum(flat.term.terms[:1]), terms.Sum(flat.term.terms[1:]))), flat.parameters
    )
    assert nested.term.terms == flat.term.terms
    document = a_document()
    document["term"] = {"type": "Sum", "terms": [document["term"]]}
    loaded = models.load(json.dumps(document))
    np.testing.assert_allclose(loaded.friction(np.array([0.5])), flat.friction(np.array([0.5])))


HALF = {"coulomb-": np.nan, "viscous-": np.nan}


def test_a_direction_that_nothing_moved_in_has_no_force():
    model = models.load(json.dumps(a_model(**HALF).to_dict(), allow_nan=False))
    assert model.to_dict()["parameters"]["coulomb-"]["value"] is None
    forces = np.asarray(model.friction(np.array([-0.1, 0.1])))
    assert np.isnan(forces[0]) and forces[1] == pytest.approx(1.1)
    bump = models.gaussian()
    names = [p.name for p in (*bump.affine, *bump.nonlinear)]
    values = {name: np.nan if name.endswith("-") else 1.0 for name in names}
    forces = np.asarray(models.from_parameters(bump, values).friction(np.array([-0.1, 0.1])))
    assert np.isnan(forces[0]) and np.isfinite(forces[1])


def test_where_an_unknown_value_is_needed_that_is_refused():
    model = a_model(**HALF)
    for use in (
        lambda: jf.simulate(model, a_log()),
        lambda: jf.export.export(model, "c"),
        lambda: jf.explain(a_log(), model),
    ):
        with pytest.raises(ValueError, match="no value for coulomb-, viscous-"):
            use()


def test_a_note_or_a_refusal_of_predict():
    arguments = Namespace(model="m.json", file="a.csv")
    blank = np.array([True, False, False])
    moving = np.array([False, True, True])
    assert commands._unknown(a_model(), np.zeros(3, bool), moving, arguments) == []
    note = commands._unknown(a_model(**HALF), blank, moving, arguments)
    assert note == [
        "1 samples at rest have no force, as m.json has no value for coulomb-, viscous-."
    ]
    with pytest.raises(
        ValueError, match="m.json: has no value for coulomb-, viscous-, which a.csv"
    ):
        commands._unknown(a_model(**HALF), blank, ~moving, arguments)
    with pytest.raises(ValueError, match="no finite force for a.csv"):
        commands._unknown(a_model(), blank, ~moving, arguments)


@pytest.mark.slow
def test_an_identified_direction_that_is_not_there_is_no_zero():
    time = np.arange(400) / 500
    velocity = 0.1 * (1 - np.cos(2 * np.pi * time / 0.4))
    acceleration = np.gradient(velocity, time)
    force = 2 * acceleration + np.where(velocity > 0, 10 + 40 * velocity, 0)
    log = jf.Recording(time=time, force=force, velocity=velocity)
    found = jf.identify("coulomb-viscous", log)
    values = {name: float(e.value) for name, e in found.parameters.items()}
    assert np.isnan(values["coulomb-"]) and np.isnan(values["viscous-"])
    assert values["coulomb+"] == pytest.approx(10, rel=0.05)
    document = json.loads(to_json(documents.identification(found, log)))
    assert document["parameters"]["coulomb-"]["value"] is None
    assert document["model"]["parameters"]["coulomb-"]["value"] is None
    assert not [w for w in document["warnings"] if w["name"] == "gain_by_sign"]


@pytest.mark.parametrize("target", ["table", "mujoco", "urdf"])
@pytest.mark.parametrize("top", [1e300, 1e150])
def test_a_range_beyond_all_numbers_is_refused(target, top, capfd):
    with pytest.raises(ValueError, match="a range that the machine reaches"):
        jf.export.export(a_model(), target, speed=(0.0, top))
    assert not any(capfd.readouterr())


def test_a_held_out_recording_without_a_position_is_named():
    here, held = a_log(), jf.Recording(time=TIME, force=FORCE, velocity=POSITION, source="held")
    candidate = Namespace(term=terms.Cogging(), effect=Namespace(name="cogging"))
    found = Namespace(selected=[Namespace(trial=Namespace(candidate=candidate))])
    holdout.check_signals(found, here, here)
    with pytest.raises(ValueError, match="held lacks 'position'"):
        holdout.check_signals(found, here, held)
