"""What a model leaves out of a recording: located, selected, verified."""

from .earlier import Earlier as Earlier
from .explained import Explanation as Explanation
from .explaining import explain as explain
from .finding import Finding as Finding
