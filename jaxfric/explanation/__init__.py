"""What a model leaves out of a recording: located, named, verified."""

from .explained import Explanation as Explanation, Finding as Finding
from .explaining import explain as explain
