"""Many recordings: read while others are identified, in batches, over all devices, resumable."""

from .comparing import Drift as Drift, Outlier as Outlier, Summary as Summary, compare as compare
from .files import File as File, find as find
from .mixed import mixed_units as mixed_units
from .running import Options as Options, run as run
from .tables import write as write
