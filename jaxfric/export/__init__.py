"""An identified model in the form that another program reads, one target a file."""

from .exporting import TARGETS as TARGETS, export as export
from .outcome import Exported as Exported, ForceError as ForceError
from .parts import unwritten as unwritten
