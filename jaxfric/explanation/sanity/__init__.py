"""Sanity before physics: what a log and a simulator differ in that no missing physics is."""

from .looked import (
    Looked as Looked,
    Part as Part,
    look as look,
    looked_at as looked_at,
    told as told,
)
from .table import Check as Check
