"""What a model leaves out of a recording: located, named, verified."""

from .earlier import Earlier as Earlier
from .explained import Explanation as Explanation, Finding as Finding
from .explaining import explain as explain
