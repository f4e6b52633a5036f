"""Files to named columns and back: CSV, Parquet, MATLAB `.mat`, NumPy `.npz`."""

import csv
import re
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

# Importing pyarrow takes about as long as the standard library takes for a file of this size,
# so smaller files are quicker without it.
_SMALL_CSV = 4_000_000  # bytes
_DELIMITERS = ",;\t|"
_NO_NUMBER = {"", "na", "n/a", "#n/a", "null", "none", "-", "nan(ind)", "-nan(ind)"}


class Table(NamedTuple):
    """Raw columns by name, the row number of the first sample as a person counts, and notes."""

    columns: dict[str, np.ndarray]
    first_row: int
    notes: list[str]


def optional(library: str, path: Path) -> Any:
    """An optional library, or a message that says what to install."""
    try:
        return __import__(library, fromlist=["_"])
    except ImportError as error:
        raise ValueError(
            f"{path}: this format needs {library.split('.')[0]}, which is not installed. "
            'Install it: pip install "jaxfric[io]".'
        ) from error


def load(path: Path, format: str | None = None) -> Table:
    """The columns of a file; the format follows the suffix unless given.

    **Raises:** `ValueError` if the file is absent, empty, damaged, or of an unknown format, or
    if its format needs a library that is not installed.
    """
    suffix = (format or path.suffix).lower().lstrip(".")
    if suffix not in _LOADERS:
        raise ValueError(
            f"{path}: the format {suffix or '(no suffix)'!r} is not known. Known are "
            f"{', '.join(sorted(_LOADERS))}; name one with format=."
        )
    if not path.is_file():
        raise ValueError(f"{path}: there is no such file.")
    if path.stat().st_size == 0:
        raise ValueError(f"{path}: the file is empty.")
    try:
        return _LOADERS[suffix](path)
    except OSError as error:
        raise ValueError(f"{path}: the file cannot be read: {error}.") from error


# ---- CSV ----


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


def _read_csv(path: Path) -> Table:
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
    columns = {name: _arrow_column(table[name]) for name in table.column_names}
    return Table(columns, dialect.first + 1, [])


def _plain_csv(lines: list[str], dialect: _Dialect, path: Path) -> Table:
    width, notes = len(dialect.header), []
    if dialect.delimiter is None:
        rows = [line.split() for line in lines]
    else:
        rows = list(csv.reader(lines, delimiter=dialect.delimiter, skipinitialspace=True))
    while rows and not rows[-1]:
        rows.pop()
    if rows and len(rows[-1]) < width:
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


# ---- Parquet, MATLAB, NumPy ----


def _arrow_column(column: Any) -> np.ndarray:
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


def _read_parquet(path: Path) -> Table:
    parquet, pa = optional("pyarrow.parquet", path), optional("pyarrow", path)
    try:
        table = parquet.ParquetFile(path).read()
    except pa.ArrowInvalid as error:
        raise ValueError(f"{path}: this is no readable Parquet file: {error}.") from error
    names = [field.name for field in table.schema if not pa.types.is_nested(field.type)]
    return Table({name: _arrow_column(table[name]) for name in names}, 1, [])


def _vectors(name: str, value: Any) -> dict[str, np.ndarray]:
    """Columns in a variable: a vector, columns of a matrix (`q:1`, …), fields of a structure."""
    if isinstance(value, Mapping):
        parts = [_vectors(f"{name}.{key}" if name else key, part) for key, part in value.items()]
        return {key: vector for part in parts for key, vector in part.items()}
    value = np.asarray(value)
    if value.dtype.kind not in "biufUOM" or value.size < 2 or value.ndim > 2:
        return {}
    if value.dtype.kind == "O" and not all(isinstance(cell, str) for cell in value.flat):
        return {}
    if value.ndim == 1 or 1 in value.shape:
        return {name: value.ravel()}
    return {f"{name}:{j + 1}": value[:, j] for j in range(value.shape[1])}


def _read_mat(path: Path) -> Table:
    with path.open("rb") as file:
        head = file.read(520)
    if b"\x89HDF\r\n\x1a\n" in head:  # version 7.3 is HDF5 behind a block of 512 bytes
        with optional("h5py", path).File(path, "r") as file:
            return Table(_vectors("", _hdf5(file)), 1, [])
    matlab = optional("scipy.io", path)
    try:
        content = matlab.loadmat(path, simplify_cells=True)
    except Exception as error:  # scipy raises many types on damaged files, none of them its own
        raise ValueError(f"{path}: this is no readable MATLAB file: {error}.") from error
    content = {key: value for key, value in content.items() if not key.startswith("__")}
    return Table(_vectors("", content), 1, [])


def _hdf5(group: Any) -> dict[str, Any]:
    """Variables of a version 7.3 file; MATLAB's axes are in reverse order there."""
    content = {}
    for key, item in group.items():
        if hasattr(item, "keys"):
            if not key.startswith("#"):
                content[key] = _hdf5(item)
        elif item.dtype.kind in "biuf" and "MATLAB_empty" not in item.attrs:
            content[key] = np.asarray(item).T
    return content


def _read_npz(path: Path) -> Table:
    try:
        with np.load(path, allow_pickle=False) as content:
            if not hasattr(content, "files"):
                raise ValueError("it holds a single array without a name")
            return Table(_vectors("", {key: content[key] for key in content.files}), 1, [])
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: this is no readable NumPy .npz file: {error}.") from error


_LOADERS: dict[str, Callable[[Path], Table]] = {
    "csv": _read_csv,
    "txt": _read_csv,
    "tsv": _read_csv,
    "parquet": _read_parquet,
    "mat": _read_mat,
    "npz": _read_npz,
}
