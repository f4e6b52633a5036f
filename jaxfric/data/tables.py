"""Files to named columns: CSV, Parquet, MATLAB `.mat`, NumPy `.npz`, robots' bags."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from . import bags, vectors
from .delimited import Table, arrow_column, read_csv
from .heading import unique

# What a table that is in no file is called in messages.
IN_MEMORY = "(table in memory)"


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
    if path.is_dir() and bags.is_bag(path):
        suffix = bags.SUFFIXES[0]
    elif path.is_dir():
        raise ValueError(
            f"{path}: is a folder; name a file in it, or identify all of them: "
            f"jaxfric fleet '{path}/*.csv'."
        )
    if not path.is_file() and not bags.is_bag(path):
        special = "is no regular file; save its content as one" if path.exists() else ""
        raise ValueError(f"{path}: {special or 'there is no such file'}.")
    if suffix not in _LOADERS:
        raise ValueError(
            f"{path}: the format {suffix or '(no suffix)'!r} is not known. Known are "
            f"{', '.join(sorted(_LOADERS))}; name one with format=."
        )
    if path.stat().st_size == 0:
        raise ValueError(f"{path}: the file is empty.")
    try:
        return _LOADERS[suffix](path)
    except OSError as error:
        raise ValueError(
            f"{path}: the file cannot be read: {_sentence(error)} Is it whole, and yours to read?"
        ) from error


def in_memory(table: Any) -> Table:
    """The columns of a mapping from names to arrays, or of a frame of pandas or polars; where a
    frame's rows have an index that has a name or is of moments, that is a column, too.

    **Raises:** `ValueError` if it is no such thing, or holds no columns.
    """
    content = dict(table) if isinstance(table, Mapping) else {}
    if hasattr(table, "columns"):
        index = getattr(table, "index", None)
        if index is not None and (index.name or np.asarray(index).dtype.kind == "M"):
            content[str(index.name or "time")] = np.asarray(index)
        content |= {str(name): np.asarray(table[name]) for name in table.columns}
    columns = _vectors("", _named({name: np.asarray(c) for name, c in content.items()}))
    if not columns:
        raise ValueError(
            f"{IN_MEMORY}: a {type(table).__name__} holds no columns. Give the path of a log, or a "
            "mapping from names to arrays of equal length, or a frame of pandas or polars."
        )
    return Table(columns, 1, [])


def _sentence(error: Exception) -> str:
    text = " ".join(str(error).split()).strip("'\"").rstrip(".")
    return f"{text or type(error).__name__}."


@contextmanager
def _damage(path: Path, kind: str) -> Iterator[None]:
    """What a library raises on a damaged file, which may be anything, as a `ValueError`."""
    try:
        yield
    except (OSError, MemoryError):
        raise
    except Exception as error:
        raise ValueError(
            f"{path}: this is no readable {kind} file: {_sentence(error)} Was it copied whole? "
            "Write it anew."
        ) from error


def _read_parquet(path: Path) -> Table:
    parquet, pa = optional("pyarrow.parquet", path), optional("pyarrow", path)
    with _damage(path, "Parquet"):
        # By number, for names may repeat.
        table = parquet.ParquetFile(path).read()
        flat = [i for i, field in enumerate(table.schema) if not pa.types.is_nested(field.type)]
        names = unique([table.schema.field(i).name for i in flat])
        columns = {n: arrow_column(table.column(i)) for n, i in zip(names, flat, strict=True)}
        nested = [i for i in range(table.num_columns) if i not in flat]
        for i in nested:
            columns |= vectors.spread(table.column(i), table.schema.field(i).name, path)
        if nested and vectors.EPISODE in columns:
            columns["segment"] = columns.pop(vectors.EPISODE)
    return Table(columns, 1, [])


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
        h5py, notes = optional("h5py", path), list[str]()
        with _damage(path, "MATLAB 7.3"), h5py.File(path, "r") as file:
            content = _hdf5(file, h5py, (file.id,), "", notes)
            return Table(_vectors("", content), 1, notes)
    matlab = optional("scipy.io", path)
    with _damage(path, "MATLAB"):
        content = matlab.loadmat(path, simplify_cells=True)
        content = {key: value for key, value in content.items() if not key.startswith("__")}
        return Table(_vectors("", content), 1, [])


def _hdf5(group: Any, h5py: Any, above: tuple, place: str, notes: list[str]) -> dict[str, Any]:
    """Variables of a version 7.3 file; MATLAB's axes are in reverse order there.

    `above`: the groups that this one is in, itself included, so that no link leads round for ever;
    `notes` gains a sentence for each link that is not followed.
    """
    content: dict[str, Any] = {}
    for key in group:
        if key.startswith("#"):
            continue
        link, name = group.get(key, getlink=True), f"{place}{key}"
        if isinstance(link, h5py.ExternalLink):
            notes.append(f"{name} is a link into another file, {link.filename}: left out.")
            continue
        item = group.get(key) if isinstance(link, h5py.SoftLink) else group[key]
        if item is None:
            notes.append(f"{name} is a link to {link.path}, which is not there: left out.")
        elif isinstance(item, h5py.Group):
            if item.id in above:
                notes.append(f"{name} is a link to a group that it is in: left out.")
            else:
                content[key] = _hdf5(item, h5py, (*above, item.id), f"{name}.", notes)
        elif isinstance(item, h5py.Dataset) and item.dtype.kind in "biuf":
            if "MATLAB_empty" not in item.attrs:
                content[key] = np.asarray(item).T
    return content


def _read_bag(path: Path) -> Table:
    bags.library(path)
    with _damage(path, "bag"):
        found = bags.states(path)
    return bags.table(path, found)


def _named(content: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Arrays `(T, joints)` with the joints' names, where an array of as many names is beside them:
    `elbow/q` instead of `q:2`.
    """
    lists = {k: v for k, v in content.items() if v.ndim == 1 and v.dtype.kind == "U"}
    found: dict[str, Any] = {}
    for key, value in content.items():
        names = [v for v in lists.values() if value.ndim == 2 and len(v) == value.shape[1]]
        if len(names) == 1 and len(set(names[0])) == len(names[0]):
            found |= {f"{name}/{key}": value[:, j] for j, name in enumerate(names[0].tolist())}
        else:
            found[key] = value
    matched = len(found) > len(content)
    return {k: v for k, v in found.items() if not (matched and k in lists)}


def _read_npz(path: Path) -> Table:
    with _damage(path, "NumPy .npz"), path.open("rb") as file:
        content = np.load(file, allow_pickle=False)
        if isinstance(content, np.ndarray):
            raise ValueError("it holds one array without a name, as .npy files do")
        arrays = {key: content[key] for key in content.files}
        return Table(_vectors("", _named(arrays)), 1, [])


_LOADERS: dict[str, Callable[[Path], Table]] = {
    "csv": read_csv,
    "txt": read_csv,
    "tsv": read_csv,
    "parquet": _read_parquet,
    "mat": _read_mat,
    "npz": _read_npz,
    **dict.fromkeys(bags.SUFFIXES, _read_bag),
}
