"""Everything that can be concealed, by name."""

from collections.abc import Iterable, Mapping

from ...terms.effect import ANY
from ...terms.effects import EFFECTS
from . import curves, memories, others, places, schedule
from .definitions import DEFINITIONS
from .nominal import Kind
from .own import by_law

# Effects with physics of their own in the simulator, written apart from the library's laws.
PHYSICS: Mapping[str, Kind] = {
    **curves.KINDS, **places.KINDS, **memories.KINDS, **schedule.KINDS, **others.KINDS,
}  # fmt: skip

OUTSIDE = ("position_dependent_delay", "hysteretic_spring", "acceleration_dependent_friction")
"""Effects that the library has no term for."""


def names() -> tuple[str, ...]:
    """The effects that take turns in `prove`, by the names of `jaxfric effects`.

    Those with physics of their own in the simulator, then all others with a law.
    """
    known = [name for name in PHYSICS if name not in OUTSIDE]
    by_their_law = [e.name for e in EFFECTS.values() if e.drawn and e.shapes(ANY)]
    return (*known, *(name for name in by_their_law if name not in PHYSICS))


def kind(name: str, by: str = "") -> Kind:
    """How an effect is concealed, by one of its definitions, or as it usually is.

    **Raises:** `ValueError`, with the names there are, for one that cannot be.
    """
    found = next((d.kind for d in DEFINITIONS if (d.of, d.name) == (name, by)), None)
    if found is not None:
        return found
    if name in PHYSICS:
        return PHYSICS[name]
    if name in EFFECTS and EFFECTS[name].shapes(ANY):
        return by_law(EFFECTS[name])
    there = ", ".join((*names(), *OUTSIDE))
    raise ValueError(f"No effect {name} can be concealed; there are {there}.")


def unrepeated(effects: Iterable[str]) -> bool:
    """Whether nobody can know the held-out force of an effect among these from the other run."""
    return any(kind(name).unrepeated for name in effects)
