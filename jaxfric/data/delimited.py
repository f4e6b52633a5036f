"""Delimited text to named columns: whatever delimiter, decimal sign or header loggers write."""

import csv
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from . import heading
from .heading import Dialect
from .printable import short

# Importing pyarrow takes about as long as NumPy takes for a file of this size, so smaller files
# are quicker without it.
_SMALL_CSV = 5_000_000  # bytes
# Of a file so much is read for its header, and so much of its lines is held at once, bytes.
_HEAD, _BLOCK = 65536, 1 << 24
# In the beginning of a text there is no control character; a block that a crash left empty (NUL) is
# at its end.
_BEGIN, _CONTROL = 512, rb"[\x00-\x08\x0e-\x1a\x1c-\x1f]"
# Numbers with a point, with a comma, and with more than a decimal sign.
_EXPONENT = r"(?:[eE][-+]?\d+)?"
_POINT = r"[-+]?(?:\d+\.\d*|\.\d+)" + _EXPONENT
_COMMA = r"[-+]?(?:\d+,\d*|,\d+)" + _EXPONENT
_SEVERAL = r"[-+]?\d{1,3}(?:(?:,\d{3})+\.\d*|(?:\.\d{3})+,\d*|(?:,\d{3}){2,}|(?:\.\d{3}){2,})"
# Groups of three digits, as commas separate thousands; all others with a comma have decimals.
_DECIMAL = r"[-+]?(?:0\d*,\d*|\d{4,},\d*|\d*,(?:\d{0,2}|\d{4,}))" + _EXPONENT
NO_NUMBER = {"", "nan", "nat", "na", "n/a", "#n/a", "null", "none", "-", "nan(ind)", "-nan(ind)"}


class Table(NamedTuple):
    """Raw columns by name, the row number of the first sample as a person counts, and notes."""

    columns: dict[str, np.ndarray]
    first_row: int
    notes: list[str]


def _decode(raw: bytes) -> str:
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")  # what measuring programs under Windows write for ° and µ


def read_csv(path: Path) -> Table:
    """The columns of a delimited text file.

    **Raises:** `ValueError` if it holds no samples or its rows differ in width.
    """
    with path.open("rb") as file:
        raw = file.read(_HEAD)
    if found := re.search(_CONTROL, raw[:_BEGIN]):
        raise ValueError(
            f"{path}: this is no text: byte {found.start() + 1} is a control character. If it is a "
            "file of another kind, give it that suffix (.mat, .npz, .parquet); else write the log "
            "as CSV."
        )
    end = raw.rfind(b"\n") + 1
    large = path.stat().st_size > _SMALL_CSV
    if not (large and end):
        raw = path.read_bytes()
    dialect = heading.dialect(_decode(raw[:end] if end else raw).splitlines(), path)
    notes = list(dialect.notes)
    if dialect.delimiter != "," and _holds(path, b","):  # a quoted cell is located as no number
        decimal, told = _signs(_parts(path, dialect.first), dialect, path)
        notes += told
        dialect = dialect._replace(decimal=decimal)
    table = None
    if large and dialect.delimiter and not _open_quotation(path):
        table = _arrow_csv(path, dialect)
    if table is None:
        raw = path.read_bytes() if large else raw
        table = _plain_csv(_decode(raw).splitlines()[dialect.first :], dialect, path)
    return table._replace(notes=notes + table.notes)


def _blocks(path: Path) -> Iterator[bytes]:
    """The lines of a file, some megabytes at once."""
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            yield block + file.readline()


def _holds(path: Path, character: bytes) -> bool:
    return any(character in block for block in _blocks(path))


def _parts(path: Path, first: int) -> Iterator[tuple[int, str]]:
    """The lines from `first` on, many at once, with the number of the first of them."""
    number = 0
    for block in _blocks(path):
        lines = _decode(block).splitlines()
        if (skipped := max(first - number, 0)) < len(lines):
            yield number + skipped, "\n".join(lines[skipped:])
        number += len(lines)


def _open_quotation(path: Path) -> bool:
    """Whether a quotation mark is open at the end of a line, where pyarrow drops the rest."""
    quoted = (block for block in _blocks(path) if b'"' in block)
    return any(line.count(b'"') % 2 for block in quoted for line in block.splitlines())


def _arrow_csv(path: Path, dialect: Dialect) -> Table | None:
    """A large file by pyarrow; `None` where that is absent or the plain reader must explain."""
    try:
        import pyarrow as pa
        from pyarrow import csv as arrow_csv
    except ImportError:
        return None
    options = (
        arrow_csv.ReadOptions(skip_rows=dialect.first, column_names=dialect.header),
        arrow_csv.ParseOptions(delimiter=dialect.delimiter),
        arrow_csv.ConvertOptions(decimal_point=dialect.decimal),
    )
    most = sum(block.count(b"\n") for block in _blocks(path)) + 1
    try:
        try:
            # By the types of the first block, so that no text has to be kept for other ones.
            columns = _joined(arrow_csv.open_csv(path, *options), most)
        except pa.ArrowInvalid:
            columns = _joined(arrow_csv.read_csv(path, *options).to_batches(), most)
    except pa.ArrowInvalid:
        return None
    return Table(columns, dialect.first + 1, [])


def _plain_csv(lines: list[str], dialect: Dialect, path: Path) -> Table:
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise heading.without_samples(path, dialect.header)
    return _regular_csv(lines, dialect) or _any_csv(lines, dialect, path)


def _signs(parts: Iterable[tuple[int, str]], dialect: Dialect, path: Path) -> tuple[str, list[str]]:
    """The decimal sign, and a warning where each comma could as well separate thousands.

    **Arguments:** `parts`, lines of the file with the number of the first of them, from 0.

    **Raises:** `ValueError` if commas and points are both used inside numbers: which of them is
    the decimal sign is not guessed.
    """
    between = "[ \t]" if dialect.delimiter is None else f"[{re.escape(dialect.delimiter)}]"
    kinds = {"point": _POINT, "comma": _COMMA, "several": _SEVERAL, "decimal": _DECIMAL}
    found: dict[str, tuple[str, str]] = {}  # the first cell of each kind, and its row
    for number, text in parts:
        for kind in kinds.keys() - found.keys():
            if kind == "point" and "." not in text:
                continue
            if kind == "several" and not re.search(r"\d[.,]\d{3}[.,]", text):
                continue
            one = re.search(f'(?m)(?:^|{between})[ "]*({kinds[kind]})[ "]*(?={between}|$)', text)
            if one:
                above = text.count("\n", 0, one.start(1))
                found[kind] = one[1], f"row {number + above + 1}"
    point, comma, several = (found.get(kind) for kind in ("point", "comma", "several"))
    if several or (point and comma):
        cell, row = several or comma
        other = (comma if several else None) or point
        beside = f" beside {other[0]!r} in {other[1]}" if other else ""
        raise ValueError(
            f"{path}: {row}: {cell!r}{beside}: the comma may separate thousands or be the decimal "
            "sign. Write the file with one decimal sign and no separator of thousands."
        )
    if comma and "decimal" not in found:
        return ",", [
            f"Warning: the comma is taken for the decimal sign ({comma[0]!r} in {comma[1]}), "
            "though every number with one could be a whole number with separated thousands; if "
            "it is, write the file without them."
        ]
    return "," if comma else ".", []


def _regular_csv(lines: list[str], dialect: Dialect) -> Table | None:
    """A file of nothing but numbers, quickly; `None` where it is anything else."""
    if dialect.decimal == ",":
        lines = [line.replace(",", ".") for line in lines]
    try:
        values = np.loadtxt(lines, delimiter=dialect.delimiter, comments=None, ndmin=2)
    except ValueError:
        return None
    if values.shape != (len(lines), len(dialect.header)):
        return None
    return Table(dict(zip(dialect.header, values.T, strict=True)), dialect.first + 1, [])


def _any_csv(lines: list[str], dialect: Dialect, path: Path) -> Table:
    width, notes = len(dialect.header), []
    if dialect.delimiter is None:
        rows = [line.split() for line in lines]
    else:
        rows = _quoted(lines, dialect, path)
    if len(rows[-1]) < width:
        notes.append(f"The last row has {len(rows[-1])} of {width} fields and is left out.")
        rows.pop()
    if any(len(row) != width for row in rows):
        rows = [_fit(row, width, i + dialect.first + 1, path) for i, row in enumerate(rows)]
    if not rows:
        raise heading.without_samples(path, dialect.header)
    cells = zip(dialect.header, zip(*rows, strict=True), strict=True)
    columns = {name: _parse(column, dialect.decimal) for name, column in cells}
    return Table(columns, dialect.first + 1, notes)


def _quoted(lines: list[str], dialect: Dialect, path: Path) -> list[list[str]]:
    """The cells of each line.

    **Raises:** `ValueError` where a quotation mark is open at the end of a line: what would be one
    cell may be half of the file.
    """
    # The end of a line shows whether a quotation mark is open there.
    ended = (f"{line}\n" for line in lines)
    reader = csv.reader(ended, delimiter=dialect.delimiter, skipinitialspace=True)
    rows: list[list[str]] = []
    try:
        for row in reader:
            if reader.line_num > len(rows) + 1 or (row and row[-1].endswith("\n")):
                raise csv.Error
            rows.append(row)
    except csv.Error:  # also a cell that is longer than any
        raise ValueError(
            f"{path}: row {dialect.first + len(rows) + 1}: a quotation mark is opened and not "
            "closed in that line. Correct or remove the line."
        ) from None
    return rows


def _fit(row: list[str], width: int, number: int, path: Path) -> list[str]:
    if not row or (len(row) == 1 and not row[0].strip()):
        return [""] * width  # a blank line: no time stamp, so the sample is left out later
    if len(row) > width and not any(row[width:]):
        return row[:width]
    if len(row) != width:
        raise ValueError(
            f"{path}: row {number} has {len(row)} fields where the header has {width}. "
            "Correct or remove that line."
        )
    return row


def _parse(cells: tuple[str, ...], decimal: str) -> np.ndarray:
    """Numbers where all cells are numbers, else the cells as they stand."""
    if decimal == ",":
        cells = tuple(cell.replace(",", ".") for cell in cells)
    try:
        return np.array(cells, dtype=np.float64)
    except ValueError:
        return np.array(cells, dtype=object)


def numbers(column: np.ndarray, name: str, path: Path, first_row: int) -> np.ndarray:
    """A column as float64; empty cells and the usual words for "no value" become NaN.

    **Raises:** `ValueError` naming the file, row, column and value of the first text.
    """
    if column.dtype.kind in "biuf":
        return column.astype(np.float64, copy=False)
    result = np.empty(len(column))
    for i, cell in enumerate(column):
        text = "" if cell is None else str(cell).strip()
        try:
            result[i] = np.nan if text.lower() in NO_NUMBER else float(text)
        except ValueError:
            raise ValueError(no_number(text, "number", name, path, first_row + i)) from None
    return result


def no_number(text: str, what: str, name: str, path: Path, row: int) -> str:
    """What to say of a cell that is not `what` its column holds; the header again, or a text."""
    if row > 2 and text and name.partition(" [")[0] == text.partition(" [")[0]:
        return (
            f"{path}: row {row} is a header again: the file holds two recordings, one after the "
            "other. Split it before that row into two files, and name both, or the one that is "
            "meant."
        )
    return (
        f"{path}: row {row}, column {short(name)!r}: {short(text)!r} is not a {what}. Correct the "
        "cell, or name another column with --columns."
    )


def _joined(batches: Iterable[Any], most: int) -> dict[str, np.ndarray]:
    """The columns of Arrow's batches by name, of `most` rows together at most."""
    columns, count = dict[str, np.ndarray](), 0
    for batch in batches:
        for name, part in zip(batch.schema.names, map(arrow_column, batch.columns), strict=True):
            known = columns.get(name, part)
            kind = np.result_type(known, part)
            if name not in columns or known.dtype != kind:
                columns[name] = np.empty(most, kind)
                columns[name][:count] = known[:count]
            columns[name][count : count + len(part)] = part
        count += batch.num_rows
    return {name: column[:count] for name, column in columns.items()}


def arrow_column(column: Any) -> np.ndarray:
    """A column of an Arrow table as numbers, moments, or objects where it is text."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_integer(kind) and column.null_count == 0:
        return column.to_numpy(zero_copy_only=False)
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        return column.cast(pa.float64()).to_numpy(zero_copy_only=False)
    if pa.types.is_boolean(kind):
        return column.cast(pa.int8()).cast(pa.float64()).to_numpy(zero_copy_only=False)
    if pa.types.is_timestamp(kind):
        return column.to_numpy(zero_copy_only=False)
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    return np.array(column.to_pylist(), dtype=object)
