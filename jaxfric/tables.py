"""Files to named columns: CSV, Parquet, MATLAB `.mat`, NumPy `.npz`."""

import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .delimited import Table, arrow_column, read_csv


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


def _read_parquet(path: Path) -> Table:
    parquet, pa = optional("pyarrow.parquet", path), optional("pyarrow", path)
    try:
        table = parquet.ParquetFile(path).read()
    except pa.ArrowInvalid as error:
        raise ValueError(f"{path}: this is no readable Parquet file: {error}.") from error
    names = [field.name for field in table.schema if not pa.types.is_nested(field.type)]
    return Table({name: arrow_column(table[name]) for name in names}, 1, [])


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
    content: dict[str, Any] = {}
    for key, item in group.items():
        if hasattr(item, "keys"):
            if not key.startswith("#"):
                content[key] = _hdf5(item)
        elif item.dtype.kind in "biuf" and "MATLAB_empty" not in item.attrs:
            content[key] = np.asarray(item).T
    return content


def _read_npz(path: Path) -> Table:
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as content:
            if not hasattr(content, "files"):
                raise ValueError("it holds a single array without a name")
            return Table(_vectors("", {key: content[key] for key in content.files}), 1, [])
    except (ValueError, EOFError, zipfile.BadZipFile) as error:
        raise ValueError(f"{path}: this is no readable NumPy .npz file: {error}.") from error


_LOADERS: dict[str, Callable[[Path], Table]] = {
    "csv": read_csv,
    "txt": read_csv,
    "tsv": read_csv,
    "parquet": _read_parquet,
    "mat": _read_mat,
    "npz": _read_npz,
}
