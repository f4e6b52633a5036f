"""Mistakes made on purpose with logs of known machines, and what the command line says to them."""

from .cases import Case as Case, make as make, mistake_of as mistake_of
from .mistakes import MISTAKES as MISTAKES
from .running import hunt as hunt
from .tallies import report as report, summary as summary
