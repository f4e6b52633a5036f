"""Files that a bad day brings: damaged, foreign or odd recordings and models, by their names."""

import io
import json
import zipfile

import numpy as np

TIME = np.arange(400) * 0.005
FORCE = np.where(np.cos(10 * TIME) > 0, 3.0, -3.0) + 0.2 * np.cos(10 * TIME)
POSITION = np.sin(10 * TIME)
SIGNALS = {"time": TIME, "force": FORCE, "position": POSITION}
HEAD = "time,force,position\n"
LINES = [f"{t:.3f},{f:.4f},{x:.6f}" for t, f, x in zip(TIME, FORCE, POSITION, strict=True)]
GOOD = HEAD + "\n".join(LINES) + "\n"


def with_line(number, line):
    """The log with another line in one place."""
    return HEAD + "\n".join([*LINES[:number], line, *LINES[number + 1 :]]) + "\n"


def with_head(head):
    return head + "\n" + "\n".join(LINES) + "\n"


def with_column(number, cell):
    """The log with the same cell in each row of one column."""
    rows = [line.split(",") for line in LINES]
    return HEAD + "\n".join(",".join([*r[:number], cell, *r[number + 1 :]]) for r in rows) + "\n"


def npz(**arrays):
    content = io.BytesIO()
    np.savez(content, **arrays)
    return content.getvalue()


def npy():
    content = io.BytesIO()
    np.save(content, TIME)
    return content.getvalue()


def pickled():
    content = io.BytesIO()
    np.savez(content, time=np.array([{"a": 1}, None], dtype=object), force=FORCE, position=POSITION)
    return content.getvalue()


def zipped(name, content):
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(name, content)
    return target.getvalue()


def parquet(names, cut=0):
    import pyarrow as pa
    import pyarrow.parquet as pq

    content = io.BytesIO()
    columns = [pa.array(SIGNALS.get(name, POSITION)) for name in names]
    pq.write_table(pa.Table.from_arrays(columns, names=list(names)), content)
    return content.getvalue()[: -cut or None]


# No recording can be made of these. File name -> content, and what the message must say.
RECORDINGS = {
    # nothing, or nothing but a part
    "empty.csv": ("", "empty"),
    "blank.csv": ("\n \n\n", "no samples"),
    "comments.csv": ("# a\n# b\n", "no samples"),
    "header.csv": (HEAD, "sample"),
    "one.csv": (HEAD + LINES[0] + "\n", "sample"),
    "two.csv": (HEAD + "\n".join(LINES[:2]) + "\n", "sample"),
    "words.csv": ("hello world\nthis is no log\n", "words.csv"),
    "html.csv": ("<!DOCTYPE html>\n<html><body>404</body></html>\n", "html.csv"),
    "json.csv": ('{"time": [0, 1], "force": [1, 2]}\n', "json.csv"),
    "binary.csv": (bytes(range(256)) * 40, "binary.csv"),
    "zeros.csv": (b"\0" * 4000, "zeros.csv"),
    "png.csv": (b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "png.csv"),
    # rows
    "long_header.csv": ("time,force," + "x" * 10_000_000 + "\n" + GOOD, "10000011 characters"),
    "open_quote.csv": (with_line(1, '0,1,"2'), "a quotation mark"),
    "late_quote.csv": (GOOD + '9,2,"3', "a quotation mark"),
    "pair_of_quotes.csv": (with_line(5, '0,1,"2') + '9,2,3"\n', "a quotation mark"),
    "long_row.csv": (with_line(7, "0.035,1,2,3,4"), "row 9 has 5 fields"),
    "short_row.csv": (with_line(7, "0.035,1"), "row 9 has 2 fields"),
    "text_cell.csv": (with_line(7, "0.035,off,2"), "row 9, column 'force': 'off'"),
    "second_header.csv": (with_line(7, HEAD.strip()), "row 9 is a header again"),
    "date_cell.csv": (with_line(7, "2026-03-04T09:12:05,1,2"), "row 9, column 'time'"),
    "dates.csv": (with_column(0, "2026-13-04"), "Correct the cell"),
    "long_cell.csv": (with_line(7, "0.035," + "y" * 900 + ",1"), "row 9"),
    "hex.csv": (with_line(7, "0.035,0x1F,1"), "row 9, column 'force': '0x1F'"),
    "formula.csv": (with_line(7, "0.035,=A1+B2,1"), "row 9, column 'force'"),
    "two_signs.csv": (with_line(7, "0.035;1,5;2.5").replace(",", ";"), "two_signs.csv"),
    "escape.csv": (with_line(7, "0.035,\x1b[31m,1"), r"\x1b"),
    # columns
    "no_force.csv": (with_head("time,a,position"), "recognised as force"),
    "no_motion.csv": (with_head("time,force,a"), "position or velocity"),
    "unnamed.csv": ("\n".join(LINES) + "\n", "column1"),
    "two_forces.csv": (with_head("time,force,torque"), "2 columns could be the force"),
    "two_times.csv": (with_head("time,t,position"), "2 columns could be the time"),
    "escape_head.csv": (with_head("time,\x1b[2Jforce2,position"), r"\x1b"),
    "many.csv": (",".join(f"c{i}" for i in range(500)) + "\n" + "1," * 499 + "1\n", "460 more"),
    "minutes.csv": (
        "time,force,position,speed [rpm]\n" + "".join(f"{line},1\n" for line in LINES),
        "--scale velocity",
    ),
    # values
    "no_number.csv": (with_column(1, "nan"), "no_number.csv"),
    "endless.csv": (with_column(1, "inf"), "endless.csv"),
    "no_place.csv": (with_column(2, "nan"), "no_place.csv"),
    "no_clock.csv": (with_column(0, "nan"), "no_clock.csv"),
    "stopped_clock.csv": (with_column(0, "1.0"), "stopped_clock.csv"),
    "backwards.csv": (HEAD + "\n".join(LINES[::-1]) + "\n", "backwards.csv"),
    "endless_clock.csv": (with_column(0, "inf"), "endless_clock.csv"),
    # other formats
    "array.npz": (npy, "one array without a name"),
    "objects.npz": (pickled, "objects.npz"),
    "zip.npz": (lambda: zipped("readme.txt", "hello"), "zip.npz"),
    "no_zip.npz": (b"PK\x03\x04 no zip", "no_zip.npz"),
    "lengths.npz": (lambda: npz(time=TIME, force=FORCE[:9], position=POSITION), "length"),
    "scalars.npz": (lambda: npz(time=1.0, force=2.0, position=3.0), "scalars.npz"),
    "complex.npz": (lambda: npz(time=TIME, force=FORCE * 1j, position=POSITION), "complex.npz"),
    "no_force.npz": (lambda: npz(time=TIME, position=POSITION), "recognised as force"),
    "csv.npz": (GOOD, "csv.npz"),
    "csv.mat": (GOOD, "csv.mat"),
    "csv.parquet": (GOOD, "csv.parquet"),
    "cut.parquet": (lambda: parquet(SIGNALS, 100), "cut.parquet"),
    "twice.parquet": (lambda: parquet(("time", "force", "position", "position")), "2 columns"),
    "no_force.parquet": (lambda: parquet(("time", "position")), "recognised as force"),
    "hdf.mat": (b"\0" * 512 + b"\x89HDF\r\n\x1a\n" + b"\1" * 900, "hdf.mat"),
    "noise.mat": (bytes(range(256)) * 8, "noise.mat"),
    "log.xyz": (GOOD, "the format 'xyz' is not known"),
    "log": (GOOD, "is not known"),
}


def parameters(**values):
    names = ("inertia", "coulomb+", "viscous+", "coulomb-", "viscous-")
    units = ("kg", "N", "N·s/m", "N", "N·s/m")
    return {
        name: {"value": values.get(name, 1.0), "unit": unit}
        for name, unit in zip(names, units, strict=True)
    }


SLIP = {"type": "Sum", "terms": [{"type": "Coulomb"}, {"type": "Viscous"}]}
TERM = {
    "type": "Sum",
    "terms": [
        {"type": "Inertia"},
        {"type": "Directional", "positive": SLIP, "negative": SLIP},
    ],
}


def model(**other):
    """The document of a model, with other entries."""
    document = {"schema": "jaxfric.model/1", "term": TERM, "parameters": parameters()}
    return document | {"units": {"force": "N", "position": "m"}} | other


def valued(value, name="coulomb+"):
    return json.dumps(model(parameters=parameters(**{name: value})))


def deep(levels):
    term = {"type": "Coulomb"}
    for _ in range(levels):
        term = {"type": "Sum", "terms": [term]}
    return term


def termed(term):
    return json.dumps(model(term=term))


TABLE = {"type": "Table", "coordinate": "position", "knots": [0.0, 1.0]}

# No model can be made of these: what they hold.
MODELS = {
    "empty": "",
    "blank": "  \n",
    "list": "[]",
    "number": "3",
    "text": '"model"',
    "null": "null",
    "object": "{}",
    "half": json.dumps(model())[:200],
    "digits": "1" * 5000,
    "brackets": "[" * 100_000,
    "csv": GOOD,
    "no_utf8": b"\xff\xfe\x00{",
    "zeros": b"\0" * 100,
    "other_schema": json.dumps(model(schema="someone.else/7")),
    "later_schema": json.dumps(model(schema="jaxfric.model/999")),
    "schema_number": json.dumps(model(schema=5)),
    "no_term": json.dumps({k: v for k, v in model().items() if k != "term"}),
    "no_parameters": json.dumps({k: v for k, v in model().items() if k != "parameters"}),
    "parameters_list": json.dumps(model(parameters=[])),
    "parameters_number": json.dumps(model(parameters=4)),
    "parameters_less": json.dumps(model(parameters={"inertia": {"value": 1.0}})),
    "parameters_more": json.dumps(model(parameters=parameters() | {"x": {"value": 1.0}})),
    "value_huge": valued(10**400),
    "value_overflow": valued(0).replace('"value": 0,', '"value": 1e999,'),
    "value_text": valued("one"),
    "value_list": valued([1.0]),
    "value_object": valued({}),
    "value_true": valued(True),
    "term_number": termed(5),
    "term_list": termed([]),
    "term_text": termed("Coulomb"),
    "term_unknown": termed({"type": "os.system"}),
    "term_private": termed({"type": "AbstractTerm"}),
    "term_type_number": termed({"type": 5}),
    "term_type_list": termed({"type": ["Sum"]}),
    "term_deep": termed(deep(300)),
    "term_empty_sum": termed({"type": "Sum", "terms": []}),
    "term_sum_number": termed({"type": "Sum", "terms": 3}),
    "term_more_fields": termed({"type": "Coulomb", "colour": "red"}),
    "term_no_side": termed({"type": "Directional", "positive": {"type": "Coulomb"}}),
    "table_coordinate": termed(TABLE | {"coordinate": 3}),
    "table_knots": termed(TABLE | {"knots": "x"}),
    "table_one_knot": termed(TABLE | {"knots": []}),
    "many_waves": termed({"type": "Cogging", "harmonics": 10**9}),
    "no_waves": termed({"type": "Cogging", "harmonics": -1}),
    "unit_number": json.dumps(model(units={"force": 3, "position": "m"})),
    "unit_code": json.dumps(model(units={"force": "N\n*/", "position": "m"})),
    "unit_other": json.dumps(model(units={"mass": "kg"})),
    "unit_list": json.dumps(model(units=["N", "m"])),
}
