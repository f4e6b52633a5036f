"""Text that a spreadsheet, a locale or a careless copy has been through."""

import numpy as np
from numpy.random import Generator

from .logs import Log
from .mistake import Mistake


def _text(log: Log, **changes) -> Log:
    return log._replace(text=log.text._replace(**changes))


def _decimal_comma(log: Log, rng: Generator, other: Log) -> Log:
    return _text(log, delimiter=";", decimal=",")


def _decimal_commas_between_tabs(log: Log, rng: Generator, other: Log) -> Log:
    return _text(log, delimiter="\t", decimal=",")


def _decimal_commas_in_one_column(log: Log, rng: Generator, other: Log) -> Log:
    """Tabs between the cells; of the force alone the point has become a comma."""
    place = [r for r in ("time", "position", "velocity", "force") if r in log.columns].index(
        "force"
    )

    def finish(lines):
        rows = [line.split("\t") for line in lines]
        for row in rows[1:]:
            row[place] = row[place].replace(".", ",")
        return ["\t".join(row) for row in rows]

    return _text(log, delimiter="\t", finish=finish)


def _thousands_grouped(log: Log, rng: Generator, other: Log) -> Log:
    """12,345.6 for the force in a tab-separated file, rounded to a tenth."""
    log = log.scaled(force=2e4 / float(np.max(np.abs(log.columns["force"]))))
    place = [r for r in ("time", "position", "velocity", "force") if r in log.columns].index(
        "force"
    )
    point = rng.random() < 0.5

    def finish(lines):
        rows = [line.split("\t") for line in lines]
        for row in rows[1:]:
            value = float(row[place])
            row[place] = f"{value:,.1f}" if point else f"{value:,.0f}"
        return ["\t".join(row) for row in rows]

    return _text(log, delimiter="\t", finish=finish)


def _header_twice(log: Log, rng: Generator, other: Log) -> Log:
    return _text(log, finish=lambda lines: [lines[0], *lines])


def _header_again_in_the_middle(log: Log, rng: Generator, other: Log) -> Log:
    at = log.size // 2
    return _text(log, finish=lambda lines: [*lines[:at], lines[0], *lines[at:]])


def _units_under_the_header(log: Log, rng: Generator, other: Log) -> Log:
    """Milliseconds, stated in a row of their own."""
    log = log.having(time=1e3 * log.columns["time"])
    units = {"time": "ms", "position": "m", "velocity": "m/s", "force": "N", "reference": "m"}
    row = ",".join(units[r] for r in units if r in log.columns)
    return _text(log, finish=lambda lines: [lines[0], row, *lines[1:]])


def _no_header(log: Log, rng: Generator, other: Log) -> Log:
    return _text(log, finish=lambda lines: lines[1:])


def _summary_at_the_end(log: Log, rng: Generator, other: Log) -> Log:
    """The mean of every column in a last row, without a word."""
    roles = [r for r in ("time", "position", "velocity", "force", "reference") if r in log.columns]
    mean = ",".join(f"{float(np.mean(log.columns[role])):.10g}" for role in roles)
    return _text(log, finish=lambda lines: [*lines, mean])


def _few_digits(log: Log, rng: Generator, other: Log) -> Log:
    """Three or four digits of everything but the time, as `%g` or a display give."""
    digits = int(rng.integers(3, 5))
    columns = {
        role: np.array([float(f"{v:.{digits}g}") for v in x.tolist()])
        for role, x in log.columns.items() if role != "time"
    }  # fmt: skip
    return log.having(**columns)


def _few_digits_of_a_long_clock(log: Log, rng: Generator, other: Log) -> Log:
    """Seconds since 1970 in single precision: many samples share a stamp."""
    time = (1.7e9 + log.columns["time"]).astype(np.float32)
    return log.having(time=time.astype(float))


MISTAKES = (
    Mistake(_decimal_comma, "text"),
    Mistake(_decimal_commas_between_tabs, "text"),
    Mistake(_decimal_commas_in_one_column, "text"),
    Mistake(_thousands_grouped, "text"),
    Mistake(_header_twice, "text"),
    Mistake(_header_again_in_the_middle, "text"),
    Mistake(_units_under_the_header, "text"),
    Mistake(_no_header, "text"),
    Mistake(_summary_at_the_end, "text"),
    Mistake(_few_digits, "text"),
    Mistake(_few_digits_of_a_long_clock, "text"),
)
