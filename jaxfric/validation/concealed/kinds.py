"""Everything that can be concealed, by name."""

from collections.abc import Mapping

from . import curves, memories, places, schedule
from .nominal import Kind

KINDS: Mapping[str, Kind] = {**curves.KINDS, **places.KINDS, **memories.KINDS, **schedule.KINDS}

OUTSIDE = ("position_dependent_delay", "hysteretic_spring", "acceleration_dependent_friction")
"""Effects that the library has no term for."""

NAMES = tuple(name for name in KINDS if name not in OUTSIDE)
"""Effects that the library knows, by the names of `jaxfric effects`."""
