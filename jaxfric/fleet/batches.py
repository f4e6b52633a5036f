"""Recordings gathered into batches that few programs serve, and their rows."""

from collections.abc import Iterator, Mapping
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh

from ..data.recording import row_of
from ..identification import devices, documents
from ..identification.identified import Identified
from ..identification.identifying import LEAST_COVERED
from ..identification.projections import AbstractProjection, ClosedWindows, WeakForm
from ..identification.setup import set_up
from .journal import Row
from .reading import Item

# Rows a device in one batch: enough that starting it costs nothing beside its work.
ROWS = 32
# Samples a device in one batch: 2¹⁸ are some 10 MB of signals, and as much again of rows.
SAMPLES = 2**18
# Samples that wait for their batches to fill, some 200 MB of signals.
WAITING = 2**22


class Batches:
    """Recordings in, rows out, as soon as a batch is full.

    **Arguments:** `model`, a model's name; `projection`, "auto", "closed-windows" or "weak-form";
    `bounds`, of nonlinear parameters; `over`, the devices; `total`, how many recordings there will
    be: a batch need not hold more.
    """

    def __init__(
        self,
        model: str,
        projection: str,
        bounds: Mapping[str, tuple[float, float]],
        over: Mesh,
        total: int,
    ):
        self._model, self._projection, self._bounds, self._over = model, projection, bounds, over
        self._most = _power(min(ROWS, -(-total // over.size)))
        self._groups: dict[tuple, list[Item]] = {}

    def add(self, item: Item) -> Iterator[tuple[Item, Row]]:
        """The rows that became ready by one more recording."""
        weak = self._projection == "weak-form"
        yield from self._join(("weak_form" if weak else "closed_windows", *item.kind), item)
        while sum(i.recording.num_samples for g in self._groups.values() for i in g) > WAITING:
            yield from self._solve(max(self._groups, key=lambda key: len(self._groups[key])))

    def flush(self) -> Iterator[tuple[Item, Row]]:
        """The rows of all that still wait."""
        while self._groups:
            yield from self._solve(next(iter(self._groups)))

    def _join(self, key: tuple, item: Item) -> Iterator[tuple[Item, Row]]:
        group = self._groups.setdefault(key, [])
        group.append(item)
        if len(group) >= self._rows(item):
            yield from self._solve(key)

    def _rows(self, item: Item) -> int:
        fitting = _power(max(1, SAMPLES // item.recording.num_samples), up=False)
        return self._over.size * min(self._most, fitting)

    def _solve(self, key: tuple) -> Iterator[tuple[Item, Row]]:
        items = self._groups.pop(key)
        # One shape, one program: what a batch lacks is filled with its last recording.
        filled = items + items[-1:] * (self._rows(items[0]) - len(items))
        batch = jax.tree.map(lambda *rows: np.stack(rows), *(i.recording for i in filled))
        width = items[0].width
        projection: AbstractProjection = ClosedWindows()
        if key[0] == "weak_form":
            projection = WeakForm(width)
        try:
            how = self._model, batch, projection, self._bounds
            setup = set_up(*how, width=width, prepared=batch)
            faults = np.stack([item.faults for item in filled])
            found = devices.solve(setup, lambda: faults, self._over)
        except ValueError as error:  # too short for the kernel
            yield from ((item, failed(item, f"{item.file.path}: {error}")) for item in items)
            return
        for i, item in enumerate(items):
            alone = row_of(found, i)
            if self._projection == "auto" and key[0] != "weak_form":
                if alone.covered < LEAST_COVERED:
                    yield from self._join(("weak_form", *key[1:]), item)
                    continue
            yield item, row(alone, item)


def row(found: Identified, item: Item) -> Row:
    """One recording's row: circumstances, then each parameter's value, standard error and unit."""
    document = documents.identification(found)
    facts = {name: item.facts[name] for name in ("samples", "duration", "sample_rate")}
    kept = ("result", "projection", "windows", "covered", "filtered_force_error")
    # The severe ones are first.
    texts = [document["diagnosis"], *(w["text"] for w in document["warnings"][:1] if w["severe"])]
    reason = "" if document["result"] == "successful" else " ".join(texts)
    named = ", ".join(warning["name"] for warning in document["warnings"])
    circumstances = facts | {name: document[name] for name in kept}
    notes = " ".join(item.facts["notes"])
    return _finite(
        circumstances
        | {"reason": reason, "warnings": named, "notes": notes}
        | {"parameters": document["parameters"]}
    )


def failed(item: Item | None, reason: str) -> Row:
    """The row of a recording that gave no result."""
    facts = {} if item is None else item.facts
    known = {name: facts[name] for name in ("samples", "duration", "sample_rate") if name in facts}
    return _finite(known) | {"result": "failed", "reason": reason, "parameters": {}}


def _finite(value: Any) -> Any:
    """Plain data in which what is infinite or no number is `None`."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _power(count: int, up: bool = True) -> int:
    """The next power of two."""
    return 1 << ((count - 1).bit_length() if up else count.bit_length() - 1)
