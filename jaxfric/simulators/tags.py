"""Tags of a model's XML text, found where they stand, so that one attribute can be changed."""

import re
from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

# Elements that hold bodies, joints and geoms as if these stood outside of them.
FRAME = "frame"


class Tag(NamedTuple):
    """A start tag: its name, attributes, where it stands in bytes, and of whom it is a child."""

    name: str
    attributes: Mapping[str, str]
    start: int
    parent: int


def tags(text: str) -> list[Tag]:
    """The start tags of a text in their order."""
    found: list[Tag] = []
    open_: list[int] = []
    parser = expat.ParserCreate()

    def start(name, attributes):
        found.append(Tag(name, attributes, parser.CurrentByteIndex, open_[-1] if open_ else -1))
        open_.append(len(found) - 1)

    def end(name):
        open_.pop()

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(text.encode(), True)
    return found


class Bodies(NamedTuple):
    """Numbers of the tags of a model's bodies, in MuJoCo's order, with their joints and geoms."""

    bodies: list[int]
    children: list[dict[str, list[int]]]

    @property
    def joints(self) -> list[int]:
        """Those of all joints, in MuJoCo's order."""
        return [n for own in self.children for n in own["joint"]]


def bodies(found: list[Tag]) -> Bodies:
    """The bodies of the world, depth first, as MuJoCo numbers them from 1."""
    world = [i for i, tag in enumerate(found) if tag.name == "worldbody"]
    order = [i for i, tag in enumerate(found) if tag.name == "body" and _above(found, i, world)]
    children = []
    for body in order:
        own: dict[str, list[int]] = {"joint": [], "geom": [], "inertial": []}
        for i, tag in enumerate(found):
            if tag.name in own and _holder(found, i) == body:
                own[tag.name].append(i)
        children.append(own)
    return Bodies(order, children)


def _above(found: list[Tag], number: int, world: list[int]) -> bool:
    while number >= 0:
        number = found[number].parent
        if number in world:
            return True
    return False


def _holder(found: list[Tag], number: int) -> int:
    number = found[number].parent
    while number >= 0 and found[number].name == FRAME:
        number = found[number].parent
    return number


def number(value: float) -> str:
    """A number as it is written."""
    return f"{value:.7g}"


def edited(
    text: str,
    changes: Mapping[int, Mapping[str, str | None]],
    new: Mapping[int, str],
    renamed: Mapping[int, str] = MappingProxyType({}),
    after: Mapping[int, str] = MappingProxyType({}),
) -> str:
    """The text with attributes of some tags set (`None`: taken away) and lines after others.

    **Arguments:** `changes` by the number of the tag; `new`, an element to stand first in a tag;
    `renamed`, another name of a tag that has no end tag; `after`, an element behind such a tag.
    """
    raw, found = text.encode(), tags(text)
    for place in sorted({*changes, *new, *renamed, *after}, key=lambda n: -found[n].start):
        start = found[place].start
        stop = _end(raw, start)
        tag = raw[start:stop].decode()
        for name, value in changes.get(place, {}).items():
            tag = _with(tag, name, value)
        if place in renamed:
            if not tag.endswith("/>"):
                raise ValueError(f"its {found[place].name} has an end tag: write it as <… />")
            tag = f"<{renamed[place]}{tag[1 + len(found[place].name) :]}"
        if place in after:
            if not tag.endswith("/>"):
                raise ValueError(f"its {found[place].name} has an end tag: write it as <… />")
            line = raw.rfind(b"\n", 0, start) + 1
            blank = raw[line:start].decode()
            tag = f"{tag}\n{blank if not blank.strip() else ''}{after[place]}"
        if place in new:
            line = raw.rfind(b"\n", 0, start) + 1
            blank = raw[line:start].decode()
            indent = f"\n{blank if not blank.strip() else ''}  "
            tag = f"{tag}{indent}{new[place]}"
        raw = raw[:start] + tag.encode() + raw[stop:]
    return raw.decode()


def _end(raw: bytes, start: int) -> int:
    """Where a tag ends: after the first > that no quotation marks hold."""
    quote = None
    for i in range(start, len(raw)):
        char = raw[i : i + 1]
        if quote:
            quote = None if char == quote else quote
        elif char in (b'"', b"'"):
            quote = char
        elif char == b">":
            return i + 1
    raise ValueError("The model's XML has a tag without an end.")


def _with(tag: str, name: str, value: str | None) -> str:
    pattern = re.compile(rf"(\s+){re.escape(name)}\s*=\s*(\"[^\"]*\"|'[^']*')")
    if value is None:
        return pattern.sub("", tag, count=1)
    if pattern.search(tag):
        return pattern.sub(lambda m: f"{m[1]}{name}={quoteattr(value)}", tag, count=1)
    close = "/>" if tag.endswith("/>") else ">"
    return f"{tag[: -len(close)].rstrip()} {name}={quoteattr(value)}{close}"
