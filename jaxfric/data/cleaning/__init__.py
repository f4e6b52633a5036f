"""What loggers do to a record, undone or masked on the host, each with a sentence that says so."""

from .cleaned import Clean as Clean, clean as clean
from .filtered import FILTERED_SEAM as FILTERED_SEAM
from .held import between_updates as between_updates, held_for as held_for
from .missing import MISSING_ROWS as MISSING_ROWS
from .wraps import UNEXPLAINED_JUMP as UNEXPLAINED_JUMP
