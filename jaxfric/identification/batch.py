"""Many identifications as one text, and as columns of a table."""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..checks import KINDS
from ..looks.text import A_ROW, Block, Table
from ..models import name_of

# Rows named one by one.
NAMED = 8


def blocks(found: Any, results: Sequence[str]) -> Iterator[Block]:
    """What to say of an `Identified` with leading axes, of arrays of numpy.

    **Arguments:** `results`, the names of its results, in the order of their numbers.
    """
    ends = np.array(results)[np.ravel(found.result._value)]
    fine = ends == "successful"
    others = [f"{count} {name}" for name, count in Counter(ends[~fine]).most_common()]
    counts = ", ".join([f"{np.count_nonzero(fine)} successful", *others])
    windows = found.projection.replace("_", " ")
    yield [f"{ends.size} recordings: {counts}", f"model {name_of(found.model.term)}; {windows}"]
    yield Table(_table(found, fine if fine.any() else ~fine), (1, 2, 3, 4))
    told = [] if fine.any() else ["None is successful: these are all rows."]
    if fine.any() and not fine.all():
        told += [f"Of the successful rows; not successful: {_rows(np.flatnonzero(~fine))}."]
    yield [*told, *_warnings(found), A_ROW]


def _table(found: Any, chosen: np.ndarray) -> list[list[str]]:
    table = [["parameter", "median", "10 %", "90 %", "± 95 %", "unit"]]
    for name, estimate in found.parameters.items():
        low, high = estimate.interval()
        half = 0.5 * (np.ravel(high) - np.ravel(low))[chosen]
        seen = np.isfinite(half)
        values = np.ravel(estimate.value)[chosen][seen]
        width = f"{np.median(half[seen]):.2g}" if seen.any() else "not visible"
        table.append([name, *_spread(values, "{:.5g}"), width, estimate.unit])
    errors = np.ravel(found.filtered_force_error)[chosen]
    errors = errors[np.isfinite(errors)]
    return [*table, ["filtered force error", *_spread(errors, "{:.2%}"), "", ""]]


def _spread(values: np.ndarray, form: str) -> list[str]:
    """Median and the quantiles of 10 and 90 %."""
    if not values.size:
        return ["-"] * 3
    return [form.format(np.quantile(values, share)) for share in (0.5, 0.1, 0.9)]


def _rows(places: np.ndarray) -> str:
    some = ", ".join(map(str, places[:NAMED]))
    more = f" and {places.size - NAMED} more" if places.size > NAMED else ""
    return f"row{'s' * (places.size > 1)} {some}{more}"


def _warnings(found: Any) -> list[str]:
    """Each fault that was found, and in which rows."""
    there = np.isfinite(found.warnings.reshape(-1, found.warnings.shape[-1]))
    return [
        f"Warning: {kind.name.replace('_', ' ')} in {_rows(np.flatnonzero(column))}."
        for kind, column in zip(KINDS, there.T, strict=True)
        if kind.text and column.any()
    ]


def columns(found: Any, results: Sequence[str]) -> dict[str, list]:
    """The parameters of an `Identified`, of arrays of numpy, by column; of a batch row by row."""
    parameters, size = found.parameters, np.size(found.result._value)
    table: dict[str, list] = {"row": [row for row in range(size) for _ in parameters]}
    table["parameter"] = list(parameters) * size
    bounds = {name: estimate.interval() for name, estimate in parameters.items()}
    numbers = {
        "value": [estimate.value for estimate in parameters.values()],
        "standard_error": [estimate.standard_error for estimate in parameters.values()],
        "low": [low for low, _ in bounds.values()],
        "high": [high for _, high in bounds.values()],
    }
    for name, values in numbers.items():
        table[name] = np.stack([np.ravel(value) for value in values], 1).ravel().tolist()
    table["unit"] = [estimate.unit for estimate in parameters.values()] * size
    ends = np.ravel(found.result._value)
    table["result"] = [results[end] for end in ends for _ in parameters]
    if np.ndim(found.result._value) == 0:
        del table["row"], table["result"]
    return table
