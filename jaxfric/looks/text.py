"""Paragraphs and tables as plain text, and pytrees that print as such."""

import textwrap
from collections.abc import Callable, Iterable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import numpy as np

WIDTH = 98
# What to do with a batch of results where one is wanted.
A_ROW = "Of a batch take a row: fits[0], or each: for fit in fits."


class Table(NamedTuple):
    """Rows of cells, the first of them the heads; the cells of `numeric` columns end in line."""

    rows: Sequence[Sequence[str]]
    numeric: Sequence[int] = ()


# A table, or paragraphs; one that begins with spaces is indented by them.
Block = Table | list[str]


def text(blocks: Iterable[Block]) -> str:
    """The blocks that hold anything, with an empty line between them."""
    return "\n\n".join("\n".join(_lines(block)) for block in blocks if block)


def _lines(block: Block) -> list[str]:
    if isinstance(block, Table):
        return aligned(block.rows, block.numeric)
    return [line for paragraph in block for line in wrapped(paragraph)]


def wrapped(paragraph: str) -> list[str]:
    """A paragraph in lines; names of files stay whole."""
    words = paragraph.lstrip(" ")
    indent = " " * (len(paragraph) - len(words))
    lines = textwrap.wrap(words, WIDTH, break_long_words=False, break_on_hyphens=False)
    return [indent + line for line in lines]


def aligned(table: Sequence[Sequence[str]], numeric: Sequence[int]) -> list[str]:
    """Columns of one width each, numbers to the right."""
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if i in numeric else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in table
    ]


def on_host(tree: Any) -> Any:
    """The pytree with arrays of numpy, so that reading it compiles nothing.

    **Raises:** `TypeError` where a leaf has no value: a tracer, a shape, anything but numbers.
    """
    return jax.tree.map(_array, tree)


def _array(leaf: Any) -> np.ndarray:
    array = np.asarray(leaf)
    if array.dtype == object:
        raise TypeError(f"{type(leaf).__name__} is no array of numbers.")
    return array


def shown(tree: Any, blocks: Callable[[Any], Iterable[Block]]) -> str:
    """The text of a pytree, given what to say of it on the host; without values its structure."""
    # Of a result that holds no number of a result, equinox cannot tell the structure.
    name = f"<{type(tree).__name__}>"
    return attempt(
        lambda: text(blocks(on_host(tree))),
        lambda: attempt(lambda: eqx.tree_pformat(tree), lambda: name),
    )


def attempt(make: Callable[[], str], otherwise: Callable[[], str]) -> str:
    """What is made, or else the other: whatever stands in a result, `repr` must not raise."""
    try:
        return make()
    except Exception:
        return otherwise()
