"""`jaxfric fleet`: many recordings into one table, with its outliers and drifts."""

import os
import time
from argparse import Namespace
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import jax

from .. import fleet
from ..data.io import write_bytes
from ..data.targets import same
from ..fleet import journal, running, tables, telling
from .commands import check_bounds, reading, show_progress
from .messages import say


def run(arguments: Namespace) -> int:
    """Identify what is left of the files, write the table, say what stands out."""
    check_bounds(arguments.model, arguments.bounds)
    tables.check(arguments.out)
    _devices(arguments)
    files = _files(arguments)
    if arguments.plot:
        from ..report import fleet as picture, pictures

        pictures.library()
    if arguments.restart:
        journal.forget(arguments.out, jax.process_index(), jax.process_count())
        running.together("restart")
    progress = Progress(len(files))
    kept, rows = fleet.run(
        files, arguments.out, _options(arguments), jobs=_jobs(arguments), tell=progress
    )
    progress.end()
    if jax.process_index():
        return 0
    _check_any(files, rows, kept)
    fleet.write(arguments.out, tables.columns(files, rows, arguments.model))
    found = fleet.compare(files, rows)
    if arguments.plot:
        format = Path(arguments.plot).suffix.lstrip(".").lower()
        write_bytes(arguments.plot, picture.render(files, rows, found, format))
    kept.remove()
    say(f"{arguments.out}: {len(files)} recordings, model {arguments.model}; ", end="")
    say(telling.summary(files, rows, found))
    for sentence in fleet.mixed_units(files, rows, arguments.model):
        say(f"\n{sentence}")
    if troubles := telling.troubles(files, rows):
        say(f"\n{troubles}")
    return 0


def _files(arguments: Namespace) -> list[fleet.File]:
    """The recordings; an earlier table that the patterns match is none, and will be replaced."""
    matching = fleet.find(arguments.patterns, arguments.axis, arguments.group)
    files = [file for file in matching if not same(file.path, arguments.out)]
    if len(files) < len(matching) and not tables.is_one(arguments.out):
        raise ValueError(
            f"{arguments.out}: is one of the recordings, which --out would replace; name another."
        )
    if not files:
        raise ValueError(f"{arguments.out}: is the only file that matches.")
    return files


def _options(arguments: Namespace) -> fleet.Options:
    how = arguments.model, arguments.projection, arguments.bounds
    return fleet.Options(*how, **reading(arguments))


def _jobs(arguments: Namespace) -> int:
    if arguments.jobs:
        return arguments.jobs
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _devices(arguments: Namespace) -> None:
    """A device a core, before jax has looked for devices; and the other processes."""
    if "xla_force_host_platform_device_count" not in os.environ.get("XLA_FLAGS", ""):
        with suppress(RuntimeError):  # this process has used jax before: its devices stay
            jax.config.update("jax_num_cpu_devices", _jobs(arguments))
    if arguments.process:
        index, count, address = arguments.process
        try:
            jax.distributed.initialize(address, count, index)
        except RuntimeError as error:
            raise ValueError(f"--process: the others are not reached: {error}") from error


def _check_any(files: Sequence[fleet.File], rows, kept: journal.Journal) -> None:
    """Where every file fails, what was asked for is wrong."""
    failed = [file for file in files if rows[file.path]["result"] == "failed"]
    if len(failed) == len(files):
        kept.remove()
        raise ValueError(f"none of {len(files)} files: {rows[failed[0].path]['reason']}")


class Progress:
    """How many rows there are and how long the rest will take; on a terminal only."""

    def __init__(self, total: int):
        self._total, self._start = total, time.monotonic()

    def __call__(self, done: int, new: int, total: int) -> None:
        left = ""
        if new:
            seconds = (time.monotonic() - self._start) / new * (total - done)
            left = f", {span(seconds)} left"
        show_progress(f"{done}/{total} recordings{left}")

    def end(self) -> None:
        """Leave the line empty."""
        show_progress("")


def span(seconds: float) -> str:
    """A duration in words."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    minutes = round(seconds / 60)
    return f"{minutes // 60} h {minutes % 60} min" if minutes >= 60 else f"{minutes} min"
