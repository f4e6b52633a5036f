"""Rows as a table, Parquet or CSV."""

import os
from collections.abc import Mapping, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ..data.io import write_bytes, write_table
from ..data.printable import encodable
from ..data.tables import optional
from ..data.targets import replaced
from .files import File
from .journal import Row

FORMATS = (".parquet", ".csv")
# Of every row, in this order: the name of the column, and what an absent value means.
_FACTS = {
    "samples": int,
    "duration": float,
    "sample_rate": float,
    "result": str,
    "filtered_force_error": float,
    "projection": str,
    "windows": int,
    "covered": float,
    "reason": str,
    "warnings": str,
    "notes": str,
}
# What a cell begins with that a spreadsheet takes for a formula.
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")
_HEAD = b"file,axis,group"
_KINDS = {"value": "", "standard_error": "_standard_error", "unit": "_unit"}


def columns(files: Sequence[File], rows: Mapping[str, Row], model: str) -> dict[str, list]:
    """The table by columns: file, axis, group, the folders' keys, circumstances, parameters.

    A parameter has three columns, `coulomb+`, `coulomb+_standard_error` and `coulomb+_unit`; a
    value that there is not is `None`.
    """
    keys = dict.fromkeys(key for file in files for key in file.keys)
    names = dict.fromkeys(name for row in rows.values() for name in row["parameters"])
    table: dict[str, list] = {"file": [f.path for f in files]}
    table |= {"axis": [f.axis or None for f in files], "group": [f.group or None for f in files]}
    for key in keys:
        column = [file.keys.get(key) for file in files]
        if column != table.get(key):
            table[f"{key}_key" if key in {*table, *_FACTS} else key] = column
    ordered = [rows[file.path] for file in files]
    table["model"] = [model] * len(ordered)
    table |= {name: [row.get(name) for row in ordered] for name in _FACTS}
    for name in names:
        for kind, suffix in _KINDS.items():
            table[name + suffix] = [row["parameters"].get(name, {}).get(kind) for row in ordered]
    return table


def check(out: str) -> None:
    """Whether the table can be written there; raises `ValueError` before the work, not after."""
    path = Path(out)
    if path.suffix.lower() not in FORMATS:
        raise ValueError(f"{out}: a fleet is written as {' or '.join(FORMATS)}; use that suffix.")
    replaced(path)
    if not path.absolute().parent.is_dir():
        raise ValueError(f"{out}: there is no folder {path.parent}; make it first.")
    if not os.access(path.absolute().parent, os.W_OK):
        raise ValueError(f"{out}: the folder {path.parent} cannot be written to.")
    if path.suffix.lower() == ".parquet":
        optional("pyarrow.parquet", path)


def is_one(path: str) -> bool:
    """Whether a file is the table of a fleet, by the names of its first columns."""
    if not path.lower().endswith(".parquet"):
        with open(path, "rb") as file:
            return file.read(len(_HEAD)) == _HEAD
    try:
        names = optional("pyarrow.parquet", Path(path)).read_schema(path).names
    except (ValueError, OSError):  # no Parquet at all
        return False
    return ",".join(names[:3]).encode() == _HEAD


def write(out: str | os.PathLike, table: Mapping[str, Sequence[Any]]) -> None:
    """Write the table, Parquet or CSV by suffix, whole or not at all.

    Bytes of a path that are no UTF-8 are spelled out. In CSV no text begins as a formula does.

    **Raises:** `ValueError` if it cannot be written there.
    """
    path = Path(out)
    table = {name: [_encodable(cell) for cell in column] for name, column in table.items()}
    if path.suffix.lower() == ".csv":
        safe = {name: [_no_formula(name, c) for c in column] for name, column in table.items()}
        write_table(path, {name: np.array(column, object) for name, column in safe.items()})
        return
    pa, parquet = optional("pyarrow", path), optional("pyarrow.parquet", path)
    types = {str: pa.string(), int: pa.int64(), float: pa.float64()}
    arrays = {name: pa.array(column, types[_type(name, column)]) for name, column in table.items()}
    content = BytesIO()
    parquet.write_table(pa.table(arrays), content)
    write_bytes(path, content.getvalue())


def _encodable(cell: Any) -> Any:
    return encodable(cell) if isinstance(cell, str) else cell


def _no_formula(name: str, cell: Any) -> Any:
    """A cell that no spreadsheet computes: the same path of a file, another text quoted."""
    if not isinstance(cell, str) or not cell.startswith(_FORMULA):
        return cell
    return os.path.join(os.curdir, cell) if name == "file" else f"'{cell}"


def _type(name: str, column: Sequence[Any]) -> type:
    """A column's type, the same for every fleet even where all its values are absent."""
    if name in _FACTS:
        return _FACTS[name]
    number = any(isinstance(value, float) for value in column)
    text = any(isinstance(value, str) for value in column)
    return float if number or (not text and name.endswith("_standard_error")) else str
