"""The same as HTML for notebooks: tables, paragraphs and a picture, every text escaped."""

from base64 import b64encode
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from html import escape
from typing import Any

from . import drawing
from .text import Block, Table, attempt, on_host

# Draws on a figure of matplotlib.
Draw = Callable[[Any], Any]

_STYLE = (
    ".jaxfric table { border-collapse: collapse; margin: .4rem 0; } "
    ".jaxfric th, .jaxfric td { text-align: left; padding: .15rem 1rem .15rem 0; } "
    ".jaxfric th.number, .jaxfric td.number { text-align: right; } "
    ".jaxfric p { margin: .3rem 0; max-width: 50rem; } .jaxfric img { max-width: 100%; }"
)


def table(head: Sequence[str], rows: Iterable[Sequence[str]], numeric: Sequence[int] = ()) -> str:
    """A table of plain text; nothing for no row."""
    body = "\n".join(f"<tr>{_cells(row, 'td', numeric)}</tr>" for row in rows)
    if not body:
        return ""
    top = _cells(head, "th", numeric)
    return f"<table>\n<thead><tr>{top}</tr></thead>\n<tbody>\n{body}\n</tbody></table>"


def _cells(row: Sequence[str], tag: str, numeric: Sequence[int]) -> str:
    marks = [' class="number"' if i in numeric else "" for i in range(len(row))]
    pairs = zip(row, marks, strict=True)
    return "".join(f"<{tag}{mark}>{escape(str(cell))}</{tag}>" for cell, mark in pairs)


def html(blocks: Iterable[Block], picture: bytes | None = None) -> str:
    """The blocks as a piece of HTML, with a PNG below them."""
    parts = [_block(block) for block in blocks if block]
    if picture:
        data = b64encode(picture).decode()
        parts.append(f'<img alt="" src="data:image/png;base64,{data}">')
    body = "\n".join(parts)
    return f'<div class="jaxfric">\n<style>{_STYLE}</style>\n{body}\n</div>'


def _block(block: Block) -> str:
    if isinstance(block, Table):
        return table(block.rows[0], block.rows[1:], block.numeric)
    return "\n".join(_paragraph(each) for each in block)


def _paragraph(paragraph: str) -> str:
    words = paragraph.lstrip(" ")
    indent = (len(paragraph) - len(words)) / 2
    style = f' style="margin-left: {indent:g}em"' if indent else ""
    return f"<p{style}>{escape(words)}</p>"


def shown(tree: Any, blocks: Callable[[Any], Iterable[Block]], draw: Draw | None = None) -> str:
    """The HTML of a pytree, given what to say of it on the host and what draws it on a figure.

    Without matplotlib there is no picture; without values there is the structure.
    """
    return attempt(
        lambda: html(blocks(on_host(tree)), png(draw)), lambda: f"<pre>{escape(repr(tree))}</pre>"
    )


def png(draw: Draw | None) -> bytes | None:
    """What draws on a figure as a PNG; `None` where it cannot, or without matplotlib."""
    if draw is None:
        return None
    with suppress(Exception):
        figure = drawing.library()(layout="constrained")
        draw(figure)
        return drawing.saved(figure, "png", 90)
    return None
