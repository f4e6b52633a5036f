"""Which machines a proof consists of."""

import itertools
import zlib
from collections.abc import Iterator
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.random import Generator

from ...terms.effects import effect
from ..concealed import OUTSIDE, names as drawn
from ..concealed.definitions import LOG, STICK, definitions

# What is concealed, in the order of the cases: of every 24, 8 machines are healthy, 12 have one
# effect, 3 have two, and one has an effect that the library has no term for.
PATTERN = "hsshsp hsshsp hsshsp hsshso".replace(" ", "")
# By definition: every fourth machine is healthy, and sticks or is logged by one; of the others each
# has one effect by one.
DEFINED = "hsss"
KINDS = {"h": "healthy", "s": "single", "p": "pair", "o": "outside"}

Name = TypeVar("Name")


class Case(NamedTuple):
    """One machine of a proof.

    `name` of its files; `kind`: "healthy", "single", "pair" or "outside"; `seed` of the machine;
    `effects` concealed in it; `size`: the range that `concealed.draw` draws their sizes from;
    `definitions`, of an effect or of how it sticks and is logged, where one was asked for.
    """

    name: str
    kind: str
    seed: int
    effects: tuple[str, ...]
    size: tuple[float, float]
    definitions: tuple[tuple[str, str], ...] = ()


def plan(cases: int, seed: int, size: tuple[float, float], half: str = "") -> list[Case]:
    """The cases of a seed; fewer cases are the first ones of more.

    Single effects take turns: each name comes once before any comes again. So do the members of
    pairs, of which none is declared confusable with the other in the catalogue, since nobody could
    name both, and the effects outside the library.

    With a `half` of the definitions ("all", "development" or "scored") these take turns instead,
    and the machines in which one effect is concealed are the same for each of its definitions.

    **Raises:** `ValueError` if there is no case, or no such size.
    """
    if cases < 1 or seed < 0:
        raise ValueError(f"{cases} cases of seed {seed}; give at least one, and a seed from zero.")
    if not 0 < size[0] <= size[1]:
        raise ValueError(f"sizes from {size[0]} to {size[1]}; give 0 < LOW ≤ HIGH.")
    if half:
        return list(itertools.islice(_defined(seed, size, half), cases))
    rng = np.random.default_rng((seed, 0))
    rows = {
        "healthy": itertools.repeat(()),
        "single": ((name,) for name in turns(drawn(), np.random.default_rng((seed, 1)))),
        "pair": _pairs(np.random.default_rng((seed, 2))),
        "outside": ((name,) for name in turns(OUTSIDE, np.random.default_rng((seed, 3)))),
    }
    found = []
    for number, letter in zip(range(cases), itertools.cycle(PATTERN), strict=False):
        kind = KINDS[letter]
        machine = int(rng.integers(2**31))
        found.append(Case(f"{number + 1:05d}", kind, machine, next(rows[kind]), size))
    return found


def _defined(seed: int, size: tuple[float, float], half: str) -> Iterator[Case]:
    """Cases by definition, without end."""
    whole = [(d.of, d.name) for d in definitions(half)]
    rows = {
        kind: turns(tuple(d for d in whole if (d[0] in (STICK, LOG)) == (kind == "healthy")), rng)
        for kind, rng in (
            ("healthy", np.random.default_rng((seed, 6))),
            ("single", np.random.default_rng((seed, 7))),
        )
    }
    drawn: dict[tuple[str, str], int] = {}
    for number, letter in enumerate(itertools.cycle(DEFINED), 1):
        kind = KINDS[letter]
        chosen = next(rows[kind])
        of = chosen[0]
        drawn[chosen] = turn = drawn.get(chosen, 0) + 1
        machine = np.random.default_rng((seed, 8, zlib.crc32(of.encode()), turn)).integers(2**31)
        effects = () if kind == "healthy" else (of,)
        yield Case(f"{number:05d}", kind, int(machine), effects, size, (chosen,))


def turns(names: tuple[Name, ...], rng: Generator) -> Iterator[Name]:
    """Each name once in a random order, then again in another."""
    while True:
        yield from (names[i] for i in rng.permutation(len(names)))


def _pairs(rng: Generator) -> Iterator[tuple[str, str]]:
    """Two names at a time, the next in turn with the first of those after it that is unlike it."""
    names = turns(drawn(), rng)
    waiting: list[str] = []
    while True:
        first = waiting.pop(0) if waiting else next(names)
        second = next((name for name in waiting if _unlike(first, name)), None)
        if second is not None:
            waiting.remove(second)
        while second is None:
            name = next(names)
            if _unlike(first, name):
                second = name
            else:
                waiting.append(name)
        yield first, second


def _unlike(first: str, second: str) -> bool:
    alike = {*effect(first).confusable_with, first}, {*effect(second).confusable_with, second}
    return second not in alike[0] and first not in alike[1]
