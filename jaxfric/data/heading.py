"""The head of a delimited text file: lines above the table, names, units, decimal sign."""

import csv
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from .iso import is_moment
from .printable import short
from .spellings import is_unit

DELIMITERS = ",;\t|"
# Ten thousand columns with names of a hundred characters.
_LONGEST_LINE = 1_000_000
# A tool writes its settings above the table, a line each.
_ABOVE = 200


class Dialect(NamedTuple):
    """How a table is written: names, lines before the first sample, delimiter, decimal sign.

    `notes`: what above the table was left out.
    """

    header: list[str]
    first: int
    delimiter: str | None  # None: blanks
    decimal: str
    notes: tuple[str, ...] = ()


def dialect(lines: list[str], path: Path) -> Dialect:
    """How a table is written, from its first lines; `#` starts a comment.

    **Raises:** `ValueError` if there is no line, or one that is longer than any of a table.
    """
    rows = [i for i, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    if not rows:
        raise without_samples(path)
    if len(lines[rows[0]]) > _LONGEST_LINE:
        raise ValueError(
            f"{path}: row {rows[0] + 1} has {len(lines[rows[0]])} characters, more than any row of "
            "a log. Is this text, with a line for each sample?"
        )
    above, delimiter = _above(lines, rows)
    rows = rows[above:]
    notes = (f"{above} line{'s' * (above > 1)} above the table left out.",) if above else ()
    cells = split(lines[rows[0]], delimiter)
    if all(map(_is_value, cells)):
        comment = lines[rows[0] - 1].lstrip("# ") if rows[0] else ""
        header, first = split(comment, delimiter), rows[0]
        if len(header) != len(cells):
            header = [f"column{i + 1}" for i in range(len(cells))]
    else:
        header, first = cells, rows[0] + 1
        if len(rows) > 2 and _are_units(split(lines[rows[1]], delimiter), len(cells)):
            units = split(lines[rows[1]], delimiter)
            header = [f"{name} [{u.strip('[]()')}]" if u else name
                      for name, u in zip(cells, units, strict=True)]  # fmt: skip
            first, rows = rows[1] + 1, rows[1:]
    data = rows[1] if len(rows) > 1 else rows[0]
    comma = any(re.match(r"\s*[-+]?\d+,\d+", cell) for cell in split(lines[data], delimiter))
    decimal = "," if delimiter != "," and comma else "."
    return Dialect(unique(header), first, delimiter, decimal, notes)


def without_samples(path: Path, header: Sequence[str] = ()) -> ValueError:
    """That a file holds nothing below its header, which may as well be the text of no log."""
    found = f" below its first line, {short(', '.join(header))!r}" if header else ""
    return ValueError(
        f"{path}: the file holds no samples{found}. A log has a line of names (time, force, "
        "position or velocity), then a line of numbers for each sample."
    )


def _above(lines: list[str], rows: list[int]) -> tuple[int, str | None]:
    """How many lines of text stand above the names, in another number of cells than the table,
    and the delimiter: the one of the first samples, for text may hold any of them.
    """
    for k, (row, below) in enumerate(zip(rows[:_ABOVE], rows[1:], strict=False)):
        delimiter = _delimiter(lines[below])
        cells, numbers = split(lines[row], delimiter), split(lines[below], delimiter)
        if len(cells) == len(numbers) > 1 and _is_row(numbers):
            if any(map(_is_value, cells)):
                return 0, delimiter
            named = k and _are_units(cells, len(split(lines[rows[k - 1]], delimiter)))
            return (k - 1 if named else k), delimiter
    return 0, _delimiter(lines[rows[0]])


def _is_row(cells: list[str]) -> bool:
    return _is_value(cells[0]) and all(_is_value(cell) for cell in cells if cell)


def _are_units(cells: list[str], count: int) -> bool:
    """Whether the cells state the units of as many columns."""
    units = [cell.strip("[]()") for cell in cells]
    return len(units) == count and any(units) and all(is_unit(unit) for unit in units if unit)


def _delimiter(line: str) -> str | None:
    """What leaves the most of a line's cells numbers: `0,5;1,2` is two, or three of one number.

    Of several the one that is there most often, and blanks last.
    """

    def numbers(delimiter: str | None) -> tuple[float, int]:
        cells = [cell for cell in split(line, delimiter) if cell]
        share = sum(map(_is_value, cells)) / max(len(cells), 1)
        return share, line.count(delimiter) if delimiter else 0

    return max([*(each for each in DELIMITERS if each in line), None], key=numbers)


def split(line: str, delimiter: str | None) -> list[str]:
    """The cells of a line."""
    if delimiter is None:
        return line.split()
    # A quotation mark that stays open is found where the rows are read.
    with suppress(csv.Error):
        return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter), [])]
    return [cell.strip() for cell in line.split(delimiter)]


def _is_value(text: str) -> bool:
    """Whether a cell is a number or a date, as of a sample."""
    return _is_number(text) or is_moment(text)


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def unique(names: list[str]) -> list[str]:
    """Names with repeats numbered, `x` and `x (2)`: as synonyms they stay ambiguous.

    A column without a name has its number, so that it can be named.
    """
    names = [name or f"column{i + 1}" for i, name in enumerate(names)]
    seen: dict[str, int] = {}
    result = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        result.append(name if seen[name] == 1 else f"{name} ({seen[name]})")
    return result
