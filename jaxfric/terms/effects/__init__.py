"""The physics that can be missing: one file an effect, found by being in this folder.

`register` adds an effect of one's own.
"""

import pkgutil
from collections.abc import Iterator, Mapping
from importlib import import_module
from types import MappingProxyType

from ...data.nearest import meant
from ..amplitude import Wave as Wave, wave as wave
from ..base import AbstractTerm, Directional
from ..effect import FAMILIES, Effect as Effect


def _own() -> Iterator[Effect]:
    """The effects of the files of this folder."""
    for file in pkgutil.iter_modules(__path__):
        found = import_module(f"{__name__}.{file.name}")
        yield from (value for value in vars(found).values() if isinstance(value, Effect))


_EFFECTS: dict[str, Effect] = {
    each.name: each for each in sorted(_own(), key=lambda each: FAMILIES.index(each.family))
}
EFFECTS: Mapping[str, Effect] = MappingProxyType(_EFFECTS)
"""Every effect by its name, by families."""

_OF_LAW: dict[type[AbstractTerm], Effect] = {
    law: each for each in EFFECTS.values() for law in each.laws
}
# Of a term that models no effect: no trait is true of it.
NONE = Effect("", "", "values")


def register(new: Effect) -> Effect:
    """Add an effect of one's own, for all that follows; returns it.

    `explain` then looks for it, models with it are saved and loaded, exported where its laws have a
    text, and `prove` conceals it. Its name and its laws must be new.

    **Raises:** `ValueError` for a name or a law that is there already, or confusable effects that
    there are not.
    """
    taken = [law.__name__ for law in new.laws if law in _OF_LAW]
    same = {law.__name__ for law in _OF_LAW} & {law.__name__ for law in new.laws}
    if new.name in EFFECTS or taken or same:
        what = new.name if new.name in EFFECTS else ", ".join(taken or sorted(same))
        raise ValueError(f"There is an effect or a law called {what} already: choose another name.")
    for name in new.confusable_with:
        effect(name)
    _EFFECTS[new.name] = new
    _OF_LAW.update(dict.fromkeys(new.laws, new))
    return new


def unregister(name: str) -> None:
    """Take back an effect that was registered."""
    gone = _EFFECTS.pop(name)
    for law in gone.laws:
        del _OF_LAW[law]


def effect(name: str) -> Effect:
    """The effect of that name; raises `ValueError`, with the names there are, for another."""
    if name not in EFFECTS:
        near = meant(name, EFFECTS)
        raise ValueError(f"No effect is called {name!r}; there are {', '.join(EFFECTS)}.{near}")
    return EFFECTS[name]


def traits(term: AbstractTerm) -> Effect:
    """The effect that a term models; one with no trait for inertia, offset, Coulomb, tables."""
    inner = term.positive if isinstance(term, Directional) else term
    return _OF_LAW.get(type(inner), NONE)


def law_named(name: str) -> type[AbstractTerm] | None:
    """The law of that name that models an effect, also of one's own; `None` where there is none."""
    return next((law for law in _OF_LAW if law.__name__ == name), None)


def effect_of(term: AbstractTerm) -> str | None:
    """The name of the effect that a term models; `None` where it models none."""
    return traits(term).name or None
