"""Sanity before physics: what a log and a simulator differ in that no missing physics is."""

from .bounded import (
    bounded as bounded,
    by_samples as by_samples,
    with_limit as with_limit,
)
from .checked import (
    CheckedSimulator as CheckedSimulator,
    Part as Part,
    check_log as check_log,
    check_logs as check_logs,
    with_checks as with_checks,
)
from .drifting import drifting as drifting
from .limits import arrived as arrived
from .pressed import stopped as stopped
from .rows import rows_of as rows_of
from .stops import with_stops as with_stops, without_visible as without_visible
from .table import Check as Check
