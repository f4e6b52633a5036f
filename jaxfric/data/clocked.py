"""A clock for a log that has none but was taken at a steady rate."""

import math
from collections.abc import Mapping

import numpy as np

from .delimited import Table
from .roles import describe

# A name that no file has.
CLOCK = "time [s] (stated rate)"


def clocked(
    table: Table, rate: float, columns: Mapping[str, str | None] | None, source: str
) -> Table:
    """The table with a time column by a stated rate, samples per second.

    **Raises:** `ValueError` for a rate that is none, or where the file has a time column.
    """
    if not (math.isfinite(rate) and rate > 0):
        raise ValueError(f"{source}: the rate is {rate}; give samples per second, over zero.")
    given = (columns or {}).get("time")
    own = given or next((name for name in table.columns if describe(name)[0] == "time"), None)
    if own and given != "":
        raise ValueError(
            f"{source}: --rate (rate=) is for files without a clock, and {own!r} is one. Leave out "
            "the rate, or the column: --columns time= (columns={'time': ''})."
        )
    lengths = {len(column) for column in table.columns.values()}
    time = np.arange(max(lengths, default=0)) / rate
    note = f"The file has no time column; the time is counted at the stated {rate:g} Hz."
    return table._replace(columns={CLOCK: time, **table.columns}, notes=[*table.notes, note])
