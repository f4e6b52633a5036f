"""Delimited text to named columns: whatever delimiter, decimal sign or header loggers write."""

import csv
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

# Importing pyarrow takes about as long as NumPy takes for a file of this size, so smaller files
# are quicker without it.
_SMALL_CSV = 5_000_000  # bytes
_DELIMITERS = ",;\t|"
_NO_NUMBER = {"", "na", "n/a", "#n/a", "null", "none", "-", "nan(ind)", "-nan(ind)"}


class Table(NamedTuple):
    """Raw columns by name, the row number of the first sample as a person counts, and notes."""

    columns: dict[str, np.ndarray]
    first_row: int
    notes: list[str]


class _Dialect(NamedTuple):
    header: list[str]
    first: int  # lines before the first sample
    delimiter: str | None  # None: blanks
    decimal: str


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _dialect(lines: list[str], path: Path) -> _Dialect:
    """Header, delimiter and decimal sign, from the first lines; `#` starts a comment."""
    rows = [i for i, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    if not rows:
        raise ValueError(f"{path}: the file holds no samples.")
    top = lines[rows[0]]
    delimiter = max(_DELIMITERS, key=top.count)
    delimiter = delimiter if delimiter in top else None
    cells = _split(top, delimiter)
    data = rows[1] if len(rows) > 1 else rows[0]
    number = re.compile(r"^\s*[-+]?\d+,\d+")
    decimal = "," if delimiter in (";", "\t", None) and any(
        number.match(cell) for cell in _split(lines[data], delimiter)
    ) else "."  # fmt: skip
    if not all(_is_number(cell) for cell in cells):
        return _Dialect(_unique(cells), rows[0] + 1, delimiter, decimal)
    comment = lines[rows[0] - 1].lstrip("# ") if rows[0] else ""
    header = _split(comment, delimiter)
    if len(header) != len(cells):
        header = [f"column{i + 1}" for i in range(len(cells))]
    return _Dialect(_unique(header), rows[0], delimiter, decimal)


def _unique(names: list[str]) -> list[str]:
    """Names with repeats numbered, `x` and `x (2)`: as synonyms they stay ambiguous."""
    seen: dict[str, int] = {}
    result = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        result.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return result


def _decode(raw: bytes) -> str:
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")  # what measuring programs under Windows write for ° and µ


def read_csv(path: Path) -> Table:
    """The columns of a delimited text file.

    **Raises:** `ValueError` if it holds no samples or its rows differ in width.
    """
    raw = path.read_bytes()
    end = raw.rfind(b"\n", 0, 65536) + 1
    dialect = _dialect(_decode(raw[:end] if end else raw).splitlines(), path)
    if len(raw) > _SMALL_CSV and dialect.delimiter and (table := _arrow_csv(raw, dialect)):
        return table
    return _plain_csv(_decode(raw).splitlines()[dialect.first :], dialect, path)


def _arrow_csv(raw: bytes, dialect: _Dialect) -> Table | None:
    """A large file by pyarrow; `None` where that is absent or the plain reader must explain."""
    try:
        import pyarrow as pa
        from pyarrow import csv as arrow_csv
    except ImportError:
        return None
    try:
        table = arrow_csv.read_csv(
            pa.BufferReader(raw),
            arrow_csv.ReadOptions(skip_rows=dialect.first, column_names=dialect.header),
            arrow_csv.ParseOptions(delimiter=dialect.delimiter),
            arrow_csv.ConvertOptions(decimal_point=dialect.decimal),
        )
    except pa.ArrowInvalid:
        return None
    columns = {name: arrow_column(table[name]) for name in table.column_names}
    return Table(columns, dialect.first + 1, [])


def _plain_csv(lines: list[str], dialect: _Dialect, path: Path) -> Table:
    while lines and not lines[-1].strip():
        lines.pop()
    if not lines:
        raise ValueError(f"{path}: the file has a header but no samples.")
    return _regular_csv(lines, dialect) or _any_csv(lines, dialect, path)


def _regular_csv(lines: list[str], dialect: _Dialect) -> Table | None:
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


def _any_csv(lines: list[str], dialect: _Dialect, path: Path) -> Table:
    width, notes = len(dialect.header), []
    if dialect.delimiter is None:
        rows = [line.split() for line in lines]
    else:
        rows = list(csv.reader(lines, delimiter=dialect.delimiter, skipinitialspace=True))
    if len(rows[-1]) < width:
        notes.append(f"The last row has {len(rows[-1])} of {width} fields and is left out.")
        rows.pop()
    if any(len(row) != width for row in rows):
        rows = [_fit(row, width, i + dialect.first + 1, path) for i, row in enumerate(rows)]
    if not rows:
        raise ValueError(f"{path}: the file has a header but no samples.")
    cells = zip(dialect.header, zip(*rows, strict=True), strict=True)
    columns = {name: _parse(column, dialect.decimal) for name, column in cells}
    return Table(columns, dialect.first + 1, notes)


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
        return column.astype(np.float64)
    result = np.empty(len(column))
    for i, cell in enumerate(column):
        text = "" if cell is None else str(cell).strip()
        try:
            result[i] = np.nan if text.lower() in _NO_NUMBER else float(text)
        except ValueError:
            raise ValueError(
                f"{path}: row {first_row + i}, column {name!r}: {text!r} is not a number. "
                "Correct the cell, or name another column with --columns."
            ) from None
    return result


def arrow_column(column: Any) -> np.ndarray:
    """A column of an Arrow table as numbers, moments, or objects where it is text."""
    import pyarrow as pa

    kind = column.type
    if pa.types.is_integer(kind) and column.null_count == 0:
        return column.to_numpy()
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind):
        return column.cast(pa.float64()).to_numpy()
    if pa.types.is_boolean(kind):
        return column.cast(pa.int8()).cast(pa.float64()).to_numpy()
    if pa.types.is_timestamp(kind):
        return column.to_numpy()
    if pa.types.is_null(kind):
        return np.full(len(column), np.nan)
    return np.array(column.to_pylist(), dtype=object)
