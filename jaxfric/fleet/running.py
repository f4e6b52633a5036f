"""A fleet from files to rows."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import jax

from .. import models
from ..data.io import READING
from ..data.tables import optional
from ..identification import devices
from .batches import Batches, failed
from .files import File
from .journal import Journal, Row
from .reading import Failure, ahead


class Options(NamedTuple):
    """All that the rows of a fleet depend on, beside its files.

    `model`, a name; `projection`, "auto", "closed-windows" or "weak-form"; `bounds` of nonlinear
    parameters; `columns`, `scale`, `units`, `period`, `repair`, `rate` and
    `counts_per_rev` as [`jaxfric.read`][] takes them.
    """

    model: str = "gaussian"
    projection: str = "auto"
    bounds: Mapping[str, tuple[float, float]] = {}
    columns: Mapping[str, str | None] = {}
    scale: Mapping[str, float] = {}
    units: Mapping[str, str] = {}
    period: Mapping[str, float] = {}
    repair: bool = True
    rate: float | None = None
    counts_per_rev: float | None = None

    @property
    def reading(self) -> dict[str, Any]:
        """The arguments of [`jaxfric.read`][]."""
        return {name: getattr(self, name) for name in READING}


def run(
    files: Sequence[File],
    out: str | os.PathLike,
    options: Options,
    *,
    jobs: int = 1,
    tell: Callable[[int, int, int], None] = lambda done, new, total: None,
) -> tuple[Journal, dict[str, Row]]:
    """The row of every file, by path; rows made by an earlier run for the same output are kept.

    Files are read by `jobs` threads while others are identified, on all devices of this process.
    With several processes (`jax.distributed`) each takes its share of the files; all of them
    return all rows.

    **Arguments:** `out`, the output that the rows are for: they are kept beside it until
    `Journal.remove`; `tell`, called with the rows that are there, those of them that this run
    made, and the number of files.

    **Raises:** `ValueError` for what the user has to know before any file is read.
    """
    models.named(options.model)
    for suffix, library in ((".parquet", "pyarrow.parquet"), (".mat", "scipy.io")):
        if first := next((f for f in files if f.path.lower().endswith(suffix)), None):
            optional(library, first.path)
    index, count = jax.process_index(), jax.process_count()
    journal = Journal(out, options._asdict(), index)
    with journal:
        there = journal.rows(files)
        # What could not be read may be readable by now.
        there = {path: row for path, row in there.items() if row["result"] != "failed"}
        left = [f for f in files[index::count] if f.path not in there]
        known, new = len(there), 0
        tell(known, 0, len(files))
        for rows in _rows(left, options, jobs):
            journal.add(rows)
            new += len(rows)
            tell(known + new, new, len(files))
        together("rows")
    return journal, journal.rows(files)


def _rows(files: Sequence[File], options: Options, jobs: int) -> Iterator[list[tuple[File, Row]]]:
    """Rows as they become ready, in bundles."""
    over = devices.mesh(jax.local_devices())
    batches = Batches(options.model, options.projection, options.bounds, over, len(files))
    for item in ahead(files, options.reading, jobs, most=4 * jobs):
        if isinstance(item, Failure):
            yield [(item.file, failed(None, item.reason))]
        elif rows := [(i.file, row) for i, row in batches.add(item)]:
            yield rows
    if rows := [(i.file, row) for i, row in batches.flush()]:
        yield rows


def together(point: str) -> None:
    """Wait until every process has come as far as this point."""
    if jax.process_count() > 1:
        from jax.experimental import multihost_utils

        multihost_utils.sync_global_devices(f"jaxfric.fleet.{point}")
