"""Files read ahead of the identification, each made ready for its batch."""

import dataclasses
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import islice
from typing import Any, NamedTuple

import jax
import numpy as np

from .. import checks
from ..data import summary
from ..data.io import read_with_notes
from ..data.recording import Recording, uniform
from ..signals import Ready, kernel_half_width
from .files import File


class Item(NamedTuple):
    """A recording that waits for its batch, its half-width of the weak form's kernel, its faults.

    Its velocity and the half-width are those that it would have alone, so that its result does not
    depend on its batch.
    """

    file: File
    facts: dict[str, Any]
    recording: Recording
    width: int
    faults: np.ndarray

    @property
    def kind(self) -> tuple:
        """What recordings of one batch have in common, so that one program serves them."""
        signals = self.recording
        shape = (signals.num_samples, signals.num_segments, signals.position is None)
        return (*shape, signals.units, self.width)


class Failure(NamedTuple):
    """A file that could not be made ready, and why."""

    file: File
    reason: str


def ahead(
    files: Iterable[File], how: Mapping[str, Any], threads: int, most: int
) -> Iterator[Item | Failure]:
    """The files in order, `most` of them read or being read before they are asked for.

    **Arguments:** `how`, the arguments of [`jaxfric.read`][]; `threads`, how many read at once.
    """
    left = iter(files)
    with ThreadPoolExecutor(threads) as pool:
        waiting = deque(pool.submit(_ready, file, how) for file in islice(left, most))
        try:
            while waiting:
                yield waiting.popleft().result()
                waiting.extend(pool.submit(_ready, file, how) for file in islice(left, 1))
        finally:
            pool.shutdown(cancel_futures=True)


def _ready(file: File, how: Mapping[str, Any]) -> Item | Failure:
    try:
        recording, notes = read_with_notes(file.path, **how)
        facts = summary.facts(recording, notes)
        # The named models know velocity only: other channels need not be carried along.
        log = uniform(dataclasses.replace(recording, channels={}))
        ready = Ready.of(log)
        width, faults = kernel_half_width(ready.recording), checks.recorded(log, ready)
        return Item(file, facts, jax.tree.map(np.asarray, ready.recording), width, faults)
    except (ValueError, OSError) as error:
        return Failure(file, str(error))
    except MemoryError:
        return Failure(file, f"{file.path}: out of memory; split the file.")
    except Exception as error:  # a fleet of thousands outlives any one of them
        return Failure(file, f"{file.path}: {type(error).__name__}: {error}")
